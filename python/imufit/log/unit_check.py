"""Units that cannot be: specific force in g, rates in deg/s, flux density in gauss, time in milliseconds.

Each rule refuses only what is unmistakable. A sensor that merely reads oddly passes.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Mapping
from functools import partial
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log.columns import GROUPS
from imufit.log.metadata import Metadata
from imufit.log.place import Place
from imufit.log.time_unit import time_unit

LEAST_STEP: Final = 1e-6
"""Mean time from row to row, s, below which no sensor samples: the fastest accelerometers give 1e5 samples a second."""
SLOWEST_STEP: Final = 2.0
"""Median time from row to row, s, from which a clock that was not stated is taken for one of another unit: at 0.5 Hz a
hand turns a sensor over between two samples. A log of rests may be as slow, and then says so."""
HEAD: Final = 200_000
"""Rows from the start of the log on which units are judged."""

Array = NDArray[np.float64]
Clock = Literal["stated", "a log's", "open"]

ACC_UNITS: Final = (
    (1.0, "g", "g"),
    (1000.0, "milli-g", "mg"),
    *((float(c), f"raw counts of {c} LSB/g", f"{c} LSB/g") for c in (16384, 8192, 4096, 2048)),
)
_DEG: Final = np.pi / 180.0
GYR_UNITS: Final = (
    (_DEG, "deg/s", "deg/s"),
    (1e-3 * _DEG, "milli-deg/s", "mdps"),
    *((_DEG / c, f"raw counts of {c:g} LSB/(deg/s)", f"{c:g} LSB/(deg/s)") for c in (131.0, 65.5, 32.8, 16.4)),
)
_LIKE_CLOCK: Final = 0.3
"""Logarithm of a ratio of rates over 1/1000 up to which the clock is in ms: noise takes some 10 % of it."""
_COARSE_STEP: Final = 0.1
"""Rows so far apart, s, may be 0.1 ms and more apart; at 10 kHz and faster nothing is logged with a clock in ms."""
_NO_GRAVITY: Final = 0.1
"""Norm at rest over gravity below which gravity was taken off: an accelerometer of any make is wrong by less."""
_FEW_GRAVITY: Final = 0.5
"""The same for the median of the whole log, which a fall leaves at one."""
_OTHER_UNIT: Final = 0.03
"""Noise pulls the ratio of rates towards zero, but not as far as this in rad/s."""
MAG_UNITS: Final = (
    (0.2, 0.7, "gauss", "G"),
    (200.0, 700.0, "milligauss", "mG"),
    (2e4, 7e4, "nT", "nT"),
    (2e-5, 7e-5, "T", "T"),
)


class OtherUnitError(InputError):
    """Readings that are unmistakably in another unit, of one sensor or of several.

    Parameters
    ----------
    problem : str
        What is wrong with the first of them.
    units : dict
        Unit that each sensor ("acc", "gyr", "mag") is in.
    place : Place
        Names the file.
    origin : mapping
        Column of the file for each column of the log.
    """

    def __init__(self, problem: str, units: Mapping[str, str], place: Place, origin: Mapping[str, str]) -> None:
        self.units = dict(units)
        named = [(column, unit) for group, unit in units.items() for column in GROUPS[group]]
        pairs = ",".join(f"{column}={origin.get(column, column)}[{unit}]" for column, unit in named)
        column = named[0][0]
        super().__init__(problem, file=place.file or "log", column=column, remedy=f"Use --map {shlex.quote(pairs)}")


def check_units(
    t: Array,
    sensors: Mapping[str, Array | None],
    metadata: Metadata,
    place: Place,
    origin: Mapping[str, str] | None = None,
    clock: Clock = "open",
) -> list[str]:
    """Refuse a log whose readings are unmistakably in another unit.

    Parameters
    ----------
    t : (n,) array
        Time, s.
    sensors : mapping
        ``acc``, ``gyr``, ``mag`` (n, 3) and ``ref_q`` (n, 4), or None for those that are absent.
    metadata : Metadata
        Gives the magnitude of the field, where known.
    place : Place
        To name the file in errors.
    origin : mapping, optional
        Column of the file for each column of the log, to word the remedy.
    clock : {"stated", "a log's", "open"}
        Whether the unit of the time was stated, or the table has metadata as a log has: rows may then be as far apart
        as they are. Where it was not stated, a gyroscope a thousand times too fast shows a clock in ms.

    Returns
    -------
    list of str
        Notes on what is odd but possible.

    Raises
    ------
    InputError
        The unit is another one; it is named, with the mapping that converts it.
    """
    acc, gyr, mag, ref_q = (sensors.get(name) for name in ("acc", "gyr", "mag", "ref_q"))
    notes: list[str] = []
    origin = origin or {}
    _check_time(t, place, origin, clock != "open")
    checks: list[Callable[[], list[str]]] = []
    if acc is not None:
        checks.append(partial(_check_acc, acc, metadata.gravity, place, origin))
    if gyr is not None:
        vectors = [(v, v is mag) for v in (acc, mag) if v is not None]
        stated = clock == "stated"
        checks.append(partial(_check_gyr, t, gyr, vectors, ref_q, place=place, origin=origin, stated=stated))
    if mag is not None:
        checks.append(partial(_check_mag, mag, metadata, place, origin))
    others: list[OtherUnitError] = []
    for check in checks:
        try:
            notes += check()
        except OtherUnitError as other:
            others.append(other)
    if others:
        # all of it in one mapping, so that nobody is asked twice
        units = {group: unit for other in others for group, unit in other.units.items()}
        raise OtherUnitError(others[0].problem, units, place, origin)
    return notes


def _check_time(t: Array, place: Place, origin: Mapping[str, str], stated: bool) -> None:
    """Refuse rows closer or farther apart than any sensor samples."""
    if t.size < 20:
        return
    mean = float(t[-1] - t[0]) / (t.size - 1)
    column = origin.get("t", "t")
    if mean < LEAST_STEP:
        raise place.error(
            f"{t.size} rows lie within {t[-1] - t[0]:.3g} s, more than any sensor samples: t is not in s",
            column="t",
            remedy="Say how many s one of its units has, such as --map "
            + shlex.quote(f"t={column}[*3600]")
            + " for hours.",
        )
    dt = float(np.median(np.diff(t)))
    if dt >= SLOWEST_STEP and not stated:
        raise _other_clock(f"the time steps are around {dt:g}", time_unit(t) or "ms", place, column)


def _other_clock(seen: str, unit: str, place: Place, column: str) -> InputError:
    return place.error(
        f"{seen}, which looks like {unit}, not s",
        column="t",
        remedy=f"Use --map {shlex.quote(f't={column}[{unit}]')}, or {shlex.quote(f't={column}[s]')} if it is s.",
    )


def rest_norm(acc: Array, rows: int = 50, relative: bool = True) -> float:
    """Median norm of an (n, 3) sensor in the quietest tenth of the windows of 50 rows; NaN without any.

    Quiet is where the spread is small, as a share of the norm (in any unit) or by itself.
    """
    norm = np.linalg.norm(acc, axis=1)
    complete = np.isfinite(norm)
    acc, norm = acc[complete], norm[complete]
    if norm.size < 2 * rows:
        return float(np.median(norm)) if norm.size else float("nan")
    windows = norm.size // rows
    shaped = acc[: windows * rows].reshape(windows, rows, 3)
    spread = np.sqrt(np.sum(np.var(shaped, axis=1), axis=1))
    size = np.median(norm[: windows * rows].reshape(windows, rows), axis=1)
    quiet = np.argsort(spread / np.maximum(size, 1e-12) if relative else spread)[: max(1, windows // 10)]
    return float(np.median(size[quiet]))


def without_gravity(acc: Array, gravity: float) -> bool:
    """Whether gravity was taken off an accelerometer: at rest and on the whole hardly anything is left of it.

    Parameters
    ----------
    acc : (n, 3) array
        m/s^2.
    gravity : float
        m/s^2.
    """
    norm = np.linalg.norm(acc, axis=1)
    norm = norm[np.isfinite(norm)]
    overall = float(np.median(norm)) if norm.size else float("nan")
    return rest_norm(acc, relative=False) < _NO_GRAVITY * gravity and overall < _FEW_GRAVITY * gravity


def in_other_unit(acc: Array) -> tuple[str, str] | None:
    """Words and unit of readings that are unmistakably not in m/s^2; None where they may be.

    Parameters
    ----------
    acc : (n, 3) array
        Readings said to be in m/s^2.
    """
    norm = rest_norm(acc)
    overall = float(np.nanmedian(np.linalg.norm(acc, axis=1))) if np.isfinite(norm) else norm
    for size, words, unit in ACC_UNITS:
        if abs(norm / size - 1.0) < 0.15 and overall < 3.0 * size:
            return words, unit
    return None


def _check_acc(acc: Array, gravity: float, place: Place, origin: Mapping[str, str]) -> list[str]:
    norm = rest_norm(acc)
    if (other := in_other_unit(acc)) is not None:
        raise OtherUnitError(
            f"at rest the norm of acc is {norm:.4g}, which looks like {other[0]}, not m/s^2",
            {"acc": other[1]},
            place,
            origin,
        )
    if without_gravity(acc, gravity):
        still = rest_norm(acc, relative=False)
        raise place.error(
            f"at rest the norm of acc is {still:.4g} m/s^2: gravity was taken off, and cannot be put back",
            column="acc_x",
            remedy="Export the accelerometer itself, not the linear acceleration; where there is none, "
            "state its gravity in the metadata.",
        )
    if np.isfinite(norm) and not 5.0 < norm < 20.0:
        return [f"{place.name}: at rest the norm of acc is {norm:.4g} m/s^2, far from 9.8: check its unit"]
    return []


def _check_gyr(
    t: Array,
    gyr: Array,
    vectors: list[tuple[Array, bool]],
    ref_q: Array | None,
    *,
    place: Place,
    origin: Mapping[str, str],
    stated: bool,
) -> list[str]:
    ratios = [(rate_ratio(t, gyr, ref_q), "the reference attitude turns")] if ref_q is not None else []
    ratios += [(field_ratio(t, gyr, v, iron), "the field in the other sensors turns") for v, iron in vectors]
    for ratio, who in ratios:
        if ratio > 0.2:
            return []
        if ratio < _OTHER_UNIT:
            if not stated and abs(np.log(ratio / 1e-3)) < _LIKE_CLOCK and float(np.median(np.diff(t))) >= _COARSE_STEP:
                seen = f"{who} at {ratio:.3g} of the rate in gyr, with rows {float(np.median(np.diff(t))):.3g} s apart"
                raise _other_clock(seen, "ms", place, origin.get("t", "t"))
            _, words, unit = min(GYR_UNITS, key=lambda known: abs(np.log(max(ratio, 1e-9) / (0.9 * known[0]))))
            raise OtherUnitError(
                f"{who} at {ratio:.3g} of the rate in gyr, which looks like {words}, not rad/s",
                {"gyr": unit},
                place,
                origin,
            )
    norm = np.linalg.norm(gyr, axis=1)
    norm = norm[np.isfinite(norm)]
    high = float(np.quantile(norm, 0.99)) if norm.size else 0.0
    if high > 100.0:
        words, unit = ("deg/s", "deg/s") if high < 4500.0 else ("raw counts", "131 LSB/(deg/s)")
        raise OtherUnitError(
            f"gyr reaches {high:.4g}, more than any sensor in rad/s: it looks like {words}",
            {"gyr": unit},
            place,
            origin,
        )
    return []


def rate_ratio(t: Array, gyr: Array, ref_q: Array) -> float:
    """Rate of the reference over the rate in gyr, over rows that turn; NaN where too few do."""
    step = max(1, int(np.ceil(0.05 / max(float(np.median(np.diff(t))), 1e-6)))) if t.size > 2 else 1
    if t.size < 20 * step:
        return float("nan")
    dot = np.abs(np.sum(ref_q[step:] * ref_q[:-step], axis=1))
    turned = 2.0 * np.arccos(np.clip(dot, 0.0, 1.0))
    reference = turned / (t[step:] - t[:-step])
    measured = np.linalg.norm(0.5 * (gyr[step:] + gyr[:-step]), axis=1)
    moving = np.isfinite(reference) & np.isfinite(measured) & (turned > 0.01) & (reference > 0.2) & (measured > 0.0)
    if np.count_nonzero(moving) < 20:
        return float("nan")
    return float(np.median(reference[moving] / measured[moving]))


def field_ratio(t: Array, gyr: Array, field: Array, iron: bool, block: float = 0.1) -> float:
    """Find the factor by which gyr explains the turning of a field fixed in space; NaN unless it explains it clearly.

    A constant vector u seen from a body that turns at w obeys du/dt = -w x u, up to the gyro's offset. Iron on the
    body adds b to what is seen, and w x b to that.

    Parameters
    ----------
    t : (n,) array
        Time, s.
    gyr, field : (n, 3) arrays
        Readings in any unit; rows with NaN are left out.
    iron : bool
        Whether the field may have an offset that is fixed to the body: a magnetometer's has.
    block : float
        Time over which readings are averaged, s.
    """
    complete = np.isfinite(gyr).all(axis=1) & np.isfinite(field).all(axis=1)
    t, gyr, field = t[complete], gyr[complete], field[complete]
    if t.size < 200:
        return float("nan")
    rows = max(1, int(np.ceil(block / max(float(np.median(np.diff(t))), 1e-6))))
    blocks = t.size // rows
    if blocks < 20:
        return float("nan")
    t, w, u = (a[: blocks * rows].reshape(blocks, rows, -1).mean(axis=1) for a in (t, gyr, field))
    size = np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-30)
    u /= np.median(size) if iron else size
    dt = t[2:] - t[:-2]
    steady = (dt[:, 0] < 5.0 * np.median(dt)) & (dt[:, 0] > 0.0)
    change = ((u[2:] - u[:-2]) / dt)[steady]
    w, u = w[1:-1][steady], u[1:-1][steady]
    axes = [np.broadcast_to(e, u.shape) for e in np.eye(3)]
    offset = [-np.cross(e, u) for e in axes]
    carried = [np.cross(w, e) for e in axes] if iron else []
    design = np.stack([-np.cross(w, u), *offset, *carried], axis=-1)
    a, b = design.reshape(-1, design.shape[-1]), change.reshape(-1)
    scale = np.linalg.norm(a, axis=0)
    if b.size < 60 or not np.all(scale > 0.0):
        return float("nan")
    solution, *_ = np.linalg.lstsq(a / scale, b, rcond=None)
    still, *_ = np.linalg.lstsq((a / scale)[:, 1:4], b, rcond=None)
    total = max(float(np.sum(b**2)), 1e-30)
    unexplained = float(np.sum((b - a @ (solution / scale)) ** 2)) / total
    by_offset_alone = float(np.sum((b - (a / scale)[:, 1:4] @ still) ** 2)) / total
    clear = unexplained < 0.4 and by_offset_alone - unexplained > 0.3 and solution[0] > 0.0
    return float(solution[0] / scale[0]) if clear else float("nan")


def _check_mag(mag: Array, metadata: Metadata, place: Place, origin: Mapping[str, str]) -> list[str]:
    norm = np.linalg.norm(mag, axis=1)
    complete = np.isfinite(norm) & (norm > 0.0)
    if not complete.any():
        return []
    size = float(np.median(norm[complete]))
    if metadata.mag_reference is not None and 0.2 < size / max(math.hypot(*metadata.mag_reference), 1e-9) < 5.0:
        return []
    for low, high, words, unit in MAG_UNITS:
        if not low <= size <= high:
            continue
        if unit == "mG" and np.linalg.norm(np.mean(mag[complete] / norm[complete, None], axis=0)) > 0.95:
            # never turned, or iron beside the sensor outweighs the field: it may well be uT
            return [f"{place.name}: the norm of mag is {size:.4g} uT: iron beside the sensor, or is it milligauss?"]
        raise OtherUnitError(
            f"the norm of mag is {size:.4g}, which looks like {words}, not uT", {"mag": unit}, place, origin
        )
    return []
