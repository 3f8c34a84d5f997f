"""`imufit record` killed while it reads an emulated device, and what `recover` makes of what it leaves."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import imufit
import numpy as np
from imufit.devices.emulate import Emulator
from imufit.devices.record import recover
from imufit.errors import InputError

PROGRAM = (sys.executable, "-c", "import sys; from imufit.cli.app import main; sys.exit(main())")
RATE = 500.0
"""Samples a second."""
LONGEST = 60.0
"""Time after which a recorder ends by itself, s: one that is left behind would read the next device of that name."""
STARTED = 30.0
"""Longest time for a recorder to open the port, s."""


@dataclass(frozen=True)
class Kill:
    """One kill.

    Attributes
    ----------
    after : float
        Time from the first sample that the device sent to the recorder until the kill, s.
    sent, recovered : int
        Samples sent until the kill, and those in the recovered log: the first of them, unaltered.
    lost : float
        How long before the kill the oldest lost sample was taken, s; 0 if none was lost.
    """

    after: float
    sent: int
    recovered: int
    lost: float


@contextmanager
def running_device() -> Iterator[Emulator]:
    """A device on a pty that was switched on before anybody reads it, and announces itself once a second."""
    with Emulator("handheld", rate=RATE, loop=True, duration=1e6, sent=True) as device:
        yield device


def kill_one(device: Emulator, wait: float, folder: Path) -> Kill:
    """Record the device, kill the recorder, recover.

    Parameters
    ----------
    device : Emulator
        Running, read by nobody.
    wait : float
        Time of the kill from the first sample on, s.
    folder : Path
        Empty.
    """
    before, log = device.summary(), folder / "log.parquet"
    recorder = subprocess.Popen(
        [*PROGRAM, "record", device.port, "-o", str(log), "--quiet", "--duration", str(LONGEST)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        end = time.monotonic() + STARTED
        while device.summary()["intact"] == before["intact"]:
            assert time.monotonic() < end, "the recorder does not read"
            assert recorder.poll() is None, "the recorder ended"
            time.sleep(0.0005)
        time.sleep(wait)
        assert recorder.poll() is None, recorder.communicate()
    finally:
        at = time.time()
        recorder.kill()
        recorder.communicate()
    sent = device.sent.slice(before["samples"]).to_pandas()
    sent = sent[sent.intact & (sent.t_host <= at)]
    t = sent.t_host.to_numpy()
    try:
        n = recover(log).n
        made = imufit.read(log)
        want = sent[["acc_x", "acc_y", "acc_z", "gyr_x", "gyr_y", "gyr_z"]].to_numpy()[:n].astype(np.float32)
        np.testing.assert_array_equal(np.concatenate([made.acc, made.gyr], axis=1), want)
    except InputError as error:
        if not any(words in str(error) for words in ("no whole batch", "does not exist")):
            raise
        n = 0
    return Kill(at - t[0], len(t), n, at - t[n] if n < len(t) else 0.0)
