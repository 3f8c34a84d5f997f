"""Readings that went over the end of the range and came in again at the other: a number of too few bits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.faults.samples import samples
from imufit.results import fault_words
from imufit.results.data_fault import DataFault

Array = NDArray[np.float64]

BEYOND: Final = 0.8
"""Part of the end of the range from which on an ideal reading may be beyond it, errors of it aside."""
OFF: Final = 1.2
"""Part of the end of the range by which a reading there is off, at least: a wrapped one is by two."""
NEAR: Final = 0.5
"""Part of the end of the range by which such a reading, whole ranges added, may be off; chance brings half of them
there."""
MOST: Final = 0.85
"""Part of the rows so far off that came in again."""
LEAST: Final = 10
"""Rows that chance does not make: of ten, nine are so near once in a hundred times."""
WITHIN: Final = 0.8
"""Part of the end of the range up to which ideal readings show the sensor's scale."""
ALIKE: Final = 0.05
"""Part of the end of the range by which readings may be off alike, by a bias or a mount. Ideal readings that are
smaller do not show the sensor's scale."""


def wrapped_faults(parts: Sequence[Mapping[str, Any]], facts: _imufit.Facts) -> list[DataFault]:
    """Name sensors whose readings wrap around.

    A number of too few bits covers its whole range: the range ends where the largest reading lies.

    Parameters
    ----------
    parts : sequence of dict
        Windows of the log, see `imufit.faults.samples.windows`.
    facts : Facts
        Of the log as declared.
    """
    if not parts:
        return []
    rows = samples(parts, facts)
    found = []
    for sensor in facts.sensors:
        if sensor == "mag":
            continue
        reading, ideal = rows.readings[sensor], rows.ideal[sensor]
        known = np.isfinite(reading) & np.isfinite(ideal)
        if not known.any():
            continue
        reading, ideal = reading[known], ideal[known]
        end = float(np.abs(reading).max())
        inside = np.abs(ideal) < WITHIN * end
        # Of a sensor with an error of scale, what is beyond by several ranges would seem to be somewhere else.
        ideal = ideal * _scale(reading[inside], ideal[inside], ALIKE * end)
        off = ideal - reading
        beyond = (np.abs(ideal) > BEYOND * end) & (np.abs(off) > OFF * end)
        turns = np.round(off / (2.0 * end))
        again = beyond & (np.abs(off - turns * 2.0 * end) < NEAR * end)
        count, wrapped = int(np.count_nonzero(beyond)), int(np.count_nonzero(again))
        if wrapped < LEAST or wrapped < MOST * count:
            continue
        words = fault_words.wrapped(sensor, end, wrapped, count)
        found.append(DataFault("wrapped", sensor, None, facts.t_start, facts.t_end, facts.n, *words, spoils=True))
    return found


def _scale(reading: Array, ideal: Array, alike: float) -> float:
    """Return the scale of a sensor, near 1 where ideal readings are smaller than what all may be off by alike."""
    square, product = float(ideal @ ideal), float(reading @ ideal)
    known = ideal.size * alike**2
    return (product + known) / (square + known) if square + known > 0.0 else 1.0
