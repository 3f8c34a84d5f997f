"""The clock of an emulated device: it goes wrong as a cheap oscillator does, and runs over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NANO = 1e-9


@dataclass(frozen=True)
class Clock:
    """A counter of 32 bits.

    Attributes
    ----------
    tick : int
        Length of a tick by the device's own clock, ns.
    drift : float
        By how much it goes fast, parts per million.
    jitter : float
        Standard deviation by which a stamp is off the time of its sample, s.
    start : int
        Ticks at which it begins when the device is switched on; a reset begins at 0.
    """

    tick: int = 1000
    drift: float = 0.0
    jitter: float = 0.0
    start: int = 0

    def ticks(
        self, t: Array, period: float, rng: np.random.Generator, *, begun: float = 0.0, start: int | None = None
    ) -> NDArray[np.uint32]:
        """Return the stamps (n,) of samples, modulo 2^32.

        Parameters
        ----------
        t : (n,) array
            True time of each sample, s.
        period : float
            True time between two samples, s; jitter stays below two fifths of it, so that no two change places.
        rng : numpy.random.Generator
            Source of the jitter.
        begun : float
            True time at which the counter began, s.
        start : int, optional
            Ticks at which it began; those of the clock without it.
        """
        off = np.zeros(len(t))
        if self.jitter > 0.0:
            off = np.clip(self.jitter * rng.standard_normal(len(t)), -0.4 * period, 0.4 * period)
        passed = np.maximum((t - begun + off) * (1.0 + 1e-6 * self.drift), 0.0)
        counted = np.floor(passed / (self.tick * NANO) + 1e-6).astype(np.uint64)
        begin = self.start if start is None else start
        return ((counted + np.uint64(begin)) & np.uint64(0xFFFFFFFF)).astype(np.uint32)
