"""`imufit record`, `recover` and `monitor` as processes of their own: killed, interrupted, without room."""

import json
import resource
import signal
import subprocess
import sys
import threading
import time

import imufit
import numpy as np
import pytest
from cli_stand_in import run
from recording_device import Pty, Sender, values_of

PROGRAM = (sys.executable, "-c", "import sys; from imufit.cli.app import main; sys.exit(main())")
PATIENCE = 60.0


@pytest.fixture
def again():
    line = Pty()
    yield line
    line.close()


@pytest.fixture
def pty():
    line = Pty()
    yield line
    line.close()


class Process:
    """A command that runs beside the test."""

    def __init__(self, *arguments, limit=None):
        def bounded():
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))

        self._process = subprocess.Popen(
            [*PROGRAM, *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=bounded if limit else None,  # noqa: PLW1509 - no thread runs here
        )

    def until(self, holds):
        end = time.monotonic() + PATIENCE
        while not holds():
            assert time.monotonic() < end, "it did not come to that"
            assert self._process.poll() is None, self._process.communicate()
            time.sleep(0.01)

    @property
    def over(self):
        return self._process.poll() is not None

    def end(self, number=None):
        if number is not None:
            self._process.send_signal(number)
        out, err = self._process.communicate(timeout=PATIENCE)
        return self._process.returncode, out, err


def sent_until(process, pty, device, part, size):
    """Send samples until the part has that size; return how many."""
    n = 0
    pty.send(device.announce())
    while not process.over and (not part.exists() or part.stat().st_size < size):
        pty.send(device.samples(range(n, n + 20)), unless=lambda: process.over)
        n += 20
        time.sleep(0.02)
    return n


def test_a_recording_that_is_killed_before_the_device_announced_itself_asks_it_afterwards(pty, again, tmp_path, capsys):
    log, part, first = (tmp_path / f"walk.parquet{end}" for end in ("", ".part", ".part0"))
    process, device = Process("record", pty.port, "-o", log), Sender()
    head, samples = device.announce(), device.samples(range(300))
    process.until(part.exists)
    pty.heard(0.1)
    pty.send(samples)
    process.until(lambda: first.exists() and first.stat().st_size > len(samples))
    process.end(signal.SIGKILL)
    code, out, err = run(capsys, "recover", log)
    assert (code, out) == (2, "")
    assert "300 samples are in it" in err[0]
    assert "--port PORT" in err[0]

    def answer():
        if b"\0" in again.heard(1.0):
            again.send(head + device.samples(range(5000, 5010)))

    plugged_in = threading.Thread(target=answer)
    plugged_in.start()
    code, out, err = run(capsys, "recover", log, "--port", again.port, "--json", "-")
    plugged_in.join()
    assert (code, err) == (0, [])
    told = json.loads(out)
    assert (told["n"], told["ended"], told["gaps"], told["port"]) == (300, "crash", [], pty.port)
    np.testing.assert_array_equal(imufit.read(log).acc, values_of(range(300))[:, :3])
    assert list(tmp_path.iterdir()) == [log]


def test_a_recording_that_is_killed_is_recovered(pty, tmp_path, capsys):
    log, part = tmp_path / "walk.parquet", tmp_path / "walk.parquet.part"
    process = Process("record", pty.port, "-o", log)
    process.until(part.exists)
    n = sent_until(process, pty, Sender(), part, 60_000)
    code, _, _ = process.end(signal.SIGKILL)
    assert code == -signal.SIGKILL
    assert not log.exists()
    code, out, err = run(capsys, "record", pty.port, "-o", log)
    assert (code, out) == (2, "")
    assert "imufit recover" in err[0]
    code, out, err = run(capsys, "recover", log, "--json", "-")
    assert (code, err) == (0, [])
    told = json.loads(out)
    saved = imufit.read(log)
    assert told["n"] == saved.n > 400
    # the last quarter of a second was not written yet, and a read or two
    assert saved.n >= n - 20 * 60
    np.testing.assert_array_equal(saved.acc, values_of(range(saved.n))[:, :3])
    assert told["ended"] == "crash"
    assert [file.name for file in tmp_path.iterdir()] == ["walk.parquet"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_is_an_ordinary_end(pty, tmp_path, number):
    log, device = tmp_path / "walk.csv", Sender()
    process = Process("record", pty.port, "-o", log, "--json", "-")
    process.until((tmp_path / "walk.csv.part").exists)
    pty.send(device.announce() + device.samples(range(50)))
    process.until(lambda: (tmp_path / "walk.csv.part").stat().st_size > 0)
    code, out, err = process.end(number)
    assert (code, err) == (0, "")
    told = json.loads(out)
    # all that had arrived by then
    assert (told["n"], told["ended"], told["file"]) == (50, "stopped", str(log))
    assert {"lost", "damaged", "gaps", "clock", "cpu_share", "rate_hz", "duration_s"} <= told.keys()
    assert imufit.read(log).n == 50


def test_a_file_that_may_not_grow_ends_the_recording_with_a_log(pty, tmp_path):
    """The limit of the system for the size of files, as a stand-in for a full disk."""
    log, part = tmp_path / "walk.parquet", tmp_path / "walk.parquet.part"
    process = Process("record", pty.port, "-o", log, limit=60_000)
    process.until(part.exists)
    sent_until(process, pty, Sender(), part, 1_000_000)
    code, _, err = process.end()
    assert code == 2
    assert "File too large" in err
    assert "Traceback" not in err
    if part.exists():  # not even the log had room
        assert "imufit recover" in err
        imufit.devices.record.recover(part)
    saved = imufit.read(log)
    assert saved.n > 100
    np.testing.assert_array_equal(saved.acc, values_of(range(saved.n))[:, :3])


def test_the_monitor_prints_lines_where_there_is_no_terminal(pty):
    process, device = Process("monitor", pty.port, "--filter", "accel,triad", "--duration", "1.5"), Sender()
    deadline = time.monotonic() + PATIENCE
    while not process.over and time.monotonic() < deadline:
        pty.send(device.announce() + device.samples(range(20)), unless=lambda: process.over)
        time.sleep(0.05)
    code, out, err = process.end()
    assert (code, err) == (0, "")
    header, *lines = out.splitlines()
    assert header.startswith("t_s,rate_hz,lost,damaged,accel_roll_deg,accel_pitch_deg,accel_yaw_deg,triad_roll_deg")
    assert len(lines) > 3
    assert all(len(line.split(",")) == 10 for line in lines)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["record", "/dev/no_such_port", "-o", "a.parquet"], "the port /dev/no_such_port does not exist"),
        (["record", "/dev/no_such_port", "-o", "a.txt"], ".parquet"),
        (["record", "/dev/no_such_port"], "-o"),
        (["record", "PORT", "-o", "a.parquet", "--baud", "0"], "--baud"),
        (["record", "PORT", "-o", "a.parquet", "--form", "morse"], "morse"),
        (["record", "PORT", "-o", "a.parquet", "--map", "t=t_ms[ms]"], "time of a recording cannot be mapped"),
        (["record", "PORT", "-o", "a.parquet", "--form", "binary", "--header", "t,a"], "Leave one of them out"),
        (["recover", "a.parquet.part"], "a.parquet.part does not exist"),
        (["recover", "a.parquet"], "a.parquet.part does not exist"),
        (["monitor", "/dev/no_such_port"], "the port /dev/no_such_port does not exist"),
        (["monitor", "PORT", "--filter", "mahoney"], "did you mean mahony?"),
        (["monitor", "PORT", "--filter", "smoother"], "unknown filter"),
        (["monitor", "PORT", "--duration", "0.2"], "nothing came from the device"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(pty, tmp_path, monkeypatch, capsys, arguments, said):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *(pty.port if a == "PORT" else a for a in arguments))
    assert (code, out) == (2, "")
    assert len(err) == 1
    assert said in err[0]
    assert list(tmp_path.iterdir()) == []
