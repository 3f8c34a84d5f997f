"""Which column of a foreign table is its time: one of numbers, a written clock, or a date and a clock beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.log.clock_text import MONTH_FIRST, ORDERS, is_date, joined, order_of, seconds_from_cells
from imufit.log.columns import LARGEST_COVARIATE
from imufit.log.time_order import counted_on
from imufit.log.time_unit import time_unit
from imufit.log.units import conversion

Array = NDArray[np.float64]

BETWEEN: Final = " + "
"""The sign in a mapping between a column of dates and one of times of day."""
_SAME_PACE: Final = 1.0
"""Steps by which two clocks of one table may differ over its first rows and still show the same time."""
_MOST: Final = 0.5
"""Share of the cells that are times in a column of times: the rest may be empty."""


@dataclass(frozen=True)
class Clock:
    """Columns that are the time of a table.

    Parameters
    ----------
    column : str
        Column of numbers or of written times.
    unit : str or None
        Its unit; of dates with slashes their order; None where neither is known.
    likely : str
        What the unit most likely is.
    day : str or None
        Column of dates, where `column` has the time of day alone.
    seconds : (n,) array
        Times of the rows looked at, s; in whatever unit they stand where none is known.
    """

    column: str
    unit: str | None
    likely: str
    day: str | None
    seconds: Array

    @property
    def source(self) -> str:
        """Text that stands for it in a mapping, without the unit."""
        return self.column if self.day is None else f"{self.day}{BETWEEN}{self.column}"

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns that it is read from."""
        return (self.column,) if self.day is None else (self.day, self.column)

    def times(self, cells: Mapping[str, NDArray[Any]]) -> Array:
        """Read the times of some rows, s, from the cells of its columns; NaN where a cell is not a time."""
        return _times(cells, self.column, self.unit, self.day)


def clocks_of(
    named: Sequence[tuple[str, str | None, int]],
    cells: Mapping[str, NDArray[Any]],
    fixed: str | None = None,
    ticks: tuple[str, ...] = (),
) -> list[Clock]:
    """Find the columns that are the time, of those whose names say so.

    Parameters
    ----------
    named : sequence of (column, unit, strange)
        As `imufit.log.words.time_columns` gives them.
    cells : mapping
        Their cells, (n,) float64 or objects.
    fixed : str, optional
        Unit that the maker fixes.
    ticks : tuple of str
        Units of which the maker used several.

    Returns
    -------
    list of Clock
        The likeliest alone, or several of which none is likelier. Of clocks that show the same time it is the finest.
    """
    days = [name for name, _, _ in named if cells[name].dtype == object and _are_dates(cells[name])]
    made: list[tuple[tuple[int, bool], Clock]] = []
    for name, stated, odd in named:
        clock = _clock(name, stated or fixed, cells, days, ticks)
        if clock is not None:
            made.append(((odd, clock.unit is None), clock))
    if not made:
        return []
    best = min(key for key, _ in made)
    alike = [clock for key, clock in made if key == best]
    alike.sort(key=lambda clock: -np.unique(clock.seconds[np.isfinite(clock.seconds)]).size)
    same = all(_same_pace(alike[0].seconds, other.seconds) for other in alike[1:])
    return alike[:1] if same else alike


def _clock(
    name: str, unit: str | None, cells: Mapping[str, NDArray[Any]], days: Sequence[str], ticks: tuple[str, ...]
) -> Clock | None:
    own = cells[name]
    if own.dtype != object:
        values = np.asarray(own, np.float64)
        if not np.isfinite(values).any():
            return None
        unit = unit or time_unit(values, ticks)
        return Clock(name, unit, "ms", None, _times(cells, name, unit, None))
    if name in days:
        return None
    day = next((each for each in days if _shows_day_alone(own)), None)
    whole = own if day is None else joined(cells[day], own)
    order = order_of(str(cell) for cell in whole if cell is not None)
    seconds = _times(cells, name, order, day)
    if np.isfinite(seconds).sum() <= _MOST * len(seconds):
        return None
    return Clock(name, (order or "s") if order is not None else None, MONTH_FIRST, day, seconds)


def _times(cells: Mapping[str, NDArray[Any]], name: str, unit: str | None, day: str | None) -> Array:
    """Convert cells to seconds; to whatever unit they stand in where none is known."""
    own = cells[name]
    if own.dtype != object:
        values = np.where(np.abs(own) <= LARGEST_COVARIATE, own, np.nan)
        to_s: Callable[[Array], Array] = conversion("t", unit).apply if unit is not None else np.asarray
        return to_s(counted_on(values))
    return seconds_from_cells(own if day is None else joined(cells[day], own), unit if unit in ORDERS else MONTH_FIRST)


def _are_dates(cells: NDArray[Any]) -> bool:
    known = [str(cell) for cell in cells if cell is not None]
    return bool(known) and all(is_date(text) for text in known)


def _shows_day_alone(cells: NDArray[Any]) -> bool:
    """Whether cells are times of day."""
    text = np.array([None if cell is None else f"1970-01-01 {cell}" for cell in cells], dtype=object)
    return bool(np.isfinite(seconds_from_cells(text)).sum() > _MOST * len(cells))


def _same_pace(first: Array, second: Array) -> bool:
    both = np.isfinite(first) & np.isfinite(second)
    if both.sum() < 2:
        return False
    first, second = first[both] - first[both][0], second[both] - second[both][0]
    step = float(np.median(np.abs(np.diff(first))))
    return bool(np.max(np.abs(first - second)) <= _SAME_PACE * step)
