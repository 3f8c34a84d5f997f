"""A clock that is not in s, by what turns: between two rows the body turns by rate times time, in whatever unit.

The turn that the gyroscope gives between rows, its rate times the step of `t`, over the turn that something else shows
is one factor for all axes and rows. A gyroscope in another unit and a clock in another unit make the same factor; which
of the two it is follows from the step between rows, which only one of them makes a usual one.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_NEAR: Final = 0.3
"""Logarithm of the factor over that of a unit up to which they are the same: noise of rates takes some 10 % of it."""
_MINUTE_NEAR: Final = 0.04
"""The same for minutes: deg/s that were converted twice make a factor of 57.3 instead of 60."""
_SLOW: Final = 0.1
"""Rows so far apart, s, may be 0.1 ms and more apart; at 10 kHz and faster nothing is logged with a clock in ms."""
_USUAL_RATE: Final = (2.5, 2500.0)
"""Rates at which sensors are logged, Hz."""
_ROUND: Final = 0.01
"""Part by which a rate is rounded to fewer digits: scale errors of gyroscopes are as large."""
_TURN: Final = 0.05
"""Median turn of the reference over the rows compared, rad: far more than the noise of readings and references adds."""
_LEAST_TURN: Final = 0.01
"""Turn of the reference, rad, from which on rows say something."""
_LEAST_ROWS: Final = 20
_MOST_SPAN: Final = 512
"""Most rows between two attitudes compared: a turn over more of them is not one turn about one axis any more."""
_CLOCKS: Final = (("ms", 1e3), ("us", 1e6), ("ns", 1e9))


def turn_ratio(t: Array, gyr: Array, ref_q: Array) -> float:
    """Find the turn of the reference over the turn that the gyroscope gives; NaN where too few rows turn.

    Parameters
    ----------
    t : (n,) array
        Time, in whatever unit.
    gyr : (n, 3) array
        Angular rate, in whatever unit.
    ref_q : (n, 4) array
        Reference attitude.
    """
    known = np.isfinite(gyr).all(axis=1) & np.isfinite(ref_q).all(axis=1)
    t, gyr, ref_q = t[known], gyr[known], ref_q[known]
    if t.size < 4 * _LEAST_ROWS:
        return float("nan")
    step = np.diff(t)
    turns = 0.5 * (gyr[1:] + gyr[:-1]) * step[:, None]
    angle = np.concatenate((np.zeros((1, 3)), np.cumsum(turns, axis=0)))
    late = np.concatenate(([0], np.cumsum(step > 5.0 * np.median(step))))
    span = 1
    while True:
        dot = np.abs(np.sum(ref_q[span:] * ref_q[:-span], axis=1))
        turned = 2.0 * np.arccos(np.clip(dot, 0.0, 1.0))
        if float(np.quantile(turned, 0.75)) >= _TURN or 2 * span > min(_MOST_SPAN, t.size // (2 * _LEAST_ROWS)):
            break
        span *= 2
    integrated = np.linalg.norm(angle[span:] - angle[:-span], axis=1)
    moving = (turned > _LEAST_TURN) & (turned < 1.0) & (integrated > 0.0) & (late[span:] == late[:-span])
    if np.count_nonzero(moving) < _LEAST_ROWS:
        return float("nan")
    return float(np.median(turned[moving] / integrated[moving]))


def other_clock(t: Array, ratio: float, gyr_units: tuple[float, ...], column: str) -> tuple[str, str] | None:
    """Say which clock explains a ratio of turns, and the source of `t` that puts it right; None where none does.

    Parameters
    ----------
    t : (n,) array
        Time as it stands.
    ratio : float
        Turn that something else shows over the turn that the gyroscope gives.
    gyr_units : tuple of float
        Ratios that the known units of a gyroscope make.
    column : str
        Column of the file that holds the time.
    """
    step = float(np.median(np.diff(t)))
    if not (np.isfinite(ratio) and ratio > 0.0 and step > 0.0):
        return None

    if abs(np.log(ratio / 60.0)) < _MINUTE_NEAR and step < 1.0 / _USUAL_RATE[0] / 60.0:
        return "t is in min", f"{column}[*60]"
    if step < _SLOW:
        return None
    for unit, factor in _CLOCKS:
        if abs(np.log(ratio * factor)) < _NEAR:
            return f"t is in {unit}", f"{column}[{unit}]"
    own = any(abs(np.log(ratio / each)) < 0.1 for each in gyr_units)
    rate = 1.0 / ratio
    if np.all(np.diff(t) == 1.0) and not own and _USUAL_RATE[0] < rate < _USUAL_RATE[1]:
        rounded = round_rate(rate)
        return f"t counts rows at {rate:.4g} Hz (rate by the gyroscope)", f"row[{rounded:g}Hz]"
    return None


def round_rate(rate: float) -> float:
    """Round a rate to as few digits as it can be without changing it by more than the gyroscope is wrong.

    Parameters
    ----------
    rate : float
        In Hz.
    """
    rounded = (float(f"{rate:.{digits}g}") for digits in (1, 2, 3, 4))
    return next((each for each in rounded if abs(each / rate - 1.0) < _ROUND), rate)
