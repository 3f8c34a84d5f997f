"""Figures of merit of a tilt: what paper B's Tables 3 to 5 say in numbers and in words, each with its definition.

An error here is (n, k): one component about a rig's axis or two of an inclination. Every figure is that of the error as
a vector, the root of the sum of squares over the components. All times are s, all angles rad; results are in degrees.

======================  ====================================================================================
rmse, offset            root mean square and mean over all counted rows
sd                      about the mean of each rest, pooled over the rests (paper B, Table 4)
sd_moving               about the mean over the rows in motion
drift                   Theil-Sen slope of the rests' means where there are eight rests or more; with fewer the median
                        of the slopes within the rests, each weighted by the cube of its length, which is the
                        information it has; without rests the median, without sign, of the slopes of the log's
                        minutes
noise_density           root of the one-sided power spectral density at rest (Welch, 128 rows, Hann window, straight
                        line taken off), averaged from a tenth of the Nyquist frequency up to it. For white noise this
                        is ``sd sqrt(2 dt)``
settling                from the end of a move until the error, averaged over a quarter second, stays within the band
                        about its median over the last quarter of the rest, which ends with the first vibration; median
                        over the moves. A method that drifts without bound has the straight line of that rest taken
                        off first
vibration               root mean square, over the vibrating rows, of the departure from the mean of the second before;
                        for a method that drifts without bound, from the straight line through that second
======================  ====================================================================================

Of each rest the first half, at most `SETTLE` seconds, is left to the methods to settle and is not counted in sd, drift
and noise density; nor are vibrations and the two seconds after one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from imufit.replaying.stretches import Rest, Stretches
from imufit.results.tilt import TiltFigures

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SETTLE = 30.0
"""Longest part of a rest that is left to the methods to settle, s."""
SETTLING_REST = 2.0
"""A move counts for the settling time if this much rest follows, s."""
SMOOTHING = 0.25
"""Width of the running mean in which settling is judged, s."""
NOISE_BAND = (0.1, 1.0)
"""Band of the noise density over the Nyquist frequency."""

_AFTER_VIBRATION = 2.0
_BEFORE_VIBRATION = 1.0
_LEAST_BEFORE = 8
_WELCH_ROWS = 128
_LEAST_WELCH_ROWS = 32
_MANY_RESTS = 8
_MARGIN = 5.0
_UNSETTLED = 0.7


def figures_of_merit(
    t: Array,
    error: Array,
    stretches: Stretches,
    counted: Mask | None = None,
    band_deg: float = 0.1,
    by_force: Array | None = None,
    bounded: bool = True,
) -> TiltFigures | None:
    """Judge one method by the error of its tilt.

    Parameters
    ----------
    t : (n,) array
        Time, s.
    error : (n, k) array
        Estimate less reference, rad; NaN where either is missing.
    stretches : Stretches
        Rests, moves and vibrations of the log.
    counted : (n,) array of bool, optional
        Rows for RMSE and offset; without it all.
    band_deg : float
        Half width of the band of the settling time, deg. A method that is noisier than that even at rest has five
        times the standard deviation of its smoothed error as its band.
    by_force : (n, k) array, optional
        Error of the tilt that the specific force alone shows, rad: the vibration gain is relative to it.
    bounded : bool
        Whether the method holds on to gravity; one that only integrates has no value to settle at, but a line.

    Returns
    -------
    TiltFigures or None
        None where the error has no finite row.
    """
    known: Mask = np.asarray(np.isfinite(error).all(axis=1))
    rows = known if counted is None else known & counted
    if not rows.any():
        return None
    quiet = _quiet_rows(t, known, stretches)
    drift = _drift(t, error, quiet, known)
    mean = error[rows].mean(axis=0)
    calm = [_before_vibration(rest, stretches) for rest in stretches.moves]
    settling = [found for rows in calm if (found := _settling(t, error, rows, band_deg, bounded)) is not None]
    swing = _swing(t, error, stretches, bounded)
    force_swing = None if by_force is None else _swing(t, by_force, stretches, True)
    moving = known & stretches.moving
    return TiltFigures(
        rmse_deg=_degrees(np.sqrt(np.mean(np.sum(error[rows] ** 2, axis=1)))),
        offset_deg=_degrees(_signed(mean)),
        sd_deg=_deviation([error[part] for part in quiet]),
        sd_moving_deg=_deviation([error[moving]]),
        drift_deg_per_min=_degrees(60.0 * _signed(drift)),
        noise_density_deg=_noise_density(t, error, quiet),
        settling_s=float(np.median([time for time, _ in settling])) if settling else None,
        settling_moves=len(settling),
        settling_unfinished=sum(unfinished for _, unfinished in settling),
        vibration_deg=None if swing is None else _degrees(swing),
        vibration_gain=swing / force_swing if swing is not None and force_swing else None,
    )


def noise_band(t: Array) -> tuple[float, float] | None:
    """Band over which the noise density is averaged, Hz; None for fewer than two rows.

    Parameters
    ----------
    t : (n,) array
        Times of the rows with an error, s.
    """
    if t.size < 2:
        return None
    nyquist = 0.5 / float(np.median(np.diff(t)))
    return NOISE_BAND[0] * nyquist, NOISE_BAND[1] * nyquist


def _quiet_rows(t: Array, known: Mask, stretches: Stretches) -> list[NDArray[np.intp]]:
    """Rows of each rest after the time to settle, without vibrations: contiguous parts."""
    shaken = np.zeros(t.size, np.bool_)
    for start, stop in stretches.vibrations:
        shaken[start : np.searchsorted(t, t[stop - 1] + _AFTER_VIBRATION)] = True
    parts: list[NDArray[np.intp]] = []
    for rest in stretches.rests:
        length = t[rest.stop - 1] - t[rest.start]
        begin = int(np.searchsorted(t, t[rest.start] + min(0.5 * length, SETTLE)))
        rows = np.arange(begin, rest.stop)
        rows = rows[known[rows] | shaken[rows]]
        for part in np.split(rows, np.flatnonzero(np.diff(shaken[rows].astype(np.int8))) + 1) if rows.size else []:
            if part.size >= 8 and not shaken[part[0]]:
                parts.append(part)
    return parts


def _deviation(parts: Sequence[Array]) -> float | None:
    """Pool the standard deviation about the mean of each part, deg."""
    kept = [part for part in parts if len(part) > 1]
    freedom = sum(len(part) - 1 for part in kept)
    if not freedom:
        return None
    return _degrees(np.sqrt(sum(float(np.sum((part - part.mean(axis=0)) ** 2)) for part in kept) / freedom))


def _drift(t: Array, error: Array, quiet: Sequence[NDArray[np.intp]], known: Mask) -> Array:
    """Slope of each component, rad/s."""
    axes = range(error.shape[1])
    if len(quiet) >= _MANY_RESTS:
        times = np.array([t[part].mean() for part in quiet])
        means = np.array([error[part].mean(axis=0) for part in quiet])
        return np.array([_slope(times, means[:, axis], len(quiet)) for axis in axes])
    parts = list(quiet) or _minutes(t, np.flatnonzero(known))
    slopes = np.array([[_slope(t[part], error[part, axis]) for axis in axes] for part in parts])
    if not quiet:
        return np.asarray(np.median(np.abs(slopes), axis=0))
    weights = np.array([(t[part[-1]] - t[part[0]]) ** 3 for part in parts])
    return np.array([_weighted_median(slopes[:, axis], weights) for axis in axes])


def _minutes(t: Array, rows: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Rows of each whole minute that has some; of a log that is shorter than two, all rows."""
    since = t[rows] - t[rows[0]]
    minute = np.minimum(since // 60.0, max(0.0, since[-1] // 60.0 - 1.0))
    return np.split(rows, np.flatnonzero(np.diff(minute)) + 1)


def _slope(t: Array, values: Array, blocks: int = 60) -> float:
    """Theil-Sen slope of the means of so many blocks."""
    if t.size < 3:
        return 0.0
    edges = np.linspace(0, t.size, min(blocks, t.size) + 1).astype(np.intp)
    counts = np.diff(edges)
    times, means = (np.add.reduceat(each, edges[:-1]) / counts for each in (t - t[0], values))
    first, second = np.triu_indices(counts.size, 1)
    return float(np.median((means[second] - means[first]) / (times[second] - times[first])))


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values)
    reached = np.cumsum(weights[order])
    if reached[-1] <= 0.0:
        return float(np.median(values))
    return float(values[order][int(np.searchsorted(reached, 0.5 * reached[-1]))])


def _noise_density(t: Array, error: Array, quiet: Sequence[NDArray[np.intp]]) -> float | None:
    """Root of the mean power spectral density over the band, deg/sqrt(Hz)."""
    parts = [part for part in quiet if part.size >= _LEAST_WELCH_ROWS]
    if not parts:
        return None
    total, weight = 0.0, 0.0
    for part in parts:
        rate = (part.size - 1) / float(t[part[-1]] - t[part[0]])
        frequency, power = _spectrum(error[part], rate)
        nyquist = 0.5 * rate
        inside = (frequency >= NOISE_BAND[0] * nyquist) & (frequency < NOISE_BAND[1] * nyquist)
        total += part.size * float(np.sum(power[inside], axis=1).mean())
        weight += part.size
    return _degrees(math.sqrt(total / weight))


def _spectrum(values: Array, rate: float) -> tuple[Array, Array]:
    """One-sided power spectral density of (n, k) values: frequencies (m,) and densities (m, k).

    Welch's method with half overlapping windows, all of them in one transform.
    """
    rows = min(_WELCH_ROWS, len(values))
    parts = sliding_window_view(values, rows, axis=0)[:: rows // 2]
    taper = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(rows) / rows)  # Hann
    power = np.abs(np.fft.rfft(_without_line(parts) * taper, axis=-1)) ** 2
    scale = 2.0 / (rate * float(np.sum(taper**2)))
    return np.asarray(np.fft.rfftfreq(rows, 1.0 / rate)), np.asarray(scale * power.mean(axis=0).T, dtype=np.float64)


def _without_line(values: Array) -> Array:
    """Values less their straight line by least squares along the last axis."""
    place = np.arange(values.shape[-1]) - 0.5 * (values.shape[-1] - 1)
    level = values - values.mean(axis=-1, keepdims=True)
    return np.asarray(level - (level @ place)[..., None] * (place / float(place @ place)))


def _before_vibration(rest: Rest, stretches: Stretches) -> tuple[int, int]:
    """Rows of a rest up to its first vibration."""
    shaken = [start for start, _ in stretches.vibrations if rest.start <= start < rest.stop]
    return rest.start, min([rest.stop, *shaken])


def _settling(
    t: Array, error: Array, calm: tuple[int, int], band_deg: float, bounded: bool
) -> tuple[float, bool] | None:
    """Time to settle after one move and whether the rest was too short to determine it; None without enough rest."""
    start, stop = calm
    rows = np.arange(start, stop)
    rows = rows[np.isfinite(error[rows]).all(axis=1)]
    length = float(t[stop - 1] - t[start])
    if length < SETTLING_REST or rows.size < 16:
        return None
    since = t[rows] - t[start]
    width = max(3, round(SMOOTHING * (rows.size - 1) / (since[-1] - since[0])))
    values = error[rows] if bounded else _without_line(error[rows].T).T
    smooth = _running_mean(values, width)
    last = smooth[since >= 0.75 * length]
    if len(last) < 4:
        return None
    departure = np.linalg.norm(smooth - np.median(last, axis=0), axis=1)
    spread = float(np.sqrt(np.sum(np.var(_without_line(last.T), axis=1))))
    outside = np.flatnonzero(departure > max(np.radians(band_deg), _MARGIN * spread))
    if not outside.size:
        return 0.0, False
    at = min(int(outside[-1]) + 1, rows.size - 1)
    return float(since[at]), bool(since[at] > _UNSETTLED * length)


def _running_mean(values: Array, width: int) -> Array:
    """Centred running mean (n, k); at the ends over what there is of the window."""
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    index = np.arange(len(values))
    first, last = np.maximum(index - width // 2, 0), np.minimum(index + width // 2 + 1, len(values))
    return np.asarray((sums[last] - sums[first]) / (last - first)[:, None])


def _swing(t: Array, error: Array, stretches: Stretches, bounded: bool) -> float | None:
    """Root mean square departure during vibrations, rad; None without any."""
    total, count = 0.0, 0
    known: Mask = np.asarray(np.isfinite(error).all(axis=1))
    for start, stop in stretches.vibrations:
        rest = next(rest for rest in stretches.rests if rest.start <= start < rest.stop)
        begin = max(rest.start, int(np.searchsorted(t, t[start] - _BEFORE_VIBRATION)))
        rows = start + np.flatnonzero(known[start:stop])
        before = begin + np.flatnonzero(known[begin:start])
        if not rows.size:
            continue
        level: Array = np.median(error[rows], axis=0)
        if before.size >= _LEAST_BEFORE:
            level = error[before].mean(axis=0)
            if not bounded:
                ago = t[before] - t[before].mean()
                slope = ago @ error[before] / float(ago @ ago)
                level = level + (t[rows] - t[before].mean())[:, None] * slope
        total += float(np.sum((error[rows] - level) ** 2))
        count += rows.size
    return math.sqrt(total / count) if count else None


def _signed(values: Array) -> float:
    """One component as it is, several by their length."""
    return float(values[0]) if values.size == 1 else float(np.linalg.norm(values))


def _degrees(angle: float) -> float:
    return math.degrees(float(angle))
