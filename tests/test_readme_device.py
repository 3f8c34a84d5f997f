"""The README's way from a breadboard to an angle: each command, with an emulated device in the place of the Uno."""

import re
import shutil
import sys
from pathlib import Path

import imufit
import numpy as np
import pytest
from firmware_host import make
from imufit.devices.emulate import Emulator
from imufit.lab.simulate import simulate

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "docs"))

import blocks  # noqa: E402  lies beside the documents

PORT = "/dev/ttyACM0"
BIAS = {"acc.bias": {"x": 0.15, "y": -0.1, "z": 0.2}}


@pytest.fixture(scope="module")
def commands():
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    section = page.split("## From a breadboard to a calibrated angle in ten minutes\n")[1].split("\n## ")[0]
    return "".join(re.findall(r"```sh[^\n]*\n(.*?)```", section, re.DOTALL)).splitlines()


def done(command, folder):
    return blocks.run(blocks.Block("sh", command, 0, None, None), folder)


def test_what_is_flashed_is_what_was_made(commands, tmp_path):
    built, flashed = (next(c for c in commands if c.startswith(tool)) for tool in ("make", "avrdude"))
    assert built == "make -C firmware uno"
    (file,) = re.findall(r"flash:w:(\S+):i", flashed)
    assert Path(file).parent == Path("firmware/build")
    if shutil.which("avr-gcc") is not None:
        assert (make(tmp_path, "uno") / Path(file).name).read_text().startswith(":")


def test_every_command_works_on_a_device_and_the_angle_is_calibrated(commands, tmp_path):
    motion = simulate("six_sides", BIAS, 1, 60.0, sensors=("acc", "gyr", "temp")).to_log()
    ran = [c for c in commands if c.startswith("imufit ")]
    assert [c.split()[1] for c in ran] == ["monitor", "calibrate", "monitor", "record", "apply", "replay"]
    for command in ran:
        # A person lets it run for longer.
        short = command.replace("--duration 20", "--duration 2")
        short += " --duration 1" if " monitor " in command else ""
        speed = "max" if " calibrate " in command else 1.0
        if PORT not in command:
            done(short, tmp_path)
            continue
        with Emulator(motion, device="mpu6050", speed=speed, wait=True) as device:
            printed = done(short.replace(PORT, device.port), tmp_path)
        if " monitor " in command:
            header, *states = [line.split(",") for line in printed.splitlines() if "," in line]
            last = dict(zip(header, states[-1], strict=True))
            # The emulated sensor lies on the table: without the model the bias tilts it.
            tilt = 0.0 if "--model" in command else -0.57
            assert float(last["kalman_roll_deg"]) == pytest.approx(tilt, abs=0.15)
    table = imufit.read(tmp_path / "angles.parquet").to_dataframe()
    raw = imufit.read(tmp_path / "tilted.parquet")
    assert raw.n > 100
    # z up on the table: with the bias the angle is off by a degree.
    angles = np.degrees(table[["kalman_roll", "kalman_pitch"]].to_numpy()[-1])
    off = np.degrees(np.arctan2(raw.acc[-100:, 1].mean(), raw.acc[-100:, 2].mean()))
    assert off == pytest.approx(-0.57, abs=0.05)
    np.testing.assert_allclose(angles, 0.0, atol=0.06)
