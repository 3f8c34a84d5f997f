"""The lag between two recordings of one motion, by their angular rates over the whole of both.

Sensor and reference need not have parallel axes: for every lag the turn between them is found that makes the rates
agree best (Schönemann 1966, A generalized solution of the orthogonal Procrustes problem, Psychometrika 31), all lags at
once by Fourier transform. One of the clocks may be fast by up to a percent: the transform is repeated with the time of
the reference stretched, in steps so small that the ends of the recordings stay within half a bin.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Final, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from imufit.joining.course import Course

Array = NDArray[np.float64]
Transform = NDArray[np.complex128]

STEP: Final = 0.05
"""Shortest bin of the mean rates, s: people, vehicles and robots turn slower than 10 Hz, vibration is faster."""
LEAST_OVERLAP: Final = 5.0
"""Shortest common stretch that is looked at, s."""
LEAST_SHARE: Final = 0.2
"""The same, as a share of the shorter recording."""
FASTER: Final = 1.5
"""A reference that turns this many times as fast as the fastest the sensor ever does shows a wild pose."""
MOST_BINS: Final = 2**18
"""Bins of the longer recording; beyond, bins are wider (three and a half hours at the shortest)."""
LARGEST_SKEW: Final = 0.01
"""Rate of one clock over the other, less one, up to which it is looked for: a clock of a resistor and a capacitor, or a
rate of samples that was rounded, is off by a percent."""
USUAL_SKEW: Final = 1e-4
"""Scale of the prior of the skew, 1 (Cauchy): crystals are right to some 50 ppm each."""
MOST_STRETCHED: Final = 2**21
"""Bins of all stretched references together, a second or two of computing: all skews up to 1 % of ten minutes. Longer
recordings are searched through smaller skews: up to 0.2 % at half an hour, 50 ppm at three hours."""
WIDTHS: Final = 6
"""Widths of bins that are tried, each twice the one before: positions to a millimetre show the force in a tenth of a
second, those of a satellite receiver in seconds. The likeliest lag of all widths counts."""
LEAST_BINS: Final = 30
"""Bins in the shorter recording; with fewer, some lag makes any two recordings agree."""
TURNS: Final = 15
"""Newton steps to the largest root. Where motion is about one axis, each halves the error, and 15 leave 3e-5 of it."""


@dataclass(frozen=True)
class Rates:
    """Mean angular rates, or something else that both recordings show, in bins.

    Attributes
    ----------
    start, step : float
        Time of the first bin's begin and width of the bins, s.
    values : (n, 3) or (n, 1) array
        Rates in rad/s, or what else there is; zero where nothing is known.
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
        edges = course.t[0] + step * np.arange(int((course.t[-1] - course.t[0]) / step) + 1)
        values = np.diff(course.angle_at(edges), axis=0) / step
        known = course.seen(edges[:-1], edges[1:]) & (np.linalg.norm(values, axis=1) <= most)
        # A constant is a bias of the sensor, not a motion.
        values -= values[known].mean(axis=0) if known.any() else 0.0
        return cls(float(edges[0]), step, np.where(known[:, None], values, 0.0), known)

    @property
    def power(self) -> float:
        """Mean square of what is known; 0 where nothing is."""
        return float(np.sum(self.values**2)) / max(1, int(self.known.sum()))


@dataclass(frozen=True)
class Candidate:
    """A lag that may be the one.

    Attributes
    ----------
    lag : float
        Time by which the reference's stamps are late at its first sample, s: its clock less the sensor's.
    skew : float
        Rate of the reference's clock over the sensor's, less one.
    gain : float
        Log of the likelihood ratio of "the rates are the same" over "they are unrelated", and of the skew's prior.
    mount : (3, 3) array
        Turn from the reference body's axes to the sensor's.
    """

    lag: float
    skew: float
    gain: float
    mount: Array


def skew_prior(skew: float) -> float:
    """Return the log of the density of a skew over that of none."""
    return -float(np.log1p((skew / USUAL_SKEW) ** 2))


def bin_width(sensor: Course, reference: Course) -> float:
    """Choose the width of the bins, s."""
    longest = max(float(course.t[-1] - course.t[0]) for course in (sensor, reference))
    sampled = (float(np.median(np.diff(course.t))) for course in (sensor, reference))
    return max(STEP, longest / MOST_BINS, *sampled)


def comparable(sensor: Course, reference: Course) -> bool:
    """Say whether each recording is long enough to be found in the other: some seconds, and some bins."""
    shorter = min(float(course.t[-1] - course.t[0]) for course in (sensor, reference))
    return shorter >= max(LEAST_OVERLAP, 2.0 * bin_width(sensor, reference))


@dataclass(frozen=True)
class _Lags:
    """Neighbouring lags with one skew, a bin apart, the latest first.

    Attributes
    ----------
    skew, latest : float
        The skew, and the lag at the first place, s.
    gain : (k,) array
        Log likelihood ratios.
    shared : (9, k) or (1, k) array
        Products of what both show.
    """

    skew: float
    latest: float
    gain: Array
    shared: Array


@dataclass(frozen=True)
class _Sums:
    """Sums over the bins that two recordings have in common, at each of k lags.

    Attributes
    ----------
    own, other : (k,) array
        Squares of what sensor and reference show.
    common : (k,) array
        Number of these bins.
    shared : (9, k) or (1, k) array
        Products of what both show.
    """

    own: Array
    other: Array
    common: Array
    shared: Array


class LagSearch:
    """Correlation, at every lag, of something that both recordings show.

    Parameters
    ----------
    own : Rates
        What the sensor shows.
    stretched : callable
        Gives what the reference shows, in bins that are longer by a skew.
    skew : float, optional
        Rate of the reference's clock over the sensor's, less one; None if it is to be looked for.

    Attributes
    ----------
    step : float
        Width of the bins, s.
    own, other : Rates
        What sensor and reference show.
    skews : (k,) array
        Skews that are looked at, the smallest first.
    spacing : float
        Distance between neighbours of these.
    independent : float
        Time after which the products of both say something new if the recordings are unrelated, s.
    """

    def __init__(self, own: Rates, stretched: Callable[[float], Rates], skew: float | None) -> None:
        self.own, self.other, self.step = own, stretched(0.0), own.step
        self._stretched, self._skew_known = stretched, skew is not None
        n, m = len(own.values), len(self.other.values)
        self._size = fft.next_fast_len(n + int(m * (1.0 + LARGEST_SKEW)) + 1, real=True)
        values, known = own.values, own.known.astype(float)
        self._rate = fft.rfft(values.T, self._size)
        self._energy = fft.rfft(np.sum(values**2, axis=1), self._size)
        self._known = fft.rfft(known, self._size)
        self._sums = float(np.sum(values**2)), float(known.sum())
        other = fft.rfft(self.other.values.T, self._size)
        self.independent = self.step * independent(self._rate, other, self._size, min(n, m))
        self.spacing = 2.0 / max(1, min(n, m))
        number = min(int(LARGEST_SKEW / self.spacing), int(MOST_STRETCHED / (2 * (n + m))))
        steps = np.arange(-number, number + 1)
        self.skews = (
            self.spacing * steps[np.argsort(np.abs(steps), kind="stable")] if skew is None else np.array([skew])
        )

    @property
    def tried(self) -> float:
        """Number of different alignments that were looked at."""
        lags = (len(self.own.values) + len(self.other.values)) * self.step / self.independent
        return max(lags, 1.0) * len(self.skews)

    def _reference(self, skew: float) -> Rates:
        """Return what the reference shows, stretched by a skew."""
        return self.other if skew == 0.0 else self._stretched(skew)

    def _everywhere(self, other: Rates) -> _Sums:
        """Sum at every lag at once, by Fourier transform."""
        n, m, size = len(self.own.values), len(other.values), self._size

        def correlated(a: Transform, b: Transform) -> Array:
            """Sum over k of a[k + j] b[k], for j from -(m - 1) to n - 1, from the transforms of both."""
            product = fft.irfft(a * np.conj(b), size)
            return np.concatenate((product[..., size - m + 1 :], product[..., :n]), axis=-1)

        known, squares = other.known.astype(float), np.sum(other.values**2, axis=1)
        there, rate = fft.rfft(known, size), fft.rfft(other.values.T, size)
        return _Sums(
            correlated(self._energy, there),
            correlated(self._known, fft.rfft(squares, size)),
            correlated(self._known, there),
            correlated(self._rate[:, None], rate[None]).reshape(len(self._rate) ** 2, -1),
        )

    def _at_places(self, other: Rates, places: range) -> _Sums:
        """Sum at some of the lags, bin by bin."""
        own, n, m = self.own, len(self.own.values), len(other.values)
        sums = []
        for place in places:
            ahead = place - (m - 1)
            mine, theirs = slice(max(ahead, 0), min(n, m + ahead)), slice(max(-ahead, 0), min(m, n - ahead))
            a, b = own.values[mine], other.values[theirs]
            there = own.known[mine], other.known[theirs]
            sums.append(
                (
                    np.sum(a[there[1]] ** 2),
                    np.sum(b[there[0]] ** 2),
                    np.count_nonzero(there[0] & there[1]),
                    *(a.T @ b).ravel(),
                )
            )
        table = np.array(sums, dtype=np.float64).T
        return _Sums(table[0], table[1], table[2], table[3:])

    def _at_every_lag(self) -> Iterator[_Lags]:
        """Compare at every lag with the reference stretched by each skew, where both have enough bins."""
        if self._too_short(self.own):
            return
        for skew in self.skews:
            other = self._reference(float(skew))
            if self._too_short(other):
                continue
            yield self._scored(float(skew), self._latest(other), other, self._everywhere(other))

    def _too_short(self, rates: Rates) -> bool:
        """Say whether the rates are known in too few bins for an overlap at any lag."""
        return bool(rates.known.sum() * self.step < LEAST_OVERLAP)

    def _near(self, lag: float, skews: Iterable[float], bins: int) -> Candidate:
        """Return the likeliest of some skews, at the lags that some bins hold on either side of one, s."""
        found = []
        for skew in skews:
            other = self._reference(float(skew))
            latest, last = self._latest(other), len(self.own.values) + len(other.values) - 2
            middle = min(max(round((latest - lag) / self.step), 0), last)
            places = range(max(middle - bins, 0), min(middle + bins, last) + 1)
            sums = self._at_places(other, places)
            lags = self._scored(float(skew), latest - places[0] * self.step, other, sums)
            found.append(self._candidate(lags, int(np.argmax(lags.gain))))
        return max(found, key=lambda each: each.gain)

    def _latest(self, other: Rates) -> float:
        """Return the lag that leaves the reference's last bin beside the sensor's first one, s."""
        return other.start - self.own.start + (len(other.values) - 1) * self.step

    def _scored(self, skew: float, latest: float, other: Rates, sums: _Sums) -> _Lags:
        """Return the likelihood of each lag."""
        # Where there is none, rounding may leave less.
        energy = sums.own - 1e-12 * self._sums[0], sums.other - 1e-12 * float(np.sum(other.values**2))
        least = max(LEAST_OVERLAP, LEAST_SHARE * min(self._sums[1], other.known.sum()) * self.step)
        usable = (sums.common * self.step >= least) & (energy[0] > 0.0) & (energy[1] > 0.0)
        shared = sums.shared[:, usable]
        agreed = largest_agreement(shared) if len(shared) == 9 else shared[0]
        values = np.clip(agreed / np.sqrt(energy[0][usable] * energy[1][usable]), 0.0, 1.0 - 1e-9)
        gain = np.zeros(len(sums.common))
        # Of bins that depend on one another, as many count as are independent; only then a prior can stand beside them.
        counted = sums.common[usable] * self.step / self.independent
        gain[usable] = -0.5 * counted * np.log1p(-(values**2)) + skew_prior(skew)
        return _Lags(skew, latest, gain, sums.shared)

    def at(self, lag: float) -> Candidate:
        """Return what there is at a lag, s; at the nearest one that the recordings allow, with the likeliest skew."""
        return self._near(lag, self.skews, 0)

    def near(self, wider: LagSearch, candidate: Candidate) -> Candidate:
        """Return the likeliest lag and skew of those that a search in wider bins takes for one candidate."""
        around = 0 if self._skew_known else round(wider.spacing / self.spacing)
        skews = candidate.skew + self.spacing * np.arange(-around, around + 1)
        return self._near(candidate.lag, skews, round(wider.step / self.step))

    def peaks(self, most: int = 8) -> list[Candidate]:
        """Return the likeliest maxima of the likelihood, `most` at most.

        Two of them never put the same sample of the reference beside the same one of the sensor: one of two such maxima
        is the foot of the other, seen with another skew.
        """
        from scipy.signal import find_peaks  # noqa: PLC0415 - costs half a second that few logs need

        found: list[Candidate] = []
        for each in self._at_every_lag():
            places, _ = find_peaks(np.concatenate(([-1.0], each.gain, [-1.0])))
            order = sorted(places - 1, key=lambda place: -each.gain[place])[:most]
            found += [self._candidate(each, int(place)) for place in order if each.gain[place] > 0.0]
        found.sort(key=lambda each: -each.gain)
        apart: list[Candidate] = []
        for candidate in found:
            if len(apart) < most and not any(self.meet(candidate, other) for other in apart):
                apart.append(candidate)
        return apart

    def meet(self, one: Clocks, other: Clocks, bins: float = 2.0) -> bool:
        """Say whether two relations of the clocks are the same, to some bins, somewhere in the common stretch."""
        since = self._common(one)
        apart = np.array([one.lag - other.lag + (one.skew - other.skew) * each for each in since])
        return bool(np.abs(apart).min() <= bins * self.step or apart[0] * apart[1] < 0.0)

    def _common(self, clocks: Clocks) -> tuple[float, float]:
        """Begin and end of the common stretch, s since the first sample of the reference."""
        begin = self.own.start - self.other.start + clocks.lag
        length = self.step * len(self.other.values)
        return max(0.0, begin), min(length, begin + self.step * len(self.own.values))

    def _candidate(self, lags: _Lags, place: int) -> Candidate:
        return Candidate(
            lags.latest - place * self.step,
            lags.skew,
            float(lags.gain[place]),
            turn_between(lags.shared[:, place].reshape(3, 3)) if len(lags.shared) == 9 else np.eye(3),
        )


def independent(own: Transform, other: Transform, size: int, shorter: int) -> float:
    """Bins after which the products of two unrelated recordings are independent (Bartlett 1935), by their transforms.

    M. S. Bartlett, Some aspects of the time-correlation problem in regard to tests of significance, Journal of the
    Royal Statistical Society 98.
    """
    shapes = [fft.irfft(np.sum(np.abs(each) ** 2, axis=0), size)[:shorter] for each in (own, other)]
    if min(float(shape[0]) for shape in shapes) <= 0.0:
        return 1.0
    products = shapes[0] * shapes[1] / (shapes[0][0] * shapes[1][0])
    return max(1.0, float(2.0 * products.sum() - 1.0))


class Correlation(LagSearch):
    """Correlation of the angular rates of a sensor and a reference at every lag, whatever the turn between their axes.

    Parameters
    ----------
    sensor, reference : Course
        Integrated rates, each on its own clock.
    skew : float, optional
        As for `LagSearch`.
    step : float, optional
        Width of the bins, s; the shortest that there is by default.
    """

    def __init__(self, sensor: Course, reference: Course, skew: float | None = 0.0, step: float | None = None) -> None:
        step = step or bin_width(sensor, reference)
        edges = np.arange(sensor.t[0], sensor.t[-1], step)
        fastest = np.linalg.norm(np.diff(sensor.angle_at(edges), axis=0), axis=1) / step
        # Where the reference turns faster than the sensor ever does, a pose is wild.
        most = FASTER * float(fastest.max()) if fastest.size else np.inf
        super().__init__(
            Rates.of(sensor, step), lambda stretch: Rates.of(reference, step / (1.0 - stretch), most), skew
        )


Search = TypeVar("Search", bound=LagSearch)


def widths(shortest: float, length: float) -> list[float]:
    """Give the widths of bins, s, from the shortest one to the longest that leaves enough of them in a `length`, s."""
    octaves = [shortest * 2.0**k for k in range(WIDTHS)]
    return [width for width in octaves if length / width >= LEAST_BINS]


def likeliest_width(searches: Iterable[Search], lag: float | None = None) -> tuple[Search, list[Candidate]] | None:
    """Return the search whose likeliest lag is the likeliest of all, and its peaks; None without any.

    The noise of a reference is one of its poses: in wider bins it is less beside the motion, until the motion itself
    averages out.

    Parameters
    ----------
    searches : iterable of LagSearch
        Over one pair of recordings, in bins of several widths.
    lag : float, optional
        The lag, s, where it is known.
    """
    best: tuple[Search, list[Candidate]] | None = None
    for search in searches:
        peaks = search.peaks() if lag is None else [search.at(lag)]
        if peaks and (best is None or peaks[0].gain > best[1][0].gain):
            best = search, peaks
    return best


class Clocks(Protocol):
    """How a reference's clock goes beside the sensor's: late by `lag`, s, at its first sample, and fast by `skew`."""

    @property
    def lag(self) -> float:
        """Time by which the stamps are late at the first sample, s."""

    @property
    def skew(self) -> float:
        """Rate of the clock over the sensor's, less one."""


def largest_agreement(shared: Array) -> Array:
    """Return the largest trace of R' A over rotations R for each matrix A of products.

    The trace is the largest root of the characteristic polynomial of Davenport's matrix (Shuster and Oh 1981,
    Three-axis attitude determination from vector observations, J. Guidance and Control 4): four real roots, so that
    Newton's method comes down to the largest from above.

    Parameters
    ----------
    shared : (9, k) array
        Matrices, row by row.

    Returns
    -------
    (k,) array
    """
    scale = np.sqrt(np.sum(shared**2, axis=0))
    a = shared / np.maximum(scale, 1e-300)
    minors = np.stack(
        [
            a[i] * a[j] - a[k] * a[n]
            for i, j, k, n in (
                (4, 8, 5, 7),
                (5, 6, 3, 8),
                (3, 7, 4, 6),
                (2, 7, 1, 8),
                (0, 8, 2, 6),
                (1, 6, 0, 7),
                (1, 5, 2, 4),
                (2, 3, 0, 5),
                (0, 4, 1, 3),
            )
        ]
    )
    determinant = np.sum(a[:3] * minors[:3], axis=0)
    constant = 1.0 - 4.0 * np.sum(minors**2, axis=0)
    root = np.full(a.shape[1], np.sqrt(3.0))
    for _ in range(TURNS):
        value = ((root**2 - 2.0) * root - 8.0 * determinant) * root + constant
        slope = (4.0 * root**2 - 4.0) * root - 8.0 * determinant
        root -= np.where(slope > 1e-9, value / np.maximum(slope, 1e-9), 0.0)
    return np.asarray(root * scale)


def turn_between(shared: Array) -> Array:
    """Return the rotation matrix R that makes the trace of R' times a (3, 3) matrix of products largest."""
    u, _, vt = np.linalg.svd(shared)
    turned = u @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(u @ vt)))]) @ vt
    return np.asarray(turned)
