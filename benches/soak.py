"""Memory over long work: diagnoses in one process, rows through every filter in chunks, a long recording, a monitor.

Each part runs in a process of its own. Printed is its resident memory after the first tenth of the work, at the end,
and at most. Work that keeps something has more at the end than after its first tenth.

Run: ``python benches/soak.py [--diagnoses N] [--rows N] [--seconds S] [--write]``; ``--seconds`` is the length of a
recording of 8 kHz from an emulated device and of a monitor, in real time. ``--write`` puts the figures into
docs/reliability.md.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from imufit import SensorModel
from imufit.lab.simulate import simulate
from imufit.replaying import FILTERS, SMOOTHERS, Stream
from imufit.results import Table
from marked import markdown, write_between

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reliability.md"
BEGIN, END = "<!-- soak -->", "<!-- end of soak -->"
IMUFIT = [sys.executable, "-c", "import sys; from imufit.cli.app import main; sys.exit(main())"]
CHUNK = 10_000
"""Rows that a stream takes at once."""


def resident() -> float:
    """Memory that this process holds now, MB."""
    fields = Path("/proc/self/status").read_text(encoding="ascii").split("VmRSS:")[1].split()
    return int(fields[0]) / 1024


def diagnoses(count: int) -> list[float]:
    """Diagnose one simulated log after another; memory after each, MB."""
    held = []
    for seed in range(count):
        SensorModel().fit(simulate("handheld", {"gyr.scale": None}, seed, duration=30.0).to_log()).diagnose()
        held.append(resident())
    return held


def filtered(rows: int) -> list[float]:
    """Put rows through every filter in chunks; memory after each chunk, MB."""
    rng = np.random.default_rng(0)
    stream = Stream([name for name in FILTERS if name not in SMOOTHERS], ("acc", "gyr", "mag"), frame="ENU")
    held = []
    for first in range(0, rows, CHUNK):
        t = (first + np.arange(CHUNK)) * 1e-3
        noise = rng.normal(0.0, 0.01, (3, CHUNK, 3))
        stream.extend(t, acc=noise[0] + [0.0, 0.0, 9.81], gyr=noise[1], mag=noise[2] + [0.0, 20.0, -44.0])
        held.append(resident())
    return held


def watched(device: list[str], work: Callable[[str], list[str]]) -> list[float]:
    """Emulate a device and put a command to its port; memory of that command once a second, MB."""
    emulator = subprocess.Popen([*IMUFIT, "emulate", *device, "--wait"], stdout=subprocess.PIPE, text=True)
    assert emulator.stdout is not None
    command = subprocess.Popen([*IMUFIT, *work(emulator.stdout.readline().strip())], stdout=subprocess.DEVNULL)
    held = []
    while command.poll() is None:
        try:
            status = Path(f"/proc/{command.pid}/status").read_text(encoding="ascii")
            held.append(int(status.split("VmRSS:")[1].split()[0]) / 1024)
        except (OSError, IndexError):
            break
        time.sleep(1.0)
    emulator.terminate()
    emulator.wait(timeout=60)
    assert command.wait() == 0, command.returncode
    return held


def recorded(seconds: float) -> list[float]:
    """Record an emulated device at 8 kHz; memory of the recorder once a second, MB."""
    device = ["handheld", "--rate", "8000", "--loop", "--duration", str(seconds)]
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.parquet"
        held = watched(device, lambda port: ["record", port, "-o", str(log), "--give-up", "2", "--quiet"])
        with pq.ParquetFile(log) as file:
            print(f"{file.metadata.num_rows:,} of {round(8000 * seconds):,} rows recorded", file=sys.stderr)
        return held


def monitored(seconds: float) -> list[float]:
    """Show the attitude of an emulated device; memory of the monitor once a second, MB."""
    show = ["--plain", "--duration", str(seconds)]
    return watched(["handheld", "--loop"], lambda port: ["monitor", port, *show])


PARTS: dict[str, Callable[[float], list[float]]] = {
    "recorded": recorded,
    "monitored": monitored,
    "diagnoses": lambda amount: diagnoses(int(amount)),
    "filtered": lambda amount: filtered(int(amount)),
}


def apart(part: str, amount: float) -> list[float]:
    """Do one part of the work in a process of its own."""
    line = [sys.executable, __file__, "--part", part, "--amount", str(amount)]
    return json.loads(subprocess.run(line, check=True, stdout=subprocess.PIPE, text=True).stdout)


def main() -> None:
    """Measure, and print or write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--diagnoses", type=int, default=500)
    parser.add_argument("--rows", type=int, default=10_000_000)
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--part", choices=PARTS, help=argparse.SUPPRESS)
    parser.add_argument("--amount", type=float, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.part:
        print(json.dumps(PARTS[given.part](given.amount)))
        return
    works = (
        ("recorded", given.seconds, f"recording of {given.seconds:g} s at 8 kHz, its log included"),
        ("monitored", given.seconds, f"monitor of {given.seconds:g} s, four filters"),
        ("diagnoses", given.diagnoses, f"{given.diagnoses} diagnoses in one process"),
        ("filtered", given.rows, f"{given.rows:,} rows through every filter in chunks of {CHUNK:,}"),
    )
    rows = []
    # A real-time run leaves most of a core.
    with ThreadPoolExecutor(3) as pool:
        for held, (_, _, words) in zip(pool.map(lambda work: apart(*work[:2]), works), works, strict=True):
            early = held[len(held) // 10]
            rows.append((words, f"{early:.0f}", f"{held[-1]:.0f}", f"{max(held):.0f}"))
            print(rows[-1], file=sys.stderr, flush=True)
    table = Table("", ("work", ">after the first tenth, MB", ">at the end, MB", ">at most, MB"), tuple(rows))
    text = markdown(table)
    if given.write:
        write_between(PAGE, BEGIN, END, text)
    else:
        print(text)


if __name__ == "__main__":
    main()
