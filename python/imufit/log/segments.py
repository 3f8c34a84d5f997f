"""Contiguous segments of a log."""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

GAP_STEPS: Final = 3.5
"""A step of more than this many median steps is a gap: one or two samples that were lost are not."""


def is_gap(steps: NDArray[np.float64], usual: float, factor: float = GAP_STEPS) -> NDArray[np.bool_]:
    """Say which steps of time are gaps, where the usual step is known: of a log that is read chunk by chunk.

    Parameters
    ----------
    steps : (n,) array
        Steps from one sample to the next, s.
    usual : float
        Median step, s.
    factor : float
        A step of more than this many median steps is a gap.
    """
    return np.asarray(steps > factor * usual)


def gap_after(t: NDArray[np.float64], factor: float = GAP_STEPS) -> NDArray[np.bool_]:
    """Say after which samples a gap follows.

    Parameters
    ----------
    t : (n,) array
        Time, s, strictly increasing.
    factor : float
        A step of more than this many median steps is a gap.

    Returns
    -------
    (n - 1,) array of bool
        Empty for n < 2.
    """
    steps = np.diff(t)
    return is_gap(steps, float(np.median(steps)), factor) if steps.size else np.zeros(0, np.bool_)


def gaps(t: NDArray[np.float64], factor: float = GAP_STEPS) -> list[tuple[int, int]]:
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
    cuts = np.flatnonzero(gap_after(t, factor)) + 1
    edges = [0, *(int(cut) for cut in cuts), t.size]
    return list(pairwise(edges))
