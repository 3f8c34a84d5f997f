"""When an emulated device takes its samples: as time goes by, or as fast as they are read."""

from __future__ import annotations

import time
from threading import Event

import numpy as np

BLOCK = 0.007
"""Shortest wait between two writes, s: fine enough for a clock to be fitted, coarse enough to cost little."""
LONGEST = 0.25
"""Longest wait without looking whether to stop, s."""


class Pace:
    """The time of a device.

    Parameters
    ----------
    speed : float
        Seconds of the device in a second; infinite for as fast as they are read.
    stop : threading.Event
        Ends any wait.
    """

    def __init__(self, speed: float, stop: Event) -> None:
        self.speed, self._stop = speed, stop
        self._begun, self._unix = time.monotonic(), time.time()

    @property
    def unhurried(self) -> bool:
        """Whether samples come as time goes by."""
        return bool(np.isfinite(self.speed))

    def begin(self) -> None:
        """Switch the device on: its time is 0 now."""
        self._begun, self._unix = time.monotonic(), time.time()

    def now(self) -> float:
        """Return the time since the device was switched on, s."""
        return (time.monotonic() - self._begun) * self.speed if self.unhurried else np.inf

    def host(self, t: np.ndarray[tuple[int], np.dtype[np.float64]]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """Return times of the device (n,), s, on the host's clock: s since 1970, NaN at full speed."""
        return self._unix + t / self.speed if self.unhurried else np.full(len(t), np.nan)

    def wait(self, t: float) -> None:
        """Wait for the time `t` (s) of the device, not shorter than `BLOCK`."""
        self.rest((t - self.now()) / self.speed)

    def rest(self, seconds: float) -> None:
        """Wait so many seconds of the host, within `BLOCK` and `LONGEST`."""
        self._stop.wait(min(max(seconds, BLOCK), LONGEST))
