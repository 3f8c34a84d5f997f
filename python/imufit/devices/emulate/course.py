"""The rows of a source one after another, from the first again after the last if requested."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Course:
    """Rows of a device while it runs.

    Parameters
    ----------
    t : (n,) array
        Times of the rows, s, from 0.
    length : float
        Time after which the first row follows the last, s.
    duration : float
        Time for which the device runs, s.
    loop : bool
        Whether it begins again after the last row.

    Attributes
    ----------
    total : float
        Number of rows; infinite if it never ends.
    """

    def __init__(self, t: Array, length: float, duration: float, *, loop: bool) -> None:
        self._t, self._length = t, length
        self.total = self._before(duration) if loop else min(self._before(duration), len(t))

    def _before(self, t: float) -> float:
        """Return the number of rows before time `t`, as if it never ended."""
        if not np.isfinite(t):
            return np.inf
        cycle = np.floor(t / self._length)
        return float(cycle * len(self._t) + np.searchsorted(self._t, t - cycle * self._length, side="left"))

    def time(self, row: float) -> float:
        """Return the time of a row, s.

        Parameters
        ----------
        row : float
            Its number, from 0.
        """
        cycle, place = divmod(int(row), len(self._t))
        return cycle * self._length + float(self._t[place])

    def first_at(self, t: float) -> float:
        """Return the first row at time `t` (s) or later; `total` if there is none.

        Parameters
        ----------
        t : float
            Time, s.
        """
        return min(self._before(t), self.total) if t > 0.0 else 0.0

    def piece(self, row: int, stop: float) -> tuple[slice, Array]:
        """Return where rows stand in the source, as far as they stand in one piece, and their times (n,), s.

        Parameters
        ----------
        row : int
            The first.
        stop : float
            The one after the last, if they stand in one piece.
        """
        cycle, place = divmod(row, len(self._t))
        end = int(min(place + stop - row, len(self._t)))
        return slice(place, end), cycle * self._length + self._t[place:end]
