"""Contiguous segments of a log."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray


def gaps(t: NDArray[np.float64], factor: float = 3.5) -> list[tuple[int, int]]:
    """Split a log at its gaps into contiguous segments.

    Parameters
    ----------
    t : (n,) array
        Time, s, strictly increasing.
    factor : float
        A step of more than this many median steps is a gap.

    Returns
    -------
    list of (start, stop)
        Row ranges ``start <= row < stop`` that together cover all rows; empty for n = 0.
    """
    if t.size == 0:
        return []
    steps = np.diff(t)
    cuts = np.flatnonzero(steps > factor * np.median(steps)) + 1 if steps.size else np.empty(0, np.int64)
    edges = [0, *(int(cut) for cut in cuts), t.size]
    return list(pairwise(edges))
