"""The poses of a log: where the sensor lies still, which side is up, and which poses cannot be used."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from imufit import _imufit
from imufit.errors import InputError

if TYPE_CHECKING:
    from imufit.log import Log

Array = NDArray[np.float64]

SIDES = ("+x", "-x", "+y", "-y", "+z", "-z")
UP = {side: np.eye(3)[k // 2] * (1.0 if k % 2 == 0 else -1.0) for k, side in enumerate(SIDES)}
"""Unit vector of each side in the body frame."""
HOLD = 0.6
"""Shortest pose, s."""
SAME_DIRECTION = np.radians(8.0)
"""Poses nearer to each other than this (rad) show gravity from the same side."""


@dataclass(frozen=True)
class Pose:
    """The readings of a sensor that lies still, summed up.

    Attributes
    ----------
    number : int
        From 1, in the order of the logs and of time.
    log : int
        Index of its log.
    rows : (int, int)
        First and last row in that log.
    t_start, t_end : float
        s.
    knocks : tuple of (int, int)
        Rows in between that are left out because the sensor was knocked.
    n : int
        Readings.
    mean, deviation, variance : (3,) array
        Mean specific force, m/s^2; standard deviation of single readings; variance of the mean, with the readings'
        correlation and the rounding of the digits.
    rate, rate_variance : (3,) array or None
        Mean angular rate, rad/s, and its variance.
    temperature : float
        Mean, degC; NaN without `temp`.
    side : str
        Body axis that points up by the readings.
    label : str or None
        The log's own label.
    attitude : (3, 3) array or None
        From the log's reference: body to reference frame.
    used : bool
        Whether it takes part.
    reason : str
        Why not; empty where it does.
    """

    number: int
    log: int
    rows: tuple[int, int]
    t_start: float
    t_end: float
    knocks: tuple[tuple[int, int], ...]
    n: int
    mean: Array
    deviation: Array
    variance: Array
    rate: Array | None
    rate_variance: Array | None
    temperature: float
    side: str
    label: str | None
    attitude: Array | None
    used: bool = True
    reason: str = ""

    @property
    def name(self) -> str:
        """Its label, or the side that is up by the readings."""
        return self.label or self.side

    @property
    def shown(self) -> str:
        """Its name, for an oblique pose with the angle (degrees) between that axis and the vertical."""
        return self.name if self.off_deg < 12.0 else f"{self.name} {self.off_deg:.0f}°"

    @property
    def off_deg(self) -> float:
        """Angle between the nearest axis and the vertical by the readings, degrees."""
        return float(np.degrees(np.arccos(min(1.0, float(np.max(np.abs(self.direction)))))))

    @property
    def direction(self) -> Array:
        """Unit vector of the mean reading."""
        return self.mean / float(np.linalg.norm(self.mean))

    def without(self, reason: str) -> Pose:
        """Return the same pose, left out.

        Parameters
        ----------
        reason : str
            Why.
        """
        return replace(self, used=False, reason=reason)


@dataclass(frozen=True)
class Found:
    """Poses of one log, and what its sensors' noise at rest is.

    Attributes
    ----------
    poses : tuple of Pose
        In the order of time, the unusable ones too.
    labelled : bool
        Whether the log names its poses.
    acc_noise, gyr_noise : float
        Standard deviation of one axis at rest, m/s^2 and rad/s; NaN where unknown.
    """

    poses: tuple[Pose, ...]
    labelled: bool
    acc_noise: float
    gyr_noise: float


def find_poses(
    log: Log,
    index: int = 0,
    first: int = 1,
    settings: Mapping[str, float] | None = None,
    *,
    labelled_only: bool = True,
) -> Found:
    """Find where the sensor lies still.

    Poses with a label are looked for in the labelled rows only; otherwise every rest counts. A rest is judged by the
    scatter of specific force and angular rate in windows of 0.4 s against the noise of the quietest windows. After a
    knock the same pose goes on if the sensor did not turn.

    Parameters
    ----------
    log : Log
        With `acc`.
    index : int
        The log's place among several.
    first : int
        Number of the first pose.
    settings : mapping, optional
        Criteria: ``window``, ``hold``, ``bridge`` (s), ``fewest`` (readings), ``creep`` (rad), ``acc_noise`` (m/s^2),
        ``gyr_noise`` (rad/s).
    labelled_only : bool
        Whether labels, where the log has them, limit the search.

    Raises
    ------
    InputError
        The accelerometer is missing, or a label is not a side.
    """
    if log.acc is None:
        raise InputError(
            "poses are found by the accelerometer, but acc_x acc_y acc_z are missing", file=log.path or "log"
        )
    labels = side_numbers(log)
    # With a reference attitude every rest is known, labelled or not.
    named = labels if labelled_only and log.ref_q is None else None
    rests = _imufit.find_rests(log.t, log.acc, log.gyr, named, {"hold": HOLD, **(settings or {})})
    hold = float((settings or {}).get("hold", HOLD))
    poses = [
        _pose(found, log, labels, index=index, number=first + k, hold=hold) for k, found in enumerate(rests["poses"])
    ]
    noise = [rests["acc_noise"], rests["gyr_noise"]]
    acc_noise, gyr_noise = (np.nan if value is None else value for value in noise)
    return Found(tuple(_saturated(poses, log.acc)), labels is not None, acc_noise, gyr_noise)


def side_numbers(log: Log) -> Array | None:
    """Return each row's label as the number of its side in `SIDES`, (n,), -1 without one; None if there is none.

    Parameters
    ----------
    log : Log
        With or without pose labels.

    Raises
    ------
    InputError
        A label names no side.
    """
    if log.pose is None:
        return None
    numbers = np.full(log.n, -1.0)
    for label in {cell for cell in log.pose if cell is not None and str(cell).strip()}:
        side = str(label).strip().lower()
        rows = np.flatnonzero(log.pose == label)
        if side not in SIDES:
            raise InputError(
                f"the label {label!r} is not a side",
                file=log.path or "log",
                row=int(rows[0]),
                column="pose",
                remedy=f"Use {' '.join(SIDES)}: the body axis that points up; leave it empty while the sensor moves.",
            )
        numbers[rows] = SIDES.index(side)
    return numbers if np.any(numbers >= 0.0) else None


def _pose(found: Any, log: Log, labels: Array | None, *, index: int, number: int, hold: float) -> Pose:
    first, last = found["rows"]
    label = None if found["label"] is None else SIDES[found["label"]]
    if label is None and labels is not None and labels[first] >= 0 and labels[first] == labels[last]:
        label = SIDES[int(labels[first])]
    rows = slice(first, last + 1)
    temperature = np.nan
    if log.temp is not None and not np.all(np.isnan(log.temp[rows])):
        temperature = float(np.nanmean(log.temp[rows]))
    pose = Pose(
        number=number,
        log=index,
        rows=(first, last),
        t_start=found["time"][0],
        t_end=found["time"][1],
        knocks=tuple(found["knocks"]),
        n=found["n"],
        mean=np.array(found["mean"]),
        deviation=np.array(found["deviation"]),
        variance=np.array(found["variance"]),
        rate=None if found["rate"] is None else np.array(found["rate"]),
        rate_variance=None if found["rate_variance"] is None else np.array(found["rate_variance"]),
        temperature=temperature,
        side=SIDES[found["side"]],
        label=label,
        attitude=_attitude(log, rows),
    )
    if not np.any(pose.mean):
        return pose.without("every axis reads zero: a sensor at rest reads gravity")
    if found["flaw"] is None:
        return pose
    kind, value = found["flaw"]
    return pose.without(_flaw(kind, value, hold))


def _flaw(kind: str, value: float, hold: float) -> str:
    if kind == "short":
        return f"still for {value:.1f} s, {hold:.1f} s are required: too short"
    if kind == "crept":
        return f"moved by {np.degrees(value):.1f} deg while it should have been still"
    return f"not still: the readings scatter by {value:.2g} m/s²"


def _attitude(log: Log, rows: slice) -> Array | None:
    """Mean reference attitude of the rows, a rotation matrix; None without a reference or when that turns."""
    if log.ref_q is None:
        return None
    known = log.ref_q[rows]
    known = known[~np.isnan(known[:, 0])]
    if not len(known):
        return None
    rotations = Rotation.from_quat(known[:, [1, 2, 3, 0]])
    return np.asarray(rotations.mean().as_matrix(), dtype=np.float64)


def _saturated(poses: Sequence[Pose], acc: Array) -> list[Pose]:
    """Leave out poses in which an axis stands at the end of its range.

    The end shows as the log's largest reading, taken again and again, without the noise that other poses have there.
    """
    if not poses:
        return []
    ends = (np.nanmax(acc, axis=0), np.nanmin(acc, axis=0))
    usual = np.median([pose.deviation for pose in poses], axis=0)
    judged = []
    for pose in poses:
        readings = acc[pose.rows[0] : pose.rows[1] + 1]
        for axis in range(3):
            at_end = max(float(np.mean(readings[:, axis] == end[axis])) for end in ends)
            noisy = usual[axis] > 1e-6 * float(np.linalg.norm(pose.mean))
            if pose.used and noisy and at_end > 0.2 and pose.deviation[axis] < 0.3 * usual[axis]:
                pose = pose.without(  # noqa: PLW2901 - the pose as judged so far
                    f"acc_{'xyz'[axis]} stands at the end of its range ({abs(pose.mean[axis]):.3g} m/s²): saturated"
                )
        judged.append(pose)
    return judged


def distinct(directions: Array) -> int:
    """Count the directions that differ by more than `SAME_DIRECTION`.

    Parameters
    ----------
    directions : (n, 3) array
        Unit vectors.
    """
    kept: list[Array] = []
    for direction in directions:
        if all(float(direction @ other) < np.cos(SAME_DIRECTION) for other in kept):
            kept.append(direction)
    return len(kept)


def repeated(poses: Sequence[Pose]) -> list[tuple[Pose, Pose]]:
    """Return pairs of neighbours in time that show gravity from the same side.

    Parameters
    ----------
    poses : sequence of Pose
        In the order of time.
    """
    return [(a, b) for a, b in itertools.pairwise(poses) if float(a.direction @ b.direction) > np.cos(SAME_DIRECTION)]
