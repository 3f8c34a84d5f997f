"""Wrong units, turned or exchanged columns, a reference in another frame: what concerns every row of a log.

Readings are held against ideal ones in rows from all over the log. Only where an ideal sensor misses most of a reading
is the table of changes gone through: each sensor with its axes permuted and signed (48 ways), or with one axis in
another unit; columns exchanged between sensors; all sensors turned alike (a mount); the reference conjugated, with its
scalar last, or in another frame; its positions in another unit; gravity or field not as the metadata say; gravity taken
off; the bytes of counts swapped. Each goes with any factor for a whole sensor. One comparison serves all of them, and
the change is named that takes away nearly all of what the log as declared leaves, with the fewest changes beside it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.faults.byte_order import bytes_swapped
from imufit.faults.samples import SENSORS, Samples, samples
from imufit.faults.units import KNOWN, POSSIBLE, USUAL, WrongUnit, units_of_field, wrong_units
from imufit.log.metadata import STANDARD_GRAVITY, Metadata
from imufit.log.origin import Origin
from imufit.results import column_words, fault_words
from imufit.results.data_fault import DataFault

Array = NDArray[np.float64]
Part = Mapping[str, Any]

MISSED: Final = 0.2
"""Share of a reading's sum of squares that an ideal sensor must leave before anything else is tried."""
LEFT: Final = MISSED
"""Share of a reading's sum of squares that another way of reading the log may leave at most: nothing is missed then."""
QUARTER: Final = 0.25
"""The same, as a share of what the log as declared leaves."""
TIE: Final = 0.01
MIN_ROWS: Final = 200
EXCITED: Final = {"acc": 0.5, "gyr": 0.05}
"""RMS of the ideal readings, m/s^2 and rad/s, from which on they say something: ten times the noise of a consumer
sensor, and less than the gravity of a log that states it in g."""
EXCITED_FIELD: Final = 0.06
"""The same of the changes of the field, as a part of the field."""
UNHEARD: Final = 2.5
"""Factor of a whole sensor, either way, that no error of scale comes near: it is wrong whatever its name."""
NO_GRAVITY: Final = 0.1
"""Part of gravity that readings have along the vertical, below which gravity was taken off."""
SHORT: Final = 0.5
"""Median length of such readings, in gravities, at most."""
EARTHLY: Final = 0.15
"""Difference from standard gravity, m/s^2, from which on gravity is that of no place on the ground: 9.76 to 9.84."""
LENGTHS: Final = {"mm": 1e-3, "cm": 1e-2}
"""Units in which positions are written, m."""

KINDS: Final = (
    "clock",
    "reference",
    "gravity",
    "axes",
    "frame",
    "mount",
    "exchange",
    "position",
    "bytes",
    "removed",
    "field",
)
"""The reading that is named first if the log does not decide."""
SHOWN: Final = {"position": "units", "gravity": "metadata", "field": "metadata", "exchange": "axes"}
"""Kinds of faults that are called otherwise."""
FRAMES: Final = ("NED", "ENU", "NWU")


def _signed_permutations() -> Array:
    found = [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order in itertools.permutations(range(3))
        for signs in itertools.product((1.0, -1.0), repeat=3)
    ]
    # Those that change least come first, rotations before reflections.
    return np.stack(sorted(found, key=lambda p: (-np.trace(p), -np.linalg.det(p))))


PERMUTATIONS: Final = _signed_permutations()
"""(48, 3, 3), the identity first."""
OWN: Final = PERMUTATIONS[:1]
"""Axes as they are declared."""

PLACES: Final = ((0, 1, 2, 3), (3, 0, 1, 2))
"""Columns in which the true w x y z may stand: as declared, and with the scalar last."""
SIGNS: Final = tuple((1.0, *signs) for signs in itertools.product((1.0, -1.0), repeat=3))
"""Signs of the recorded w x y z; those of all four together mean nothing."""
CLOCKS: Final = tuple(factor for base in (2.0, 4.0, 8.0, 10.0) for factor in (base, 1.0 / base))
"""Factors of a clock that are tried: slips of a rate, or of a divider of a timer. Larger ones, of units, are refused on
reading (`imufit.log.clock_check`)."""


def _one_column(sensor: str) -> Array:
    factors = [unit.factor for unit in KNOWN[sensor] if not 1.0 / UNHEARD < unit.factor < UNHEARD]
    eye = np.eye(3)
    return np.stack([np.diag(1.0 + (factor - 1.0) * axis) for axis in eye for factor in factors])


COLUMNS: Final = {sensor: _one_column(sensor) for sensor in SENSORS}
"""Maps of a sensor of which one column is in another unit, (k, 3, 3)."""


@dataclass(frozen=True, eq=False)
class Change:
    """Another way to read a log.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    rows : Samples
        Readings beside the ideal ones that are expected then.
    matrices : ndarray
        (k, 3, 3) maps from the ideal reading to the reading that are open to a sensor.
    words : tuple of str
        What it means, and what is to be done about it; of single sensors they depend on how these fit.
    sensor : str or None
        The one that it is about.
    """

    kind: str
    rows: Samples
    matrices: Array
    words: fault_words.Words | None = None
    sensor: str | None = None

    def open_to(self, sensor: str) -> Array:
        """Return the maps (k, 3, 3) that are open to a sensor."""
        return np.concatenate([self.matrices, COLUMNS[sensor]]) if self.kind == "axes" else self.matrices


@dataclass(frozen=True, eq=False)
class Match:
    """How well one sensor fits one way of reading the log.

    Attributes
    ----------
    share : float
        Sum of squares left, over that of the readings.
    matrix : ndarray
        (3, 3) map from the ideal reading to the reading: a signed permutation, or one column in another unit.
    ratio : float
        Reading over ideal reading.
    """

    share: float
    matrix: Array
    ratio: float

    @property
    def usual(self) -> bool:
        """True if the ratio is that of a sensor with an error of scale."""
        return 1.0 / USUAL < self.ratio < USUAL

    @property
    def turned(self) -> bool:
        """True if the axes are not as declared."""
        return not np.array_equal(self.matrix, np.eye(3))

    @property
    def column(self) -> int | None:
        """The axis that is in another unit than the others, if one is."""
        off = np.abs(np.diag(self.matrix) - 1.0)
        return int(np.argmax(off)) if np.count_nonzero(self.matrix) == 3 and off.max() not in (0.0, 1.0, 2.0) else None


@dataclass(frozen=True, eq=False)
class Reading:
    """A log read in another way: how well each sensor fits, which sensors that explains, and how much is changed."""

    change: Change
    matches: dict[str, Match]
    good: tuple[str, ...]
    changes: int

    @classmethod
    def of(cls, change: Change, declared: Mapping[str, float], *, field_estimated: bool) -> Reading:
        """Compare every sensor with what the change makes it read.

        Parameters
        ----------
        change : Change
            What is changed.
        declared : mapping
            Share that each sensor leaves as the log is declared.
        field_estimated : bool
            The magnetic field is known only from the readings themselves.
        """
        matches = {}
        for sensor, share in declared.items():
            single = change.kind == "axes" and share <= MISSED
            matches[sensor] = _match(sensor, change.rows, OWN if single else change.open_to(sensor), field_estimated)
        good = tuple(sensor for sensor, match in matches.items() if _explains(sensor, match, declared[sensor]))
        turned = sum(match.turned for match in matches.values()) if change.kind == "axes" else 1
        return cls(change, matches, good, turned + sum(not match.usual for match in matches.values()))

    def left(self, sensors: Sequence[str]) -> float:
        """Sum of the shares that some sensors leave."""
        return float(sum(self.matches[s].share for s in sensors))


def frame_faults(parts: Sequence[Part], facts: _imufit.Facts, metadata: Metadata, origin: Origin) -> list[DataFault]:
    """Name wrong units, turned axes and wrong frames.

    Parameters
    ----------
    parts : sequence of dict
        Windows of the log, see `imufit.faults.samples.windows`.
    facts : Facts
        Of the log as declared.
    metadata : Metadata
        Of the log.
    origin : Origin
        Columns of the file, which the remedies name.

    Returns
    -------
    list of DataFault
        None where the log as declared fits, or where nothing that was tried fits.
    """
    if not parts:
        return []
    rows = samples(parts, facts)
    found = _changed(parts, rows, facts, metadata, origin)
    if not any(fault.sensor in ("acc", None) for fault in found):
        found += _without_gravity(rows, facts, metadata)
    if not any(fault.sensor in ("mag", None) for fault in found):
        found += _field_of_another_size(rows, facts, origin)
    return found


def _changed(
    parts: Sequence[Part], rows: Samples, facts: _imufit.Facts, metadata: Metadata, origin: Origin
) -> list[DataFault]:
    declared = declared_shares(rows, facts.sensors)
    missed = [sensor for sensor, share in declared.items() if share > MISSED]
    if not missed:
        return []
    changes = (
        *_changes(parts, rows, facts, metadata, declared, origin),
        *_columns(parts, rows, facts, missed, origin),
        *_metadata(rows, facts, metadata),
    )
    readings = [Reading.of(change, declared, field_estimated=facts.field_estimated) for change in changes]
    if _false_field(rows, facts, metadata):
        # Readings of the size of the earth's field are in uT.
        readings = [r for r in readings if "mag" not in r.matches or r.matches["mag"].usual]
    readings = [r for r in readings if len(r.good) > len(declared) - len(missed) and r.changes]
    if not readings:
        return []
    first = min(readings, key=lambda r: (-len(r.good), r.changes, r.left(r.good)))
    alike = [
        r
        for r in readings
        if (r.good, r.changes) == (first.good, first.changes) and r.left(first.good) < first.left(first.good) + TIE
    ]
    best = min(alike, key=lambda r: (KINDS.index(r.change.kind), r.left(r.good)))
    alike.remove(best)
    return _worded(best, [s for s in best.good if s in missed], alike, declared, facts, origin)


def declared_shares(rows: Samples, sensors: Sequence[str]) -> dict[str, float]:
    """Share of each reading's sum of squares that an ideal sensor misses, the log read as declared.

    Parameters
    ----------
    rows : Samples
        Rows from all over the log.
    sensors : sequence of str
        Which sensors; those whose readings say nothing are left out.
    """
    views = {sensor: _view(sensor, rows) for sensor in sensors}
    return {s: float(np.sum((v[0] - v[1]) ** 2) / np.sum(v[0] ** 2)) for s, v in views.items() if v is not None}


def explains(share: float, declared: float) -> bool:
    """Say whether another way of reading a log explains a sensor: by the shares left, there and as declared."""
    return share <= min(LEFT, QUARTER * declared)


def _changes(
    parts: Sequence[Part],
    rows: Samples,
    facts: _imufit.Facts,
    metadata: Metadata,
    declared: Mapping[str, float],
    origin: Origin,
) -> Iterator[Change]:
    """Go through the table of changes that are tried."""
    sensors = list(declared)
    yield Change("axes", rows, PERMUTATIONS)
    for matrix in PERMUTATIONS[1:] if len(sensors) > 1 else ():
        if np.linalg.det(matrix) > 0.0:
            words = fault_words.mount([s for s in SENSORS if s in facts.sensors], matrix, sensors[0], origin)
            yield Change("mount", rows, matrix[None], words)
    up = {frame: np.array(_imufit.frame_vectors(frame)["up"]) for frame in (*FRAMES, metadata.frame)}
    for frame in FRAMES:
        # f = R^T (a - g), and -g is gravity upwards.
        change = metadata.gravity * (up[frame] - up[metadata.frame])
        if any(change):
            yield Change("frame", rows.with_force(change), OWN, fault_words.frame(frame, metadata.frame))
    if declared.get("gyr", 0.0) <= MISSED:
        # A reference that is read otherwise turns otherwise, and so does one on another clock.
        return
    for places, signs in itertools.product(PLACES, SIGNS):
        if places == PLACES[0] and signs == SIGNS[0]:
            continue
        other = ({**part, "ref_q": np.ascontiguousarray(part["ref_q"][:, places] * signs)} for part in parts)
        yield Change("reference", samples(other, facts), OWN, fault_words.quaternion(places, signs, origin))
    resting = samples(({**part, "ref_p": None} for part in parts), facts) if "acc" in facts.sensors else rows
    for factor in CLOCKS:
        yield Change("clock", rows.on_clock(factor, resting), OWN, fault_words.clock(factor, origin))


def _columns(
    parts: Sequence[Part], rows: Samples, facts: _imufit.Facts, missed: Sequence[str], origin: Origin
) -> Iterator[Change]:
    """Columns that hold something else: another sensor's readings, swapped bytes, positions in another unit."""
    for one, other in itertools.combinations(facts.sensors, 2):
        if not {one, other} & set(missed):
            continue
        names = [[f"{sensor}_{axis}" for axis in "xyz"] for sensor in (one, other)]
        single = [[pair] for pair in itertools.product(*names)]
        for pairs in (*single, list(zip(*names, strict=True))):
            yield Change("exchange", rows.exchanged(pairs), OWN, column_words.exchanged(pairs, origin))
    for sensor in missed:
        swapped = bytes_swapped(rows.readings[sensor])
        if swapped is not None:
            other_order = rows.with_readings(**{sensor: swapped})
            yield Change("bytes", other_order, OWN, column_words.swapped_bytes(sensor), sensor)
    if "acc" in missed and any(part["ref_p"] is not None for part in parts):
        still = samples(({**part, "ref_p": None} for part in parts), facts)
        for unit, factor in LENGTHS.items():
            yield Change(
                "position", rows.with_position(still, factor), OWN, column_words.positions(unit, origin), "ref"
            )


def _metadata(rows: Samples, facts: _imufit.Facts, metadata: Metadata) -> Iterator[Change]:
    """Gravity and field from the readings, where the metadata do not state them."""
    up = np.array(_imufit.frame_vectors(metadata.frame)["up"])
    if "acc" in facts.sensors:
        if abs(metadata.gravity - STANDARD_GRAVITY) > EARTHLY:
            words = column_words.gravity_told(metadata.gravity, STANDARD_GRAVITY)
            yield Change("gravity", rows.with_force((STANDARD_GRAVITY - metadata.gravity) * up), OWN, words, "acc")
        yield Change("removed", rows.with_force(-metadata.gravity * up), OWN, column_words.GRAVITY_REMOVED, "acc")
    if "mag" in facts.sensors and not facts.field_estimated and metadata.mag_reference is not None:
        field = rows.own_field()
        if POSSIBLE[0] <= np.linalg.norm(field) <= POSSIBLE[1]:
            ideal = np.where(np.isfinite(rows.ideal["mag"]), field @ rows.attitude, np.nan)
            words = column_words.field_told(metadata.mag_reference, field)
            yield Change(
                "field", Samples(rows.readings, {**rows.ideal, "mag": ideal}, rows.attitude), OWN, words, "mag"
            )


def _false_field(rows: Samples, facts: _imufit.Facts, metadata: Metadata) -> bool:
    """Whether the stated field has an impossible size, while the readings have a possible one."""
    told = metadata.mag_reference
    if told is None or "mag" not in facts.sensors:
        return False
    told_size, read = float(np.linalg.norm(told)), float(np.linalg.norm(rows.own_field()))
    return not POSSIBLE[0] <= told_size <= POSSIBLE[1] and POSSIBLE[0] <= read <= POSSIBLE[1]


def _without_gravity(rows: Samples, facts: _imufit.Facts, metadata: Metadata) -> list[DataFault]:
    """Name an accelerometer that shows nothing of gravity along the vertical of the reference."""
    if "acc" not in facts.sensors:
        return []
    readings = rows.readings["acc"]
    known = np.isfinite(readings).all(axis=1) & np.isfinite(rows.ideal["acc"]).all(axis=1)
    if np.count_nonzero(known) < MIN_ROWS:
        return []
    up = np.array(_imufit.frame_vectors(metadata.frame)["up"]) @ rows.attitude[known]
    along = float(np.mean(np.sum(readings[known] * up, axis=1)))
    length = float(np.median(np.linalg.norm(readings[known], axis=1)))
    if abs(along) > NO_GRAVITY * metadata.gravity or length > SHORT * metadata.gravity:
        return []
    words = column_words.GRAVITY_REMOVED
    return [DataFault("removed", "acc", None, facts.t_start, facts.t_end, facts.n, *words, spoils=True)]


def _field_of_another_size(rows: Samples, facts: _imufit.Facts, origin: Origin) -> list[DataFault]:
    """Name a magnetometer that turns in a field of impossible size, where the field is not stated."""
    if "mag" not in facts.sensors or not facts.field_estimated or _view("mag", rows) is None:
        return []
    size = float(np.linalg.norm(rows.own_field()))
    units = units_of_field(size)
    if not units:
        return []
    words = column_words.field_in_another_unit(size, _named(units), origin)
    return [DataFault("units", "mag", None, facts.t_start, facts.t_end, facts.n, *words, spoils=True)]


def _named(units: Sequence[WrongUnit]) -> list[column_words.Unit]:
    return [(unit.words, unit.unit) for unit in units]


def _explains(sensor: str, match: Match, declared: float) -> bool:
    if declared <= MISSED and match.usual and not match.turned:
        return match.share <= MISSED
    if match.column is not None and not match.usual:
        # Two units at once, one of them on a single axis: any factor would come about so.
        return False
    known = (
        match.usual or bool(wrong_units(sensor, match.ratio, match.share)) or not 1.0 / UNHEARD < match.ratio < UNHEARD
    )
    return known and explains(match.share, declared)


def _view(sensor: str, rows: Samples) -> tuple[Array, Array] | None:
    """Return readings and ideal readings of the rows that have both; None where they say nothing."""
    y, x = rows.readings[sensor], rows.ideal[sensor]
    known = np.isfinite(y).all(axis=1) & np.isfinite(x).all(axis=1)
    if np.count_nonzero(known) < MIN_ROWS:
        return None
    y, x = y[known], x[known]
    field = float(np.sqrt(np.mean(np.sum(x * x, axis=1))))
    if sensor == "mag":
        y, x = y - y.mean(axis=0), x - x.mean(axis=0)
    # A few blows must not decide.
    size = np.linalg.norm(y, axis=1)
    usual = size <= np.quantile(size, 0.995)
    y, x = y[usual], x[usual]
    least = EXCITED_FIELD * field if sensor == "mag" else EXCITED[sensor]
    excited = float(np.sqrt(np.mean(np.sum(x * x, axis=1)))) > least and bool(np.any(y))
    return (y, x) if excited else None


def _match(sensor: str, rows: Samples, matrices: Array, field_estimated: bool) -> Match:
    """Return how well a sensor fits with that of some permutations of its axes which leaves least, and any factor."""
    if sensor == "mag" and field_estimated:
        # Axes that are corrected give another field.
        fits = [_fits(_view(sensor, rows.with_own_field(matrix)), OWN) for matrix in matrices]
        share, ratio = np.concatenate(fits, axis=1)
    else:
        share, ratio = _fits(_view(sensor, rows), matrices)
    # Axes that do not move may have any sign: what changes least stands first.
    alike = share <= share.min() + TIE
    k = int(np.argmax(alike))
    opposite = len(PERMUTATIONS) - 1
    if sensor == "acc" and k and len(share) > opposite and alike[opposite]:
        # Gravity instead of specific force.
        k = opposite
    return Match(float(share[k]), matrices[k], float(ratio[k]))


def _fits(view: tuple[Array, Array] | None, matrices: Array) -> Array:
    """Share left and ratio, (2, k), of the readings y to each of the (k, 3, 3) matrices times x."""
    if view is None:
        return np.ones((2, len(matrices)))
    y, x = view
    total = float(np.sum(y * y))
    power = np.maximum(np.einsum("kij,jl,kil->k", matrices, x.T @ x, matrices), 1e-300)
    inner = np.einsum("kij,ij->k", matrices, y.T @ x)
    return np.stack([1.0 - np.maximum(inner, 0.0) ** 2 / np.maximum(power * total, 1e-300), inner / power])


def _words(reading: Reading, good: Sequence[str], origin: Origin) -> fault_words.Words | None:
    """Say what a reading means that fits as well as another one."""
    if reading.change.words is not None:
        return reading.change.words
    for sensor in good:
        match = reading.matches[sensor]
        units = _named(wrong_units(sensor, match.ratio, match.share))
        if not (match.usual or match.turned) and units:
            return column_words.wrong_unit(sensor, "xyz", match.ratio, units, origin)
    return None


def _worded(
    best: Reading,
    good: Sequence[str],
    alike: Sequence[Reading],
    declared: Mapping[str, float],
    facts: _imufit.Facts,
    origin: Origin,
) -> list[DataFault]:
    found: list[DataFault] = []

    def add(kind: str, sensor: str | None, words: fault_words.Words) -> None:
        found.append(DataFault(kind, sensor, None, facts.t_start, facts.t_end, facts.n, *words, spoils=True))

    change = best.change
    left = {s: fault_words.falls(s, declared[s], best.matches[s].share) for s in good}
    if change.words is not None:
        others = (_words(r, good, origin) for r in alike if r.change.kind != change.kind)
        other = next((words for words in others if words), None)
        sensor = None if change.kind in ("mount", "exchange", "clock") else change.sensor or "ref"
        add(SHOWN.get(change.kind, change.kind), sensor, fault_words.changed(change.words, list(left.values()), other))
    frame = next((r.change.words[1] for r in alike if r.change.words and r.change.kind == "frame"), None)
    for sensor in good:
        match = best.matches[sensor]
        if match.column is not None:
            factor = match.ratio * match.matrix[match.column, match.column]
            words = column_words.wrong_unit(
                sensor, "xyz"[match.column], factor, _named(wrong_units(sensor, factor, match.share)), origin
            )
            found.append(
                DataFault(
                    "units",
                    sensor,
                    f"{sensor}_{'xyz'[match.column]}",
                    facts.t_start,
                    facts.t_end,
                    facts.n,
                    *words,
                    spoils=True,
                )
            )
        elif change.words is None and match.turned:
            kind = "frame" if sensor == "acc" and np.array_equal(match.matrix, -np.eye(3)) else "axes"
            add(kind, sensor, fault_words.axes(sensor, match.matrix, left[sensor], frame, origin))
        if not match.usual:
            units = _named(wrong_units(sensor, match.ratio, match.share))
            add("units", sensor, column_words.wrong_unit(sensor, "xyz", match.ratio, units, origin))
    return found
