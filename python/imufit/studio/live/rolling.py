"""The last rows of a device, in memory of a fixed size."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.log.segments import GAP_STEPS
from imufit.studio.traces import Points

Array = NDArray[np.float64]

ROWS: Final = 1 << 16
"""Rows that are kept: a minute at 1 kHz. With twelve columns they take 14 MB."""


class Rolling:
    """Keeps the last rows of some columns; one thread adds while another one reads.

    Parameters
    ----------
    columns : sequence of str
        Columns besides `t`.
    rows : int
        Rows that are kept.
    """

    def __init__(self, columns: Sequence[str], rows: int = ROWS) -> None:
        self.columns = tuple(columns)
        self._rows = rows
        # Twice the room: the kept rows are one piece of memory, and are moved once in so many rows.
        self._held = np.full((1 + len(self.columns), 2 * rows), np.nan)
        self._end = 0
        self._lock = threading.Lock()

    def add(self, batch: Mapping[str, Array]) -> None:
        """Take rows.

        Parameters
        ----------
        batch : mapping of (n,) arrays
            ``t`` (s, ascending) and the columns, SI units; a column that lacks is missing in these rows.
        """
        t = batch["t"][-self._rows :]
        with self._lock:
            if self._end + t.size > self._held.shape[1]:
                kept = self._rows - t.size
                self._held[:, :kept] = self._held[:, self._end - kept : self._end].copy()
                self._end = kept
            part = slice(self._end, self._end + t.size)
            self._held[0, part] = t
            for k, name in enumerate(self.columns, 1):
                self._held[k, part] = batch[name][-self._rows :] if name in batch else np.nan
            self._end += t.size

    @property
    def span(self) -> tuple[float, float] | None:
        """Times of the first and the last row that are kept, s; None before the first one."""
        with self._lock:
            if not self._end:
                return None
            return float(self._held[0, max(0, self._end - self._rows)]), float(self._held[0, self._end - 1])

    @property
    def bytes(self) -> int:
        """Bytes that it takes, however many rows came."""
        return self._held.nbytes

    def window(self, names: Sequence[str], seconds: float, pixels: int) -> dict[str, Points]:
        """Return the points of the last seconds of some columns.

        Parameters
        ----------
        names : sequence of str
            Columns.
        seconds : float
            Length of the window, s.
        pixels : int
            Width of the panel.
        """
        with self._lock:
            last = slice(max(0, self._end - self._rows), self._end)
            if last.stop == 0:
                return {}
            t = self._held[0, last].copy()
            begin = int(np.searchsorted(t, t[-1] - seconds))
            t = t[begin:]
            rows = {name: self._held[1 + self.columns.index(name), last][begin:].copy() for name in names}
        return {name: Points(*self._points(t, values, pixels)) for name, values in rows.items()}

    @staticmethod
    def _points(t: Array, values: Array, pixels: int) -> tuple[Array, Array, Array]:
        steps = np.diff(t[np.isfinite(values)])
        gap = GAP_STEPS * float(np.median(steps)) if steps.size else np.inf
        return _imufit.thinned(t, values, gap, float(t[0]), float(t[-1]), pixels)
