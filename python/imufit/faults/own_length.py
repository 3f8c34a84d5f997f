"""Readings that were divided by their own length: directions in the place of readings."""

from __future__ import annotations

from typing import Final

import numpy as np

from imufit import _imufit
from imufit.faults.samples import Samples
from imufit.results import column_words
from imufit.results.data_fault import DataFault

SPREAD: Final = 1e-5
"""Relative spread of the lengths up to which they are the same: six digits leave less, and noise of any sensor more."""
ROWS: Final = 100
"""Rows that show it."""


def own_length_faults(rows: Samples, facts: _imufit.Facts) -> list[DataFault]:
    """Name sensors whose vectors have one length, though noise and motion must change the length.

    Parameters
    ----------
    rows : Samples
        Rows from all over the log.
    facts : Facts
        Of the log as declared.
    """
    found = []
    for sensor in ("acc", "mag"):
        if sensor not in facts.sensors:
            continue
        length, ideal = (np.linalg.norm(values[sensor], axis=1) for values in (rows.readings, rows.ideal))
        length = length[np.isfinite(length)]
        if length.size < ROWS or np.ptp(length) > SPREAD * length.max():
            continue
        size = float(np.median(length))
        # Readings that were computed without noise have one length where the body does not move along.
        varied = sensor == "acc" and float(np.nanstd(ideal)) > 1e-3 * size
        unit = abs(size - 1.0) < SPREAD
        if varied or unit:
            words = column_words.own_length(sensor, size)
            found.append(DataFault("length", sensor, None, facts.t_start, facts.t_end, facts.n, *words, spoils=True))
    return found
