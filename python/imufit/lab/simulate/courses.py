"""Courses of temperature or of a column that are requested, instead of those that chance gives.

Each has `at(t)`, the quantity (n,) at times t (s); `simulate(..., courses={"temp": Line(20.0, 0.1)})`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.signal import lfilter

from imufit.lab.simulate.motion import Array


class Course(Protocol):
    """A quantity that changes with time."""

    def at(self, t: Array) -> Array:
        """Return the quantity, shape (n,).

        Parameters
        ----------
        t : ndarray
            (n,) times, s.
        """


@dataclass(frozen=True)
class Line:
    """A quantity that grows steadily, such as a temperature on a ramp.

    Attributes
    ----------
    start : at time zero, in the unit of the quantity.
    slope : by which it grows in a second.
    """

    start: float
    slope: float

    def at(self, t: Array) -> Array:
        """Return the quantity, shape (n,).

        Parameters
        ----------
        t : ndarray
            (n,) times, s.
        """
        return self.start + self.slope * t


@dataclass(frozen=True)
class Mixture:
    """A weighted sum of courses, such as a fan's current that follows the temperature.

    Attributes
    ----------
    parts : weight and course of each part.
    offset : added to their sum.
    """

    parts: Sequence[tuple[float, Course]]
    offset: float = 0.0

    def at(self, t: Array) -> Array:
        """Return the quantity, shape (n,).

        Parameters
        ----------
        t : ndarray
            (n,) times, s.
        """
        total = np.full(t.shape, self.offset)
        for weight, course in self.parts:
            total = total + weight * course.at(t)
        return total


@dataclass(frozen=True)
class Wandering:
    """Autocorrelated chance about zero: white noise through two first-order lags in a row, so that it has a slope.

    Attributes
    ----------
    seed : of the chance; the same seed gives the same course.
    duration : up to which time (s) it is known.
    time : time (s) in which the two lags together forget; each takes half of it.
    size : standard deviation.
    step : between two values (s), which straight lines join.
    """

    seed: Sequence[int]
    duration: float
    time: float
    size: float = 1.0
    step: float = 0.05

    def at(self, t: Array) -> Array:
        """Return the quantity, shape (n,).

        Parameters
        ----------
        t : ndarray
            (n,) times, s.
        """
        ahead = 10.0 * self.time
        grid = np.arange(-ahead, self.duration + 1.0, self.step)
        keep = np.exp(-2.0 * self.step / self.time)
        drawn = np.random.default_rng(list(self.seed)).standard_normal(grid.size)
        course = lfilter([1.0], [1.0, -2.0 * keep, keep**2], drawn)
        gain = np.sqrt((1.0 + keep**2) / (1.0 - keep**2) ** 3)
        return np.asarray(np.interp(t, grid, self.size * course / gain), dtype=np.float64)
