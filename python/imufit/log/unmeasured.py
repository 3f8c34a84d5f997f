"""Single impossible readings: they are left out and reported; a log with many of them is refused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.log.columns import GROUPS, LARGEST, LARGEST_COVARIATE, SENSORS, SMALLEST, UNITS
from imufit.log.place import Place
from imufit.remedy import Remedy, when_read

Array = NDArray[np.float64]

MOST: Final = 0.01
"""Share of the samples of a column that may be left out. Transmission errors that spoil whole numbers are rarer by
orders of magnitude; what is more frequent is another unit, a filler, or bytes that are not numbers."""
TOLD: Final = 5
"""Readings that are listed one by one; of more the number is stated."""

_SENSOR_COLUMNS: Final = frozenset(column for sensor in SENSORS for column in GROUPS[sensor])


@dataclass
class _Column:
    """Findings in one column so far.

    Parameters
    ----------
    name : str
        Column of the file, to be named.
    rows, samples, bad : int
        Rows counted, and of these the samples, and the samples that cannot be.
    first : list of (int, float)
        Row and value of the first ones that cannot be, SI units.
    lone : int
        Rows without a value in which another column of the same sensor has one.
    first_lone : int
        The first of them.
    """

    name: str
    rows: int = 0
    samples: int = 0
    bad: int = 0
    first: list[tuple[int, float]] = field(default_factory=list)
    lone: int = 0
    first_lone: int = 0


class Unmeasured:
    """Leaves out readings beyond `LARGEST`, infinite ones too, and counts them, each row once however often it is read.

    All code on a log relies on it: squares of readings and their sums are finite, and none is zero unless the
    reading is.

    Parameters
    ----------
    place : Place
        To name the file in errors and notes.
    """

    def __init__(self, place: Place) -> None:
        self._place = place
        self._columns: dict[str, _Column] = {}

    def left_out(self, values: Mapping[str, Array], names: Mapping[str, str], start: int) -> dict[str, Array]:
        """Return columns without what cannot be; of a sensor, attitude or position without the whole sample.

        Parameters
        ----------
        values : mapping
            Columns of the log, (n,) each, SI units; NaN is a missing sample.
        names : mapping
            Column of the file for each of them, to be named.
        start : int
            Row of the log at which the block begins.
        """
        found = dict(values)
        bad: dict[str, NDArray[np.bool_]] = {}
        lone = _lone(values)
        for target, column in values.items():
            size = np.abs(column)
            beyond = size > LARGEST.get(target, LARGEST_COVARIATE)
            self._count(target, names[target], column, beyond, lone.get(target), start)
            if beyond.any():
                bad[target] = beyond
            tiny = (size < SMALLEST) & (size > 0.0) if target in _SENSOR_COLUMNS else np.False_
            if tiny.any():
                found[target] = np.where(tiny, 0.0, column)
        for target, beyond in bad.items():
            members = next((group for group in GROUPS.values() if target in group), (target,))
            for member in members:
                if member in found:
                    found[member] = np.where(beyond, np.nan, found[member])
        return found

    def _count(
        self, target: str, name: str, values: Array, bad: NDArray[np.bool_], lone: NDArray[np.bool_] | None, start: int
    ) -> None:
        seen = self._columns.setdefault(target, _Column(name))
        new = max(0, seen.rows - start)
        if new >= values.size:
            return
        seen.samples += int(np.count_nonzero(~np.isnan(values[new:])))
        places = np.flatnonzero(bad[new:]) + new
        seen.bad += places.size
        seen.first += [(start + int(k), float(values[k])) for k in places[: TOLD - len(seen.first)]]
        if lone is not None and lone[new:].any():
            alone = np.flatnonzero(lone[new:]) + new
            seen.first_lone = seen.first_lone if seen.lone else start + int(alone[0])
            seen.lone += alone.size
        seen.rows = start + values.size

    def check(self) -> None:
        """Refuse a log in which a column has too many of them, once all rows have been read.

        Raises
        ------
        InputError
            Names the first of them.
        """
        many = {target: seen for target, seen in self._columns.items() if seen.bad > MOST * seen.samples}
        if not many:
            return
        target, seen = min(many.items(), key=lambda item: item[1].first[0][0])
        row, value = seen.first[0]
        remedy = Remedy.of("Write NaN (or leave the cell empty) for a missing sample.")
        largest = LARGEST.get(target, LARGEST_COVARIATE)
        if np.isinf(value):
            problem = f"{value} is not a reading"
        elif target in LARGEST:
            problem = f"{value:.4g} is more than {largest:.0e}, beyond anything that {target} can measure"
            remedy += " Or is it another unit? " + when_read(Remedy("mapping=", self._place.option)) + " takes it."
        else:
            problem = f"{value:.4g} is more than {largest:.0e}, beyond anything that is measured"
        raise self._place.error(problem, row=row, column=seen.name, remedy=remedy)

    @property
    def notes(self) -> tuple[str, ...]:
        """Readings left out of the rows read so far, and cells without a reading beside the sensor's other axes."""
        told = [(row, target, value) for target, seen in self._columns.items() for row, value in seen.first]
        notes = []
        for row, target, value in sorted(told)[:TOLD]:
            place = self._place.error("", row=row, column=self._columns[target].name).where
            unit = f" {UNITS[target]}" if UNITS.get(target, "1") != "1" else ""
            notes.append(f"{self._place.name}: {place}: {value:.6g}{unit} cannot be measured; left out")
        count = sum(seen.bad for seen in self._columns.values())
        if count > len(notes):
            notes.append(f"{self._place.name}: {count - len(notes)} more readings cannot be measured; left out")
        return (*notes, *self._lone_notes())

    def _lone_notes(self) -> Iterator[str]:
        for seen in self._columns.values():
            if seen.lone:
                place = self._place.error("", row=seen.first_lone, column=seen.name).where
                more = f"; the column has {seen.lone} such cells" if seen.lone > 1 else ""
                yield f"{self._place.name}: {place}: the cell is empty beside readings of other axes{more}"


def _lone(values: Mapping[str, Array]) -> dict[str, NDArray[np.bool_]]:
    """Find the rows in which a column of a sensor has no value although another one of that sensor has one."""
    found: dict[str, NDArray[np.bool_]] = {}
    for sensor in SENSORS:
        empty = {column: np.isnan(values[column]) for column in GROUPS[sensor] if column in values}
        if empty:
            whole = np.logical_and.reduce(list(empty.values()))
            found |= {column: gaps & ~whole for column, gaps in empty.items()}
    return found
