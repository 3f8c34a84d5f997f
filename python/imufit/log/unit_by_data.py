"""Units that no name states, found in the readings: a unit is stated or determined, never assumed."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.log.unit_check import ACC_UNITS, GYR_UNITS, MAG_UNITS, field_ratio, rate_ratio, rest_norm
from imufit.log.units import conversion

Array = NDArray[np.float64]

_TIME_UNITS: Final = (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9))
_USUAL_STEP: Final = (4e-4, 0.4)
"""Usual time from sample to sample, s: 2.5 Hz to 2500 Hz. Within a factor of a thousand only one unit fits."""
_SINCE_1970: Final = (1e8, 4e9)
"""Seconds since 1970 from 1973 to 2096: a clock of the day in any of the units shows which one."""
_DAYS: Final = (2e4, 1e5)
"""Days since 1899, as spreadsheets count them, from 1954 to 2173."""
_NEAR: Final = 0.15
"""Relative difference up to which gravity at rest shows the unit; the units lie a factor of 2 apart."""
_NEAR_RATE: Final = 0.25
"""The same for rates, of which noise pulls a ratio towards zero by some percent; the units lie a factor of 2 apart."""
_EARTH: Final = (20.0, 70.0)
"""Magnitude of the earth's field, uT (World Magnetic Model: 22 to 67)."""
_LEAST_CHANGE: Final = 0.15
"""RMS change of the field seen by a sensor that turned by 30 degrees and more, over the smallest field of the earth: a
turn by 30 degrees about the vertical, evenly run through, changes a horizontal component of half the field so much."""


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


def acc_unit(acc: Array) -> str | None:
    """Find the unit of an accelerometer by gravity at rest; None where no known unit fits.

    Parameters
    ----------
    acc : (n, 3) array
        Readings as they stand in the file.
    """
    norm = rest_norm(acc)
    known = ((9.80665, "", "m/s^2"), *ACC_UNITS)
    return next((unit for size, _, unit in known if abs(norm / size - 1.0) < _NEAR), None)


def gyr_unit(t: Array, gyr: Array, vectors: list[tuple[Array, bool]], ref_q: Array | None) -> str | None:
    """Find the unit of a gyroscope by what else turns; None where nothing turns, or no known unit fits.

    Parameters
    ----------
    t : (n,) array
        Time, s.
    gyr : (n, 3) array
        Readings as they stand in the file.
    vectors : list of ((n, 3) array, bool)
        Sensors of a field that stands still in space, in any unit, and whether the body may add an offset to it.
    ref_q : (n, 4) array or None
        Reference attitude.
    """
    ratios = [rate_ratio(t, gyr, ref_q)] if ref_q is not None else []
    ratios += [field_ratio(t, gyr, vector, iron) for vector, iron in vectors]
    known = ((1.0, "", "rad/s"), *GYR_UNITS)
    for ratio in ratios:
        if np.isfinite(ratio) and ratio > 0.0:
            size, _, unit = min(known, key=lambda each: abs(np.log(ratio / each[0])))
            return unit if abs(np.log(ratio / size)) < _NEAR_RATE else None
    return None


def mag_unit(mag: Array, turned: bool) -> str | None:
    """Find the unit of a magnetometer by the size of the earth's field; None where no known unit fits.

    Iron beside the sensor adds to the norm, but not to what a turn changes.

    Parameters
    ----------
    mag : (n, 3) array
        Readings as they stand in the file.
    turned : bool
        Whether the sensor was turned, so that the field must have changed.
    """
    norm = np.linalg.norm(mag, axis=1)
    known_rows = np.isfinite(norm) & (norm > 0.0)
    if not known_rows.any():
        return None
    size = float(np.median(norm[known_rows]))
    spread = float(np.sqrt(np.sum(np.var(mag[known_rows], axis=0))))
    for low, high, _, unit in ((*_EARTH, "", "uT"), *MAG_UNITS):
        changes = not turned or spread >= _LEAST_CHANGE * low
        iron = turned and size > high and _LEAST_CHANGE * low <= spread <= high
        if changes and (low <= size <= high or iron):
            return unit
    return None


def turned(t: Array, gyr: Array) -> bool:
    """Whether a sensor turned by more than 30 degrees about one of its axes.

    Parameters
    ----------
    t : (n,) array
        Time, s.
    gyr : (n, 3) array
        Angular rate, rad/s; NaN where there is none.
    """
    known = np.isfinite(gyr).all(axis=1)
    if known.sum() < 2:
        return False
    t, rate = t[known], gyr[known] - np.median(gyr[known], axis=0)
    angle = np.cumsum(rate[1:] * np.diff(t)[:, None], axis=0)
    return bool(np.max(np.ptp(angle, axis=0)) > np.radians(30.0))
