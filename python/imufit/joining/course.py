"""The attitude that a gyroscope alone gives, at any time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.log.segments import gap_after

Array = NDArray[np.float64]

CONJUGATE: Final = np.array([1.0, -1.0, -1.0, -1.0])
"""Factor of a quaternion's components that makes it the inverse turn."""


@dataclass(frozen=True)
class Stretches:
    """Times of samples and the gaps between them.

    Attributes
    ----------
    t : (n,) array
        Ascending times, s.
    gap : (n - 1,) array of bool
        Where samples are missing.
    """

    t: Array
    gap: NDArray[np.bool_]

    @classmethod
    def between_gaps(cls, t: Array) -> Stretches:
        """Look for gaps between times."""
        return cls(t, gap_after(t))

    def row(self, t: Array) -> tuple[NDArray[np.intp], Array]:
        """Return the last sample before some times, the first or the last but one at most, and the time since, s."""
        row = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        return row, t - self.t[row]

    @property
    def unbroken(self) -> list[tuple[float, float]]:
        """First and last time, s, of each stretch without a gap."""
        ends = np.flatnonzero(self.gap)
        begins = np.concatenate(([0], ends + 1))
        return list(zip(self.t[begins].tolist(), self.t[np.append(ends, len(self.t) - 1)].tolist(), strict=True))

    def seen(self, begin: Array, end: Array) -> NDArray[np.bool_]:
        """Say which stretches lie within the times and touch no gap."""
        count = np.concatenate(([0], np.cumsum(self.gap)))
        first, _ = self.row(begin)
        last, _ = self.row(end)
        inside = (begin >= self.t[0]) & (end <= self.t[-1])
        return np.asarray(inside & (count[last + 1] == count[first]))


@dataclass(frozen=True)
class Course(Stretches):
    """Angular rates of a gyroscope, integrated.

    Attributes
    ----------
    t, gap : arrays
        As for `Stretches`.
    rate : (n - 1, 3) array
        Mean angular rate between two samples, rad/s, sensor axes.
    attitude : (n, 4) array
        Attitude at each sample, sensor to its axes at the first one; scalar first. Over a gap it stands still.
    angle : (n, 3) array
        Integral of the rates, axis by axis, rad.
    """

    rate: Array
    attitude: Array
    angle: Array

    @classmethod
    def of(cls, t: Array, gyr: Array) -> Course:
        """Integrate rates.

        Parameters
        ----------
        t : (n,) array
            Ascending times, s.
        gyr : (n, 3) array
            Angular rates, rad/s; rows with NaN are left out.
        """
        there = np.isfinite(gyr).all(axis=1)
        t, gyr = t[there], gyr[there]
        gap = gap_after(t)
        rate = 0.5 * (gyr[1:] + gyr[:-1])
        turns = np.where(gap[:, None], 0.0, rate * np.diff(t)[:, None])
        start = np.zeros((1, 3))
        attitude = _imufit.chained_turns(np.concatenate((start, turns)))
        return cls(t, gap, rate, attitude, np.concatenate((start, np.cumsum(turns, axis=0))))

    def at(self, t: Array) -> Array:
        """Attitude at some times within the course, (k, 4)."""
        place, since = self.row(t)
        since = np.where(self.gap[place], 0.0, since)
        turn = _imufit.quaternion_from_rotation_vector(self.rate[place] * since[:, None])
        return _imufit.quaternion_product(self.attitude[place], turn)

    def angle_at(self, t: Array) -> Array:
        """Integral of the rates up to some times within the course, (k, 3), rad."""
        return np.stack([np.interp(t, self.t, self.angle[:, k]) for k in range(3)], axis=1)


def reference_course(t: Array, q: Array) -> Course:
    """Course of a reference: its turns from one sample to the next, as a gyroscope on the body would read them.

    Parameters
    ----------
    t : (m,) array
        Ascending times, s.
    q : (m, 4) array
        Attitudes, body to reference frame, scalar first, none of them NaN.
    """
    turns = _imufit.rotation_vector_from_quaternion(_imufit.quaternion_product(q[:-1] * CONJUGATE, q[1:]))
    gap = gap_after(t)
    turns = np.where(gap[:, None], 0.0, turns)
    angle = np.concatenate((np.zeros((1, 3)), np.cumsum(turns, axis=0)))
    return Course(t, gap, turns / np.diff(t)[:, None], q, angle)
