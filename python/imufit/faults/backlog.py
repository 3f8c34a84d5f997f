"""Rows stamped with their arrival: a receiver that had to catch up got them faster than they were taken.

At the beginning of a log, or after a gap, rows come at more than one and a half times the usual rate until the backlog
is used up. Their times say nothing of when they were taken.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from imufit.faults.row_fault import SENSORS, RowFault, runs
from imufit.log import Chunk, Log

FASTER: Final = 0.67
"""Mean step of `ROWS` rows over the usual one, below which rows come too fast."""
ROWS: Final = 10
SURPLUS: Final = 20
"""Rows more than there should be in the time."""
GAP: Final = 5.0
"""Steps without a row after which rows may have been held back."""
TURNED: Final = 2e-3
WENT: Final = 2e-3
"""Turn, rad, and way, m, up to which the body was at rest."""
MOST: Final = 0.4
"""A larger share of fast rows is another rate, no backlog."""


def _moved(log: Log, low: int, high: int) -> bool:
    """Whether the body moved between two rows; at rest a wrong time does no harm."""
    if log.ref_q is None:
        return True
    q = log.ref_q[low : high + 1]
    q = q[np.isfinite(q).all(axis=1)]
    if not len(q):
        return True
    turned = 2.0 * np.arccos(np.clip(np.abs(q @ q[0]), 0.0, 1.0)).max()
    place = np.zeros((1, 3)) if log.ref_p is None else log.ref_p[low : high + 1]
    place = place[np.isfinite(place).all(axis=1)]
    return bool(turned > TURNED or (len(place) and np.ptp(place, axis=0).max() > WENT))


def backlogs(chunk: Chunk) -> list[RowFault]:
    """Find rows that came in a burst, in the core of a chunk.

    Parameters
    ----------
    chunk : Chunk
        Rows with margins.
    """
    t = chunk.log.t
    if t.size < 10 * ROWS:
        return []
    step = (t[ROWS:] - t[:-ROWS]) / ROWS
    usual = float(np.median(step))
    fast = step < FASTER * usual
    if not fast.any() or fast.mean() > MOST:
        return []
    row = chunk.start - chunk.begin
    # Rows within a fast window, short interruptions included.
    spans: list[list[int]] = []
    for first, stop in runs(fast)[0 if fast[0] else 1 :: 2].tolist():
        if spans and first - spans[-1][1] < 2 * ROWS:
            spans[-1][1] = stop + ROWS
        else:
            # The rows before the first fast rows of a log are part of the burst.
            spans.append([0 if row + first < 2 * ROWS else first, stop + ROWS])
    sensors = tuple(name for name in SENSORS if getattr(chunk.log, name) is not None)
    found = []
    for first, stop in spans:
        last = min(stop, t.size) - 1
        span = float(t[last] - t[first])
        surplus = (last - first) - span / usual
        gap = float(np.max(np.diff(t[max(0, first - ROWS) : first + ROWS])))
        held_back = row + first < 2 * ROWS or (gap > GAP * usual and gap / usual > 0.5 * surplus)
        if surplus >= SURPLUS and held_back:
            moved = float(_moved(chunk.log, max(first, chunk.begin), min(last, chunk.end - 1)))
            rate = (last - first) / span
            found += RowFault.within(
                chunk, (first, last), "backlog", sensors, rate=rate, usual=1.0 / usual, surplus=surplus, moved=moved
            )
    return found
