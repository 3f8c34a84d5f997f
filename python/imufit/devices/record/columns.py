"""From the columns that a device names to the columns of a log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.devices.record.arrived import Announced
from imufit.devices.record.ticks import time_column
from imufit.errors import InputError
from imufit.log.check import UNIT_TOLERANCE
from imufit.log.columns import GROUPS
from imufit.log.each_once import check_each_once
from imufit.log.foreign import Plan, RowNumber, plan_columns
from imufit.log.place import Place

Array = NDArray[np.float64]

_REFERENCE: Final = GROUPS["ref_q"]


class Columns:
    """Which column of a device becomes which column of a log.

    Parameters
    ----------
    announced : Announced
        The device's announcement.
    mapping : mapping, optional
        Source text for target columns, such as ``{"acc_x": "-AccX[g]"}``.

    Raises
    ------
    InputError
        No log can be made of them: an axis is missing or misspelt, a sensor is missing, a name stands there twice.
    """

    def __init__(self, announced: Announced, mapping: Mapping[str, str] | None = None) -> None:
        time = time_column(announced.columns) if announced.form == "text" else None
        self._places = {name: k for k, name in enumerate(announced.columns) if time is None or k != time[0]}
        names = [name for k, name in enumerate(announced.columns) if time is None or k != time[0]]
        place = Place()
        try:
            check_each_once(["t", *names], place)
            self._plan: Plan = plan_columns(["t", *names], mapping, place)
        except InputError as error:
            who = f" {announced.name}" if announced.name else ""
            raise InputError(
                f"no log can be made of what the device{who} sends: {error.problem}",
                column=error.column,
                remedy=error.advice,
            ) from None
        if "pose" in self._places:
            raise InputError("the device sends a column pose, which is text in a log", remedy="Name it otherwise.")
        self.names = tuple(column.target for column in self._plan.columns if column.target != "t")

    def of(self, values: Array) -> dict[str, Array]:
        """Columns of a log, SI units.

        Parameters
        ----------
        values : (n, columns) array
            As decoded.

        Returns
        -------
        dict of (n,) arrays
            Without `t`. Values that a log cannot hold are NaN: infinite values, and attitudes that are not unit
            quaternions.
        """
        columns = {}
        for column in self._plan.columns:
            source = column.source
            if column.target == "t" or isinstance(source, RowNumber):
                continue
            raw = values[:, self._places[source]] if isinstance(source, str) else source.numbers(0, len(values))
            numbers = column.conversion.apply(raw)
            columns[column.target] = np.where(np.isinf(numbers), np.nan, numbers)
        if all(name in columns for name in _REFERENCE):
            norm = np.sqrt(sum(columns[name] ** 2 for name in _REFERENCE))
            wrong = ~(np.abs(norm - 1.0) <= UNIT_TOLERANCE)
            for name in _REFERENCE:
                columns[name] = np.where(wrong, np.nan, columns[name])
        return columns
