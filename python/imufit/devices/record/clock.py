"""The device's clock on the host's: a line under the arrivals, since whatever holds rows back only makes them late."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LARGEST_DRIFT: Final = 0.05
"""Drift beyond which the device's seconds are taken as they are: resonators are off by 0.005, RC circuits by 0.03."""
SHORTEST: Final = 0.5
"""Time over which a drift is fitted at least, s."""
FEWEST: Final = 20
"""Reads with rows from which on a drift is fitted."""
LONG_EDGE: Final = 0.1
"""Share of the time of the arrivals that an edge of the hull spans at least, if they keep the device's pace."""
PROMPT: Final = 0.02
"""Delay up to which rows count as prompt in any case, s."""
SAME_CLOCK: Final = 0.5
"""Difference of the offsets of two pieces up to which one clock ran on between them, s."""
CLOSE: Final = 0.1
"""Of a step: what lies between the last row of a clock and the first one of the next at least."""
_AT_ONCE: Final = 65_536  # points of which a hull is made at once: lists of them take eight times their memory


@dataclass(frozen=True)
class ClockFit:
    """How device time becomes time of the host; k pieces.

    Attributes
    ----------
    rate : float
        Seconds of the host per second of the device.
    offsets : (k,) array
        Host's time at 0 of the device's clock, for each piece, s; pieces of one run of the clock have the same.
    fitted : bool
        Whether the rate was fitted; it is 1 where the rows are too few or their arrival has nothing to do with it.
    alien : bool
        Whether the arrivals passed at another pace altogether (`LARGEST_DRIFT`).
    jitter : float
        Standard deviation of the delay beyond the shortest, over the reads, s.
    latest : float
        Largest such delay, s.
    """

    rate: float
    offsets: Array
    fitted: bool
    alien: bool
    jitter: float
    latest: float

    @property
    def drift_ppm(self) -> float | None:
        """How much faster the device's clock runs than the host's, parts per million; None if that was not fitted."""
        return 1e6 * (1.0 / self.rate - 1.0) if self.fitted else None


def lower_hull(x: Array, y: Array) -> tuple[Array, Array]:
    """Lower convex hull of points in the order of x (Andrew's monotone chain, 1979).

    Parameters
    ----------
    x, y : (n,) array
        x ascending.
    """
    if x.size > _AT_ONCE:
        hulls = [lower_hull(x[k : k + _AT_ONCE], y[k : k + _AT_ONCE]) for k in range(0, x.size, _AT_ONCE)]
        x, y = (np.concatenate(corners) for corners in zip(*hulls, strict=True))
    hull: list[tuple[float, float]] = []
    for point in zip(x.tolist(), y.tolist(), strict=True):
        if hull and point[0] == hull[-1][0]:
            if point[1] >= hull[-1][1]:
                continue
            hull.pop()
        while len(hull) > 1:
            (x0, y0), (x1, y1) = hull[-2], hull[-1]
            if (y1 - y0) * (point[0] - x0) < (point[1] - y0) * (x1 - x0):
                break
            hull.pop()
        hull.append(point)
    corners = np.array(hull)
    return corners[:, 0], corners[:, 1]


def common_slope(runs: Sequence[tuple[Array, Array]]) -> float:
    """Slope of the lines under several clouds of points, one line each, that have the least distance to all points.

    The sum of the distances is convex in the slope and has its least value at an edge of a lower hull (for one cloud
    Moon, Skelly and Towsley 1999: the edge over the mean).

    Parameters
    ----------
    runs : sequence of (x, y)
        Points in the order of x.
    """
    hulls = [lower_hull(x, y) for x, y in runs]
    slopes = np.unique(np.concatenate([np.diff(y) / np.diff(x) for x, y in hulls]))
    if not slopes.size:
        return 0.0
    weights = [(x.size, float(x.mean())) for x, _ in runs]

    def height(slope: float) -> float:
        """Sum over the points of the height of their line at their x."""
        pairs = zip(hulls, weights, strict=True)
        return sum(n * (float(np.min(y - slope * x)) + slope * mean) for (x, y), (n, mean) in pairs)

    low, high = 0, slopes.size - 1
    while low < high:  # the heights are concave over the slopes
        middle = (low + high) // 2
        if height(float(slopes[middle])) < height(float(slopes[middle + 1])):
            low = middle + 1
        else:
            high = middle
    return float(slopes[low])


def fit_clock(device: Array, arrival: Array, segment: NDArray[np.int64], start: NDArray[np.uint8]) -> ClockFit:
    """Fit the line: one rate for all pieces, one offset for each run of the device's clock.

    Parameters
    ----------
    device : (n,) array
        Time on the device's clock, s.
    arrival : (n,) array
        When the rows arrived, s; the same for rows that were read together.
    segment : (n,) int array
        Piece of each row, ascending from 0, see `imufit.devices.record.ticks.Unwrapper`.
    start : (n,) array
        Number of the device's start.
    """
    # of rows read together the last one waited least
    last = np.append(np.flatnonzero((np.diff(arrival) != 0.0) | (np.diff(segment) != 0)), device.size - 1)
    x, late, piece = device[last], arrival[last] - device[last], segment[last]
    bounds = np.searchsorted(piece, np.arange(int(piece[-1]) + 2))
    pieces = [slice(a, b) for a, b in pairwise(bounds.tolist())]
    begins = np.searchsorted(segment, np.arange(len(pieces)))
    rate, fitted, alien = _rate(x, late, pieces)
    above = arrival[last] - rate * x
    offsets = np.array([float(above[rows].min()) for rows in pieces])
    runs = _runs(offsets, begins, device, start, rate)
    if len(set(runs)) < len(runs):
        rate, fitted, alien = _rate(x, late, [slice(pieces[a].start, pieces[b].stop) for a, b in _spans(runs)])
        above = arrival[last] - rate * x
        offsets = np.array([float(above[rows].min()) for rows in pieces])
        for a, b in _spans(runs):
            offsets[a : b + 1] = offsets[a : b + 1].min()
    delay = above - offsets[piece]
    return ClockFit(rate, offsets, fitted, alien, float(delay.std()), float(delay.max()))


def _rate(x: Array, late: Array, runs: Sequence[slice]) -> tuple[float, bool, bool]:
    """Rate, whether it was fitted, and whether the arrivals have another pace altogether."""
    spans = [float(np.ptp(x[rows])) for rows in runs]
    if x.size < FEWEST or max(spans) < SHORTEST:
        return 1.0, False, False
    ordered = [np.argsort(x[rows], kind="stable") for rows in runs]
    slope = drift([(x[rows][o], late[rows][o]) for rows, o in zip(runs, ordered, strict=True)])
    if slope is None:
        return 1.0, False, max(spans) > 2.0
    return 1.0 + slope, True, False


def drift(runs: Sequence[tuple[Array, Array]]) -> float | None:
    """Slope of the delay over the device's time, one for all runs of its clock.

    Rows that had piled up before the port was read come late by seconds, and would turn the line: what lies far above
    the longest edge of the hulls is left out of the fit.

    Parameters
    ----------
    runs : sequence of (x, y)
        Device time in ascending order, and arrival less device time, s.

    Returns
    -------
    float or None
        None where no edge of a possible slope is long: the arrivals have another pace.
    """
    longest, rough = 0.0, 0.0
    for x, y in runs:
        corners, heights = lower_hull(x, y)
        widths = np.diff(corners)
        slopes = np.diff(heights) / widths
        widths = np.where(np.abs(slopes) <= LARGEST_DRIFT, widths, 0.0)
        if widths.size and widths.max() > longest:
            longest, rough = float(widths.max()), float(slopes[np.argmax(widths)])
    if longest < LONG_EDGE * max(float(np.ptp(x + y)) for x, y in runs):
        return None
    kept = []
    for x, y in runs:
        above = y - rough * x
        above -= above.min()
        prompt = above <= max(PROMPT, 5.0 * float(np.median(above)))
        kept.append((x[prompt], y[prompt]))
    slope = common_slope(kept)
    return slope if abs(slope) <= LARGEST_DRIFT else rough


def _runs(offsets: Array, begins: NDArray[np.intp], device: Array, start: NDArray[np.uint8], rate: float) -> list[int]:
    """Return the number of the run that each piece belongs to."""
    runs = [0]
    for k in range(1, offsets.size):
        row = int(begins[k])
        step = float(device[row] - device[row - 1])
        same = start[row] == start[row - 1] and step >= 0.0
        same = same and abs(offsets[k] - offsets[k - 1]) < SAME_CLOCK + 0.01 * rate * step
        runs.append(runs[-1] + (not same))
    return runs


def _spans(runs: Sequence[int]) -> list[tuple[int, int]]:
    """First and last piece of each run."""
    ends = np.flatnonzero(np.diff([*runs, runs[-1] + 1]))
    firsts = np.concatenate(([0], ends[:-1] + 1))
    return [(int(a), int(b)) for a, b in zip(firsts, ends, strict=True)]


def typical_step(t: Array) -> float:
    """Median of the steps forward, s; 1 ms where there are none."""
    steps = np.diff(t)
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if steps.size else 1e-3


def spread(t: Array, step: float | None = None) -> Array:
    """Rows that share a stamp spread evenly up to the next stamp, and stamps that go back held: strictly increasing.

    Parameters
    ----------
    t : (n,) array
        Time, s, of a clock that is coarser than the rows.
    step : float, optional
        Usual time between two of its stamps, s; without it their own.
    """
    t = np.maximum.accumulate(t)
    firsts = np.flatnonzero(np.diff(t, prepend=-np.inf))
    if firsts.size == t.size:
        return t
    stamps = t[firsts]
    counts = np.diff(firsts, append=t.size)
    room = np.diff(stamps, append=np.inf)
    room = np.minimum(room, typical_step(stamps) if step is None else step)
    within = np.arange(t.size) - np.repeat(firsts, counts)
    return np.asarray(t + np.repeat(room / counts, counts) * within, dtype=np.float64)


def spread_arrivals(arrival: Array, before: float = -np.inf, step: float | None = None) -> Array:
    """Rows that were read together spread over the time since the read before: for devices without a clock.

    Parameters
    ----------
    arrival : (n,) array
        When the rows arrived, s, ascending.
    before : float
        When the rows before these arrived, s; minus infinity if there are none.
    step : float, optional
        Usual time between two reads, s; without it their own.
    """
    lasts = np.append(np.flatnonzero(np.diff(arrival)), arrival.size - 1)
    counts = np.diff(lasts, prepend=-1)
    reads = arrival[lasts]
    room = np.minimum(np.diff(reads, prepend=before), typical_step(reads) if step is None else step)
    left = np.repeat(lasts, counts) - np.arange(arrival.size)
    return np.asarray(arrival - np.repeat(room / counts, counts) * left, dtype=np.float64)
