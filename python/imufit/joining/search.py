"""The lag between two recordings of one motion, by their angular rates over the whole of both.

Sensor and reference need not have parallel axes: for every lag the turn between them is found that makes the rates
agree best (Schönemann 1966, A generalized solution of the orthogonal Procrustes problem, Psychometrika 31), all lags at
once by Fourier transform.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from imufit.joining.course import Course

Array = NDArray[np.float64]

STEP: Final = 0.05
"""Shortest bin of the mean rates, s: people, vehicles and robots turn slower than 10 Hz, vibration is faster."""
LEAST_OVERLAP: Final = 5.0
"""Shortest common stretch that is looked at, s."""
LEAST_SHARE: Final = 0.2
"""The same, as a share of the shorter recording."""
FASTER: Final = 1.5
"""A reference that turns this many times as fast as the fastest the sensor ever does shows a wild pose."""
MOST_BINS: Final = 2**19
"""Bins of the longer recording; beyond, bins are wider (seven hours at the shortest)."""


@dataclass(frozen=True)
class Rates:
    """Mean angular rates in bins.

    Attributes
    ----------
    start, step : float
        Time of the first bin's begin and width of the bins, s.
    values : (n, 3) array
        rad/s; zero where nothing is known.
    known : (n,) array of bool
        Bins without a gap.
    """

    start: float
    step: float
    values: Array
    known: NDArray[np.bool_]

    @classmethod
    def of(cls, course: Course, step: float, most: float = np.inf) -> Rates:
        """Take the means of a course; bins with a rate above `most`, rad/s, are not known."""
        edges = np.arange(course.t[0], course.t[-1], step)
        values = np.diff(course.angle_at(edges), axis=0) / step
        known = course.seen(edges[:-1], edges[1:]) & (np.linalg.norm(values, axis=1) <= most)
        # A constant is a bias of the sensor, not a motion.
        values -= values[known].mean(axis=0) if known.any() else 0.0
        return cls(float(edges[0]), step, np.where(known[:, None], values, 0.0), known)


@dataclass(frozen=True)
class Candidate:
    """A lag that may be the one.

    Attributes
    ----------
    lag : float
        Time by which the reference's stamps are late, s: its clock less the sensor's.
    gain : float
        Log of the likelihood ratio of "the rates are the same" over "they are unrelated", in units of one bin.
    mount : (3, 3) array
        Turn from the reference body's axes to the sensor's.
    """

    lag: float
    gain: float
    mount: Array


def binned(sensor: Course, reference: Course, step: float) -> tuple[Rates, Rates]:
    """Take the mean rates of both; where the reference turns faster than the sensor ever does, a pose is wild."""
    edges = np.arange(sensor.t[0], sensor.t[-1], step)
    fastest = np.linalg.norm(np.diff(sensor.angle_at(edges), axis=0), axis=1) / step
    most = FASTER * float(fastest.max()) if fastest.size else np.inf
    return Rates.of(sensor, step), Rates.of(reference, step, most)


def bin_width(sensor: Course, reference: Course) -> float:
    """Choose the width of the bins, s."""
    longest = max(float(course.t[-1] - course.t[0]) for course in (sensor, reference))
    sampled = (float(np.median(np.diff(course.t))) for course in (sensor, reference))
    return max(STEP, longest / MOST_BINS, *sampled)


class Correlation:
    """Correlation of the rates of a sensor and a reference at every lag.

    Parameters
    ----------
    sensor, reference : Course
        Integrated rates, each on its own clock.

    Attributes
    ----------
    step : float
        Width of the bins, s.
    own, other : Rates
        Mean rates of sensor and reference.
    gain : (lags,) array
        Log of the likelihood ratio at every lag, as in `Candidate`.
    shared : (lags, 3, 3) array
        Sums of the products of the rates at every lag.
    """

    def __init__(self, sensor: Course, reference: Course) -> None:
        self.step = bin_width(sensor, reference)
        self.own, self.other = own, other = binned(sensor, reference, self.step)
        n, m = len(own.values), len(other.values)
        self.first = other.start - own.start + (m - 1) * self.step
        size = fft.next_fast_len(n + m, real=True)

        def correlated(a: Array, b: Array) -> Array:
            """Sum over k of a[k + j] b[k], for j from -(m - 1) to n - 1."""
            product = fft.irfft(fft.rfft(a, size) * np.conj(fft.rfft(b, size)), size)
            return np.concatenate((product[size - m + 1 :], product[:n]))

        known = own.known.astype(float), other.known.astype(float)
        sizes = np.sum(own.values**2, axis=1), np.sum(other.values**2, axis=1)
        # Where there is none, rounding may leave less.
        rounding = 1e-12 * np.array([size.sum() for size in sizes])
        energy = correlated(sizes[0], known[1]) - rounding[0], correlated(known[0], sizes[1]) - rounding[1]
        common = correlated(known[0], known[1])
        self.shared = np.empty((n + m - 1, 3, 3))
        for i in range(3):
            for k in range(3):
                self.shared[:, i, k] = correlated(own.values[:, i], other.values[:, k])
        least = max(LEAST_OVERLAP, LEAST_SHARE * min(known[0].sum(), known[1].sum()) * self.step)
        usable = (common * self.step >= least) & (energy[0] > 0.0) & (energy[1] > 0.0)
        singular = np.linalg.svd(self.shared[usable], compute_uv=False)
        sign = np.sign(np.linalg.det(self.shared[usable]))
        agreed = singular[:, 0] + singular[:, 1] + sign * singular[:, 2]
        values = np.zeros(n + m - 1)
        values[usable] = np.clip(agreed / np.sqrt(energy[0][usable] * energy[1][usable]), 0.0, 1.0 - 1e-9)
        self.gain = -0.5 * common * np.log1p(-(values**2))

    def at(self, lag: float) -> Candidate:
        """Return what there is at a lag, s; at the nearest one that the recordings allow."""
        place = round((self.first - lag) / self.step)
        return self._candidate(min(max(place, 0), len(self.gain) - 1))

    def peaks(self, most: int = 8) -> list[Candidate]:
        """Return the lags, `most` at most, at which the likelihood has a maximum, likeliest first."""
        from scipy.signal import find_peaks  # noqa: PLC0415 - costs half a second that few logs need

        places, _ = find_peaks(np.concatenate(([-1.0], self.gain, [-1.0])))
        order = sorted(places - 1, key=lambda place: -self.gain[place])[:most]
        return [self._candidate(int(place)) for place in order if self.gain[place] > 0.0]

    def _candidate(self, place: int) -> Candidate:
        return Candidate(
            self.first - place * self.step,
            float(self.gain[place]),
            turn_between(self.shared[place]),
        )


def turn_between(shared: Array) -> Array:
    """Return the rotation matrix R that makes the trace of R' times a (3, 3) matrix of products largest."""
    u, _, vt = np.linalg.svd(shared)
    turned = u @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(u @ vt)))]) @ vt
    return np.asarray(turned)
