"""The likeliest alignment of a sensor and a reference, and how well their rates agree under it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from imufit.joining.course import Course
from imufit.joining.joined import RateTrace
from imufit.joining.refine import Aligned, refine
from imufit.joining.search import (
    Candidate,
    Correlation,
    LagSearch,
    bin_width,
    independent,
    likeliest_width,
    turn_between,
    widths,
)

Array = NDArray[np.float64]

RIVAL: Final = 0.3
"""A second lag with this share of the first one's log likelihood is looked at to a fraction of a sample as well."""
RESOLVED: Final = 0.5
"""Share of the motion's power that bins keep which resolve it: with half of it, two bins stand for a period. Two lags a
period apart are in different bins then."""
SAME: Final = 0.5
"""Two alignments that put one sample of the reference at the same time, to this many bins, are one."""
SURE: Final = 7.0
"""Log odds from which on an alignment is accepted: one in a thousand is wrong. They count against all alignments that
were tried, of unrelated recordings, and against each other one."""


@dataclass(frozen=True, eq=False)
class Placed:
    """An alignment and the rates of both under it.

    Attributes
    ----------
    aligned : Aligned
        Lag, skew, and the mount that makes the mean rates agree best.
    common : CommonRates or None
        The rates of both at the same times; None where something else was compared.
    traces : RateTrace
        The rates and how well they agree.
    left_error : float
        Standard error of the share of the rates (square) that is left, over this share.
    """

    aligned: Aligned
    common: CommonRates | None
    traces: RateTrace
    left_error: float

    def odds(self, other: Placed) -> float:
        """Return the log odds that another alignment leaves more of the rates than this one by more than chance.

        Of a motion that repeats itself both leave the noise alone, and the difference is as much as the noise varies.
        The odds are less than zero if the other one leaves less.

        Q. H. Vuong 1989, Likelihood ratio tests for model selection and non-nested hypotheses, Econometrica 57.
        """
        least = 1e-12
        difference = float(np.log(max(other.traces.left, least) / max(self.traces.left, least)))
        # The other overlap is another sample of the noise.
        samples = 1.0 + self.traces.overlap / max(other.traces.overlap, least)
        variance = max(self.left_error**2 * samples, least)
        return 0.5 * difference * abs(difference) / variance


@dataclass(frozen=True, eq=False)
class Likeliest:
    """The likeliest alignment and the evidence against it.

    Attributes
    ----------
    best : Placed
        The likeliest one.
    second : Placed or None
        Of the others the one against which the odds are least; None if no other comes near.
    search : LagSearch
        Where it was looked for.
    """

    best: Placed
    second: Placed | None
    search: LagSearch

    @property
    def rival(self) -> float:
        """Share of the rates (square) that is left by the best one over that by the second; 0 without one."""
        return 0.0 if self.second is None else self.best.traces.left / self.second.traces.left

    @property
    def ambiguous(self) -> bool:
        """True if two lags make the rates agree equally well, or nearly so for as little as there is."""
        return self.second is not None and self.best.odds(self.second) < SURE

    @property
    def unrelated(self) -> bool:
        """True if one of as many unrelated alignments agrees as well."""
        return 0.5 * self.best.traces.gain / self.search.independent < SURE + float(np.log(self.search.tried))


def likeliest(
    sensor: Course,
    body: Course,
    rates: Correlation,
    skew: float | None = None,
    peaks: Sequence[Candidate] | None = None,
) -> Likeliest | None:
    """Find the likeliest alignment.

    Parameters
    ----------
    sensor, body : Course
        Integrated rates of sensor and reference, each on its own clock.
    rates : Correlation
        Of the two.
    skew : float, optional
        Rate of the reference's clock over the sensor's, less one, where it is known.
    peaks : sequence of Candidate, optional
        The peaks of `rates`, where they are known.

    Returns
    -------
    Likeliest or None
        None where no few seconds are common to both.
    """

    def refined(peak: Candidate) -> Placed | None:
        aligned = refine(sensor, body, peak, skew is not None)
        return None if aligned is None else placed(sensor, body, rates, aligned)

    return likeliest_of(peaks or rates.peaks(), rates, refined)


def likeliest_of_all_widths(sensor: Course, body: Course, skew: float | None) -> Likeliest | None:
    """Find the likeliest alignment in bins of the width that shows it best; arguments as for `likeliest`."""
    shortest = bin_width(sensor, body)
    length = min(float(course.t[-1] - course.t[0]) for course in (sensor, body))
    searches: list[Correlation] = []
    for width in widths(shortest, length):
        search = Correlation(sensor, body, skew, width)
        if searches and search.own.power < RESOLVED * searches[0].own.power:
            break
        searches.append(search)
    best = likeliest_width(searches)
    if best is None:
        return None
    chosen, peaks = best
    # Narrower bins show each lag more closely, as refining needs it.
    for wider, narrower in pairwise(searches[searches.index(chosen) :: -1]):
        peaks = [replace(narrower.near(wider, peak), gain=peak.gain) for peak in peaks]
    return likeliest(sensor, body, chosen, skew, peaks=peaks)


def likeliest_of(
    peaks: Sequence[Candidate], search: LagSearch, refined: Callable[[Candidate], Placed | None]
) -> Likeliest | None:
    """Refine the peaks of a search, the likeliest first, and return the likeliest alignment."""
    found: list[Placed] = []
    for peak in peaks:
        each = refined(peak) if peak.gain >= RIVAL * peaks[0].gain else None
        if each is not None and not any(search.meet(each.aligned, other.aligned, SAME) for other in found):
            found.append(each)
    if not found:
        return None
    best, *others = sorted(found, key=lambda each: -each.traces.gain)
    return Likeliest(best, min(others, key=best.odds, default=None), search)


def left_error(left: Array) -> float:
    """Return the standard error of the mean square of what is left, (k, c), over it; infinite without any.

    The squares of a normal process are correlated by the square of its own correlation (Isserlis 1918, On a formula for
    the product-moment coefficient of any order of a normal frequency distribution in any number of variables,
    Biometrika 12).
    """
    squares = np.sum(left**2, axis=1)
    if not squares.any():
        return float("inf")
    size = 2 * fft.next_fast_len(len(left), real=True)
    spectrum = fft.rfft(left.T, size)
    spread = float(np.var(squares) / np.mean(squares) ** 2)
    return float(np.sqrt(spread * independent(spectrum, spectrum, size, len(left)) / len(left)))


@dataclass(frozen=True, eq=False)
class CommonRates:
    """Mean rates of sensor and reference in the bins that both have, each less its mean.

    Attributes
    ----------
    measured : (k, 3) array
        Of the sensor, rad/s, its axes.
    expected : (k, 3) array
        Of the reference, rad/s, axes of its body.
    change : (k, 3) array
        Time derivative of the latter, rad/s^2.
    since : (k,) array
        Middles of these bins after the reference's first sample, s, on its clock.
    middle : (m,) array
        Middle of each of the reference's bins, s, on its clock.
    overlap : float
        Length of the common bins, s.
    """

    measured: Array
    expected: Array
    change: Array
    since: Array
    middle: Array
    overlap: float

    @classmethod
    def of(cls, sensor: Course, body: Course, rates: LagSearch, aligned: Aligned) -> CommonRates:
        """Take the means over the same times of both under an alignment."""
        other, step = rates.other, rates.step
        edges = other.start + step * np.arange(len(other.values) + 1, dtype=np.float64)
        on_sensor = aligned.on_sensor_clock(edges, float(body.t[0]))
        known = other.known & sensor.seen(on_sensor[:-1], on_sensor[1:])
        inside = np.clip(on_sensor, sensor.t[0], sensor.t[-1])
        measured = np.diff(sensor.angle_at(inside), axis=0) / np.diff(on_sensor)[:, None]
        middle = 0.5 * (edges[1:] + edges[:-1])
        if known.sum() > 2:
            change = np.gradient(other.values, step, axis=0)[known]
            since = middle[known] - float(body.t[0])
            measured, expected = (each - each.mean(axis=0) for each in (measured[known], other.values[known]))
        else:
            measured = expected = change = np.zeros((0, 3))
            since = np.zeros(0)
        return cls(measured, expected, change, since, middle, float(known.sum() * step))

    def mount(self) -> Array:
        """Turn from the reference body's axes to the sensor's that makes the rates agree best, (3, 3)."""
        return turn_between(self.measured.T @ self.expected)

    def left(self, mount: Array) -> Array:
        """Return what a mount and the scale that fits best leave of the rates, (k, 3), rad/s."""
        expected = self.expected @ mount.T
        scale = np.sum(self.measured * expected) / max(float(np.sum(expected**2)), 1e-300)
        return np.asarray(self.measured - scale * expected)

    def correlation(self, mount: Array) -> float:
        """Correlation of the rates, axis by axis, with a mount; 0 where nothing moves."""
        size = np.sqrt(np.sum(self.measured**2) * np.sum(self.expected**2))
        return float(np.sum(self.measured * (self.expected @ mount.T)) / size) if size > 0.0 else 0.0


def placed(sensor: Course, body: Course, rates: LagSearch, aligned: Aligned) -> Placed:
    """Return an alignment with the mount that makes the mean rates agree best, and these rates."""
    own, other, step = rates.own, rates.other, rates.step
    common = CommonRates.of(sensor, body, rates, aligned)
    mount = common.mount() if len(common.measured) else aligned.mount
    own_middle = own.start + step * (np.arange(len(own.values), dtype=np.float64) + 0.5)
    traces = RateTrace(
        sensor_t=own_middle,
        sensor=np.where(own.known, np.linalg.norm(own.values, axis=1), np.nan),
        reference_t=common.middle,
        reference=np.where(other.known, np.linalg.norm(other.values, axis=1), np.nan),
        aligned_t=aligned.on_sensor_clock(common.middle, float(body.t[0])),
        correlation=common.correlation(mount),
        overlap=common.overlap,
    )
    return Placed(replace(aligned, mount=mount), common, traces, left_error(common.left(mount)))
