"""Columns of a log thinned to what a figure can show: the smallest and the largest value of each pixel."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.inspection.series import Steps
from imufit.log.segments import is_gap

Array = NDArray[np.float64]

PIXELS: Final = 1200
"""Stretches of time that a figure of 10 inches at 150 dots per inch keeps apart, margins left out."""


class Trace:
    """One or several columns over time, chunk by chunk, in memory that does not grow with the log.

    Up to twice as many samples as there are pixels are kept as they are.

    Parameters
    ----------
    begin, end : float
        Time that the figure shows, s.
    columns : int
        Columns of values.
    usual : float
        Median step between samples, s: a line is interrupted over a gap. NaN where there is none.
    """

    def __init__(self, begin: float, end: float, columns: int, usual: float) -> None:
        self._begin, self._width = begin, max(end - begin, np.finfo(float).tiny) / PIXELS
        self._usual = usual
        self._low = np.full((PIXELS, columns), np.inf)
        self._high = np.full((PIXELS, columns), -np.inf)
        self._broken: list[float] = []
        self._steps = Steps()
        self._kept: list[tuple[Array, Array]] | None = []
        self._samples = 0

    def add(self, t: Array, values: Array) -> None:
        """Take samples.

        Parameters
        ----------
        t : (n,) array
            Ascending times within the figure, s.
        values : (n, columns) array
            NaN where an axis is missing.
        """
        if not t.size:
            return
        self._samples += t.size
        if self._kept is not None:
            self._kept.append((t.copy(), values.copy()))
            if self._samples > 2 * PIXELS:
                self._kept = None
        pixel = np.clip(((t - self._begin) / self._width).astype(int), 0, PIXELS - 1)
        firsts = np.flatnonzero(np.diff(pixel, prepend=-1))
        at = pixel[firsts]
        known = np.isfinite(values)
        low = np.minimum.reduceat(np.where(known, values, np.inf), firsts, axis=0)
        high = np.maximum.reduceat(np.where(known, values, -np.inf), firsts, axis=0)
        self._low[at] = np.minimum(self._low[at], low)
        self._high[at] = np.maximum(self._high[at], high)
        begin, steps = self._steps.add(t)
        # A gap within one pixel cannot be shown.
        wide = is_gap(steps, self._usual) & (steps > self._width)
        self._broken += (begin[wide] + 0.5 * steps[wide]).tolist()

    def lines(self) -> tuple[Array, Array]:
        """Return times, s, and values of the lines to draw, NaN where they are interrupted; (m,) and (m, columns)."""
        if self._kept is not None:
            width = self._low.shape[1]
            t = np.concatenate([np.empty(0), *(t for t, _ in self._kept)])
            values = np.concatenate([np.empty((0, width)), *(values for _, values in self._kept)])
        else:
            used = np.flatnonzero((self._low <= self._high).any(axis=1))
            centre = self._begin + (used + 0.5) * self._width
            # Up and down in turn: the line covers from the smallest to the largest value.
            t = np.column_stack([centre, centre]).ravel()
            values = np.stack([self._low[used], self._high[used]], axis=1).reshape(2 * used.size, -1)
            values[~np.isfinite(values)] = np.nan
        places = np.searchsorted(t, self._broken)
        return np.insert(t, places, self._broken), np.insert(values, places, np.nan, axis=0)
