"""Readings that are pinned at the end of a range."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Final

import numpy as np

from imufit.faults.row_fault import UNITS
from imufit.figures import quantity
from imufit.replay.clipped import end_of_range
from imufit.results.data_fault import DataFault

LEAST: Final = 3
"""Rows at the end of a range below which it may be chance."""


class ClippedRows:
    """Counts the readings at the ends of the ranges, chunk by chunk.

    Parameters
    ----------
    ends : mapping
        End of the range of each sensor that may have one, m/s^2 and rad/s.
    certain : collection of str
        Sensors whose metadata tell it. Of the others the readings have to show that they are pinned there.
    """

    def __init__(self, ends: Mapping[str, float], certain: Collection[str] = ()) -> None:
        self._ends = dict(ends)
        self._certain = set(certain)
        self._rows: dict[str, int] = {}
        self._first: dict[str, float] = {}
        self._last: dict[str, float] = {}

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
                rows = np.flatnonzero(at_end[:, axis])
                if rows.size:
                    channel = f"{sensor}_{name}"
                    self._rows[channel] = self._rows.get(channel, 0) + int(rows.size)
                    self._first.setdefault(channel, float(chunk["t"][core][rows[0]]))
                    self._last[channel] = float(chunk["t"][core][rows[-1]])

    def faults(self) -> list[DataFault]:
        """Name the channels that are clipped."""
        found = []
        for channel, rows in self._rows.items():
            sensor = channel[:3]
            if rows < LEAST or sensor not in self._certain:
                continue
            end = quantity.quantity(self._ends[sensor], UNITS[sensor])
            first, last = self._first[channel], self._last[channel]
            evidence = (
                f"{channel} stands at the end of its range, {end}, in {rows} rows at {quantity.span(first, last)}."
            )
            remedy = f"Set a larger range, or move less; {sensor}.saturation models the loss."
            found.append(DataFault("clipped", sensor, channel, first, last, rows, evidence, remedy))
        return found
