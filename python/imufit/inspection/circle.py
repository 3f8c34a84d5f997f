"""Angles on a circle as lines of a figure: what goes over 180 degrees leaves at one edge and comes in at the other."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TURN: Final = 360.0
"""A whole turn, deg."""


class Unwound:
    """Angles made continuous from chunk to chunk, so that smallest and largest value of a pixel mean something.

    Between two samples an angle is taken to go the shorter way.
    """

    def __init__(self) -> None:
        self._last: Array | None = None

    def add(self, angles: Array) -> Array:
        """Return the next angles with whole turns added.

        Parameters
        ----------
        angles : (n, k) array
            deg, none of them NaN.
        """
        if not len(angles):
            return angles
        joined = angles if self._last is None else np.concatenate([self._last[None], angles])
        unwound = np.unwrap(joined, axis=0, period=TURN)[-len(angles) :]
        self._last = unwound[-1]
        return np.asarray(unwound)


def on_circle(t: Array, angles: Array) -> tuple[Array, Array]:
    """Lay continuous angles on the circle from -180 to 180 deg.

    A line that crosses an edge is led to the edge, interrupted, and goes on from the other edge.

    Parameters
    ----------
    t : (n,) array
        Ascending times, s.
    angles : (n, k) array
        deg; NaN interrupts a line.

    Returns
    -------
    t : (m,) array
        Times with those of the crossings, s.
    angles : (m, k) array
        deg, from -180 to 180.
    """
    turns = np.floor((angles + 0.5 * TURN) / TURN)
    wrapped = angles - TURN * turns
    steps = np.diff(angles, axis=0)
    # Of more than two turns between two points all that shows is that every angle occurs.
    whole = np.trunc(np.maximum(np.abs(steps) - TURN, 0.0) / TURN)
    ends = wrapped[:-1] + steps - np.sign(steps) * TURN * whole
    crossings = np.abs(np.floor((ends + 0.5 * TURN) / TURN))
    places, fractions, columns = [], [], []
    for row, column in np.argwhere(crossings > 0.0):
        begin, end = wrapped[row, column], ends[row, column]
        way = 1.0 if end > begin else -1.0
        for k in range(int(crossings[row, column])):
            fraction = (way * (0.5 + k) * TURN - begin) / (end - begin)
            if 0.0 < fraction < 1.0:
                places.append(row)
                fractions.append(fraction)
                columns.append(column if way > 0.0 else -column - 1)
    if not places:
        return t, wrapped
    order = np.lexsort([fractions, places])
    at, part, which = (np.array(each)[order] for each in (places, fractions, columns))
    times = t[at] + part * (t[at + 1] - t[at])
    middle = wrapped[at] + part[:, None] * (ends[at] - wrapped[at])
    middle -= TURN * np.floor((middle + 0.5 * TURN) / TURN)
    up = which >= 0
    column = np.where(up, which, -which - 1)
    edge = np.where(up, 0.5 * TURN, -0.5 * TURN)
    rows = np.arange(at.size)
    left, gap, entered = middle.copy(), middle.copy(), middle.copy()
    left[rows, column], gap[rows, column], entered[rows, column] = edge, np.nan, -edge
    inserted = np.stack([left, gap, entered], axis=1).reshape(-1, angles.shape[1])
    before = np.repeat(at + 1, 3)
    return np.insert(t, before, np.repeat(times, 3)), np.insert(wrapped, before, inserted, axis=0)
