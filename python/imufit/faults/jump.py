"""Rows that are lost without a gap in the time: the reference goes on somewhere else, from one row to the next.

Time that is written by row number, or a buffer that overflows before it is stamped, closes a gap. The body turned
meanwhile: between two rows the reference turns by much more than the gyroscope does, and does not turn back.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from imufit.faults.row_fault import RowFault
from imufit.faults.turning import Turning
from imufit.log import Chunk

LEAST: Final = np.radians(6.0)
"""Turn, rad, from which on a jump is named: markers that are exchanged or hidden turn a body by less."""
LARGER: Final = 10.0
"""Times that a jump is larger than what else differs between gyroscope and reference from row to row (99 %)."""
SHARE: Final = 0.99
AROUND: Final = 10
"""Samples of the reference before and after over which the jump must last, and which are left out: derivatives of the
reference reach as far."""
LASTS: Final = 0.5
"""Part of the jump that must be left after `AROUND` samples."""
MOST: Final = 3
"""Jumps in a chunk above which the reference is at fault otherwise."""


def jumps(chunk: Chunk) -> list[RowFault]:
    """Find jumps of the reference in the core rows of a chunk.

    Parameters
    ----------
    chunk : Chunk
        Rows with margins.
    """
    log = chunk.log
    if log.gyr is None or log.ref_q is None:
        return []
    none = np.full((log.n, 3), np.nan)
    turning = Turning(log.t, log.gyr, none, none, log.ref_q)
    known = np.isfinite(log.gyr).all(axis=1)
    if min(int(np.count_nonzero(known)), len(turning.rows)) < 4 * AROUND:
        return []
    more = turning.turned - turning.read
    size = np.where(turning.seen, np.linalg.norm(more, axis=1), 0.0)
    at = np.flatnonzero(size > max(LEAST, LARGER * float(np.quantile(size, SHARE))))
    at = at[(at >= AROUND) & (at < len(size) - AROUND)]
    if not 0 < len(at) <= MOST:
        return []
    found = []
    for step in at:
        lasting = float(np.linalg.norm(more[step - AROUND : step + AROUND + 1].sum(axis=0)))
        if lasting < LASTS * size[step]:
            continue
        rows = turning.rows[[step - AROUND + 1, step + AROUND]]
        found += RowFault.within(
            chunk,
            (int(rows[0]), int(rows[1])),
            "jump",
            ("ref",),
            turned=float(np.linalg.norm(turning.turned[step])),
            read=float(np.linalg.norm(turning.read[step])),
            when=float(turning.body.t[step]),
        )
    return found
