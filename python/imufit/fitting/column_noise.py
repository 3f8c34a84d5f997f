"""How much of what a column of a log (a temperature, a current) shows is the noise of its own measurement."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class ColumnNoise:
    """Share of a column's variance that is white noise, from second differences; fed part by part."""

    def __init__(self) -> None:
        self._count, self._mean, self._squares = 0, 0.0, 0.0
        self._differences, self._noise = 0, 0.0

    def add(self, values: Array) -> None:
        """Add the next part.

        Parameters
        ----------
        values : ndarray
            (n,) part of the column; NaN where it is not known.
        """
        known = values[np.isfinite(values)]
        if known.size == 0:
            return
        mean, squares = float(known.mean()), float(known.var() * known.size)
        total, apart = self._count + known.size, mean - self._mean
        self._squares += squares + apart**2 * self._count * known.size / total
        self._mean += apart * known.size / total
        self._count = total
        second = np.diff(known, 2)
        self._differences += second.size
        self._noise += float(second @ second) / 6.0

    @property
    def share(self) -> float:
        """Variance of the noise over that of the column; 0 for a column that never changes."""
        if self._differences == 0 or self._squares <= 0.0:
            return 0.0
        return min(self._noise / self._differences * self._count / self._squares, 1.0)
