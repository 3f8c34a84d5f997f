"""Wrong units, turned or exchanged axes, a reference in another frame: what concerns every row of a log.

Readings are held against ideal ones in rows from all over the log. Only where an ideal sensor misses most of a reading
are other ways to read the log tried: each sensor with its axes permuted and signed (48 ways) and any factor; all
sensors turned alike (a mount); the reference conjugated, with its scalar last, or in another frame. One of them is
named if it takes away nearly all of what the log as declared leaves, with the fewest changes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.faults import axes
from imufit.faults.samples import SENSORS, Samples, samples
from imufit.faults.units import DEG, TOLERANCE, USUAL, WrongUnit, wrong_unit
from imufit.log.contents import SENSOR_NAMES
from imufit.log.metadata import Metadata
from imufit.results.data_fault import DataFault

Array = NDArray[np.float64]
Part = Mapping[str, Any]

MISSED: Final = 0.2
"""Share of a reading's sum of squares that an ideal sensor must leave before anything else is tried."""
LEFT: Final = 0.1
"""Share that another way of reading the log may leave at most, and a quarter of what the log as declared leaves."""
TIE: Final = 0.01
MIN_ROWS: Final = 200
EXCITED: Final = {"acc": 1.0, "gyr": 0.05, "mag": 3.0}
"""RMS of the ideal readings, m/s^2, rad/s and uT, from which on they say something."""

KINDS: Final = ("reference", "axes", "frame", "mount")
"""What is named first where the log cannot tell."""
FRAMES: Final = ("NED", "ENU", "NWU")


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


@dataclass(frozen=True, eq=False)
class Reading:
    """A way of reading the log: what is changed, and how well each sensor fits then."""

    kind: str
    matches: dict[str, Match]
    words: str = ""
    remedy: str = ""
    changes: int = 0
    turned: Array = field(default_factory=lambda: np.eye(3))

    def good(self, declared: Mapping[str, float]) -> tuple[str, ...]:
        """Sensors that this way explains."""
        return tuple(s for s, m in self.matches.items() if _explains(s, m, declared[s]))

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
    as_declared = samples(parts, facts)
    views = {s: _view(s, as_declared) for s in facts.sensors}
    excited = [s for s, view in views.items() if view is not None]
    declared = {s: _declared_share(*view) for s, view in views.items() if view is not None}
    missed = [s for s in excited if declared[s] > MISSED]
    if not missed:
        return []
    ways = [_each_sensor(as_declared, facts, missed, excited), *_mounts(as_declared, facts, excited)]
    ways += _references(parts, as_declared, facts, metadata, excited)
    base = len(excited) - len(missed)
    ways = [way for way in ways if len(way.good(declared)) > base and way.changes]
    if not ways:
        return []
    most = max(len(way.good(declared)) for way in ways)
    ways = [way for way in ways if len(way.good(declared)) == most]
    ways.sort(key=lambda way: (way.changes, way.left(way.good(declared))))
    alike = [
        way
        for way in ways
        if way.changes == ways[0].changes
        and way.good(declared) == ways[0].good(declared)
        and way.left(ways[0].good(declared)) < ways[0].left(ways[0].good(declared)) + TIE
    ]
    best = min(alike, key=lambda way: KINDS.index(way.kind))
    alike.remove(best)
    good = [s for s in best.good(declared) if s in missed]
    return _worded(best, good, alike, declared, facts, metadata)


def _explains(sensor: str, match: Match, declared: float) -> bool:
    same = np.array_equal(match.matrix, np.eye(3)) and match.usual
    if same and declared <= MISSED:
        return match.share <= MISSED
    known = match.usual or wrong_unit(sensor, match.ratio) is not None
    return known and match.share <= min(LEFT, 0.25 * declared)


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


def _declared_share(y: Array, x: Array) -> float:
    return float(np.sum((y - x) ** 2) / np.sum(y * y))


def _fits(y: Array, x: Array, matrices: Array) -> tuple[Array, Array]:
    """Share left and ratio of the readings y to each of the (k, 3, 3) matrices times x."""
    moment, power, total = y.T @ x, float(np.sum(x * x)), float(np.sum(y * y))
    inner = np.einsum("kij,ij->k", matrices, moment)
    share = 1.0 - np.maximum(inner, 0.0) ** 2 / max(power * total, 1e-300)
    return share, inner / max(power, 1e-300)


def _as_it_is(y: Array, x: Array) -> Match:
    share, ratio = _fits(y, x, np.eye(3)[None])
    match = Match(float(share[0]), np.eye(3), float(ratio[0]))
    return Match(_declared_share(y, x), match.matrix, 1.0) if match.usual else match


def _fits_of(sensor: str, rows: Samples, facts: _imufit.Facts) -> tuple[Array, Array] | None:
    """Share left and ratio of one sensor for every signed permutation."""
    if sensor == "mag" and facts.field_estimated:
        return _fits_with_field(rows)
    view = _view(sensor, rows)
    return None if view is None else _fits(*view, axes.PERMUTATIONS)


def _fits_with_field(rows: Samples) -> tuple[Array, Array] | None:
    """Share left and ratio of the magnetometer, the field estimated anew for every signed permutation.

    With R the attitude and P the axes the field is the mean of R P^T y; sums of products of R and y tell the rest.
    """
    y = rows.readings["mag"]
    known = np.isfinite(y).all(axis=1)
    if np.count_nonzero(known) < MIN_ROWS:
        return None
    y, r = y[known], rows.attitude[known]
    fields = np.einsum("nkj,na,paj->pk", r, y, axes.PERMUTATIONS, optimize=True) / len(y)
    y, r = y - y.mean(axis=0), r - r.mean(axis=0)
    products = np.einsum("nkj,na->kja", r, y, optimize=True)
    inner = np.einsum("pk,kja,paj->p", fields, products, axes.PERMUTATIONS, optimize=True)
    turned = np.einsum("nkj,nlj->kl", r, r, optimize=True)
    power = np.einsum("pk,kl,pl->p", fields, turned, fields, optimize=True)
    total = max(float(np.sum(y * y)), 1e-300)
    return 1.0 - np.maximum(inner, 0.0) ** 2 / np.maximum(power * total, 1e-300), inner / np.maximum(power, 1e-300)


def _with_field(rows: Samples) -> Samples:
    """Ideal readings of the magnetometer for the field that its readings give with this reference."""
    readings = rows.readings["mag"]
    known = np.isfinite(readings).all(axis=1)
    turned = np.einsum("nij,nj->ni", rows.attitude[known], readings[known])
    mean = turned.mean(axis=0) if known.any() else np.zeros(3)
    return Samples(rows.readings, {**rows.ideal, "mag": np.einsum("nij,i->nj", rows.attitude, mean)}, rows.attitude)


def _each_sensor(rows: Samples, facts: _imufit.Facts, missed: Sequence[str], excited: Sequence[str]) -> Reading:
    """Every sensor with the axes and the factor that suit it best."""
    matches = {}
    for sensor in excited:
        fits = _fits_of(sensor, rows, facts)
        view = _view(sensor, rows)
        if view is not None and (sensor not in missed or fits is None):
            matches[sensor] = _as_it_is(*view)
        if sensor in matches or fits is None:
            continue
        share, ratio = fits
        # Axes that do not move may have any sign: what changes least stands first.
        k = int(np.argmax(share <= share.min() + TIE))
        if sensor == "acc" and k and share[-1] <= share.min() + TIE:
            k = len(share) - 1
        matches[sensor] = Match(float(share[k]), axes.PERMUTATIONS[k], float(ratio[k]))
    changes = sum((not np.array_equal(m.matrix, np.eye(3))) + (not m.usual) for m in matches.values())
    return Reading("axes", matches, changes=changes)


def _mounts(rows: Samples, facts: _imufit.Facts, excited: Sequence[str]) -> list[Reading]:
    """All sensors turned alike."""
    fits = {s: _fits_of(s, rows, facts) for s in excited}
    known = {s: f for s, f in fits.items() if f is not None}
    if len(known) < 2:
        return []
    found = []
    for k in axes.PROPER[1:]:
        matrix = axes.PERMUTATIONS[k]
        matches = {s: Match(float(share[k]), matrix, float(ratio[k])) for s, (share, ratio) in known.items()}
        units = sum(not m.usual for m in matches.values())
        remedy = ",".join(axes.mapping(s, matrix) for s in SENSORS if s in facts.sensors)
        found.append(
            Reading(
                "mount",
                matches,
                f"The axes of every sensor are turned against the body that the reference describes: "
                f"{axes.in_words(next(iter(known)), matrix)}, and so on.",
                f"Turn them back with --map '{remedy}', or multiply the reference from the right by a turn of "
                f"{axes.turn(matrix.T)}.",
                1 + units,
                matrix,
            )
        )
    found.sort(key=lambda way: way.left(list(known)))
    return found[:2]


def _references(
    parts: Sequence[Part], rows: Samples, facts: _imufit.Facts, metadata: Metadata, excited: Sequence[str]
) -> list[Reading]:
    """Read the reference in other ways: frame, inverse, order of the numbers, degrees."""
    found = [_reading("frame", changed, facts, excited, *words) for changed, *words in _other_frames(rows, metadata)]
    conjugated = "Conjugate it: --map ref_qx=-ref_qx,ref_qy=-ref_qy,ref_qz=-ref_qz"
    last = "Put the scalar first: --map ref_qw=ref_qz,ref_qx=ref_qw,ref_qy=ref_qx,ref_qz=ref_qy"
    changes: list[tuple[Callable[[Array], Array], str, str]] = [
        (
            lambda q: q * [1.0, -1.0, -1.0, -1.0],
            "The reference attitude is the inverse: it takes vectors of the reference frame into the body, or "
            "its angle counts the other way.",
            f"{conjugated}.",
        ),
        (
            lambda q: q[:, [3, 0, 1, 2]],
            "The reference attitude has its scalar last.",
            f"{last}.",
        ),
        (
            lambda q: q[:, [3, 0, 1, 2]] * [1.0, -1.0, -1.0, -1.0],
            "The reference attitude has its scalar last, and is the inverse: it takes vectors of the reference frame "
            "into the body.",
            "Put the scalar first and conjugate it: --map ref_qw=ref_qz,ref_qx=-ref_qw,ref_qy=-ref_qx,ref_qz=-ref_qy.",
        ),
    ]
    for change, words, remedy in changes:
        other = samples([{**part, "ref_q": np.ascontiguousarray(change(part["ref_q"]))} for part in parts], facts)
        found.append(_reading("reference", other, facts, excited, words, remedy))
    return found


def _reading(
    kind: str, rows: Samples, facts: _imufit.Facts, excited: Sequence[str], words: str, remedy: str
) -> Reading:
    if "mag" in facts.sensors and facts.field_estimated and kind == "reference":
        rows = _with_field(rows)
    matches = {}
    for sensor in excited:
        view = _view(sensor, rows)
        matches[sensor] = Match(1.0, np.eye(3), 1.0) if view is None else _as_it_is(*view)
    units = sum(not m.usual for m in matches.values())
    return Reading(kind, matches, words, remedy, 1 + units)


def _other_frames(rows: Samples, metadata: Metadata) -> list[tuple[Samples, str, str]]:
    """Ideal readings for a reference that is really in another frame than declared."""
    found = []
    declared = _imufit.frame_vectors(metadata.frame)
    for name in FRAMES:
        if name == metadata.frame:
            continue
        true = _imufit.frame_vectors(name)
        # f = R^T (a - g), and -g is gravity upwards.
        change = metadata.gravity * (np.array(true["up"]) - np.array(declared["up"]))
        ideal = dict(rows.ideal)
        if "acc" in ideal:
            ideal["acc"] = ideal["acc"] + np.einsum("nij,i->nj", rows.attitude, change)
        words = f"The reference is in the frame {name}, not {metadata.frame} as the log says."
        remedy = f'Declare frame = "{name}".'
        if not any(change):
            continue
        found.append((Samples(rows.readings, ideal, rows.attitude), words, remedy))
    return found


def _worded(
    best: Reading,
    good: Sequence[str],
    alike: Sequence[Reading],
    declared: Mapping[str, float],
    facts: _imufit.Facts,
    metadata: Metadata,
) -> list[DataFault]:
    found: list[DataFault] = []

    def add(kind: str, sensor: str | None, evidence: str, remedy: str) -> None:
        found.append(DataFault(kind, sensor, None, facts.t_start, facts.t_end, facts.n, evidence, remedy, spoils=True))

    left = ", ".join(_falls(s, declared[s], best.matches[s].share) for s in good)
    if best.kind in ("mount", "frame", "reference"):
        others = "".join(f" Here this looks the same: {_lower(way)}" for way in _distinct(best, alike))
        sensor = "ref" if best.kind != "mount" else None
        add(best.kind, sensor, f"{best.words} Read so, the residual falls {left}.{others}", best.remedy)
    for sensor in good:
        match = best.matches[sensor]
        if best.kind == "axes" and not np.array_equal(match.matrix, np.eye(3)):
            kind = "frame" if sensor == "acc" and np.array_equal(match.matrix, -np.eye(3)) else "axes"
            add(kind, sensor, *_axes_words(sensor, match, declared[sensor], alike))
        if not match.usual:
            unit = wrong_unit(sensor, match.ratio)
            if metadata.rig_axis is not None and sensor == "gyr" and abs(match.ratio * DEG - 1.0) < TOLERANCE:
                faster = f"The reference turns {1.0 / match.ratio:.4g} times as fast as the gyroscope"
                add(
                    "units",
                    "ref",
                    f"{faster}: ref_angle is in degrees.",
                    "Declare the unit: --map 'ref_angle=ref_angle[deg]'.",
                )
            elif unit is not None:
                add("units", sensor, *_unit_words(sensor, match, unit))
    return found


def _distinct(best: Reading, alike: Sequence[Reading]) -> list[Reading]:
    """Other ways of the same kind of change, each sentence once."""
    return [way for way in alike if way.words and way.words != best.words and way.kind != best.kind][:1]


def _lower(way: Reading) -> str:
    text = way.words[:1].lower() + way.words[1:]
    return f"{text} {way.remedy}"


def _axes_words(sensor: str, match: Match, declared: float, alike: Sequence[Reading]) -> tuple[str, str]:
    handed = "" if np.linalg.det(match.matrix) > 0.0 else " (a left-handed set of axes)"
    if np.array_equal(match.matrix, -np.eye(3)):
        what = f"{sensor} reads the opposite of what it should on every axis"
        if sensor == "acc":
            what += ": gravity instead of specific force, or a reference whose vertical axis points the other way"
    else:
        shown = axes.in_words(sensor, match.matrix)
        what = f"The axes of the {SENSOR_NAMES[sensor]} are exchanged or turned round{handed}: {shown}"
    text = f"{what}. Read so, the residual falls {_falls(sensor, declared, match.share)}."
    remedy = f"Put them right with --map '{axes.mapping(sensor, match.matrix)}'"
    other = next((way.remedy for way in alike if way.kind == "frame"), "")
    return text, f"{remedy}{', or: ' + other if other else '.'}"


def _unit_words(sensor: str, match: Match, unit: WrongUnit) -> tuple[str, str]:
    ratio = match.ratio
    size = f"{ratio:.4g} times what it should" if ratio < 1.0 else f"{ratio:.4g} times too much"
    columns = ",".join(f"{sensor}_{a}={sensor}_{a}[{unit.unit}]" for a in "xyz")
    remedy = (
        f"Declare the unit: --map '{columns}', or convert the readings."
        if unit.unit
        else f"Divide the readings of {sensor} by {unit.factor:.6g}."
    )
    return f"{sensor} reads {size} on every axis alike, which looks like {unit.words}.", remedy


def _falls(sensor: str, before: float, after: float) -> str:
    """Say how the residual falls, as a share of the reading's RMS."""
    first, last = (100.0 * float(np.sqrt(share)) for share in (before, after))
    return f"from {first:.3g} to {last:.2g} % of {sensor}"
