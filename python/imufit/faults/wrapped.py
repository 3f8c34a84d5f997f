"""Readings that went over the end of the range and came in again at the other: a number of too few bits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from imufit import _imufit
from imufit.faults.samples import samples
from imufit.results import fault_words
from imufit.results.data_fault import DataFault

BEYOND: Final = 1.05
"""Part of the end of the range from which on an ideal reading is beyond it, scale errors and noise aside."""
NEAR: Final = 0.1
"""Part of the whole range by which a reading that came in again may differ from the ideal one less the range."""
MOST: Final = 0.8
"""Part of the rows beyond the range that came in again; the others lie about the end itself."""
LEAST: Final = 5
"""Rows that chance does not make."""


def wrapped_faults(
    parts: Sequence[Mapping[str, Any]], facts: _imufit.Facts, ends: Mapping[str, float]
) -> list[DataFault]:
    """Name sensors whose readings wrap around.

    Parameters
    ----------
    parts : sequence of dict
        Windows of the log, see `imufit.faults.samples.windows`.
    facts : Facts
        Of the log as declared.
    ends : mapping
        End of the range of each sensor that may have one, m/s^2 and rad/s, whether or not it can be judged.
    """
    if not ends:
        return []
    rows = samples(parts, facts)
    found = []
    for sensor, reading in rows.readings.items():
        if sensor not in ends:
            continue
        ideal, end = rows.ideal[sensor], ends[sensor]
        beyond = np.abs(ideal) > BEYOND * end
        again = np.abs(ideal - np.sign(ideal) * 2.0 * end - reading) < NEAR * 2.0 * end
        count, wrapped = int(np.count_nonzero(beyond)), int(np.count_nonzero(beyond & again))
        if wrapped < LEAST or wrapped < MOST * count:
            continue
        words = fault_words.wrapped(sensor, end, wrapped, count)
        found.append(DataFault("wrapped", sensor, None, facts.t_start, facts.t_end, facts.n, *words, spoils=True))
    return found
