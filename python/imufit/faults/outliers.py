"""Single samples that no sensor has read: spikes, and fillers such as -999 in the place of lost samples.

A value is an outlier to its channel where two things hold. It lies beyond all other values by more than these spread
over, so that no motion of this log leads there. And the channel jumps there and back by many times its largest other
step, so that no motion of another kind leads there either. A filler stands for several rows with one value; a blow that
a sensor did see has rows before and after it that differ, and steps that grow and die away.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.faults.row_fault import SENSORS, RowFault, runs
from imufit.log import Chunk

Array = NDArray[np.float64]

APART: Final = 1.0
"""Spread of all other values by which an outlier lies beyond them."""
JUMP: Final = 10.0
"""Times the largest other step by which the channel jumps to an outlier and back."""
MOST: Final = 0.2
"""Share of the rows above which values are not outliers."""
ROWS: Final = 100
"""Rows by which the others are known."""


def outliers(chunk: Chunk) -> list[RowFault]:
    """Find samples that are none in the core rows of a chunk.

    Parameters
    ----------
    chunk : Chunk
        Rows with margins.
    """
    found = []
    for sensor in SENSORS:
        column = getattr(chunk.log, sensor)
        rows = np.empty(0, np.intp) if column is None else np.flatnonzero(np.isfinite(column).all(axis=1))
        for axis in range(3) if rows.size >= ROWS else ():
            values = column[rows, axis]
            outlying, usual = _outlying(values)
            for first, stop in runs(outlying)[0 if outlying[0] else 1 :: 2].tolist() if outlying.any() else ():
                span, inside = (int(rows[first]), int(rows[stop - 1])), values[first:stop]
                figures = {"low": -float(inside.min()), "high": float(inside.max()), "usual": usual}
                found += RowFault.within(chunk, span, "outlier", (sensor,), "xyz"[axis], **figures)
    return found


def _outlying(values: Array) -> tuple[NDArray[np.bool_], float]:
    """Whether each sample of a channel is an outlier, and the largest absolute value of the others."""
    outlying = np.zeros(values.size, np.bool_)
    order = np.sort(values)
    for sign in (1.0, -1.0):
        end = order if sign > 0.0 else -order[::-1]
        # The widest gap among the outermost samples parts the outliers from the others.
        first = int((1.0 - MOST) * end.size)
        at = first + int(np.argmax(np.diff(end[first:])))
        if end[at + 1] - end[at] > APART * (end[at] - end[0]):
            outlying |= sign * values > end[at]
    if not outlying.any() or outlying.mean() > MOST:
        return np.zeros(values.size, np.bool_), 0.0
    others = values[~outlying]
    steps = np.abs(np.diff(values))
    edge = outlying[1:] != outlying[:-1]
    within = ~outlying[1:] & ~outlying[:-1]
    inside = outlying[1:] & outlying[:-1]
    quiet = float(steps[within].max(initial=0.0))
    # Several outliers in a row are a filler, of one value: a motion has many.
    certain = float(steps[edge].min(initial=np.inf)) > JUMP * quiet and not steps[inside].any()
    return outlying & certain, float(np.abs(others).max())
