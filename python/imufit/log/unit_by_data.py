"""Units that no name states, found in the readings: a unit is stated or determined, never assumed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.log.clock_check import turn_ratio
from imufit.log.metadata import STANDARD_GRAVITY
from imufit.log.unit_check import ACC_UNITS, GYR_UNITS, MAG_UNITS, field_ratio, rest_norm

Array = NDArray[np.float64]

_GRAVITIES: Final = ((STANDARD_GRAVITY, "m/s^2"), *((size, unit) for size, _, unit in ACC_UNITS))
"""Gravity in each unit."""
_NEAR: Final = 0.15
"""Relative difference up to which gravity at rest shows the unit; the units lie a factor of 2 apart."""
_NEAR_RATE: Final = 0.25
"""The same for rates, of which noise pulls a ratio towards zero by some percent; the units lie a factor of 2 apart."""
_BLOCKS: Final = (0.1, 0.3, 1.0)
"""Lengths of the blocks over which turning is compared, s: shaking averages out of the longer ones, quick turns too."""
_WINDOW: Final = 3.0
"""Time over which readings are turned back, s: a hand or an arm turns by a radian, and the rates' offset by less than a
tenth of one."""
_WINDOWS: Final = 60
"""Windows looked at, three minutes."""
_CLEARLY: Final = 1.25
"""Factor by which any other unit leaves more of the specific force over. Over 24 simulated logs of hands and arms
(tests/foreign_files.py) the right unit left least in all, half or twice the unit 1.1 to 13 times as much."""
_FINE_STEP: Final = 0.01
"""Step to which faster readings are averaged before they are turned back, s: a hand turns by a degree in it."""
_EARTH: Final = (20.0, 70.0)
"""Magnitude of the earth's field, uT (World Magnetic Model: 22 to 67)."""
_LEAST_CHANGE: Final = 0.15
"""RMS change of the field seen by a sensor that turned by 30 degrees and more, over the smallest field of the earth: a
turn by 30 degrees about the vertical, evenly run through, changes a horizontal component of half the field so much."""


def acc_unit(acc: Array) -> str | None:
    """Find the unit of an accelerometer by gravity at rest; None where no known unit fits.

    Parameters
    ----------
    acc : (n, 3) array
        Readings as they stand in the file.
    """
    norm = rest_norm(acc)
    return next((unit for size, unit in _GRAVITIES if abs(norm / size - 1.0) < _NEAR), None)


def likely_acc_unit(acc: Array) -> str:
    """Find the unit in which the quietest readings of an accelerometer are nearest to gravity; g where none is known.

    Parameters
    ----------
    acc : (n, 3) array
        Readings as they stand in the file.
    """
    norm = rest_norm(acc)
    if not (np.isfinite(norm) and norm > 0.0):
        return "g"
    return min(_GRAVITIES, key=lambda each: abs(np.log(norm / each[0])))[1]


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
    known = {unit: size for size, _, unit in ((1.0, "", "rad/s"), *GYR_UNITS)}
    ratios: list[tuple[float, str | None]] = []
    if ref_q is not None:
        ratios.append((turn_ratio(t, gyr, ref_q), None))
    least: dict[int, str | None] = {}
    for k, (vector, iron) in enumerate(vectors):
        if not iron:
            least[k], clear = _least_left_over(t, gyr, vector, known)
            if clear:
                return least[k]
        ratios += [(field_ratio(t, gyr, vector, iron, block), least.get(k)) for block in _BLOCKS]
    for ratio, other in ratios:
        if np.isfinite(ratio) and ratio > 0.0:
            unit = min(known, key=lambda each: abs(np.log(ratio / known[each])))
            # shaking that goes with the turning pulls the ratio to another unit: both ways have to agree
            agreed = other is None or other == unit
            return unit if agreed and abs(np.log(ratio / known[unit])) < _NEAR_RATE else None
    return None


def _least_left_over(t: Array, gyr: Array, acc: Array, known: Mapping[str, float]) -> tuple[str | None, bool]:
    """Find the unit in which the gyroscope best turns an accelerometer's readings of some seconds into one direction.

    Turned back by the rates, specific force is gravity and what shakes about it, which averages out: a wrong unit
    leaves gravity turning.

    Returns
    -------
    (unit, clear)
        The unit, None where too few rows are known; and whether it is clearly better than the others, than no turning
        at all, and than the scales between the known units.
    """
    shares = {unit: _left_over(t, gyr, acc, size) for unit, size in known.items()}
    still = _left_over(t, gyr, acc, 0.0)
    if not np.isfinite([still, *shares.values()]).all():
        return None, False
    best = min(shares, key=lambda unit: shares[unit])
    if shares[best] * _CLEARLY > min(still, *(share for unit, share in shares.items() if unit != best)):
        return best, False
    beside = min(_left_over(t, gyr, acc, known[best] * np.exp(off)) for off in (-_NEAR_RATE, _NEAR_RATE))
    return best, shares[best] <= beside


def _left_over(t: Array, gyr: Array, acc: Array, factor: float) -> float:
    """Share of the specific force's square that is not constant once turned back at `factor` times the rates."""
    known = np.isfinite(gyr).all(axis=1) & np.isfinite(acc).all(axis=1) & np.isfinite(t)
    t, gyr, acc = t[known], gyr[known], acc[known]
    step = float(np.median(np.diff(t))) if t.size > 1 else 0.0
    block = max(1, round(_FINE_STEP / step)) if step > 0.0 else 1
    blocks = t.size // block
    gyr, acc = (a[: blocks * block].reshape(blocks, block, 3).mean(axis=1) for a in (gyr, acc))
    step *= block
    rows = round(_WINDOW / step) if step > 0.0 else 0
    windows = min(blocks // rows, _WINDOWS) if rows > 1 else 0
    if windows < 1:
        return float("nan")
    shaped = [a[: windows * rows].reshape(windows, rows, -1) for a in (gyr, acc)]
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - costs a fifth of a second that many commands do not need

    turn = Rotation.identity(windows)
    total = shaped[1][:, 0].copy()
    for row in range(1, rows):
        mean = 0.5 * (shaped[0][:, row - 1] + shaped[0][:, row])
        turn = turn * Rotation.from_rotvec(mean * factor * step)
        total += turn.apply(shaped[1][:, row])
    constant = np.sum((total / rows) ** 2, axis=1)
    whole = np.mean(np.sum(shaped[1] ** 2, axis=2), axis=1)
    return float(1.0 - np.sum(constant) / max(float(np.sum(whole)), 1e-30))


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
