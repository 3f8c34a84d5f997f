"""The specific force of a sensor and that of a body whose positions alone are known, as lengths.

The second difference of mean positions is a mean of the acceleration. The same difference of what the accelerometer
integrates, in axes that the gyroscope keeps still, is the same mean of the specific force but for the turn of these
axes. Its length needs neither that turn nor a mount.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.joining.course import Course, Stretches
from imufit.joining.search import Rates
from imufit.log import Log
from imufit.log.metadata import STANDARD_GRAVITY
from imufit.log.segments import gap_after

Array = NDArray[np.float64]

REACH: Final = 1.5
"""Reach of a mean force to both sides, widths."""
FRESH: Final = 100.0
"""Time after which the integrals start from zero again, s: a third integral over hours has no digits left."""
OUTSTANDING: Final = 20.0
"""A position this many times as far off its neighbours as the usual one (median) stands out of their noise: of normal
errors none is beyond four."""


@dataclass(frozen=True, eq=False)
class Forces:
    """Specific force over time, by what it integrates to.

    Attributes
    ----------
    stretches : Stretches
        Samples and their gaps.
    integral : callable
        Third integral at some times, (k,) s to (k, 3) m s, in axes that do not turn.
    gravity : (3,) array
        Gravity in these axes where the integral has none of it, m/s^2; zero where it is part of it.
    """

    stretches: Stretches
    integral: Callable[[Array], Array]
    gravity: Array

    def lengths(self, t: Array, width: float) -> tuple[Array, NDArray[np.bool_]]:
        """Length of the mean force around some times, m/s^2, and where no gap is near.

        Parameters
        ----------
        t : (k,) array
            Times, s.
        width : float
            Time over which positions are averaged, and between the three that are compared, s: the mean force reaches
            one and a half of these to both sides and weighs as a quadratic spline does.
        """
        parts = [self.integral(t + place * width) for place in (1.5, 0.5, -0.5, -1.5)]
        mean = (parts[0] - parts[3] - 3.0 * (parts[1] - parts[2])) / width**3
        seen = self.stretches.seen(t - REACH * width, t + REACH * width)
        return np.linalg.norm(mean - self.gravity, axis=1), seen

    def binned(self, width: float, skew: float = 0.0) -> Rates:
        """Take the lengths every `width` seconds of the sensor's clock, less their mean."""
        step = width / (1.0 - skew)
        first, last = self.stretches.t[0] + REACH * width, self.stretches.t[-1] - REACH * width
        values, known = self.lengths(first + step * np.arange(max(1, int((last - first) / step) + 1)), width)
        values = values - (values[known].mean() if known.any() else 0.0)
        return Rates(float(first), width, np.where(known, values, 0.0)[:, None], known)


def sensor_forces(log: Log) -> Forces:
    """Integrate the accelerometer of a log twice, in axes that its gyroscope keeps still; without one, in its own."""
    assert log.acc is not None
    there = np.isfinite(log.acc).all(axis=1)
    t, force = log.t[there], np.ascontiguousarray(log.acc[there])
    if log.gyr is not None and np.isfinite(log.gyr).all(axis=1).sum() > 1:
        force = _imufit.rotate(Course.of(log.t, log.gyr).at(t), force)
    step = np.diff(t)[:, None]
    gap = gap_after(t) | (np.diff(np.floor((t - t[0]) / FRESH)) > 0.0)
    begin = np.maximum.accumulate(np.concatenate(([0], np.where(gap, np.arange(1, len(t)), 0))))
    mean = 0.5 * (force[1:] + force[:-1])

    def summed(parts: Array) -> Array:
        """Add up from the last fresh start."""
        total = np.concatenate((np.zeros((1, 3)), np.cumsum(parts, axis=0)))
        return np.asarray(total - total[begin])

    speed = summed(mean * step)
    place = summed((speed[:-1] + mean * step / 2.0) * step)
    total = summed((place[:-1] + (speed[:-1] / 2.0 + mean * step / 6.0) * step) * step)
    stretches = Stretches(t, gap)

    def integral(when: Array) -> Array:
        row, since = stretches.row(when)
        since = since[:, None]
        return np.asarray(total[row] + since * (place[row] + since * (speed[row] / 2.0 + since * mean[row] / 6.0)))

    return Forces(stretches, integral, np.zeros(3))


def position_forces(t: Array, p: Array, up: Array, most: float) -> Forces:
    """Specific force of a body by its positions.

    Parameters
    ----------
    t : (m,) array
        Ascending times, s.
    p : (m, 3) array
        Positions in a frame that does not turn, m.
    up : (3,) array
        Unit vector upwards in this frame.
    most : float
        Largest acceleration that there can be, m/s^2. A position that takes more, and stands out of the noise of the
        others, is left out.
    """
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - takes 13 MB that logs without a position do not need

    tame = ~_wild(t, p, most)
    t, p = t[tame], p[tame]
    spline = CubicSpline(t, p - p.mean(axis=0)).antiderivative()
    return Forces(Stretches.between_gaps(t), spline, -STANDARD_GRAVITY * up)


def _wild(t: Array, p: Array, most: float) -> NDArray[np.bool_]:
    """Say which positions are off the line between their neighbours, more than these are."""
    share = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None]
    off = np.linalg.norm(p[1:-1] - (1.0 - share) * p[:-2] - share * p[2:], axis=1)
    possible = most * (t[1:-1] - t[:-2]) * (t[2:] - t[1:-1]) / 2.0
    far = (off > possible) & (off > OUTSTANDING * float(np.median(off)))
    around = np.concatenate(([0.0], off, [0.0]))
    wild = np.zeros(len(t), np.bool_)
    wild[1:-1] = far & (off >= around[:-2]) & (off >= around[2:])
    return wild
