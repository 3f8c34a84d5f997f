"""Readings of one sensor as evenly spaced samples: pieces without gap, in which NaN is a lost sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GAP = 1.0
"""A longer step, s, ends a piece, if it is longer than ten usual steps as well."""
_USUAL = 10


@dataclass(frozen=True)
class Samples:
    """Readings of one sensor at even steps.

    Attributes
    ----------
    step : float
        Usual time between two readings, s.
    pieces : tuple of (k, 3) arrays
        Readings; a row of NaN is a lost one.
    n : int
        Readings that are there.
    """

    step: float
    pieces: tuple[Array, ...]
    n: int

    @property
    def longest(self) -> int:
        """Samples of the longest piece, lost ones included."""
        return max((len(piece) for piece in self.pieces), default=0)


def even_samples(t: Array, readings: Array) -> Samples | None:
    """Put readings on an even grid; None where there are too few of them.

    The step between two readings counts as the nearest whole number of usual steps, so that jitter does not matter and
    lost rows leave a hole. A gap ends the piece.

    Parameters
    ----------
    t : (n,) array
        Time, s.
    readings : (n, 3) array
        NaN in rows without a reading.
    """
    there = np.isfinite(readings).all(axis=1) & np.isfinite(t)
    t, readings = t[there], readings[there]
    if t.size < 3:
        return None
    steps = np.diff(t)
    step = float(np.median(steps))
    ends = np.flatnonzero(steps > max(GAP, _USUAL * step)) + 1
    pieces = []
    for first, last in zip([0, *ends], [*ends, t.size], strict=True):
        places = np.concatenate([[0], np.cumsum(np.maximum(1, np.rint(steps[first : last - 1] / step)))])
        piece = np.full((int(places[-1]) + 1, 3), np.nan)
        piece[places.astype(np.intp)] = readings[first:last]
        pieces.append(piece)
    # The mean step inside the pieces is surer than the median of jittered ones.
    spans = [(t[last - 1] - t[first], len(piece) - 1) for first, last, piece in _spans(ends, t.size, pieces)]
    counted = sum(samples for _, samples in spans)
    step = sum(span for span, _ in spans) / counted if counted else step
    return Samples(float(step), tuple(pieces), int(t.size))


def _spans(ends: NDArray[np.intp], n: int, pieces: list[Array]) -> list[tuple[int, int, Array]]:
    """First row, row after the last one, and the samples of each piece."""
    return list(zip([0, *ends.tolist()], [*ends.tolist(), n], pieces, strict=True))
