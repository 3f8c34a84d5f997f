"""Where a sensor's range ends, for a log that does not say so.

A reading beyond the range is cut off: it stands at the end, bit for bit the same from row to row, while the other
axes go on, and it comes there or leaves with a jump. Each part is needed, for a reading stands still at its largest
value for other reasons too:

- a sensor at rest, or turning evenly, whose noise is below its resolution: its other axes stand as well
- the flat top of a slow swing between two steps of the resolution: the rows around it lead up to it and not beyond
- a column that is held until the next sample comes: all axes stand together
- a column of zeros, or a constant one: there is nothing to come from

An axis counts as clipped at the largest value of the log, of one sign, where

- that stands in at least `ROWS` consecutive rows while another axis changes from each of at least `ROWS` samples to the
  next, by more than `STEPS` steps of the resolution and a thousandth of the value in all, and where the rows before and
  after show that the value went on: one differs by more than `WINDOW` of it, or by `STEPS` steps while the parabola
  through two rows on either side passes `BEYOND` of the value above it; or
- readings pile up there: at least `PILE` of them, more than within the next `WINDOW` of the value below, most of them
  peaks of one or two rows that stand out by more than a thousandth and a step. So short blows show.

Below 1.5 times gravity and 1 rad/s, less than any common range, nothing counts.

Readings that were mixed across axes afterwards (a correction of misalignment) are no longer the same from row to row:
then the range has to be given.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.log import Log

Array = NDArray[np.float64]

ROWS: Final = 3
STEPS: Final = 8
PILE: Final = 10
WINDOW: Final = 0.05
BEYOND: Final = 0.003
_LEAST_IN_GRAVITY: Final = 1.5
_LEAST_RATE: Final = 1.0


def ranges(log: Log) -> dict[str, float]:
    """Find where the ranges of a log's sensors end: the rules ``acc_range`` (m/s^2) and ``gyr_range`` (rad/s).

    The metadata under these names come first, then the readings; if neither determines a range, the entry is missing.

    Parameters
    ----------
    log : Log
        The log.
    """
    least = {"acc": _LEAST_IN_GRAVITY * log.metadata.gravity, "gyr": _LEAST_RATE}
    found = {}
    for sensor, smallest in least.items():
        column = getattr(log, sensor)
        end = log.metadata.ranges.get(sensor)
        if end is None and column is not None:
            end = end_of_range(column, smallest)
        if end is not None:
            found[f"{sensor}_range"] = end
    return found


def end_of_range(column: Array, least: float) -> float | None:
    """Find the value at which a sensor's readings are cut off, by the rule at the head of this module.

    Parameters
    ----------
    column : (n, 3) array
        Readings of one sensor.
    least : float
        Smallest end that counts, in the unit of the readings.

    Returns
    -------
    float or None
        The smallest of the ends that were found on any axis; None where nothing is cut off.
    """
    largest = [(axis, sign, _largest(sign * column[:, axis])) for axis in range(3) for sign in (1.0, -1.0)]
    step: float | None = None
    ends = []
    for axis, sign, end in largest:
        if end < least:
            continue
        values = sign * column[:, axis]
        runs = _runs(values == end)
        long = runs[runs[:, 1] - runs[:, 0] >= ROWS]
        piled = _is_many(values, runs, end)
        if (len(long) or piled) and step is None:
            step = _resolution(column)
        step_here = step or 0.0
        if (piled and _are_peaks(values, runs, end, step_here)) or any(
            _is_cut(column, axis, span, end, step_here) for span in long
        ):
            ends.append(end)
    return min(ends, default=None)


def _largest(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else -math.inf


def _runs(at_end: NDArray[np.bool_]) -> NDArray[np.intp]:
    """First row and row after the last of each stretch of true rows, (k, 2)."""
    return np.flatnonzero(np.diff(at_end, prepend=False, append=False)).reshape(-1, 2)


def _resolution(column: Array) -> float:
    """Smallest step between consecutive readings of any axis."""
    steps = np.abs(np.diff(column, axis=0))
    steps = steps[np.isfinite(steps) & (steps > 0.0)]
    return float(steps.min()) if steps.size else 0.0


def _is_cut(column: Array, axis: int, span: NDArray[np.intp], end: float, step: float) -> bool:
    start, stop = span
    others = np.delete(column[start:stop], axis, axis=1)
    if not np.isfinite(others).all():
        return False
    changes = (np.diff(others, axis=0) != 0.0).any(axis=1)
    moved = np.ptp(others, axis=0).max() > max(STEPS * step, 1e-3 * end)
    return bool(np.count_nonzero(changes) >= ROWS - 1 and moved and _goes_beyond(column[:, axis], start, stop, step))


def _goes_beyond(values: Array, start: int, stop: int, step: float) -> bool:
    """Whether the rows around those from `start` to `stop` show that the true top is above them."""
    if start < 2 or stop + 2 > len(values):
        return False
    end = abs(values[start])
    outer, inner = np.abs(values[[start - 2, stop + 1]]).mean(), np.abs(values[[start - 1, stop]])
    jump = end - inner.min()
    # The parabola through two rows on either side has its top in the middle.
    near, far = 0.5 * (stop - start) + 0.5, 0.5 * (stop - start) + 1.5
    top = inner.mean() + (inner.mean() - outer) * near**2 / (far**2 - near**2)
    smallest = STEPS * step
    return bool(jump > max(smallest, WINDOW * end) or (jump > smallest and top - end > max(smallest, BEYOND * end)))


def _is_many(values: Array, runs: NDArray[np.intp], end: float) -> bool:
    count = (runs[:, 1] - runs[:, 0]).sum()
    return bool(count >= PILE and np.count_nonzero(values > (1.0 - WINDOW) * end) < 2 * count)


def _are_peaks(values: Array, runs: NDArray[np.intp], end: float, step: float) -> bool:
    before, after = values[np.maximum(runs[:, 0] - 1, 0)], values[np.minimum(runs[:, 1], len(values) - 1)]
    # Noise makes a reading flicker between two steps of the resolution.
    below = min((1.0 - 1e-3) * end, end - 1.5 * step)
    peaks = (runs[:, 1] - runs[:, 0] < ROWS) & (np.maximum(before, after) < below)
    return bool(2 * np.count_nonzero(peaks) > len(runs))
