"""Order of the time stamps: errors, and clocks that are coarser than the sampling."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.log.columns import LARGEST
from imufit.log.place import Place

DAY: Final = 86400.0
"""Length of a day, s."""
COARSE_AT_LEAST: Final = 10
COARSE_AT_MOST: Final = 0.02
"""Share of rows that repeat a stamp below which it says nothing of the clock's step how many rows a step has."""
_PARTS: Final = 10
_PARTS_AT_LEAST: Final = 4
_KEPT_STEPS: Final = 100_000
EVEN: Final = 0.9
"""Share of the clock's steps that have as many rows as their length says, by one row or a quarter. Of steps of a clock
all do; 0.9 leaves room for rows that were lost."""
PAUSE: Final = 3.5
"""Usual steps of the clock from which on a step is a pause of the recording, as for `is_gap`."""
COPIED: Final = 0.5
"""Share of the rows with a repeated stamp that say the same as the row before from which on they are copies of it,
where other rows do not so as often."""


def over_midnight(before: float, after: float) -> bool:
    """Whether a clock that shows the time of day went past midnight between two of its readings.

    Parameters
    ----------
    before, after : float
        s since midnight; a log goes on after a pause of less than half a day.
    """
    return 0.0 <= after < before <= DAY and before - after > 0.5 * DAY


@dataclass(frozen=True)
class TimeRepair:
    """New time stamps for rows that share one, all but the first.

    Parameters
    ----------
    rows : (k,) int array
        Rows to change, ascending.
    times : (k,) float array
        Their new time, s.
    note : str
        What was done; empty when nothing was.
    often : bool
        Whether so many rows share a stamp that they may be copies: seldom pairs may well hold a reading that the
        sensor has not renewed.
    """

    rows: NDArray[np.int64]
    times: NDArray[np.float64]
    note: str = ""
    often: bool = False

    def apply(self, t: NDArray[np.float64], start: int) -> NDArray[np.float64]:
        """Repair the (n,) block of time stamps that begins at row `start`."""
        first, last = np.searchsorted(self.rows, [start, start + t.size])
        if first == last:
            return t
        t = t.copy()
        t[self.rows[first:last] - start] = self.times[first:last]
        return t


class TimeScan:
    """Goes once over all time stamps, block by block, before anything else is read.

    A stamp that is not finite or that goes back is an error at once. Repeated stamps are collected. When there are at
    least 10, scattered over the log, and each step of the clock has as many rows as its length says, the clock is
    coarser than the sampling, and the rows of a step are spread evenly over it. Otherwise the first repeated stamp is
    an error, since it means a splice or a copied block.
    """

    def __init__(self, place: Place) -> None:
        self._place = place
        self._n = 0
        self._last: float | None = None
        self._rows: list[NDArray[np.int64]] = []
        self._stamps: list[NDArray[np.float64]] = []
        self._next: list[NDArray[np.float64]] = []
        self._steps: list[NDArray[np.float64]] = []
        self._kept = 0

    def add(self, t: NDArray[np.float64]) -> None:
        """Take the next block of time stamps, (n,) in s."""
        if t.size == 0:
            return
        start = self._n
        self._check_finite(t, start)
        joined = t if self._last is None else np.concatenate(([self._last], t))
        offset = start - (joined.size - t.size)
        steps = np.diff(joined)
        self._check_forward(joined, steps, offset)
        self._collect(joined, steps, offset)
        if self._kept < _KEPT_STEPS:
            self._steps.append(steps[: _KEPT_STEPS - self._kept])
            self._kept += steps.size
        self._n += t.size
        self._last = float(t[-1])

    def _check_finite(self, t: NDArray[np.float64], start: int) -> None:
        bad = np.flatnonzero(~(np.abs(t) <= LARGEST["t"]))
        if bad.size:
            raise self._place.error(
                f"{t[bad[0]]:.6g} is not a time",
                row=start + int(bad[0]),
                column="t",
                remedy="Every row needs its time in s: fill it in or delete the row.",
            )

    def _check_forward(self, t: NDArray[np.float64], steps: NDArray[np.float64], offset: int) -> None:
        back = np.flatnonzero(steps < 0.0)
        if back.size:
            i = int(back[0])
            late, early = float(t[i]), float(t[i + 1])
            remedy = "Sort the log by t or split it there."
            if over_midnight(late, early):
                remedy = "This looks like the time of day at midnight: add 86400 s to t from this row on."
            raise self._place.error(
                f"t = {early!r} is before t = {late!r} of row {offset + i}",
                row=offset + i + 1,
                column="t",
                remedy=remedy,
            )

    def _collect(self, t: NDArray[np.float64], steps: NDArray[np.float64], offset: int) -> None:
        if self._next and np.isnan(self._next[-1][-1]) and steps.size:
            self._next[-1][-1] = t[1]
        found = np.flatnonzero(steps == 0.0) + 1
        if found.size:
            self._rows.append(offset + found)
            self._stamps.append(t[found])
            self._next.append(np.append(t, np.nan)[found + 1])

    def finish(self) -> TimeRepair:
        """Judge the repeated stamps once every block has been taken."""
        if not self._rows:
            return TimeRepair(np.empty(0, np.int64), np.empty(0))
        rows = np.concatenate(self._rows)
        stamps, after = np.concatenate(self._stamps), np.concatenate(self._next)
        last = np.flatnonzero(np.diff(stamps, append=np.inf) != 0.0)
        counts = np.diff(last, prepend=-1) + 1
        lengths = after[last] - stamps[last]
        usual = float(np.median(lengths[np.isfinite(lengths)])) if np.isfinite(lengths).any() else self.median_step
        parts = np.unique(rows * _PARTS // self._n).size
        if rows.size < COARSE_AT_LEAST or parts < _PARTS_AT_LEAST or not usual > 0.0:
            raise self.repeated()
        seldom = rows.size < COARSE_AT_MOST * self._n and bool(np.all(counts == 2))
        # Over a pause, and behind the last row, a step is as long as usual.
        steps = np.where(lengths < PAUSE * usual, lengths, usual)
        if not seldom:
            row = float(steps.sum() / counts.sum())
            even = np.abs(counts * row - steps) <= np.maximum(1.01 * row, 0.25 * steps)
            if np.mean(even) < EVEN:
                raise self.repeated()
        elif not np.isfinite(lengths[-1]):
            steps[-1] = self.median_step
        of = np.repeat(np.arange(last.size), counts - 1)
        place = np.arange(rows.size) - np.repeat(last - counts + 2, counts - 1) + 1
        note = f"{self._place.name}: {rows.size} repeated time stamps: clock coarser than the sampling; "
        note += (
            "the second row of each pair was moved halfway to the next stamp"
            if seldom
            else f"it goes in steps of {usual:.3g} s, over each of which its rows were spread evenly"
        )
        return TimeRepair(rows, stamps + place / counts[of] * steps[of], note, often=not seldom)

    def repeated(self) -> Exception:
        """Make the error for stamps that repeat one another and are not those of a coarse clock."""
        stamps = np.concatenate(self._stamps)
        row, stamp = int(self._rows[0][0]), float(stamps[0])
        problem = f"t = {stamp!r} repeats t = {stamp!r} of row {row - 1}"
        remedy = "Two samples cannot share a time: delete the copied rows or split the log there."
        # A stamp that single precision holds exactly, as copies of float64 stamps hardly ever all are.
        if stamps.size >= COARSE_AT_LEAST and bool(np.all(stamps == stamps.astype(np.float32))):
            digit = float(np.spacing(np.float32(stamp)))
            different = np.unique(stamps)
            typical = float(np.median(np.diff(different))) if different.size > 1 else digit
            if digit > 0.5 * typical:
                problem += f": t is in single precision (float32), which tells times of this size only to {digit:g} s"
                remedy = "Write t as float64, or subtract the first time before it is rounded; record or export again."
        return self._place.error(problem, row=row, column="t", remedy=remedy)

    @property
    def median_step(self) -> float:
        """Median time from row to row over the first 100,000 rows, s."""
        steps = np.concatenate(self._steps) if self._steps else np.empty(0)
        return float(np.median(steps)) if steps.size else float("nan")


class Copies:
    """Counts rows that say the same as the row before them, of those with a repeated stamp and of the others.

    Parameters
    ----------
    repair : TimeRepair
        Rows with a repeated stamp.
    """

    def __init__(self, repair: TimeRepair) -> None:
        self._rows = repair.rows
        self._last: dict[str, NDArray[Any]] = {}
        self._same = np.zeros(2, int)
        self._n = np.zeros(2, int)

    def add(self, columns: Mapping[str, NDArray[Any]], start: int) -> None:
        """Take the next rows.

        Parameters
        ----------
        columns : mapping
            Columns of the file but the time, (n,) each.
        start : int
            First row.
        """
        same = None
        for name, values in columns.items():
            joined = np.concatenate([self._last.get(name, values[:0]), values])
            equal = joined[1:] == joined[:-1]
            if joined.dtype != object:
                equal |= np.isnan(joined[1:]) & np.isnan(joined[:-1])
            same = equal if same is None else same & equal
            self._last[name] = joined[-1:]
        if same is None or not same.size:
            return
        rows = np.arange(same.size) + (1 if start == 0 else start)
        repeated = np.isin(rows, self._rows, assume_unique=True)
        self._same += [np.count_nonzero(same & ~repeated), np.count_nonzero(same & repeated)]
        self._n += [np.count_nonzero(~repeated), np.count_nonzero(repeated)]

    @property
    def many(self) -> bool:
        """Whether the rows with a repeated stamp are copies: they are alike, and the others are not."""
        share = self._same / np.maximum(self._n, 1)
        return bool(share[1] > COPIED and share[0] < COPIED * share[1])
