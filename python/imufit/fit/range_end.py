"""Where a sensor's readings may be cut off, for the question whether they are.

This is only the value that a cut-off is tried at: whether readings are cut off there, the reference tells.
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
TALLER = 2.0
"""Readings at the largest value are this many times those at a step below: the tail of a distribution gets thinner."""


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
    _near: Array = field(default_factory=lambda: np.empty(0))

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
        steps = steps[np.isfinite(steps) & (steps > 0.0)]
        # A reading at the end has no digits of its own: steps to and from there tell nothing of the resolution.
        self._step = min(self._step, float(np.quantile(steps, 0.01)) if steps.size else np.inf)
        self.largest = max(self.largest, float(values.max()))
        near = np.concatenate([self._near, values])
        # More than a thousand of the largest are not needed, unless they stand at the end.
        self._near = np.sort(near[near >= self._reach(near)])

    def _reach(self, near: Array) -> float:
        return float(max(self.largest - BELOW * self._step, 0.98 * self.largest)) if near.size else 0.0

    def end(self) -> float | None:
        """Return the value at which readings pile up; None where they do not."""
        near = self._near[self._near >= self._reach(self._near)]
        at_end = int(np.count_nonzero(near >= self.largest * (1.0 - 1e-12)))
        if at_end < LEAST or not at_end > TALLER * (near.size - at_end) / BELOW:
            return None
        return self.largest
