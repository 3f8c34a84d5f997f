"""The specific force of a sensor and that of a body whose positions alone are known, as lengths.

The second difference of a position over some time is a mean of its acceleration. The same second difference of what the
accelerometer integrates, in axes that the gyroscope keeps still, is the same mean of the specific force but for the turn
of these axes. Its length needs neither that turn nor a mount.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from imufit import _imufit
from imufit.joining.course import Course, Stretches
from imufit.joining.search import Rates
from imufit.log import Log
from imufit.log.metadata import STANDARD_GRAVITY

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Forces:
    """Specific force over time, by what it integrates to.

    Attributes
    ----------
    stretches : Stretches
        Samples and their gaps.
    place : callable
        Second integral at some times, (k,) s to (k, 3) m, in axes that do not turn.
    gravity : (3,) array
        Gravity in these axes where the integral has none of it, m/s^2; zero where it is part of it.
    """

    stretches: Stretches
    place: Callable[[Array], Array]
    gravity: Array

    def lengths(self, t: Array, half: float) -> tuple[Array, NDArray[np.bool_]]:
        """Length of the mean force around some times, m/s^2, and where no gap is near.

        Parameters
        ----------
        t : (k,) array
            Times, s.
        half : float
            The mean reaches so far to both sides, s, and weighs as a triangle does.
        """
        mean = (self.place(t + half) - 2.0 * self.place(t) + self.place(t - half)) / half**2
        return np.linalg.norm(mean - self.gravity, axis=1), self.stretches.seen(t - half, t + half)

    def binned(self, half: float, skew: float = 0.0, most: float = np.inf) -> Rates:
        """Take the lengths every `half` seconds of the sensor's clock, less their mean; none above `most`."""
        step = half / (1.0 - skew)
        first, last = self.stretches.t[0] + half, self.stretches.t[-1] - half
        values, known = self.lengths(first + step * np.arange(max(1, int((last - first) / step) + 1)), half)
        known &= values <= most
        values = values - (values[known].mean() if known.any() else 0.0)
        return Rates(float(first), half, np.where(known, values, 0.0)[:, None], known)


def sensor_forces(log: Log) -> Forces:
    """Integrate the accelerometer of a log twice, in axes that its gyroscope keeps still; without one, in its own."""
    assert log.acc is not None
    there = np.isfinite(log.acc).all(axis=1)
    t, force = log.t[there], np.ascontiguousarray(log.acc[there])
    if log.gyr is not None and np.isfinite(log.gyr).all(axis=1).sum() > 1:
        force = _imufit.rotate(Course.of(log.t, log.gyr).at(t), force)
    step = np.diff(t)[:, None]
    mean = 0.5 * (force[1:] + force[:-1])
    start = np.zeros((1, 3))
    speed = np.concatenate((start, np.cumsum(mean * step, axis=0)))
    place = np.concatenate((start, np.cumsum((speed[:-1] + 0.5 * mean * step) * step, axis=0)))
    stretches = Stretches.between_gaps(t)

    def at(when: Array) -> Array:
        row, since = stretches.row(when)
        since = since[:, None]
        return np.asarray(place[row] + since * (speed[row] + 0.5 * since * mean[row]))

    return Forces(stretches, at, np.zeros(3))


def position_forces(t: Array, p: Array, up: Array) -> Forces:
    """Specific force of a body by its positions.

    Parameters
    ----------
    t : (m,) array
        Ascending times, s.
    p : (m, 3) array
        Positions in a frame that does not turn, m.
    up : (3,) array
        Unit vector upwards in this frame.
    """
    return Forces(Stretches.between_gaps(t), CubicSpline(t, p), -STANDARD_GRAVITY * up)
