"""What live commands show: an artificial horizon, raw readings, a figure, and a line that says how to stop."""

import math
import os
import pty
import signal
import subprocess
import sys
import time

import pytest
from imufit.cli.horizon import GROUND, HEIGHT, LINE, SKY, WIDTH, horizon

PROGRAM = (sys.executable, "-m", "imufit")
DEADLINE = 60.0


def share(lines, character):
    return sum(line.count(character) for line in lines) / (WIDTH * HEIGHT)


@pytest.mark.parametrize("roll", [0.0, 0.3, -0.7, 1.2, math.pi / 2])
def test_the_horizon_halves_a_level_picture_however_it_rolls(roll):
    lines = horizon(roll, 0.0)
    assert [len(line) for line in lines] == [WIDTH] * HEIGHT
    assert share(lines, SKY) == pytest.approx(share(lines, GROUND), abs=0.03)
    assert sum(LINE in line for line in lines) >= 1


def test_a_raised_nose_shows_sky_and_a_lowered_one_ground():
    assert share(horizon(0.0, 0.3), SKY) > 0.6
    assert share(horizon(0.0, -0.3), GROUND) > 0.6
    assert share(horizon(0.0, 1.0), GROUND) == 0.0


def test_where_the_right_side_is_down_the_ground_is_on_the_right():
    lines = horizon(0.5, 0.0)
    middle = WIDTH // 2
    assert sum(line[middle:].count(GROUND) for line in lines) > sum(line[:middle].count(GROUND) for line in lines)


@pytest.fixture
def port():
    """The port of a device without hardware."""
    command = [*PROGRAM, "emulate", "six_sides", "--device", "mpu6050", "--loop"]
    device = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    yield device.stdout.readline().strip()
    device.kill()
    device.communicate()


def screen(command, *words):
    """Run a command on a terminal until the words stand there, interrupt it; return what came to the terminal."""
    own, other = pty.openpty()
    environment = {**os.environ, "COLUMNS": "80", "LINES": "24", "TERM": "xterm"}
    process = subprocess.Popen(command, stdin=other, stdout=other, stderr=other, env=environment)
    os.close(other)
    os.set_blocking(own, False)
    seen, end, asked = b"", time.monotonic() + DEADLINE, False
    while time.monotonic() < end:
        try:
            seen += os.read(own, 65536)
        except BlockingIOError:
            pass
        except OSError:
            break
        if not asked and all(word in seen.decode(errors="replace") for word in words):
            asked = True
            process.send_signal(signal.SIGINT)
        if process.poll() is not None:
            break
        time.sleep(0.01)
    if not asked:
        process.kill()
    assert process.wait(DEADLINE) in (0, 130), seen
    os.close(own)
    return seen.decode()


def test_an_emulated_device_says_that_it_lives_and_how_to_stop_it():
    screen([*PROGRAM, "emulate", "six_sides", "--loop"], "samples", " Hz", "Ctrl-C ends it")


def test_monitor_shows_horizon_and_readings(port):
    screen([*PROGRAM, "monitor", port, "--frame", "NWU", "--raw"], "<-+->", "acc_z", "Ctrl-C ends it")


def test_monitor_writes_readings_and_a_figure_where_there_is_no_terminal(port, tmp_path):
    figure = tmp_path / "angles.png"
    command = [*PROGRAM, "monitor", port, "--frame", "NWU", "--raw", "--duration", "3", "--plot", str(figure)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=DEADLINE)
    assert (done.returncode, done.stderr) == (0, "")
    header, *rows = [line for line in done.stdout.splitlines() if "," in line]
    names = header.split(",")
    assert {"acc_x", "acc_z", "gyr_y"} <= set(names)
    assert all(len(row.split(",")) == len(names) for row in rows)
    last = dict(zip(names, map(float, rows[-1].split(",")), strict=True))
    assert math.hypot(last["acc_x"], last["acc_y"], last["acc_z"]) == pytest.approx(9.8, rel=0.5)
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_a_recording_on_a_terminal_says_how_to_stop_it(port, tmp_path):
    screen([*PROGRAM, "record", port, "-o", str(tmp_path / "log.parquet")], " rows", " deg", "Ctrl-C ends it")
    assert (tmp_path / "log.parquet").exists()
