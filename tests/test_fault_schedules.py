"""Random schedules of what goes wrong on a line and a disk: every log opens and holds every intact frame once."""

import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from fault_schedules import Device, play
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule
from imufit import Log, read
from imufit.devices.emulate import Emulator
from imufit.devices.record import recover
from imufit.devices.record.part import part_path, parts_of

SHARE = st.floats(0.0, 1.0, exclude_max=True)


class Schedule(RuleBasedStateMachine):
    """Steps of a schedule; it is played when it is complete."""

    def __init__(self):
        super().__init__()
        self.device = Device()
        self.ends = 0

    @initialize(n=st.one_of(st.just(0), st.integers(1, 150)))
    def begins(self, n):
        for _ in range(n):
            self.device.next()

    @rule(n=st.integers(1, 150))
    def samples(self, n):
        for _ in range(n):
            self.device.next()

    @rule(junk=st.binary(min_size=1, max_size=60))
    def garbage_between_frames(self, junk):
        self.device.next(before=junk)

    @rule(junk=st.binary(min_size=1, max_size=60), at=SHARE)
    def garbage_in_a_frame(self, junk, at):
        def spoilt(data):
            # not right before its end: an end in the junk would leave it whole
            place = 1 + int(at * (len(data) - 2))
            return data[:place] + junk + data[place:]

        self.device.next(spoilt)

    @rule(at=SHARE, bits=st.integers(1, 255), n=st.integers(1, 4))
    def damaged_byte(self, at, bits, n):
        def damaged(data):
            place = int(at * len(data))
            return data[:place] + bytes([data[place] ^ bits]) + data[place + 1 :]

        for _ in range(n):
            self.device.next(damaged)

    @rule(n=st.integers(1, 30))
    def dropped(self, n):
        for _ in range(n):
            self.device.next(lambda data: b"")

    @rule(at=SHARE, away=st.sampled_from([0, 3, 40, 300]))
    def unplugged_within_a_frame(self, at, away):
        self.device.next(lambda data: data[: int(at * len(data))])
        self.device.tell("unplug")
        self.device.plugged = False
        for _ in range(away):
            self.device.next()
        self.device.plugged = True
        self.device.tell("plug")

    @rule(silence=st.sampled_from([0.0, 0.2, 3.0]))
    def reset(self, silence):
        self.device.reset(silence)

    # Now and then only, or no recording ever becomes long.
    @precondition(lambda self: self.ends < 2)
    @rule()
    def killed(self):
        self.ends += 1
        self.device.tell("kill")

    @precondition(lambda self: self.ends < 2)
    @rule(room=st.integers(0, 20_000))
    def disk_full(self, room):
        self.ends += 1
        self.device.tell("full", room)

    def teardown(self):
        with tempfile.TemporaryDirectory() as folder:
            play(self.device, Path(folder))


Schedule.TestCase.settings = settings(
    max_examples=200,
    stateful_step_count=20,
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
TestEverySchedule = Schedule.TestCase


RECORD = """
import resource, signal, sys
from imufit import InputError
from imufit.devices.record import record
port, log, room = sys.argv[1:]
if room != "-":
    # What the system does at the limit of a file is what it does on a full disk: it writes what fits, then refuses.
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(room), resource.RLIM_INFINITY))
print("ready", flush=True)
try:
    record(port, log, form="binary")
except InputError as error:
    sys.exit(str(error))
"""
ENOUGH = 60_000
DEADLINE = 60.0


@contextmanager
def recorder(device, log, room="-"):
    command = [sys.executable, "-c", RECORD, device.port, str(log), str(room)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == "ready\n"
        yield process
    finally:
        process.kill()
        process.communicate()


def numbered():
    """A log whose rows can be told apart."""
    number = np.arange(40_000.0)
    return Log.from_arrays(number / 1000.0, acc=np.tile([0.0, 0.0, 9.8], (40_000, 1)), covariates={"number": number})


def check_beginning(device, log):
    """What is in the log is the beginning of what was sent whole."""
    sent = device.sent.to_pandas()
    wanted = sent[sent.intact].number.to_numpy()
    rows = read(log).covariates["number"]
    assert rows.size > 100
    np.testing.assert_array_equal(rows, wanted[: rows.size])


@pytest.mark.parametrize("bytes_before", [8_000, ENOUGH, 3 * ENOUGH])
def test_recorder_that_is_killed_leaves_a_part_that_is_recovered(tmp_path, bytes_before):
    log = tmp_path / "walk.parquet"
    rates = {"garbage": 2.0, "crc": 2.0, "drop": 2.0}
    with Emulator(numbered(), sent=True, wait=True, fault_rates=rates, seed=bytes_before) as device:
        with recorder(device, log) as process:
            end = time.monotonic() + DEADLINE
            while not (parts_of(log) and part_path(log).stat().st_size > bytes_before) and time.monotonic() < end:
                time.sleep(0.01)
            process.kill()
            process.wait()
        assert not log.exists()
        assert recover(part_path(log)).ended == "crash"
        check_beginning(device, log)


def test_disk_that_is_full_ends_the_recording_and_keeps_what_was_written(tmp_path):
    log = tmp_path / "walk.parquet"
    with Emulator(numbered(), sent=True, wait=True) as device:
        with recorder(device, log, ENOUGH) as process:
            _, said = process.communicate(timeout=DEADLINE)
        assert process.returncode == 1
        assert "cannot be written (File too large)" in said
        assert "Traceback" not in said
        if not log.exists():
            recover(part_path(log))
        check_beginning(device, log)
