"""The unit of time stamps, by their steps and by the age that they show."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.log.units import conversion

Array = NDArray[np.float64]

_TIME_UNITS: Final = (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9))
_USUAL_STEP: Final = (4e-4, 0.4)
"""Usual time from sample to sample, s: 2.5 Hz to 2500 Hz. Within a factor of a thousand only one unit fits."""
_SINCE_1970: Final = (1e8, 4e9)
"""Seconds since 1970 from 1973 to 2096: a clock of the day in any of the units shows which one."""
_DAYS: Final = (2e4, 1e5)
"""Days since 1899, as spreadsheets count them, from 1954 to 2173."""


def time_unit(t: Array, ticks: tuple[str, ...] = ()) -> str | None:
    """Find the unit of the time stamps, such as ``ms``; None where they do not show it.

    Parameters
    ----------
    t : (n,) array
        Stamps as they stand in the file.
    ticks : tuple of str
        Units that alone are possible; empty for the usual ones.
    """
    steps = np.diff(t[np.isfinite(t)])
    steps = steps[steps > 0.0]
    if not steps.size:
        return None
    step, size = float(np.median(steps)), float(np.nanmedian(np.abs(t)))
    low, high = _USUAL_STEP
    if ticks:
        usual = [unit for unit in ticks if low <= step * conversion("t", unit).factor < high]
        return usual[0] if len(usual) == 1 else None
    if _DAYS[0] <= size <= _DAYS[1] and low <= step * 86400.0 <= high:
        return "d"
    dated = [unit for unit, s in _TIME_UNITS if _SINCE_1970[0] <= size * s <= _SINCE_1970[1] and step * s <= 100.0]
    usual = [unit for unit, s in _TIME_UNITS if low <= step * s < high]
    if len(dated) == 1 and (dated == usual or not usual):
        return dated[0]
    return usual[0] if len(usual) == 1 else None
