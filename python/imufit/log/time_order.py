"""Order of the time stamps: errors, and clocks that are coarser than the sampling."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.log.columns import LARGEST
from imufit.log.place import Place

DAY: Final = 86400.0
"""Length of a day, s."""
COARSE_AT_LEAST: Final = 10
COARSE_AT_MOST: Final = 0.02
"""Share of rows that repeat a stamp below which the rows per step do not show the clock's step."""
_PARTS: Final = 10
_PARTS_AT_LEAST: Final = 4
_KEPT_STEPS: Final = 100_000
MOST_AT_ONE: Final = 10_000
"""Rows at one stamp from which on the clock stands still: more than a second of the fastest sensors, at 8 kHz."""
EVEN: Final = 0.9
"""Share of the clock's steps with as many rows as their length states, to one row or a quarter. Of steps of a clock
all do; 0.9 leaves room for rows that were lost."""
PAUSE: Final = 3.5
"""Usual steps of the clock from which on a step is a pause of the recording, as for `is_gap`."""
COPIED: Final = 0.5
"""Share of the rows with a repeated stamp that say the same as the row before from which on they are copies of it,
where other rows do not so as often."""
COUNTERS: Final = (2.0**32, 2.0**24, 2.0**16)
"""Numbers at which counters of 32, 24 and 16 bits begin again at 0: micros() of an Arduino does after 71 minutes."""
_USUAL_GAP: Final = 3.5
"""Median steps up to which rows follow one another without a gap, as for `join`: a counter that began anew went on."""
_STEPS_KNOWN: Final = 10
"""Steps from which on their median is known."""
_WHOLE: Final = 1e-3
"""Rounding of a whole number of ticks up to 2^32 that was converted to seconds."""


def over_midnight(before: float, after: float) -> bool:
    """Whether a clock that shows the time of day went past midnight between two of its readings.

    Parameters
    ----------
    before, after : float
        s since midnight; a log goes on after a pause of less than half a day.
    """
    return 0.0 <= after < before <= DAY and before - after > 0.5 * DAY


def _period(before: float, after: float, step: float, tick: float, day: bool) -> float:
    """Time after which a clock began anew between two rows, s; 0 where the second row does not follow the first.

    Parameters
    ----------
    before, after : float
        The stamps, s.
    step : float
        Median step, s.
    tick : float
        Seconds of 1 in the file.
    day : bool
        Whether the clock shows the time of day.
    """
    if day:
        return DAY if over_midnight(before, after) else 0.0
    if tick <= 0.0 or after < 0.0:
        return 0.0
    counts = before / tick, after / tick
    if any(abs(count - round(count)) > _WHOLE for count in counts):
        return 0.0
    for size in COUNTERS:
        if before < size * tick and after + size * tick - before <= _USUAL_GAP * step:
            return size * tick
    return 0.0


def counted_on(counts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Count whole numbers on where a counter began again at 0; anything else comes back as it is.

    Parameters
    ----------
    counts : (n,) array
        Time stamps as they stand in the file.
    """
    steps = np.diff(counts)
    back = np.flatnonzero(steps < 0.0)
    ahead = steps[steps > 0.0]
    if not back.size or ahead.size < _STEPS_KNOWN:
        return counts
    periods = [_period(float(counts[i]), float(counts[i + 1]), float(np.median(ahead)), 1.0, False) for i in back]
    if not all(periods):
        return counts
    added = np.zeros(counts.size)
    added[back + 1] = periods
    return counts + np.cumsum(added)


@dataclass(frozen=True)
class TimeRepair:
    """New time stamps: on past where the clock began anew, and for rows that share one, all but the first.

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
    anew : (m,) int array
        Rows at which the clock began anew, ascending.
    periods : (m,) float array
        What is added from each of them on, s.
    """

    rows: NDArray[np.int64]
    times: NDArray[np.float64]
    note: str = ""
    often: bool = False
    anew: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    periods: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    def apply(self, t: NDArray[np.float64], start: int) -> NDArray[np.float64]:
        """Repair the (n,) block of time stamps that begins at row `start`."""
        if self.anew.size:
            passed = np.searchsorted(self.anew, np.arange(start, start + t.size), side="right")
            t = t + np.concatenate(([0.0], np.cumsum(self.periods)))[passed]
        first, last = np.searchsorted(self.rows, [start, start + t.size])
        if first == last:
            return t
        t = t.copy()
        t[self.rows[first:last] - start] = self.times[first:last]
        return t


class TimeScan:
    """Goes once over all time stamps, block by block, before anything else is read.

    A stamp that is not finite or that goes back is an error at once. Repeated stamps are collected. When there are at
    least 10, scattered over the log, and each step of the clock has as many rows as its length states, the clock is
    coarser than the sampling, and the rows of a step are spread evenly over it. Otherwise the first repeated stamp is
    an error, since it means a splice or a copied block.

    A clock that begins anew is counted on: a time of day at midnight, and a counter of 16, 24 or 32 bits whose next
    count comes after a usual step. Any other stamp that goes back is an error.

    Parameters
    ----------
    place : Place
        To name the file in errors.
    tick : float
        Seconds of 1 in the file.
    """

    def __init__(self, place: Place, tick: float = 1.0) -> None:
        self._place = place
        self._tick = tick
        self._day = False
        self._anew: list[int] = []
        self._periods: list[float] = []
        self._n = 0
        self._last: float | None = None
        self._rows: list[NDArray[np.int64]] = []
        self._stamps: list[NDArray[np.float64]] = []
        self._next: list[NDArray[np.float64]] = []
        self._steps: list[NDArray[np.float64]] = []
        self._kept = 0
        self._standing = 0

    def add(self, t: NDArray[np.float64], written: bool = False) -> None:
        """Take the next block of time stamps.

        Parameters
        ----------
        t : (n,) array
            Time, s.
        written : bool
            Whether the stamps stand there as times of day or dates, so that one that goes back half a day and more
            comes after midnight.
        """
        self._day = written
        if t.size == 0:
            return
        start = self._n
        self._check_finite(t, start)
        t = self._counted_on(t, start)
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

    def _counted_on(self, t: NDArray[np.float64], start: int) -> NDArray[np.float64]:
        """Add up what a clock that began anew has behind it."""
        t = t + sum(self._periods)
        before = np.concatenate(([self._last if self._last is not None else t[0]], t[:-1]))
        for i in np.flatnonzero(t < before):
            # what was added before counts for neither of the two
            added = sum(self._periods)
            known = self._steps or [np.diff(t[:i])]
            steps = np.concatenate(known)
            step = float(np.median(steps)) if steps.size >= _STEPS_KNOWN else 0.0
            last = float(before[i] if i == 0 else t[i - 1]) - added
            now = float(t[i]) - added
            period = _period(last, now, step, self._tick, self._day)
            if not period:
                return t
            t[i:] += period
            self._anew.append(start + int(i))
            self._periods.append(period)
        return t

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
        ends = np.concatenate(([-1 - self._standing], np.flatnonzero(steps != 0.0), [steps.size]))
        if np.diff(ends).max() > MOST_AT_ONE:
            raise self.repeated()
        self._standing = int(steps.size - 1 - ends[-2])

    def finish(self) -> TimeRepair:
        """Judge the repeated stamps once every block has been taken."""
        anew, periods = np.array(self._anew, np.int64), np.array(self._periods)
        went_on = ""
        if anew.size:
            what = "midnight" if self._day else f"{round(self._periods[0] / self._tick)} counts"
            times = "" if anew.size == 1 else f" {anew.size} times"
            went_on = f"{self._place.name}: the clock began anew{times}, at {what}: counted on"
        if not self._rows:
            return TimeRepair(np.empty(0, np.int64), np.empty(0), went_on, anew=anew, periods=periods)
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
        note = f"{went_on}; {note.partition(': ')[2]}" if went_on else note
        times = stamps + place / counts[of] * steps[of]
        if np.any(times <= stamps):
            # Numbers of this size do not resolve the rows of a step.
            raise self.repeated()
        return TimeRepair(rows, times, note, often=not seldom, anew=anew, periods=periods)

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
            # Of rows with one stamp in all, that none is further from the next than a second is the least there is.
            apart = float(np.median(np.diff(different))) if different.size > 1 else 1.0
            if digit > 0.5 * apart:
                problem += (
                    f": t is in single precision (float32), which resolves times of this size only to {digit:g} s"
                )
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
