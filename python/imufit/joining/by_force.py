"""Lag and skew of a reference that has positions alone, by the length of the specific force."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.joining.forces import REACH, Forces
from imufit.joining.joined import Compared, RateTrace
from imufit.joining.likeliest import Likeliest, Placed, left_error, likeliest_of
from imufit.joining.refine import Aligned
from imufit.joining.search import LEAST_BINS, USUAL_SKEW, Candidate, LagSearch, likeliest_width, widths

Array = NDArray[np.float64]

WIDTH: Final = 0.05
"""Shortest width of a mean force, s, as for rates: people, vehicles and robots shake slower than 10 Hz."""
LEAST_SAMPLES: Final = 1.0
"""Samples of the slower recording in a width: with fewer, the position between samples is guessed."""
OVERSAMPLED: Final = 4
"""Mean forces in a width by which the lag is refined: neighbours share samples, so that more say nothing new."""
ROUNDS: Final = 10
"""Gauss-Newton steps at most."""
WILD: Final = 5.0
"""Forces this many times as far off as the usual one (median) are left out."""
BLOCK: Final = 8
"""Widths in a block within which errors are taken to depend on one another."""


def likeliest_by_force(
    sensor: Forces, reference: Forces, near: Candidate | None, skew: float | None
) -> Likeliest | None:
    """Find the likeliest alignment of two specific forces.

    Parameters
    ----------
    sensor, reference : Forces
        Of both, each on its own clock.
    near : Candidate or None
        The lag, where it is known.
    skew : float, optional
        Rate of the reference's clock over the sensor's, less one, where it is known.

    Returns
    -------
    Likeliest or None
        None where the recordings are too short, or no lag gives them forces in common.
    """
    best = likeliest_width(
        (_search(sensor, reference, width, skew) for width in _widths(sensor, reference)),
        near.lag if near is not None else None,
    )
    if best is None:
        return None
    search, peaks = best

    def refined(peak: Candidate) -> Placed | None:
        start = replace(peak, lag=near.lag) if near is not None else peak
        return _refined(sensor, reference, search, start, near is not None, skew is not None)

    return likeliest_of(peaks, search, refined)


def _widths(sensor: Forces, reference: Forces) -> list[float]:
    times = sensor.stretches.t, reference.stretches.t
    shortest = max(WIDTH, *(LEAST_SAMPLES * float(np.median(np.diff(t))) for t in times))
    return widths(shortest, min(float(np.ptp(t)) for t in times))


def _search(sensor: Forces, reference: Forces, width: float, skew: float | None) -> LagSearch:
    return LagSearch(sensor.binned(width), lambda stretch: reference.binned(width, stretch), skew)


def _refined(
    sensor: Forces, reference: Forces, search: LagSearch, near: Candidate, lag_known: bool, skew_known: bool
) -> Placed | None:
    """Refine lag and skew by least squares; the reference's length is a constant and a multiple of the sensor's."""
    width = search.step
    start, end = float(reference.stretches.t[0]), float(reference.stretches.t[-1])
    t = np.arange(start + REACH * width, end - REACH * width, width / OVERSAMPLED)
    expected, there = reference.lengths(t, width)
    middle = start if lag_known else 0.5 * (start + end)
    at_middle, rate = near.lag + near.skew * (middle - start), near.skew
    free = np.array([not lag_known, not skew_known, True, True])
    shift = width / 4.0
    kept = there
    left, normal = np.zeros(0), np.eye(4)
    for turn in range(ROUNDS):
        when = t - at_middle - rate * (t - middle)
        length, seen = sensor.lengths(when, width)
        used = kept & seen & sensor.stretches.seen(when - REACH * width - shift, when + REACH * width + shift)
        if used.sum() < LEAST_BINS:
            return None
        later, _ = sensor.lengths(when[used] + shift, width)
        earlier, _ = sensor.lengths(when[used] - shift, width)
        slope = (later - earlier) / (2.0 * shift)
        columns = np.stack([slope, slope * (t[used] - middle), np.ones(int(used.sum())), length[used]], axis=1)
        scale = float(np.polyfit(length[used], expected[used], 1)[0])
        columns[:, :2] *= -scale
        left = expected[used] - columns[:, 2:] @ np.linalg.lstsq(columns[:, 2:], expected[used], rcond=None)[0]
        normal, pull = _equations(columns, left, t[used], BLOCK * width)
        normal[1, 1] += 2.0 / (USUAL_SKEW**2 + rate**2)
        pull[1] -= 2.0 * rate / (USUAL_SKEW**2 + rate**2)
        step = np.zeros(4)
        step[free] = np.linalg.solve(normal[np.ix_(free, free)], pull[free])
        at_middle, rate = at_middle + step[0], rate + step[1]
        if turn in (2, 5):
            off = np.zeros(len(t))
            off[used] = np.abs(left - columns @ step)
            kept = there & (off <= WILD * float(np.median(off[used])))
        elif turn > 6 and abs(step[0]) < 1e-5:
            break
    covariance = np.zeros((4, 4))
    covariance[np.ix_(free, free)] = np.linalg.inv(normal[np.ix_(free, free)])
    to_start = np.array([1.0, start - middle])
    lag_error = float(np.sqrt(max(to_start @ covariance[:2, :2] @ to_start, 0.0)))
    lag = float(at_middle + rate * (start - middle))
    aligned = Aligned(lag, lag_error, float(rate), float(np.sqrt(covariance[1, 1])), np.eye(3), float("nan"), 0)
    correlation = float(np.corrcoef(length[used], expected[used])[0, 1])
    traces = _trace(search, aligned, start, correlation, float(used.sum()) * width / OVERSAMPLED)
    return Placed(aligned, None, traces, left_error(left[:, None]))


def _equations(columns: Array, left: Array, t: Array, block: float) -> tuple[Array, Array]:
    """Return normal equations, weighted by what blocks show (White 1980): errors within a block are not independent."""
    residual = left - columns @ np.linalg.lstsq(columns, left, rcond=None)[0]
    number = np.floor((t - t[0]) / block).astype(int)
    scores = np.stack([np.bincount(number, columns[:, k] * residual) for k in range(4)], axis=1)
    information = columns.T @ columns
    inflated = np.sum(scores[:, 0] ** 2) / max(float(information[0, 0]), 1e-300)
    variance = max(float(inflated), float(np.mean(residual**2)), 1e-12)
    return information / variance, columns.T @ left / variance


def _trace(search: LagSearch, aligned: Aligned, start: float, correlation: float, overlap: float) -> RateTrace:
    def shown(values: Array, known: NDArray[np.bool_]) -> Array:
        return np.where(known, values[:, 0], np.nan)

    own, other = search.own, search.other
    reference_t = other.start + other.step * np.arange(len(other.values), dtype=np.float64)
    return RateTrace(
        sensor_t=own.start + own.step * np.arange(len(own.values), dtype=np.float64),
        sensor=shown(own.values, own.known),
        reference_t=reference_t,
        reference=shown(other.values, other.known),
        aligned_t=aligned.on_sensor_clock(reference_t, start),
        correlation=correlation,
        overlap=overlap,
        compared=Compared.FORCES,
    )
