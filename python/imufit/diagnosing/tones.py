"""A tone in a residual, steady or moving: an oscillation too fast for the means of blocks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtrc

Array = NDArray[np.float64]

FEWEST_ROWS = 1000
"""Fewer do not separate a tone from noise."""
SLOWEST = 24
"""Periods in the log; the means of blocks show slower swings."""
AROUND = ((64, 10), (256, 40), (1024, 160))
"""Lines of the spectrum on each side that estimate the noise, up to which line: few where it still rises steeply."""

STRETCH = 256
"""Samples of a stretch within which a moving tone counts as steady: at 200 Hz one that crosses the spectrum in a minute
moves by a line."""
LOWEST = 6
"""Lines of a stretch below which its slow course is seen, not a tone."""
BESIDE = 10
"""Lines on each side that show the noise around a line of a stretch."""
RARE = 1e-3
"""Probability below which noise seldom makes a line as high as the highest of a stretch."""


def moving(t: Array, residual: Array) -> tuple[tuple[float, float], float, float] | None:
    """Find a tone whose frequency changes: a line in most stretches of the residual, each where it pleases.

    Parameters
    ----------
    t, residual : ndarray
        (n,) time stamps, s, and residual; NaN where there is none.

    Returns
    -------
    tuple of tuple of float, float and float or None
        Frequencies of the first and of the last stretch, Hz, mean square, and the p-value of so many lines; None if
        there are too few samples, or a line stands in less than half of the stretches.
    """
    from scipy.ndimage import median_filter  # noqa: PLC0415  only needed here

    known = np.isfinite(residual)
    t, residual = t[known], residual[known]
    stretches = len(t) // STRETCH
    if len(t) < FEWEST_ROWS:
        return None
    taper = np.hanning(STRETCH)
    parts = residual[: stretches * STRETCH].reshape(stretches, STRETCH)
    power = np.abs(np.fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * taper)) ** 2
    floor = median_filter(power, (1, 2 * BESIDE + 1)) / np.log(2.0)
    ratio = (power / np.maximum(floor, np.finfo(float).tiny))[:, LOWEST:-2]
    # A crest of the spectrum that stands in all stretches alike is the colour of the noise.
    ratio /= np.maximum(np.median(ratio, axis=0) / np.log(2.0), 1.0)
    line = LOWEST + ratio.argmax(axis=1)
    seen = ratio.shape[1] * np.exp(-ratio.max(axis=1)) < RARE
    if 2 * np.count_nonzero(seen) < stretches:
        return None
    lobe = line[:, None] + np.arange(-2, 3)
    above = np.take_along_axis(power - floor, lobe, axis=1).sum(axis=1)
    square = 2.0 * float(np.mean(above * seen)) / (STRETCH * float(np.sum(taper**2)))
    frequency = line[seen] / (STRETCH * float(np.median(np.diff(t))))
    return (frequency[0], frequency[-1]), square, float(bdtrc(np.count_nonzero(seen) - 1, stretches, RARE))


def strongest(t: Array, residual: Array) -> tuple[float, float, float] | None:
    """Find the strongest tone of a residual.

    Parameters
    ----------
    t, residual : ndarray
        (n,) time stamps, s, and residual; NaN where there is none.

    Returns
    -------
    tuple of float or None
        Frequency, Hz, mean square, and the p-value among all frequencies; None if there are too few samples.
    """
    from scipy.ndimage import median_filter  # noqa: PLC0415  only needed here

    known = np.isfinite(residual)
    t, residual = t[known], residual[known]
    if len(t) < FEWEST_ROWS:
        return None
    dt = float(np.median(np.diff(t)))
    place = np.rint((t - t[0]) / dt).astype(int)
    places = int(place[-1]) + 1
    if places > 2 * len(t):
        return None
    even = np.zeros(places)
    even[place] = residual - residual.mean()
    # Without a taper a slow walk would leak into everything.
    taper = np.hanning(places)
    power = np.abs(np.fft.rfft(even * taper)) ** 2
    floor = np.empty_like(power)
    first = 0
    for last, lines in AROUND:
        floor[first:last] = median_filter(power[: last + lines], 2 * lines + 1)[first:last]
        first = last
    floor[first:] = median_filter(power, 2 * AROUND[-1][1] + 1)[first:]
    # The last lines have no lobe of their own.
    low, high = SLOWEST, len(power) - 3
    ratio = np.log(2.0) * power[low:high] / np.maximum(floor[low:high], np.finfo(float).tiny)
    at = int(np.argmax(ratio))
    line = low + at
    # A tone's power lies within the lobe of the taper.
    lobe = slice(line - 2, line + 3)
    square = 2.0 * float(np.sum(power[lobe] - floor[lobe] / np.log(2.0))) / (len(t) * float(np.sum(taper**2)))
    return line / (places * dt), square, float(min((high - low) * np.exp(-ratio[at]), 1.0))
