"""Order of the time stamps: errors, and clocks that are coarser than the sampling."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.log.columns import LARGEST
from imufit.log.place import Place

DAY: Final = 86400.0
"""Length of a day, s."""
COARSE_AT_LEAST: Final = 10
COARSE_AT_MOST: Final = 0.02
_PARTS: Final = 10
_PARTS_AT_LEAST: Final = 4
_KEPT_STEPS: Final = 100_000


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
    """New time stamps for the second rows of pairs that share one.

    Parameters
    ----------
    rows : (k,) int array
        Rows to change, ascending.
    times : (k,) float array
        Their new time, s.
    note : str
        What was done; empty when nothing was.
    """

    rows: NDArray[np.int64]
    times: NDArray[np.float64]
    note: str = ""

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

    A stamp that is not finite or that goes back is an error at once. Repeated stamps are collected: when there are at
    least 10, scattered over the log, never more than two rows at one stamp and under 2 % of the rows, the clock is
    coarser than the sampling, and the second row of each pair goes halfway to the next stamp. Otherwise the first
    repeated stamp is an error, since it means a splice or a copied block.
    """

    def __init__(self, place: Place) -> None:
        self._place = place
        self._n = 0
        self._last: float | None = None
        self._rows: list[int] = []
        self._stamps: list[float] = []
        self._next: list[float] = []
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
        if len(self._next) < len(self._rows) and steps.size:
            self._next.append(float(t[1]))
        for i in np.flatnonzero(steps == 0.0):
            self._rows.append(offset + int(i) + 1)
            self._stamps.append(float(t[i]))
            if i + 2 < t.size:
                self._next.append(float(t[i + 2]))
        if len(self._rows) > COARSE_AT_LEAST + COARSE_AT_MOST * (offset + t.size) + _KEPT_STEPS:
            raise self._repeated()

    def finish(self) -> TimeRepair:
        """Judge the repeated stamps once every block has been taken."""
        if not self._rows:
            return TimeRepair(np.empty(0, np.int64), np.empty(0))
        rows, stamps = np.array(self._rows, np.int64), np.array(self._stamps)
        following = np.array(self._next)
        if following.size < rows.size:
            following = np.append(following, stamps[-1] + self.median_step)
        parts = np.unique(rows * _PARTS // self._n).size
        pairs = not np.any(following == stamps)
        if rows.size < COARSE_AT_LEAST or rows.size >= COARSE_AT_MOST * self._n or parts < _PARTS_AT_LEAST or not pairs:
            raise self._repeated()
        note = (
            f"{self._place.name}: {rows.size} repeated time stamps: clock coarser than the sampling; "
            "the second row of each pair was moved halfway to the next stamp"
        )
        return TimeRepair(rows, stamps + 0.5 * (following - stamps), note)

    def _repeated(self) -> Exception:
        row, stamp = self._rows[0], self._stamps[0]
        problem = f"t = {stamp!r} repeats t = {stamp!r} of row {row - 1}"
        remedy = "Two samples cannot share a time: delete the copied rows or split the log there."
        # A stamp that single precision holds exactly, as copies of float64 stamps hardly ever all are.
        if all(float(np.float32(each)) == each for each in self._stamps) and len(self._stamps) >= COARSE_AT_LEAST:
            digit = float(np.spacing(np.float32(stamp)))
            typical = float(np.median(np.diff(np.unique(self._stamps)))) if len(set(self._stamps)) > 1 else digit
            if digit > 0.5 * typical:
                problem += f": t is in single precision (float32), which tells times of this size only to {digit:g} s"
                remedy = "Write t as float64, or subtract the first time before it is rounded; record or export again."
        return self._place.error(problem, row=row, column="t", remedy=remedy)

    @property
    def median_step(self) -> float:
        """Median time from row to row over the first 100,000 rows, s."""
        steps = np.concatenate(self._steps) if self._steps else np.empty(0)
        return float(np.median(steps)) if steps.size else float("nan")
