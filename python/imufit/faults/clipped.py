"""Readings that are pinned at the end of a range."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.replaying.clipped import end_of_range
from imufit.results import fault_words
from imufit.results.data_fault import DataFault

Array = NDArray[np.float64]

LEAST: Final = 3
"""Rows at the end of a range below which it may be chance."""


class ClippedRows:
    """Counts the readings at the ends of the ranges, chunk by chunk.

    Parameters
    ----------
    ends : mapping
        End of the range of each sensor that may have one, m/s^2 and rad/s.
    certain : collection of str
        Sensors whose metadata state it. Of the others the readings have to show that they are pinned there.
    """

    def __init__(self, ends: Mapping[str, float], certain: Collection[str] = ()) -> None:
        self._ends = dict(ends)
        self._certain = set(certain)
        self._times: dict[str, list[Array]] = {}

    def add(self, chunk: Mapping[str, Any]) -> None:
        """Take the core rows of a chunk, as the compiled core takes it."""
        core = slice(chunk["begin"], chunk["end"])
        for sensor, end in self._ends.items():
            column = chunk[sensor]
            if column is None:
                continue
            at_end = np.abs(column[core]) >= end * (1.0 - 1e-9)
            if sensor not in self._certain and at_end.any():
                found = end_of_range(column[core], 0.0)
                if found is not None and found >= end * (1.0 - 1e-9):
                    self._certain.add(sensor)
            for axis, name in enumerate("xyz"):
                self._times.setdefault(f"{sensor}_{name}", []).append(chunk["t"][core][at_end[:, axis]])

    def faults(self) -> list[DataFault]:
        """Name the channels that are clipped."""
        found = []
        for channel, parts in self._times.items():
            sensor, times = channel[:3], np.concatenate(parts)
            if times.size >= LEAST and sensor in self._certain:
                span = float(times[0]), float(times[-1])
                words = fault_words.clipped(channel, self._ends[sensor], times.size, span)
                found.append(DataFault("clipped", sensor, channel, *span, times.size, *words))
        return found
