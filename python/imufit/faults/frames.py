"""Wrong units, turned or exchanged axes, a reference in another frame: what concerns every row of a log.

Readings are held against ideal ones in rows from all over the log. Only where an ideal sensor misses most of a reading
is the table of changes gone through: each sensor with its axes permuted and signed (48 ways); all sensors turned alike
(a mount); the reference conjugated, with its scalar last, or in another frame; each with any factor. One comparison
serves all of them, and the change is named that takes away nearly all of what the log as declared leaves, with the
fewest changes beside it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.faults.samples import SENSORS, Samples, samples
from imufit.faults.units import DEG, TOLERANCE, USUAL, wrong_unit
from imufit.log.metadata import Metadata
from imufit.results import fault_words
from imufit.results.data_fault import DataFault

Array = NDArray[np.float64]
Part = Mapping[str, Any]

MISSED: Final = 0.2
"""Share of a reading's sum of squares that an ideal sensor must leave before anything else is tried."""
LEFT: Final = 0.1
"""Share of a reading's sum of squares that another way of reading the log may leave at most."""
QUARTER: Final = 0.25
"""The same, as a share of what the log as declared leaves."""
TIE: Final = 0.01
MIN_ROWS: Final = 200
EXCITED: Final = {"acc": 1.0, "gyr": 0.05, "mag": 3.0}
"""RMS of the ideal readings, m/s^2, rad/s and uT, from which on they say something."""

KINDS: Final = ("clock", "reference", "axes", "frame", "mount")
"""What is named first where the log cannot tell."""
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
        (k, 3, 3) signed permutations from the ideal reading to the reading that are open to a sensor.
    words : tuple of str
        What it means, and what is to be done about it; of single sensors they depend on how these fit.
    """

    kind: str
    rows: Samples
    matrices: Array
    words: fault_words.Words | None = None


@dataclass(frozen=True, eq=False)
class Match:
    """How well one sensor fits one way of reading the log.

    Attributes
    ----------
    share : float
        Sum of squares left, over that of the readings.
    matrix : ndarray
        (3, 3) signed permutation from the ideal reading to the reading.
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
            matches[sensor] = _match(sensor, change.rows, OWN if single else change.matrices, field_estimated)
        good = tuple(sensor for sensor, match in matches.items() if _explains(sensor, match, declared[sensor]))
        turned = sum(match.turned for match in matches.values()) if change.kind == "axes" else 1
        return cls(change, matches, good, turned + sum(not match.usual for match in matches.values()))

    def left(self, sensors: Sequence[str]) -> float:
        """Sum of the shares that some sensors leave."""
        return float(sum(self.matches[s].share for s in sensors))


def frame_faults(parts: Sequence[Part], facts: _imufit.Facts, metadata: Metadata) -> list[DataFault]:
    """Name wrong units, turned axes and wrong frames.

    Parameters
    ----------
    parts : sequence of dict
        Windows of the log, see `imufit.faults.samples.windows`.
    facts : Facts
        Of the log as declared.
    metadata : Metadata
        Of the log.

    Returns
    -------
    list of DataFault
        None where the log as declared fits, or where nothing that was tried fits.
    """
    if not parts:
        return []
    rows = samples(parts, facts)
    declared = declared_shares(rows, facts.sensors)
    missed = [sensor for sensor, share in declared.items() if share > MISSED]
    if not missed:
        return []
    changes = _changes(parts, rows, facts, metadata, declared)
    readings = [Reading.of(change, declared, field_estimated=facts.field_estimated) for change in changes]
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
    return _worded(best, [s for s in best.good if s in missed], alike, declared, facts, metadata)


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
    parts: Sequence[Part], rows: Samples, facts: _imufit.Facts, metadata: Metadata, declared: Mapping[str, float]
) -> Iterator[Change]:
    """Go through the table of changes that are tried."""
    sensors = list(declared)
    yield Change("axes", rows, PERMUTATIONS)
    for matrix in PERMUTATIONS[1:] if len(sensors) > 1 else ():
        if np.linalg.det(matrix) > 0.0:
            words = fault_words.mount([s for s in SENSORS if s in facts.sensors], matrix, sensors[0])
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
        yield Change("reference", samples(other, facts), OWN, fault_words.quaternion(places, signs))
    resting = samples(({**part, "ref_p": None} for part in parts), facts) if "acc" in facts.sensors else rows
    for factor in CLOCKS:
        yield Change("clock", rows.on_clock(factor, resting), OWN, fault_words.clock(factor))


def _explains(sensor: str, match: Match, declared: float) -> bool:
    if declared <= MISSED and match.usual and not match.turned:
        return match.share <= MISSED
    known = match.usual or wrong_unit(sensor, match.ratio) is not None
    return known and explains(match.share, declared)


def _view(sensor: str, rows: Samples) -> tuple[Array, Array] | None:
    """Return readings and ideal readings of the rows that have both; None where they say nothing."""
    y, x = rows.readings[sensor], rows.ideal[sensor]
    known = np.isfinite(y).all(axis=1) & np.isfinite(x).all(axis=1)
    if np.count_nonzero(known) < MIN_ROWS:
        return None
    y, x = y[known], x[known]
    if sensor == "mag":
        y, x = y - y.mean(axis=0), x - x.mean(axis=0)
    # A few blows must not decide.
    size = np.linalg.norm(y, axis=1)
    usual = size <= np.quantile(size, 0.995)
    y, x = y[usual], x[usual]
    excited = float(np.sqrt(np.mean(np.sum(x * x, axis=1)))) > EXCITED[sensor] and bool(np.any(y))
    return (y, x) if excited else None


def _match(sensor: str, rows: Samples, matrices: Array, field_estimated: bool) -> Match:
    """Return how well a sensor fits with that of some permutations of its axes which leaves least, and any factor."""
    if sensor == "mag" and field_estimated:
        # Axes that are put right give another field.
        fits = [_fits(_view(sensor, rows.with_own_field(matrix)), OWN) for matrix in matrices]
        share, ratio = np.concatenate(fits, axis=1)
    else:
        share, ratio = _fits(_view(sensor, rows), matrices)
    # Axes that do not move may have any sign: what changes least stands first.
    alike = share <= share.min() + TIE
    k = int(np.argmax(alike))
    if sensor == "acc" and k and alike[-1]:
        # Gravity instead of specific force.
        k = len(share) - 1
    return Match(float(share[k]), matrices[k], float(ratio[k]))


def _fits(view: tuple[Array, Array] | None, matrices: Array) -> Array:
    """Share left and ratio, (2, k), of the readings y to each of the (k, 3, 3) matrices times x."""
    if view is None:
        return np.ones((2, len(matrices)))
    y, x = view
    power, total = float(np.sum(x * x)), float(np.sum(y * y))
    inner = np.einsum("kij,ij->k", matrices, y.T @ x)
    return np.stack([1.0 - np.maximum(inner, 0.0) ** 2 / max(power * total, 1e-300), inner / max(power, 1e-300)])


def _words(reading: Reading, good: Sequence[str]) -> fault_words.Words | None:
    """Say what a reading means that fits as well as another one."""
    if reading.change.words is not None:
        return reading.change.words
    for sensor in good:
        match = reading.matches[sensor]
        unit = wrong_unit(sensor, match.ratio)
        if not (match.usual or match.turned) and unit is not None:
            return fault_words.wrong_unit(sensor, match.ratio, unit.words, unit.unit, unit.factor)
    return None


def _worded(
    best: Reading,
    good: Sequence[str],
    alike: Sequence[Reading],
    declared: Mapping[str, float],
    facts: _imufit.Facts,
    metadata: Metadata,
) -> list[DataFault]:
    found: list[DataFault] = []

    def add(kind: str, sensor: str | None, words: fault_words.Words) -> None:
        found.append(DataFault(kind, sensor, None, facts.t_start, facts.t_end, facts.n, *words, spoils=True))

    change = best.change
    left = {s: fault_words.falls(s, declared[s], best.matches[s].share) for s in good}
    if change.words is not None:
        others = (_words(r, good) for r in alike if r.change.kind != change.kind)
        other = next((words for words in others if words), None)
        sensor = {"mount": None, "clock": None}.get(change.kind, "ref")
        add(change.kind, sensor, fault_words.changed(change.words, list(left.values()), other))
    frame = next((r.change.words[1] for r in alike if r.change.words and r.change.kind == "frame"), "")
    for sensor in good:
        match = best.matches[sensor]
        if change.words is None and match.turned:
            kind = "frame" if sensor == "acc" and np.array_equal(match.matrix, -np.eye(3)) else "axes"
            add(kind, sensor, fault_words.axes(sensor, match.matrix, left[sensor], frame))
        if match.usual:
            continue
        unit = wrong_unit(sensor, match.ratio)
        if metadata.rig_axis is not None and sensor == "gyr" and abs(match.ratio * DEG - 1.0) < TOLERANCE:
            add("units", "ref", fault_words.angle_in_degrees(match.ratio))
        elif unit is not None:
            add("units", sensor, fault_words.wrong_unit(sensor, match.ratio, unit.words, unit.unit, unit.factor))
    return found
