"""Evidence of a log without a reference attitude: rests, turns between them, the length of the magnetic field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.fitting.labelled_rests import all_sides, labelled, placement
from imufit.rests import SIDES, UP, Pose, check_unit, distinct, find_poses, find_turns

if TYPE_CHECKING:
    from imufit.log import Log

Array = NDArray[np.float64]

STRETCH = 1.0
"""Rests are cut into stretches of at least this time, s, so that what changes within them shows."""
MOST_STRETCHES = 2000
BLOCKS = 20
"""Groups of rests that are left out in turn."""
FEWEST_RESTS = 8
"""Fewer rests leave no blocks to judge by, unless labels state the side of each of six."""
PARTS = 4
"""Blocks that each of fewer labelled rests is cut into. Six rests make 24 blocks, two for each held-out fold.

The first part of every rest comes first, then the second: either half of the blocks sees all sides, and so does what
is left when a fold and the blocks beside it are out."""
LEAST_SPREAD = np.radians(10.0)
"""A field whose direction in the body varies by less than this (rad, root mean square) shows nothing of the sensor."""
MOST_FIELD_ROWS = 4000
FEWEST_FIELD_ROWS = 200
FEWEST_DIFFERENCES = 6
"""Fewer stretches that follow each other do not show how much they differ."""
FIELD_BLOCKS = 20
CLEAR = 8.0
"""Specific forces of different poses are distinct from this many times their noise on."""
EDGES = 60
APART: Final = 0.1
"""Part of gravity by which two levels of an axis differ; a sensor that is laid up by hand lies within five degrees."""
_POSE = _imufit.rest_channels().index("acc_pose")


@dataclass(frozen=True, eq=False)
class RestReadings:
    """Evidence of a log without a reference.

    Attributes
    ----------
    arrays : dict
        As `_imufit.Evidence.add_rests` takes it.
    blocks : int
        Blocks of time: groups of rests, or equal parts of the log where only the field counts.
    spans : (blocks, 2) array
        Times at which each block begins and ends, s.
    held : (rests, 2) array
        Times at which each rest begins and ends, s.
    rests, attitudes, turns, labels : int
        How many were found; attitudes differ by more than 8 degrees, labels are those that stand in for a reference.
    levels : int
        Different parts of gravity at which one axis was held, at most.
    placement : float
        How far a labelled side is off the vertical, rad; NaN without labels.
    sensors : tuple of str
        Sensors with evidence.
    field : float or None
        Mean length of the magnetic field, uT.
    expected : list of float
        Variance of a row of each of the nine channels that the noise within each rest gives.
    samples : list of ndarray
        Values of every covariate, between which bins are cut.
    means : list of float
        Mean temperature and mean of each covariate over what is judged; NaN where unknown.
    lacking : str
        The rests that acc and gyr need to be judged, where there are too few; empty elsewhere.
    notes : tuple of str
        Readings that could not be used, each with the reason; the lacking rests come first.
    """

    arrays: dict[str, Any]
    blocks: int
    spans: Array
    held: Array
    rests: int
    attitudes: int
    levels: int
    turns: int
    labels: int
    placement: float
    sensors: tuple[str, ...]
    field: float | None
    expected: list[float]
    samples: list[Array]
    means: list[float]
    lacking: str
    notes: tuple[str, ...]


def read_rests(log: Log, covariates: Sequence[str]) -> RestReadings:
    """Find the rests of a log, and take means over them.

    Parameters
    ----------
    log : Log
        Without reference attitude.
    covariates : sequence of str
        Names of its columns that can act on sensors.
    """
    notes: list[str] = []
    poses, gyr_noise, lacking = _poses(log)
    field_rows = _field_rows(log, notes)
    parts = PARTS if len(poses) < FEWEST_RESTS else 1
    blocks = min(BLOCKS, len(poses)) * parts if poses else FIELD_BLOCKS
    of_pose = np.arange(len(poses)) * (blocks // parts) // max(len(poses), 1)
    edges = _edges(log, poses, of_pose, blocks, field_rows)
    spans = np.column_stack([edges[:-1], edges[1:]]) if parts == 1 or not poses else _parts(poses, parts)
    # A fold holds few whole rests that follow each other if these belong to one part after the other.
    of_whole = of_pose + len(poses) * (np.arange(len(poses)) % parts)
    table = _Table(log, covariates)
    rest, part, pieces = _stretches(log, poses, parts)
    stills = table.means(pieces)
    poses, gyr_noise = _as_they_scatter(poses, gyr_noise, rest, pieces, stills)
    expected = _expected(poses, pieces)
    upright = [k for k, pose in enumerate(poses) if pose.label] if all_sides(poses) else []
    off = np.nan
    if upright:
        off = placement([poses[k] for k in upright], float(log.metadata.gravity))
        expected[_POSE] = off**2 + expected[0] / float(log.metadata.gravity) ** 2
    turns: list[tuple[int, int, int, int, float, int]] = []
    path = np.zeros(0, dtype=np.intp)
    # A few turns do not show the noise of turns, and would bias the accelerometer's parameters.
    if len(poses) >= FEWEST_RESTS and log.gyr is not None:
        turns, path = _turns(log, poses, gyr_noise, of_whole, notes)
    known = (bool(poses), bool(poses) and bool(np.isfinite(stills["gyr"]).any()), field_rows.size > 0)
    sensors = [sensor for sensor, told in zip(("acc", "gyr", "mag"), known, strict=True) if told]
    field = None
    if log.mag is not None and field_rows.size:
        field = float(np.mean(np.linalg.norm(log.mag[field_rows], axis=1)))
    arrays = {
        "stills": stills,
        "poses": table.means([_pose_rows(pose) for pose in poses]),
        "path": table.rows(path, filled=True),
        "field": table.rows(field_rows),
        "rest": rest.tolist(),
        "block": (of_pose[rest] + part * len(poses)).tolist(),
        "labelled": [(k, UP[str(poses[k].label)].tolist(), int(of_whole[k])) for k in upright],
        "turns": turns,
        "field_block": np.clip(np.searchsorted(edges, log.t[field_rows], side="right") - 1, 0, blocks - 1).tolist(),
    }
    return RestReadings(
        arrays=arrays,
        blocks=blocks,
        spans=spans,
        held=np.array([(pose.t_start, pose.t_end) for pose in poses]).reshape(-1, 2),
        rests=len(poses),
        levels=_levels(poses),
        attitudes=distinct(np.array([pose.direction for pose in poses])) if poses else 0,
        turns=len(turns),
        labels=len(upright),
        placement=off,
        sensors=tuple(sensors),
        field=field,
        expected=expected.tolist(),
        samples=_samples(stills, arrays["field"], poses, float(expected[0]), len(covariates)),
        means=_means(stills, arrays["field"]),
        lacking=lacking,
        notes=(lacking, *notes) if lacking else tuple(notes),
    )


def _levels(poses: Sequence[Pose]) -> int:
    """Count the parts of gravity at which one axis was held; the axis that was held at most."""
    directions = np.sort(np.array([pose.direction for pose in poses]).reshape(-1, 3), axis=0)
    return int(np.max(1 + np.count_nonzero(np.diff(directions, axis=0) > APART, axis=0))) if len(poses) else 0


def _means(stills: dict[str, Any], field: dict[str, Any]) -> list[float]:
    """Means over the stretches of all rests, or over the rows of the field where there are none.

    A column that never changes there must not differ from its mean, whatever it does elsewhere.
    """
    judged = stills if len(stills["t"]) else field
    columns = [judged["temp"], *judged["covariates"]]
    return [float(np.nanmean(c)) if c is not None and np.isfinite(c).any() else np.nan for c in columns]


class _Table:
    """Columns of a log as the compiled core takes them: rows of it, or means over rows."""

    def __init__(self, log: Log, covariates: Sequence[str]) -> None:
        self._log = log
        self._acc, self._gyr, self._mag = (
            np.full((log.n, 3), np.nan) if column is None else np.asarray(column, dtype=np.float64)
            for column in (log.acc, log.gyr, log.mag)
        )
        self._temp = None if log.temp is None else _held(log.temp)
        self._covariates = [_held(log.covariates[name]) for name in covariates]

    def rows(self, rows: NDArray[np.intp], *, filled: bool = False) -> dict[str, Any]:
        """Return some rows; `filled`: a specific force that was read less often than the rate is drawn in between."""
        acc = self._acc[rows]
        if filled and rows.size:
            acc = np.column_stack([_between(self._log.t, self._acc[:, axis], self._log.t[rows]) for axis in range(3)])
        return self._chunk(
            self._log.t[rows], acc, self._gyr[rows], self._mag[rows],
            None if self._temp is None else self._temp[rows], [column[rows] for column in self._covariates],
        )  # fmt: skip

    def means(self, pieces: Sequence[NDArray[np.intp]]) -> dict[str, Any]:
        """Return means over pieces."""

        def mean(column: Array) -> Array:
            known = [column[rows] for rows in pieces]
            empty = np.full(column.shape[1:], np.nan)
            means = [np.nanmean(v, axis=0) if np.isfinite(v).any() else empty for v in known]
            return np.array(means, dtype=np.float64).reshape(len(pieces), *column.shape[1:])

        return self._chunk(
            mean(self._log.t), mean(self._acc), mean(self._gyr), mean(self._mag),
            None if self._temp is None else mean(self._temp), [mean(column) for column in self._covariates],
        )  # fmt: skip

    @staticmethod
    def _chunk(t: Array, acc: Array, gyr: Array, mag: Array, temp: Array | None, own: list[Array]) -> dict[str, Any]:
        arrays = {"t": t, "acc": acc, "gyr": gyr, "mag": mag, "temp": temp}
        return {
            **{name: None if a is None else np.ascontiguousarray(a, dtype=np.float64) for name, a in arrays.items()},
            "ref_q": None,
            "ref_p": None,
            "ref_exact": None,
            "covariates": [np.ascontiguousarray(column, dtype=np.float64) for column in own],
            "offset": 0,
            "begin": 0,
            "end": len(t),
        }


def _held(column: Array) -> Array:
    """Carry the last known value on, and the first one back."""
    column = np.asarray(column, dtype=np.float64)
    known = np.flatnonzero(np.isfinite(column))
    if known.size == 0:
        return column
    last = np.searchsorted(known, np.arange(column.size), side="right") - 1
    return np.asarray(column[known[np.maximum(last, 0)]])


def _between(t: Array, column: Array, at: Array) -> Array:
    known = np.isfinite(column)
    return np.interp(at, t[known], column[known]) if known.any() else np.full(at.size, np.nan)


def _pose_rows(pose: Pose) -> NDArray[np.intp]:
    rows = np.arange(pose.rows[0], pose.rows[1] + 1)
    for first, last in pose.knocks:
        rows = rows[(rows < first) | (rows > last)]
    return rows


def _poses(log: Log) -> tuple[list[Pose], float, str]:
    """Return the usable rests, none if they are too few, the gyroscope's noise at rest, rad/s, and what is lacking."""
    poses: list[Pose] = []
    noise = np.nan
    if log.acc is not None and np.isfinite(log.acc).any():
        found = find_poses(log, labelled_only=False)
        poses, noise = [pose for pose in found.poses if pose.used], found.gyr_noise
        if poses:
            check_unit(poses, log)
    poses = labelled(log, poses)
    if len(poses) >= FEWEST_RESTS or all_sides(poses):
        return poses, noise, ""
    sensors = " and ".join(name for name in ("acc", "gyr") if getattr(log, name) is not None)
    if not sensors:
        return [], noise, ""
    lacking = (
        f"{len(poses)} {'rest is' if len(poses) == 1 else 'rests are'} too few to judge {sensors} by without a "
        f"reference: lay the sensor down in at least {FEWEST_RESTS}, better {BLOCKS}, different attitudes for two "
        f"seconds each, or on all six sides and label these ({' '.join(SIDES)} in the column pose)."
    )
    return [], noise, lacking


def _as_they_scatter(
    poses: Sequence[Pose],
    gyr_noise: float,
    rest: NDArray[np.intp],
    pieces: Sequence[NDArray[np.intp]],
    stills: dict[str, Any],
) -> tuple[list[Pose], float]:
    """Return rests and the gyroscope's noise, rad/s, no quieter than successive stretches of one rest differ.

    Noise that is coloured does not average out as fast as the readings' own scatter implies.
    """
    if not poses:
        return [], gyr_noise
    same = np.flatnonzero(rest[1:] == rest[:-1])
    usual = float(np.median([rows.size for rows in pieces]))

    def of_stretch(means: Array) -> float:
        differences = means[same + 1] - means[same]
        known = differences[np.isfinite(differences).all(axis=1)]
        return float(np.mean(known**2) / 2.0) if len(known) >= FEWEST_DIFFERENCES else 0.0

    acc, gyr = of_stretch(stills["acc"]), of_stretch(stills["gyr"])
    return [
        replace(
            pose,
            variance=np.maximum(pose.variance, acc * usual / pose.n),
            rate_variance=pose.rate_variance
            if pose.rate_variance is None
            else np.maximum(pose.rate_variance, gyr * usual / pose.n),
        )
        for pose in poses
    ], float(np.sqrt(np.fmax(gyr_noise**2, gyr * usual)))


def _expected(poses: Sequence[Pose], pieces: Sequence[NDArray[np.intp]]) -> NDArray[np.float64]:
    """Return the variance of a row of each channel that the scatter of readings within each rest gives, (9,)."""
    expected = np.full(9, np.nan)
    if not poses:
        return expected
    usual = np.median([rows.size for rows in pieces])
    # The variance of a pose's mean holds for a mean over fewer readings in proportion.
    shorter = np.array([pose.n / usual for pose in poses])
    expected[0] = np.median(np.mean([pose.variance for pose in poses], axis=1) * shorter)
    rates = [p.rate_variance * s for p, s in zip(poses, shorter, strict=True) if p.rate_variance is not None]
    if rates:
        expected[3:6] = np.median(rates, axis=0)
        expected[1] = 1.0
    return expected


def _stretches(
    log: Log, poses: Sequence[Pose], blocks: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], list[NDArray[np.intp]]]:
    """Return the number of its rest, of its block within the rest, and the rows of each stretch.

    All are about as long; a short rest is one stretch, or one for each of its blocks.
    """
    total = sum(pose.t_end - pose.t_start for pose in poses)
    length = max(STRETCH, total / MOST_STRETCHES)
    rest: list[int] = []
    block: list[int] = []
    pieces: list[NDArray[np.intp]] = []
    for k, pose in enumerate(poses):
        rows = _pose_rows(pose)
        parts = blocks * max(1, int((pose.t_end - pose.t_start) / (length * blocks)))
        time = log.t[rows] - pose.t_start
        number = np.minimum((time / (pose.t_end - pose.t_start) * parts).astype(np.intp), parts - 1)
        for part in range(parts):
            chosen = rows[number == part]
            if chosen.size:
                rest.append(k)
                block.append(part * blocks // parts)
                pieces.append(chosen)
    return np.array(rest, dtype=np.intp), np.array(block, dtype=np.intp), pieces


def _turns(
    log: Log, poses: Sequence[Pose], noise: float, of_pose: NDArray[np.intp], notes: list[str]
) -> tuple[list[tuple[int, int, int, int, float, int]], NDArray[np.intp]]:
    """Return turns between neighbouring rests as the compiled core takes them, and the rows of all."""
    assert log.gyr is not None
    found = find_turns(log, poses, noise, float(log.metadata.gravity))
    notes.extend(found.left_out)
    turns: list[tuple[int, int, int, int, float, int]] = []
    path: list[NDArray[np.intp]] = []
    at = 0
    for k, span in enumerate(found.spans):
        if span is None:
            continue
        first, last, *_, variance = span
        rows = np.arange(first, last + 1)
        rows = rows[np.isfinite(log.gyr[rows]).all(axis=1)]
        if rows.size < 3:
            continue
        turns.append((at, at + rows.size, k, k + 1, float(1.0 / np.sqrt(variance)), int(of_pose[k])))
        path.append(rows)
        at += rows.size
    return turns, np.concatenate(path) if path else np.zeros(0, dtype=np.intp)


def _field_rows(log: Log, notes: list[str]) -> NDArray[np.intp]:
    """Return rows with a magnetic field, evenly spread over the log; none if they are not informative."""
    nothing = np.zeros(0, dtype=np.intp)
    if log.mag is None:
        return nothing
    rows = np.flatnonzero(np.isfinite(log.mag).all(axis=1) & (np.linalg.norm(log.mag, axis=1) > 0.0))
    rows = rows[:: max(1, -(-rows.size // MOST_FIELD_ROWS))]
    if rows.size < FEWEST_FIELD_ROWS:
        return nothing
    spread = _spread(log.mag[rows])
    if spread < LEAST_SPREAD:
        notes.append(
            f"The magnetometer was hardly turned: the field's direction in the body varies by {np.degrees(spread):.0f} "
            f"deg, {np.degrees(LEAST_SPREAD):.0f} are needed for its length to be informative."
        )
        return nothing
    return np.asarray(rows)


def _spread(readings: Array) -> float:
    """Return the root mean square angle (rad) between readings and their mean direction."""
    units = readings / np.linalg.norm(readings, axis=1, keepdims=True)
    mean = units.mean(axis=0)
    cosine = np.clip(units @ mean / max(float(np.linalg.norm(mean)), 1e-12), -1.0, 1.0)
    return float(np.sqrt(np.mean(np.arccos(cosine) ** 2)))


def _edges(
    log: Log, poses: Sequence[Pose], of_pose: NDArray[np.intp], blocks: int, field_rows: NDArray[np.intp]
) -> Array:
    """Return times at which blocks begin: between rests, or such that each has as many rows of the field."""
    first, last_time = float(log.t[0]), float(log.t[-1])
    if blocks <= len(poses):
        last = [k for k in range(len(poses) - 1) if of_pose[k] != of_pose[k + 1]]
        inner = [0.5 * (poses[k].t_end + poses[k + 1].t_start) for k in last]
    elif field_rows.size:
        inner = log.t[field_rows[np.arange(1, blocks) * field_rows.size // blocks]].tolist()
    else:
        inner = np.linspace(first, last_time, blocks + 1)[1:-1].tolist()
    return np.array([first, *inner, last_time])


def _parts(poses: Sequence[Pose], parts: int) -> Array:
    """Return when each part of each rest begins and ends, (parts * rests, 2), s: the first part of all rests first."""
    begin, end = (np.array([getattr(pose, name) for pose in poses]) for name in ("t_start", "t_end"))
    shares = np.arange(parts + 1)[:, None] / parts
    times = begin + shares * (end - begin)
    return np.column_stack([times[:-1].ravel(), times[1:].ravel()])


def _samples(
    stills: dict[str, Any], field: dict[str, Any], poses: Sequence[Pose], variance: float, covariates: int
) -> list[Array]:
    """Values between which bins are cut; specific forces only between poses, never within the noise of one."""
    nothing = np.zeros(0)
    force = []
    for axis in range(3):
        values = np.sort([pose.mean[axis] for pose in poses])
        gaps = np.flatnonzero(np.diff(values) > CLEAR * np.sqrt(variance)) if values.size else nothing.astype(np.intp)
        middles = 0.5 * (values[gaps] + values[gaps + 1]) if gaps.size else nothing
        # The lowest value comes first: an edge lies above it.
        force.append(np.concatenate([values[:1], np.repeat(middles, -(-EDGES // max(middles.size, 1)))]))

    def both(name: str) -> Array:
        columns = [table[name] for table in (stills, field) if table[name] is not None]
        values = np.concatenate(columns) if columns else nothing
        return np.asarray(values[np.isfinite(values)])

    own = [np.concatenate([stills["covariates"][k], field["covariates"][k]]) for k in range(covariates)]
    finite = [np.asarray(values[np.isfinite(values)]) for values in own]
    return [both("t"), both("temp"), *force, nothing, nothing, nothing, nothing, *finite]
