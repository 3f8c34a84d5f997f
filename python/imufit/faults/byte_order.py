"""Counts whose two bytes were read in the wrong order."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LARGEST: Final = 32768
"""Largest count of a 16-bit register."""
ROUNDING: Final = 0.02
"""Counts by which a reading may lie beside a whole one: seven digits of the largest count leave a hundredth."""


def bytes_swapped(readings: Array) -> Array | None:
    """Return readings with the bytes of each count exchanged; None where they are not whole counts of 16 bits.

    Parameters
    ----------
    readings : ndarray
        (n, 3) of one sensor, in any unit; NaN where there is none.
    """
    known = np.unique(readings[np.isfinite(readings)])
    if known.size < LARGEST // 1024:
        return None
    steps = np.diff(known)
    step = float(steps[steps > 1e-9 * float(np.ptp(known))].min(initial=np.inf))
    if not np.isfinite(step):
        return None
    # The smallest step has rounding in it: what the largest reading is in whole counts has less.
    top = float(np.abs(known).max())
    step = top / max(round(top / step), 1)
    counts = known / step
    if np.abs(counts).max() > LARGEST or np.abs(counts - np.round(counts)).max() > ROUNDING:
        return None
    whole = np.round(np.nan_to_num(readings) / step).astype(np.int16)
    return np.where(np.isfinite(readings), whole.byteswap() * step, np.nan)
