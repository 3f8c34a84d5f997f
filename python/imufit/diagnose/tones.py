"""A tone in a residual: an oscillation of one frequency, too fast for the means of blocks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEWEST_ROWS = 1000
"""Fewer tell no tone from noise."""
SLOWEST = 24
"""Periods in the log; the means of blocks show slower swings."""
AROUND = ((64, 10), (256, 40), (1024, 160))
"""To which line of the spectrum on each side how many lines tell the noise around: few where it still rises steeply."""


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
