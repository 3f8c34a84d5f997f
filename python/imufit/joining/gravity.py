"""How a sensor sits on the body, by its rates and by gravity.

The rates of a motion about one axis show where this axis is in the sensor, and nothing of the turn about the axis.
Gravity shows the rest, unless the axis is vertical.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from imufit.joining.likeliest import CommonRates
from imufit.joining.mount import OPEN, square_turns
from imufit.joining.refine import Aligned
from imufit.joining.search import turn_between
from imufit.log import Log
from imufit.log.scalar_first import rotation_from_quaternions

Array = NDArray[np.float64]

RATE_ERROR: Final = 0.03
"""Standard deviation of the map of a sensor's rates, 1: scale and axes of a sensor are right to a few percent."""
TILT_ERROR: Final = 0.1
"""Standard deviation of the direction of the mean specific force, rad: a frame that is not level, an offset of the
accelerometer (0.5 m/s^2 are 0.05 rad), accelerations that do not cancel."""
UPRIGHT: Final = 0.35
"""Largest angle between the mean specific force and the vertical of the frame, rad: 20 degrees. In a frame other than
the stated one the angle is 90 degrees or 180."""


STEADY: Final = 0.8
"""Mean specific force in a level frame over its mean length, 1, from which on it shows the vertical."""


@dataclass(frozen=True, eq=False)
class Mount:
    """A turn from the reference body's axes to the sensor's.

    Attributes
    ----------
    matrix : (3, 3) array
        The turn.
    error : float
        Standard error about the axis about which it is least sure, rad; infinite where nothing shows it.
    by_gravity : bool
        True if the rates alone leave it open, and gravity settles it.
    """

    matrix: Array
    error: float
    by_gravity: bool = False

    @property
    def open(self) -> bool:
        """True if the turn about one axis is not known; the matrix then is the one nearest to parallel axes."""
        return self.error > OPEN


def vertical(frame: str) -> Array:
    """Return the unit vector upwards in a frame, (3,)."""
    return np.array([0.0, 0.0, -1.0 if frame == "NED" else 1.0])


def mean_force(log: Log) -> Array:
    """Return the mean specific force in the reference frame over its mean length, (3,); NaN where it is not steady.

    Its length is 1 for a log at rest in frames that are right. Of an axis that is not where it was taken to be the
    forces of a half turn cancel to two thirds.
    """
    unknown = np.full(3, np.nan)
    if log.acc is None or log.ref_q is None:
        return unknown
    known = np.isfinite(log.acc).all(axis=1) & log.has_reference
    if not known.any():
        return unknown
    force = rotation_from_quaternions(log.ref_q[known]).apply(log.acc[known])
    mean = np.asarray(force.mean(axis=0) / max(float(np.linalg.norm(force, axis=1).mean()), 1e-30))
    return mean if np.linalg.norm(mean) >= STEADY else unknown


def upside_down(log: Log) -> bool:
    """Return whether the mean specific force points down in the stated frame: the frame, or its sign, is another."""
    force = mean_force(log)
    return bool(force @ vertical(log.metadata.frame) < -np.cos(UPRIGHT) * np.linalg.norm(force))


def mounted(common: CommonRates, aligned: Aligned, log: Log, reference: Log, rows: NDArray[np.intp]) -> Mount:
    """Find the mount by the rates and, as far as these leave it open, by gravity.

    Parameters
    ----------
    common : CommonRates
        Mean rates of both.
    aligned : Aligned
        Relation of the clocks.
    log : Log
        The sensor; its accelerometer counts, where it has one.
    reference : Log
        With the attitude of the body.
    rows : (m,) array of int
        Rows of the reference with an attitude.
    """
    if not len(common.measured):
        return Mount(aligned.mount, np.inf)
    noise = (1.0 - max(common.correlation(aligned.mount), 0.0) ** 2) / len(common.measured)
    weight = 1.0 / (RATE_ERROR**2 + noise)
    products = (
        weight
        * common.measured.T
        @ common.expected
        / np.sqrt(max(float(np.sum(common.measured**2) * np.sum(common.expected**2)), 1e-300))
    )
    by_rates = _mount(products, weight * _second_moment(common.measured))
    if not by_rates.open:
        return by_rates
    force, up = _forces(aligned, log, reference, rows)
    if len(force):
        upwards = products + force.T @ up / (len(force) * TILT_ERROR**2)
        known = weight * _second_moment(common.measured) + _second_moment(force) / TILT_ERROR**2
        found = _mount(upwards, known)
        off = np.mean(force @ found.matrix * up, axis=0).sum()
        if not found.open and off > np.cos(UPRIGHT):
            return Mount(found.matrix, found.error, by_gravity=True)
    return by_rates


def _second_moment(vectors: Array) -> Array:
    """Mean of the products of the components, over the mean square; (3, 3)."""
    moment = vectors.T @ vectors
    return np.asarray(moment / max(float(np.trace(moment)), 1e-300))


def _mount(products: Array, known: Array) -> Mount:
    """Return the likeliest turn and its error; along an axis that is not known it is brought to parallel axes.

    Parameters
    ----------
    products : (3, 3) array
        Weighted sum of the products of what the sensor and the body see.
    known : (3, 3) array
        Weighted second moment of the former: directions that are seen, in the sensor.
    """
    matrix = turn_between(products)
    values, axes = np.linalg.eigh(np.trace(known) * np.eye(3) - known)
    error = float(1.0 / np.sqrt(max(values[0], 1e-12)))
    return Mount(_most_parallel(matrix, axes[:, 0]) if error > OPEN else matrix, error)


def _most_parallel(matrix: Array, axis: Array) -> Array:
    """Turn a mount about an axis of the sensor to where its axes lie nearest to those of the body.

    Of the 24 turns that map axes on axes the nearest one is taken; of those equally near, the one nearest to no turn.
    """
    found = []
    cross = np.cross(np.eye(3), axis)
    for square in square_turns():
        wanted = square @ matrix.T
        # The trace of wanted' exp(angle axis) is a + b cos(angle) + c sin(angle).
        along = float(axis @ wanted @ axis)
        b, c = float(np.trace(wanted)) - along, float(np.sum(wanted * cross))
        found.append((along + np.hypot(b, c), float(np.trace(square)), np.arctan2(c, b)))
    nearest = max(each[0] for each in found)
    _, _, angle = max((each for each in found if each[0] > nearest - 1e-3), key=lambda each: each[1])
    return np.asarray(Rotation.from_rotvec(angle * axis).as_matrix() @ matrix)


def _forces(aligned: Aligned, log: Log, reference: Log, rows: NDArray[np.intp]) -> tuple[Array, Array]:
    """Directions of the specific force in the sensor and of the vertical in the body, (k, 3) each.

    Both are means over a second: accelerations of a motion nearly cancel.
    """
    assert reference.ref_q is not None
    if log.acc is None:
        return np.zeros((0, 3)), np.zeros((0, 3))
    there = np.isfinite(log.acc).all(axis=1)
    t_ref = aligned.on_sensor_clock(reference.t[rows], float(reference.t[rows[0]]))
    turns = rotation_from_quaternions(reference.ref_q[rows])
    up = turns.apply(vertical(reference.metadata.frame), inverse=True)
    begin, end = max(log.t[there][0], t_ref[0]), min(log.t[there][-1], t_ref[-1])
    t = log.t[there]
    own, other = (np.where((x >= begin) & (x < end), np.floor(x - begin), -1.0) for x in (t, t_ref))
    seconds = np.setdiff1d(np.intersect1d(own, other), [-1.0])
    return _unit(_means(seconds, own, log.acc[there])), _unit(_means(seconds, other, up))


def _means(seconds: Array, second: Array, values: Array) -> Array:
    """Means of (n, 3) values in each of (k,) seconds, all of which have some."""
    place = np.searchsorted(seconds, second)
    inside = np.isin(second, seconds)
    count = np.bincount(place[inside], minlength=len(seconds))
    sums = [np.bincount(place[inside], values[inside, k], minlength=len(seconds)) for k in range(3)]
    return np.stack(sums, axis=1) / count[:, None]


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300))
