"""Where a sensor's readings may be cut off, for the question whether they are.

This is only the value that a cut-off is tried at: the reference determines whether readings are cut off there.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEAST = 3
"""Readings that must stand at the largest value."""
BELOW = 4
"""Steps of the resolution below it that are looked at as well."""
JUMP = 8.0
"""Steps of the resolution by which a reading comes to the end or leaves it: one that stands still is not cut off."""
NOISY = 0.2
"""... unless it reads the same less often than this: then its noise shows, and is gone where it is cut off."""
CHANCE = 1e-6
"""Probability of so many equal readings in a row in a sensor that reads the same twice as often as this one."""
TALLER = 2.0
"""Readings at the largest value are this many times those at a step below: the tail of a distribution gets thinner."""
ALIKE = 1e-3
"""Part of the largest reading within which the ends of several axes, or of both signs, are one: motion does not end
alike."""
ENDS = 3
"""Of the six ends of the axes those that must be one."""


@dataclass
class RangeEnd:
    """The largest reading of a sensor and how many readings stand there, over chunks of a log.

    Attributes
    ----------
    largest : float
        Largest absolute reading of any axis.
    """

    largest: float = 0.0
    _step: float = np.inf
    _same: int = 0
    _pairs: int = 0
    _near: Array = field(default_factory=lambda: np.empty((0, 2)))
    _ends: Array = field(default_factory=lambda: np.zeros(6))

    def add(self, column: Array) -> None:
        """Take the readings of a chunk.

        Parameters
        ----------
        column : ndarray
            (n, 3) readings; NaN where there is none.
        """
        values = np.abs(column[np.isfinite(column)])
        if values.size == 0:
            return
        steps = np.abs(np.diff(column, axis=0))
        steps = steps[np.isfinite(steps)]
        self._pairs += steps.size
        self._same += int(np.count_nonzero(steps == 0.0))
        steps = steps[steps > 0.0]
        # A reading at the end has no digits of its own: steps to and from there do not show the resolution.
        self._step = min(self._step, float(np.quantile(steps, 0.01)) if steps.size else np.inf)
        self.largest = max(self.largest, float(values.max()))
        ends = np.concatenate([np.fmax.reduce(column, axis=0), np.fmax.reduce(-column, axis=0)])
        self._ends = np.fmax(self._ends, ends)
        change = np.abs(np.diff(column, axis=0, prepend=column[:1], append=column[-1:]))
        jump = np.fmax(change[:-1], change[1:])
        known = np.isfinite(column)
        near = np.concatenate([self._near, np.stack([np.abs(column[known]), jump[known]], axis=1)])
        self._near = near[near[:, 0] >= self._reach()]

    def _reach(self) -> float:
        return max(self.largest - BELOW * self._step, 0.98 * self.largest)

    def end(self) -> float | None:
        """Return the value at which readings pile up, or at which several axes end; None where they do not."""
        if np.count_nonzero(self._ends >= (1.0 - ALIKE) * self.largest) >= ENDS:
            return self.largest
        value, jump = self._near[self._near[:, 0] >= self._reach()].T
        at_end = value >= self.largest * (1.0 - 1e-12)
        count = int(np.count_nonzero(at_end))
        arriving = int(np.count_nonzero(jump[at_end] > JUMP * self._step))
        # One long stay at the end is as good, unless this sensor often reads the same.
        same = max(self._same - (count - 1), 1) / max(self._pairs, 1)
        stays = (arriving >= 1 or same < NOISY) and count >= LEAST and same ** (count - 1) < CHANCE
        if not (arriving >= LEAST or stays) or not count > TALLER * (value.size - count) / BELOW:
            return None
        return self.largest
