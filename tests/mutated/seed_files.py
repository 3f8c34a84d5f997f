"""Well-made files that the mutations start from, by the commands themselves: logs, models, settings, answers, parts."""

import csv
import json
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from imufit.devices.record.arrived import Announced, Arrived
from imufit.devices.record.circumstances import Circumstances
from imufit.devices.record.part import PartFile

from mutated.column_mutations import Columns

LOGS = {
    "handheld": ("handheld", "--duration", "6", "--rate", "50", "--effect", "gyr.scale"),
    "walk": ("handheld", "--duration", "30", "--rate", "50", "--effect", "acc.bias"),
    "arm": ("arm", "--duration", "10", "--rate", "30"),
    "sides": ("six_sides", "--duration", "40", "--rate", "10"),
    "poses": ("poses", "--duration", "60", "--rate", "10"),
    "tilt": ("tilt", "--duration", "12", "--rate", "20"),
    "table": ("turntable", "--duration", "12", "--rate", "20", "--effect", "mag.hard_iron"),
}
"""Arguments of `imufit simulate` for each log: 240 to 1500 rows, so that a command takes a tenth of a second."""

MADE = {
    "model.toml": ("fit", "handheld.csv", "--effects", "gyr.scale,acc.bias,mag.hard_iron", "-o", "model.toml"),
    "wide.toml": (
        *("fit", "walk.csv", "--effects"),
        *("gyr.bias,gyr.g_sensitivity,acc.lever_arm,acc.bias_temperature,mag.soft_iron", "-o", "wide.toml"),
    ),
    "calibration.toml": ("calibrate", "poses.csv", "-o", "calibration.toml", "--json", "calibration.json"),
    "settings.toml": ("tune", "handheld.csv", "--filter", "complementary", "-o", "settings.toml"),
    "answer.json": ("diagnose", "handheld.csv", "--json", "answer.json"),
    "ladder.json": ("ladder", "walk.csv", "--json", "ladder.json"),
    "compare.json": ("compare", "arm.csv", "--json", "compare.json"),
}
"""The command that makes each further file out of the logs."""

COVARIATES = ("motor_current", "vbat")


@dataclass
class SeedFiles:
    """What the mutations start from.

    Attributes
    ----------
    logs : dict
        Columns of each log.
    files : dict
        Content of every file by its name, sidecars and sealed truths of the logs included.
    """

    logs: dict[str, Columns] = field(default_factory=dict)
    files: dict[str, bytes] = field(default_factory=dict)


def make(folder: Path) -> None:
    """Write all files into a folder; the same ones at each call."""
    commands: list[tuple[str, ...]] = [
        ("simulate", *arguments, "--seed", "3", "-o", f"{name}.csv") for name, arguments in LOGS.items()
    ]
    commands += MADE.values()
    program = "import sys, json; from imufit.cli.app import main; sys.exit(any(map(main, json.load(sys.stdin))))"
    given = json.dumps(commands).encode()
    subprocess.run([sys.executable, "-c", program], cwd=folder, check=True, stdout=subprocess.DEVNULL, input=given)
    write_part(folder / "taken.parquet.part")


def write_part(path: Path) -> None:
    """Write what a recording leaves that was killed: 300 samples at 100 Hz in six batches."""
    columns = ("acc_x", "acc_y", "acc_z", "gyr_x", "gyr_y", "gyr_z")
    device = Announced("binary", "d", 1e-6, columns, (20.0,) * 6, (100.0,) * 6)
    file = PartFile(path)
    file.begin(device, Circumstances("/dev/x", "2026-01-02T03:04:05+00:00", 100.0))
    noise = np.random.default_rng(1)
    for first in range(0, 300, 50):
        k = np.arange(first, first + 50)
        values = noise.normal(0, 0.02, (50, 6)) + np.array([0.0, 0.0, 9.8, 0.0, 0.0, 0.0])
        zeros, ones = np.zeros(50, np.uint32), np.ones(50, np.uint8)
        stamps = (k * 10_000).astype(np.uint32)
        rows = Arrived(device, 100.0 + k * 0.01, zeros, ones, stamps, k.astype(np.uint16), zeros, values)
        file.write(rows, {"counts": {"samples": first + 50, "damaged": 0}, "now": 100.0, "lost_since": None})
    file.close()


def load(folder: Path) -> SeedFiles:
    """Read what `make` wrote."""
    seeds = SeedFiles(files={path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.is_file()})
    for name in LOGS:
        seeds.logs[name] = _columns(folder / f"{name}.csv")
    for name in ("answer.json", "ladder.json", "compare.json"):
        json.loads(seeds.files[name])
    return seeds


def _columns(path: Path) -> Columns:
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    columns: Columns = {}
    for name, cells in zip(header, zip(*rows, strict=True), strict=True):
        if name == "pose":
            columns[name] = np.array(cells)
        else:
            columns[name] = np.array([float(cell) if cell else np.nan for cell in cells])
    ramp = np.arange(len(rows)) / 50
    columns.update(zip(COVARIATES, (np.sin(ramp), 3.7 - 0.01 * ramp), strict=True))
    return columns
