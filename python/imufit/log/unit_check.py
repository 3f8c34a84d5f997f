"""Units that cannot be: specific force in g, rates in deg/s, flux density in gauss, time in milliseconds.

Each rule refuses only what is unmistakable. A sensor that merely reads oddly passes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log.clock_check import other_clock, turn_ratio
from imufit.log.columns import GROUPS
from imufit.log.metadata import Metadata
from imufit.log.place import Place
from imufit.log.time_unit import time_unit
from imufit.log.units import conversion
from imufit.remedy import Remedy, mapped

FASTEST_GYR: Final = 32e3
"""Largest output rate of a gyroscope of this class, Hz (TDK InvenSense, ICM-42688-P data sheet DS-000347: 32 kHz)."""
FASTEST: Final = 1e6
"""Rate that no log without a gyroscope reaches, Hz: the fastest accelerometers give 1e5 samples a second."""
_CLOCK_OFF: Final = 0.05
"""Relative error of a sensor's own clock (the same data sheet: 5 % at most)."""
SLOWEST_STEP: Final = 2.0
"""Median time from row to row, s, from which a clock that was not stated is taken for one of another unit: at 0.5 Hz a
hand turns a sensor over between two samples. A log of rests may be as slow, and then has metadata."""
_ROWS_OF_A_CLOCK: Final = 20
"""Rows from which on the steps of a clock are judged."""
HEAD: Final = 200_000
"""Rows from the start of the log on which units are judged."""

Array = NDArray[np.float64]
Clock = Literal["stated", "a log's", "open"]

ACC_UNITS: Final = (
    (1.0, "g", "g"),
    (1000.0, "milli-g", "mg"),
    (980.665, "cm/s^2 (Gal)", "cm/s^2"),
    *((float(c), f"raw counts of {c} LSB/g", f"{c} LSB/g") for c in (16384, 8192, 4096, 2048)),
)
_DEG: Final = np.pi / 180.0
GYR_UNITS: Final = (
    (_DEG, "deg/s", "deg/s"),
    (1e-3 * _DEG, "milli-deg/s", "mdps"),
    *((_DEG / c, f"raw counts of {c:g} LSB/(deg/s)", f"{c:g} LSB/(deg/s)") for c in (131.0, 65.5, 32.8, 16.4)),
)
_RPM: Final = (np.pi / 30.0, "rpm", "rpm")
_AGREES: Final = 0.3
"""Logarithm of a ratio of rates up to which they agree: half of what lies between two units."""
_CLEARER: Final = 0.1
"""The same by which a single axis must agree better than all of them; noise takes some 10 % of a ratio."""
_NEAR_GRAVITY: Final = 0.15
"""Relative difference up to which gravity shows the unit; nearly all units lie a factor of 2 apart."""
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
_TESLA: Final = 2e-3
"""Norm below which a magnetometer reads in T: 2 mT is beyond the range of all that measure the earth's field, and 2 nT
is below the noise of all that are built beside accelerometers."""
_EARTH: Final = (20.0, 70.0)
"""Magnitude of the earth's field, uT (World Magnetic Model: 22 to 67)."""
_COUNTS: Final = tuple(
    (per, f"raw counts of {words}", words)
    for per, words in ((1 / 0.15, "0.15 uT/LSB"), (10.9, "10.9 LSB/uT"), (30.0, "30 LSB/uT"), (120.0, "120 LSB/uT"))
)
"""Counts per uT of common magnetometers: AK8963 and AK09916, HMC5883L, QMC5883L at 8 G and at 2 G."""
_UNDECIDED: Final = 0.03
"""Difference of logarithms up to which two units fit equally well: errors of scale of consumer accelerometers."""
_AT_REST: Final = 0.1
"""Spread over size of the quietest readings up to which the sensor rested there: noise and swaying hands."""
_ONE_LENGTH: Final = 1e-5
"""Relative spread of the norm up to which all readings have one length; the noise of every sensor is larger."""
_MOVES: Final = 0.1
"""Range of each axis over the norm, from which on the sensor was turned."""
_HOT: Final = 55.0
"""Temperature, degC, above which boards seldom work: 13 degC reads so in degF."""
_KELVIN: Final = 200.0
"""The same for kelvin: no sensor beside an accelerometer works at 200 degC."""


class OtherUnitError(InputError):
    """Readings that are unmistakably in another unit, of one sensor or of several.

    Parameters
    ----------
    problem : str
        What is wrong with the first of them.
    units : dict
        Unit that each of these columns of the log is in.
    place : Place
        Names the file.
    origin : mapping
        Column of the file for each column of the log.
    otherwise : str or Remedy
        What else it may be, and the mapping for it.
    """

    def __init__(
        self,
        problem: str,
        units: Mapping[str, str],
        place: Place,
        origin: Mapping[str, str],
        otherwise: str | Remedy = "",
    ) -> None:
        self.units = dict(units)
        self.otherwise = otherwise
        column = next(iter(units))
        remedy = "Use " + place.mapped(_in_units(units, origin)) + otherwise
        super().__init__(problem, file=place.file or "log", column=column, remedy=remedy)


def check_units(
    t: Array,
    sensors: Mapping[str, Array | None],
    metadata: Metadata,
    place: Place,
    origin: Mapping[str, str] | None = None,
    clock: Clock = "open",
    tick: float = 1.0,
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
    tick : float
        Unit in which the time stands in the file, s.

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
    check_rate(t, tick, origin.get("t", "t"), place, gyr is not None)
    if clock == "open":
        check_steps(t, tick, origin.get("t", "t"), place)
    if acc is not None and gyr is not None:
        _check_exchange(acc, gyr, metadata.gravity, place, origin)
    checks: list[Callable[[], list[str]]] = []
    if acc is not None:
        checks.append(partial(_check_acc, acc, ref_q, metadata, place, origin))
    if gyr is not None:
        vectors = [(v, v is mag) for v in (acc, mag) if v is not None]
        checks.append(partial(_check_gyr, t, gyr, vectors, ref_q, place=place, origin=origin, clock=clock))
    elif clock == "a log's":
        checks.append(partial(_slow_clock, t, place, origin.get("t", "t")))
    if mag is not None:
        checks.append(partial(_check_mag, mag, metadata, place, origin))
    if (temp := sensors.get("temp")) is not None:
        checks.append(partial(_check_temp, temp, place, origin))
    others: list[OtherUnitError] = []
    for check in checks:
        try:
            notes += check()
        except OtherUnitError as other:
            others.append(other)
    if others:
        # all of it in one mapping, so that the question comes once
        units = {column: unit for other in others for column, unit in other.units.items()}
        others_words = sum((Remedy.of(other.otherwise) for other in others), Remedy("", ""))
        raise OtherUnitError(others[0].problem, units, place, origin, others_words)
    return notes


def _check_exchange(acc: Array, gyr: Array, gravity: float, place: Place, origin: Mapping[str, str]) -> None:
    """Refuse a log in which gravity is in gyr and nothing in acc."""
    still = rest_norm(acc, relative=False)
    if still < _FEW_GRAVITY * gravity and abs(rest_norm(gyr) / gravity - 1.0) < _NEAR_GRAVITY:
        pairs = [
            (f"{one}_{axis}", f"{other}_{axis}") for one, other in (("acc", "gyr"), ("gyr", "acc")) for axis in "xyz"
        ]
        mapping = {target: origin.get(source, source) for target, source in pairs}
        raise place.error(
            f"at rest gyr shows gravity and acc {still:.4g}: the columns of acc and gyr are exchanged",
            column="acc_x",
            remedy="Use " + place.mapped(mapping),
        )


def _check_temp(temp: Array, place: Place, origin: Mapping[str, str]) -> list[str]:
    known = temp[np.isfinite(temp)]
    usual = float(np.median(known)) if known.size else 0.0
    if usual < _HOT:
        return []
    column, (unit, words) = origin.get("temp", "temp"), ("K", "kelvin") if usual > _KELVIN else ("degF", "fahrenheit")
    return [
        f"{place.name}: temp is around {usual:.4g}, hot for degC: if it is in {words}, use "
        f"{place.mapped({'temp': f'{column}[{unit}]'})}"
    ]


def check_rate(t: Array, tick: float, column: str, place: Place, turns: bool) -> None:
    """Refuse rows closer together than any such sensor samples: the unit of the time is another one.

    Parameters
    ----------
    t : (n,) array
        Time by the unit that was stated or found, s.
    tick : float
        That unit, s.
    column : str
        Column of the file that holds the time.
    place : Place
        To name the file.
    turns : bool
        Whether the log has a gyroscope: an analog accelerometer alone may be sampled faster.

    Raises
    ------
    InputError
        Names the rate, and the unit that the steps look like.
    """
    fastest = FASTEST_GYR if turns else FASTEST
    t = t[np.isfinite(t)]
    step = _sampled_every(t) if t.size >= _ROWS_OF_A_CLOCK else 0.0
    if step <= 0.0 or step * fastest * (1.0 + _CLOCK_OFF) >= 1.0:
        return
    likely = time_unit(t / tick)
    slower = likely is not None and conversion("t", likely).factor > tick
    source = f"{column}[{likely}]" if slower else f"{column}[*3600]"
    remedy = "Use " if slower else "Say how many s one of its units has, such as "
    raise place.error(
        f"steps of {step:.3g} s mean {1.0 / step:.3g} Hz, faster than any such sensor samples ({fastest:g} Hz)"
        + (f": the time looks like {likely}" if slower else ": the time is in another unit"),
        column=column,
        remedy=remedy + place.mapped({"t": source}) + ("" if slower else " for hours."),
    )


def _sampled_every(t: Array) -> float:
    """Usual time from sample to sample of an (n,) time, s: the median of the mean steps in its parts.

    A pause lengthens the mean step of one part alone. A single step shows less than the mean of a part: rows that
    arrive in packets are stamped nearly at once, though nothing was sampled so fast. There are as many parts as there
    are rows at least; so many rows have one step in each.
    """
    edges = np.linspace(0, t.size - 1, _ROWS_OF_A_CLOCK).astype(int)
    return float(np.median(np.diff(t[edges]) / np.diff(edges)))


def check_steps(t: Array, tick: float, column: str, place: Place, stated: bool = False) -> None:
    """Refuse rows so far apart that no turning can be followed.

    Parameters
    ----------
    t, tick, column, place
        As for `check_rate`.
    stated : bool
        Whether the user stated that unit: the remedy does not propose it again.

    Raises
    ------
    InputError
        Names the step, and the unit that it looks like.
    """
    t = t[np.isfinite(t)]
    if t.size < _ROWS_OF_A_CLOCK:
        return
    dt = float(np.median(np.diff(t)))
    if dt >= SLOWEST_STEP:
        unit = time_unit(t / tick) or "ms"
        source = f"{column}[{unit}]"
        raise place.error(
            f"the time steps are around {dt:g}, which looks like {unit}, not s",
            column="t",
            remedy="Use " + place.mapped({"t": source}) if stated else _time_from(source, column, place),
        )


def _slow_clock(t: Array, place: Place, column: str) -> list[str]:
    """Say that rows lie far apart where nothing turns that would show the unit of the clock."""
    step = float(np.median(np.diff(t))) if t.size >= _ROWS_OF_A_CLOCK else 0.0
    unit = time_unit(t) if step >= SLOWEST_STEP else None
    if unit in (None, "s"):
        return []
    return [
        f"{place.name}: rows are {step:.4g} s apart, and nothing turns that would show whether t is in s: if it is in "
        f"{unit}, use {place.mapped({'t': f'{column}[{unit}]'})}"
    ]


def _time_from(source: str, column: str, place: Place) -> Remedy:
    """Name the source of the time that is likely, and the one for a time in s."""
    in_seconds = mapped({"t": f"{column}[s]"}, shell="")
    return "Use " + place.mapped({"t": source}) + ", or " + in_seconds + " if it is s."


def rest_norm(acc: Array, rows: int = 50, relative: bool = True) -> float:
    """Median norm of an (n, 3) sensor in the quietest tenth of the windows of 50 rows; NaN without any.

    Quiet is where the spread is small, as a share of the norm (in any unit) or by itself.
    """
    return _rest(acc, rows, relative)[0]


def _rest(acc: Array, rows: int = 50, relative: bool = True) -> tuple[float, float]:
    """Give the norm of `rest_norm`, and the spread of these readings."""
    norm = np.linalg.norm(acc, axis=1)
    complete = np.isfinite(norm)
    acc, norm = acc[complete], norm[complete]
    if norm.size < 2 * rows:
        return (float(np.median(norm)), 0.0) if norm.size else (float("nan"), 0.0)
    windows = norm.size // rows
    shaped = acc[: windows * rows].reshape(windows, rows, 3)
    spread = np.sqrt(np.sum(np.var(shaped, axis=1), axis=1))
    size = np.median(norm[: windows * rows].reshape(windows, rows), axis=1)
    quiet = np.argsort(spread / np.maximum(size, 1e-12) if relative else spread)[: max(1, windows // 10)]
    return float(np.median(size[quiet])), float(np.median(spread[quiet]))


def _gravity_read(acc: Array, ref_q: Array | None) -> float:
    """Norm of acc at rest; where the sensor never rests, what the reference attitude leaves of the mean reading."""
    norm, spread = _rest(acc)
    if ref_q is None or not spread > _AT_REST * norm:
        return norm
    known = np.isfinite(acc).all(axis=1) & np.isfinite(ref_q).all(axis=1)
    if not known.any():
        return norm
    v, (w, u) = acc[known], (ref_q[known, :1], ref_q[known, 1:])
    turn = 2.0 * np.cross(u, v)
    # On average the reference frame sees no acceleration but gravity; with wrong axes it sees much less than the norm.
    mean = float(np.linalg.norm(np.mean(v + w * turn + np.cross(u, turn), axis=0)))
    return mean if mean > 0.3 * norm else norm


def _has_one_length(readings: Array) -> bool:
    """Whether all readings of a sensor that was turned have one length."""
    norm = np.linalg.norm(readings, axis=1)
    known = np.isfinite(norm)
    if np.count_nonzero(known) < 100:
        return False
    size = float(norm[known].max())
    one = float(np.ptp(norm[known])) <= _ONE_LENGTH * size
    return one and bool(np.ptp(readings[known], axis=0).max() > _MOVES * size)


def _nearest(size: float, known: Sequence[tuple[float, str, str]], most: float) -> list[tuple[float, str, str]]:
    """Units in which something has a size, the nearest first; more than one where the readings leave it open."""
    off = {unit: abs(math.log(size / unit[0])) for unit in known} if size > 0.0 else {}
    near = {unit: away for unit, away in off.items() if away < most}
    return [unit for unit in sorted(near, key=lambda u: near[u]) if near[unit] <= min(near.values()) + _UNDECIDED]


def _one_of(
    sensor: str, seen: str, units: Sequence[tuple[float, str, str]], place: Place, origin: Mapping[str, str]
) -> OtherUnitError:
    """Make the error for a sensor that is in the first of these units, or else in one of the others."""
    (_, first, unit), *others = units
    more = sum(
        (f", or if it is {words}: " + mapped(_in_units(_all_in(sensor, other), origin)) for _, words, other in others),
        Remedy("", ""),
    )
    si = {"acc": "m/s^2", "mag": "uT"}[sensor]
    return OtherUnitError(f"{seen}, which looks like {first}, not {si}", _all_in(sensor, unit), place, origin, more)


def _all_in(sensor: str, unit: str) -> dict[str, str]:
    return dict.fromkeys(GROUPS[sensor], unit)


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


def units_of_force(acc: Array, ref_q: Array | None = None) -> list[tuple[float, str, str]]:
    """Find the units that readings are unmistakably in, the likeliest first; empty where they may be in m/s^2.

    Parameters
    ----------
    acc : (n, 3) array
        Readings said to be in m/s^2.
    ref_q : (n, 4) array, optional
        Reference attitude.
    """
    norm = _gravity_read(acc, ref_q)
    overall = float(np.nanmedian(np.linalg.norm(acc, axis=1))) if np.isfinite(norm) else norm
    units = _nearest(norm, ACC_UNITS, _NEAR_GRAVITY)
    return units if units and overall < 3.0 * units[0][0] else []


def _check_acc(
    acc: Array, ref_q: Array | None, metadata: Metadata, place: Place, origin: Mapping[str, str]
) -> list[str]:
    gravity, norm = metadata.gravity, _gravity_read(acc, ref_q)
    if units := units_of_force(acc, ref_q):
        if units[0][2] == "g" and abs(norm - 1.0) < _ONE_LENGTH and _has_one_length(acc):
            raise place.error(
                "every reading of acc has the length 1: each was divided by its own length, and shows a direction only",
                column="acc_x",
                remedy="Export the readings themselves. For a filter, which takes directions too: "
                + place.mapped(_in_units(_all_in("acc", "g"), origin)),
            )
        raise _one_of("acc", f"at rest the norm of acc is {norm:.4g}", units, place, origin)
    if without_gravity(acc, gravity):
        still = rest_norm(acc, relative=False)
        raise place.error(
            f"at rest the norm of acc is {still:.4g} m/s²: gravity was taken off, and cannot be put back",
            column="acc_x",
            remedy="Export the accelerometer itself, not the linear acceleration; where there is none, "
            "state its gravity in the metadata.",
        )
    if np.isfinite(norm) and not 5.0 < norm < 20.0:
        return [f"{place.name}: at rest the norm of acc is {norm:.4g} m/s², far from 9.8: check its unit"]
    return []


def _check_gyr(
    t: Array,
    gyr: Array,
    vectors: list[tuple[Array, bool]],
    ref_q: Array | None,
    *,
    place: Place,
    origin: Mapping[str, str],
    clock: Clock,
) -> list[str]:
    """Refuse rates in another unit, and a clock in another one; note a clock that nothing that turns vouches for."""
    ratios = [(turn_ratio(t, gyr, ref_q), "the reference attitude turns")] if ref_q is not None else []
    ratios += [(field_ratio(t, gyr, v, iron), "the field in the other sensors turns") for v, iron in vectors]
    for ratio, who in ratios:
        if 0.2 < ratio < 1.0 / _OTHER_UNIT:
            return []
        column = origin.get("t", "t")
        units_of_rates = tuple(size for size, *_ in GYR_UNITS)
        other = None if clock == "stated" else other_clock(t, ratio, units_of_rates, column)
        if other is not None:
            raise place.error(
                f"{who} at {ratio:.3g} of the rate in gyr, with rows {float(np.median(np.diff(t))):.3g} s apart: "
                f"{other[0]}, not in s",
                column="t",
                remedy=_time_from(other[1], column, place),
            )
        if ratio < _OTHER_UNIT:
            size, words, unit = min(GYR_UNITS, key=lambda known: abs(np.log(max(ratio, 1e-9) / (0.9 * known[0]))))
            words, unit, axes = _by_turns(t, gyr, ref_q, vectors, (size, words, unit))
            name = "" if axes == "xyz" else f", all of it gyr_{axes}'s"
            raise OtherUnitError(
                f"{who} at {ratio:.3g} of the rate in gyr{name}, which looks like {words}, not rad/s",
                {f"gyr_{axis}": unit for axis in axes},
                place,
                origin,
            )
    high, likely = rate_unit_by_size(gyr)
    if likely is not None:
        words, unit, axes = _by_turns(t, gyr, ref_q, vectors, likely)
        name = "gyr" if axes == "xyz" else f"gyr_{axes}"
        raise OtherUnitError(
            f"{name} reaches {high:.4g}, more than any sensor in rad/s: it looks like {words}",
            {f"gyr_{axis}": unit for axis in axes},
            place,
            origin,
        )
    return _slow_clock(t, place, origin.get("t", "t")) if clock == "a log's" else []


def rate_unit_by_size(gyr: Array) -> tuple[float, tuple[float, str, str] | None]:
    """Find how high rates reach, and the likely unit of rates that are higher than any sensor's in rad/s.

    Parameters
    ----------
    gyr : (n, 3) array
        Readings as they stand.
    """
    norm = np.linalg.norm(gyr, axis=1)
    norm = norm[np.isfinite(norm)]
    high = float(np.quantile(norm, 0.99)) if norm.size else 0.0
    if high <= 100.0:
        return high, None
    return high, GYR_UNITS[0] if high < 4500.0 else GYR_UNITS[2]


def _by_turns(
    t: Array, gyr: Array, ref_q: Array | None, vectors: list[tuple[Array, bool]], likely: tuple[float, str, str]
) -> tuple[str, str, str]:
    """Find words and unit of a gyroscope, and the axes that are in it: all, or a single one where only that agrees.

    A candidate agrees where the gyroscope, converted so, turns as the reference does, or as the field in the other
    sensors. Where nothing turns or nothing agrees, it is the likely unit on all axes.
    """

    def off(unit: tuple[float, str, str], axes: str) -> float:
        converted = gyr * np.array([unit[0] if axis in axes else 1.0 for axis in "xyz"])
        ratios = [] if ref_q is None else [turn_ratio(t, converted, ref_q)]
        ratios += [field_ratio(t, converted, vector, iron) for vector, iron in vectors]
        return next((abs(math.log(ratio)) for ratio in ratios if ratio > 0.0), math.inf)

    units = (likely, *(unit for unit in (*GYR_UNITS, _RPM) if unit is not likely))
    together, alone = (
        min(((off(unit, axes), unit, axes) for axes in tried for unit in units), key=lambda each: each[0])
        for tried in (("xyz",), ("x", "y", "z"))
    )
    best = alone if alone[0] < together[0] - _CLEARER else together
    _, unit, axes = best if best[0] < _AGREES else (0.0, likely, "xyz")
    return unit[1], unit[2], axes


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
    change = (u[2:] - u[:-2])[steady] / dt[steady]
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
    told = 0.0 if metadata.mag_reference is None else math.hypot(*metadata.mag_reference)
    if told > 0.0 and 0.2 < size / told < 5.0:
        return []
    found = [(low, words, unit) for low, high, words, unit in MAG_UNITS if low <= size <= high]
    if not found and size < _TESLA:
        found = [(size, "T", "T")]
    if not found:
        return []
    turns = np.linalg.norm(np.mean(mag[complete] / norm[complete, None], axis=0)) <= 0.95
    if found[0][2] == "mG" and not turns:
        # never turned, or iron beside the sensor outweighs the field: it may well be uT
        return [f"{place.name}: the norm of mag is {size:.4g} uT: iron beside the sensor, or is it milligauss?"]
    if found[0][2] == "mG":
        found = _milligauss_or_counts(mag[complete], size, told, found[0])
    raise _one_of("mag", f"the norm of mag is {size:.4g}", found, place, origin)


def _milligauss_or_counts(
    mag: Array, size: float, told: float, milligauss: tuple[float, str, str]
) -> list[tuple[float, str, str]]:
    """Units of about ten to the uT: by the stated field, or by whole numbers."""
    units = [(10.0, *milligauss[1:]), *_COUNTS]
    if told > 0.0:
        return _nearest(size / told, units, math.inf)
    whole = bool(np.array_equal(mag, np.round(mag)))
    return [unit for unit in units if unit[2] == "mG" or (whole and _EARTH[0] <= size / unit[0] <= _EARTH[1])]


def _in_units(units: Mapping[str, str], origin: Mapping[str, str]) -> dict[str, str]:
    """Return the mapping that reads columns of the log in these units."""
    return {column: f"{origin.get(column, column)}[{unit}]" for column, unit in units.items()}
