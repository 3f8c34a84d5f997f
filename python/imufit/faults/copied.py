"""Columns that repeat another column bit for bit."""

from __future__ import annotations

import itertools
from typing import Final

import numpy as np

from imufit import _imufit
from imufit.faults.samples import Samples
from imufit.results import column_words
from imufit.results.data_fault import DataFault

ROWS: Final = 100
"""Rows that show it."""
SURE: Final = 2.0
"""Times farther from the ideal readings one of two equal columns must be, for it to be the copy."""


def copied_faults(rows: Samples, facts: _imufit.Facts) -> list[DataFault]:
    """Name columns of the sensors that are copies.

    Parameters
    ----------
    rows : Samples
        Rows from all over the log.
    facts : Facts
        Of the log as declared.
    """
    columns = {
        f"{sensor}_{axis}": (rows.readings[sensor][:, k], rows.ideal[sensor][:, k])
        for sensor in facts.sensors
        for k, axis in enumerate("xyz")
    }
    found = []
    for one, other in itertools.combinations(columns, 2):
        a, b = columns[one][0], columns[other][0]
        known = np.isfinite(a) & np.isfinite(b)
        if np.count_nonzero(known) < ROWS or not np.array_equal(a[known], b[known]):
            continue
        # A column of zeros, or one that does not move, is not a copy of another such column.
        if np.unique(a[known]).size < ROWS // 10:
            continue
        miss = {name: float(np.nanmean((columns[name][0] - columns[name][1]) ** 2)) for name in (one, other)}
        copy, original = (one, other) if miss[one] > miss[other] else (other, one)
        words = column_words.copied(copy, original, sure=miss[copy] > SURE**2 * miss[original])
        fault = DataFault("copied", copy[:3], copy, facts.t_start, facts.t_end, facts.n, *words, spoils=True)
        found.append(fault)
    return found
