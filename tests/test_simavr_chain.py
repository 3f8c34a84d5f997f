"""Paper B's chain without hardware: the Uno's own program under simavr reads a tilted MPU6050, and imufit its line."""

import json
import os
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import imufit
import numpy as np
import pytest
import serial
from firmware_host import make

G = 9.80665
HOLD, MOVE = 1.2, 0.8  # s
TILTS = [(0.0, 0.0), (10.0, -5.0), (30.0, 0.0), (-45.0, 20.0)]  # roll, pitch, deg
FILTERS = ("accel", "complementary", "kalman")
MISSING = [tool for tool in ("avr-gcc", "make") if shutil.which(tool) is None]
MISSING += [name for name in ("/usr/include/simavr/sim_avr.h", "/usr/include/libelf.h") if not Path(name).exists()]

# Without the tools there is nothing to test; where all changes are tested they have to be there.
pytestmark = pytest.mark.skipif(
    bool(MISSING) and "CI" not in os.environ, reason=f"needs gcc-avr, avr-libc, libsimavr-dev, libelf-dev: no {MISSING}"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return make(tmp_path_factory.mktemp("simavr"), "uno", "simulation")


@contextmanager
def device(folder, *options):
    """A running simulation's port."""
    command = [str(folder / "uno_simulation"), str(folder / "uno_mpu6050.elf"), *map(str, options)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
    finally:
        process.kill()
        process.communicate()


def run(*arguments):
    command = [sys.executable, "-m", "imufit.cli.app", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout


def force(roll, pitch):
    """Specific force of a sensor that lies z up and is tilted, in counts of 1 / 16384 g."""
    roll, pitch = np.radians([roll, pitch])
    unit = [-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)]
    return np.rint(16384 * np.array(unit))


@pytest.fixture(scope="module")
def recorded(folder):
    """The log of a course through the tilts, and what `imufit record` says of it."""
    course, t = [], 0.5
    for roll, pitch in TILTS:
        course += [f"{t} {roll} {pitch}", f"{t + HOLD} {roll} {pitch}"]
        t += HOLD + MOVE
    (folder / "course.txt").write_text("\n".join(course), encoding="utf-8")
    log = folder / "log.parquet"
    with device(folder, "--course", folder / "course.txt", "--seconds", t - MOVE) as port:
        told = run("record", port, "--frame", "NWU", "-o", log, "--give-up", 0.2, "--json", "-")
    return log, json.loads(told)


def test_no_frame_is_lost(recorded):
    _, told = recorded
    assert told["device"] == "Uno MPU6050"
    # The port may be opened in the middle of a frame.
    assert (told["lost"], told["unknown"]) == (0, 0)
    assert told["damaged"] <= 1


def test_registers_become_si_units_exactly(recorded):
    log = imufit.read(recorded[0])
    counts = log.acc / (G / 16384)
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-9)
    for roll, pitch in TILTS:
        assert (np.rint(counts) == force(roll, pitch)).all(axis=1).sum() > 0.8 * HOLD * 200
    np.testing.assert_allclose(log.temp, -3920 / 340 + 36.53, rtol=1e-12)
    rate = np.rint(log.gyr * np.degrees(1) * 131)
    np.testing.assert_allclose(log.gyr, np.radians(rate / 131), rtol=1e-12)
    # The fastest swing: 75 deg in 0.8 s.
    assert abs(np.degrees(log.gyr[:, 0])).max() == pytest.approx(75 * np.pi / 2 / MOVE, rel=2e-3)


def in_seconds_of_the_device(log, file):
    """The log in the simulated Uno's own seconds, of which its sensor samples 200.

    On a machine with other work they are longer than real ones, and change; a recording rightly has real ones, but the
    turns that a gyro reads are by the sensor's.
    """
    frame = log.to_dataframe()
    frame["t"] = np.arange(log.n) / 200
    imufit.Log.from_dataframe(frame, metadata=log.metadata).write(file)


def test_the_angles_are_those_of_the_simulated_tilt(recorded, tmp_path):
    in_seconds_of_the_device(imufit.read(recorded[0]), tmp_path / "log.parquet")
    run(
        "replay", tmp_path / "log.parquet", *[f"--filter={name}" for name in FILTERS], "-o", tmp_path / "angles.parquet"
    )
    table = imufit.read(tmp_path / "angles.parquet").to_dataframe()
    counts = np.rint(table[["acc_x", "acc_y", "acc_z"]].to_numpy() * 16384 / G)
    for roll, pitch in TILTS:
        last = np.flatnonzero((counts == force(roll, pitch)).all(axis=1))[-1]
        for name in FILTERS:
            found = np.degrees(table.loc[last, [f"{name}_roll", f"{name}_pitch"]].to_numpy(dtype=float))
            np.testing.assert_allclose(found, [roll, pitch], atol=0.05, err_msg=name)


def test_it_announces_itself_when_it_is_asked(folder):
    def count_of(line, seconds):
        data, end = b"", time.monotonic() + seconds
        while time.monotonic() < end:
            data += line.read(4096)
        return data.count(b"Uno MPU6050")

    with device(folder, "--seconds", 3) as port, serial.Serial(port, timeout=0.02) as line:
        assert count_of(line, 0.4) == 1
        line.write(b"\0")
        assert count_of(line, 0.3) == 1


def test_a_sensor_whose_wires_come_off_comes_back(folder, tmp_path):
    with device(folder, "--away", 1.0, 1.4, "--seconds", 3.2, "--fast") as port:
        told = json.loads(run("record", port, "-o", tmp_path / "log.parquet", "--give-up", 0.2, "--json", "-"))
    log = imufit.read(tmp_path / "log.parquet")
    assert told["lost"] == 0
    assert log.n > 200 * 1.5
    assert any("MPU6050: no answer" in message["text"] for message in log.metadata.extra["recording"]["messages"])
