"""Where a sensor's range ends, for a log that does not say so.

A reading beyond the range is cut off: it stands at the end, bit for bit the same from row to row, while the other
axes go on, and it comes there or leaves with a jump. Each part is needed, for a reading stands still at its largest
value for other reasons too:

- a sensor at rest, or turning evenly, whose noise is below its resolution: its other axes stand as well
- the flat top of a slow swing between two steps of the resolution: it is reached step by step
- a column that is held until the next sample comes: all axes stand together
- a column of zeros, or a constant one: there is nothing to come from

An axis counts as clipped at the largest value of the log, of one sign, where that stands in at least `ROWS` consecutive
rows while another axis changes from each of at least `ROWS` samples to the next, by more than `STEPS` steps of the
resolution and a thousandth of the value in all, and where the row before or after differs by more than `STEPS` steps.
Below 1.5 times gravity and 1 rad/s, less than any common range, nothing counts.

Readings that were mixed across axes afterwards (a correction of misalignment) are no longer the same from row to row:
then the range has to be given.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log import Log

Array = NDArray[np.float64]

ROWS: Final = 3
STEPS: Final = 8
_LEAST_IN_GRAVITY: Final = 1.5
_LEAST_RATE: Final = 1.0


def ranges(log: Log) -> dict[str, float]:
    """Find where the ranges of a log's sensors end: the rules ``acc_range`` (m/s^2) and ``gyr_range`` (rad/s).

    What the metadata say under these names comes first, then what the readings show; where neither tells, there is no
    entry.

    Parameters
    ----------
    log : Log
        The log.

    Raises
    ------
    InputError
        The metadata name a range that is no positive number.
    """
    least = {"acc": _LEAST_IN_GRAVITY * log.metadata.gravity, "gyr": _LEAST_RATE}
    found = {}
    for sensor, smallest in least.items():
        known = log.metadata.extra.get(f"{sensor}_range")
        column = getattr(log, sensor)
        end = _checked(f"{sensor}_range", known, log) if known is not None else None
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
    possible = [(axis, sign, end) for axis, sign, end in largest if end >= least]
    runs = [(axis, end, _runs(sign * column[:, axis] == end)) for axis, sign, end in possible]
    if not any(len(spans) for _, _, spans in runs):
        return None
    step = _resolution(column)
    ends = [end for axis, end, spans in runs if any(_is_cut(column, axis, span, end, step) for span in spans)]
    return min(ends, default=None)


def _largest(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.max()) if finite.size else -math.inf


def _runs(at_end: NDArray[np.bool_]) -> NDArray[np.intp]:
    """First row and row after the last of each stretch of at least `ROWS` true rows, (k, 2)."""
    edges = np.flatnonzero(np.diff(at_end, prepend=False, append=False)).reshape(-1, 2)
    return edges[edges[:, 1] - edges[:, 0] >= ROWS]


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
    around = [abs(abs(column[row, axis]) - end) for row in (start - 1, stop) if 0 <= row < len(column)]
    return bool(np.count_nonzero(changes) >= ROWS - 1 and moved and any(jump > STEPS * step for jump in around))


def _checked(name: str, value: object, log: Log) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not (math.isfinite(value) and value > 0.0):
        raise InputError(
            f"metadata {name} is {value!r}, which is no end of a range",
            file=log.path,
            column=name,
            remedy="Write a positive number in m/s^2 (acc) or rad/s (gyr), or leave it out.",
        )
    return float(value)
