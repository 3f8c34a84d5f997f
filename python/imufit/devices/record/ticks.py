"""The device's clock, row by row: ticks or a column of text become seconds that run on, cut where they cannot."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.devices.record.arrived import Announced, Arrived
from imufit.log.columns import without_unit
from imufit.log.units import lookup

Array = NDArray[np.float64]

WRAP: Final = 2.0**32
ELSEWHERE: Final = 1.0
"""Difference of the device's and the host's time over lost frames from which on it is another clock, s."""
_STALL: Final = 60.0  # no line holds rows back for half of this, s
_TIME: Final = re.compile(r"(?:t|time|timestamp|stamp|ts)(?:_?(s|sec|seconds|ms|millis|us|micros|ns))?")
_COUNTERS: Final = re.compile(
    r"(?:time_?)?(millis|micros|nanos|milliseconds|microseconds|seconds|sec|secs|ms|us|usec|msec)"
)
_UNITS: Final = {
    **dict.fromkeys(("s", "sec", "secs", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "millis", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "usec", "micros", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nanos"), 1e-9),
}


def time_column(columns: tuple[str, ...]) -> tuple[int, float | None] | None:
    """Which column of text is the time, and its unit.

    Parameters
    ----------
    columns : tuple of str
        Names as in the header, such as ``t_ms``, ``Time (s)``, ``micros``.

    Returns
    -------
    tuple or None
        Place of the first such column and its unit, s; the unit is None where the name does not state it.
    """
    for place, name in enumerate(columns):
        plain = without_unit(name).strip().lower()
        found = _TIME.fullmatch(plain) or _COUNTERS.fullmatch(plain)
        if not found:
            continue
        if plain != name.strip().lower():
            unit = lookup(re.sub(r"^.*[\[(]|[\])]\s*$", "", name))
            if unit is not None and unit[0] == "time":
                return place, unit[1]
        return place, _UNITS[found[1]] if found[1] else None
    return None


def guessed_unit(values: Array, arrival: Array) -> float:
    """Find the unit of a column of time that does not name it: by the host's clock, or in a short piece by its step.

    Parameters
    ----------
    values : (n,) array
        Times as they stand there.
    arrival : (n,) array
        When the rows arrived, s.
    """
    steps = np.diff(values)
    steps = steps[steps > 0.0]
    if not steps.size:
        return 1.0
    passed = float(arrival[-1] - arrival[0])
    if passed > 0.3:
        return min((1.0, 1e-3, 1e-6, 1e-9), key=lambda unit: abs(np.log(unit * float(steps.sum()) / passed)))
    step = float(np.median(steps))
    return 1.0 if step < 1.0 else 1e-3 if step < 1000.0 else 1e-6


class Unwrapper:
    """Follows a device's clock through rows as they come.

    Parameters
    ----------
    announced : Announced
        What the rows hold.
    unit : float, optional
        Unit of the column of time in text form, s, where its name does not state it.
    """

    def __init__(self, announced: Announced, unit: float | None = None) -> None:
        self._place: int | None = None
        self._tick = announced.tick
        self._wrap = WRAP
        if announced.form == "text":
            found = time_column(announced.columns)
            self._place = None if found is None else found[0]
            self._tick = 1.0 if found is None else (found[1] or unit or 1.0)
        self.segment = -1
        self._last = (0.0, 0.0, 0.0, 0)  # stamp, unwrapped, arrival, opening
        self._start = -1
        self._earliest = 0.0  # least arrival less the device's time, s, of the piece

    def add(self, rows: Arrived) -> tuple[Array, NDArray[np.int64]]:
        """Time on the device's clock and number of the piece in which that clock certainly ran on.

        Parameters
        ----------
        rows : Arrived
            The next rows.

        Returns
        -------
        tuple
            (n,) s, and (n,) number of the piece, which goes up at every doubt: the line was opened anew, the device
            started anew, or its clock and the computer's disagree over lost frames.
        """
        if rows.announced.form == "binary":
            stamps = rows.stamps.astype(np.float64)  # whole numbers up to 2^53 stay whole
            if self._start < 0:
                self._begin(rows, float(stamps[0]))
            before = np.concatenate(([self._last[0]], stamps[:-1]))
            step = (stamps - before) % WRAP
        else:
            stamps = self._text_stamps(rows)
            if self._start < 0:
                self._begin(rows, float(stamps[0]))
            before = np.concatenate(([self._last[0]], stamps[:-1]))
            step = stamps - before
            whole = (before == np.floor(before)) & (before < WRAP) & (before > 0.75 * WRAP) & (stamps < 0.25 * WRAP)
            step = np.where(whole & (step < 0.0), step + WRAP, step)
        opening = rows.opening.astype(np.int64)
        anew = opening != np.concatenate(([self._last[3]], opening[:-1]))
        start = rows.start.astype(np.int64)
        reset = start != np.concatenate(([self._start], start[:-1]))
        passed = np.diff(rows.arrival, prepend=self._last[2]) / self._tick
        missing = (rows.lost > 0) | anew
        if rows.announced.form == "binary":
            # a frame that follows the last one is less than half a turn away, unless a turn outlasts every stall
            turns = np.round((passed - step) / WRAP)
            near = np.where(step > 0.5 * WRAP, -1.0, 0.0)
            step += WRAP * np.where(missing | (self._tick * WRAP > _STALL), turns, near)
            back = (step < 0.0) & missing
        else:
            back = step < 0.0
        ticks = self._last[1] + np.cumsum(step)
        broken = anew | reset | back
        broken |= self._elsewhere(rows.arrival - ticks * self._tick, missing, broken)
        segment = self.segment + np.cumsum(broken)
        self.segment = int(segment[-1])
        self._start = int(start[-1])
        self._last = (float(stamps[-1]), float(ticks[-1]), float(rows.arrival[-1]), int(opening[-1]))
        return np.asarray(ticks * self._tick, dtype=np.float64), segment

    def _elsewhere(self, late: Array, missing: NDArray[np.bool_], broken: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Say at which lost frames the device's clock is another one, by how late rows arrive: (n,).

        A row arrives late while the computer is busy, and the rows behind it catch up. No row arrives before it was
        sent. A row has another clock if it is earlier than the earliest row of its piece, or suddenly much later.
        """
        found = np.zeros(late.size, np.bool_)
        grown = np.diff(late, prepend=self._last[2] - self._last[1] * self._tick) > ELSEWHERE
        edges = np.unique([0, *np.flatnonzero(broken), late.size])
        for begin, end in pairwise(edges.tolist()):
            if broken[begin]:
                self._earliest = float(late[begin])
            at = begin
            while at < end:
                earliest = np.minimum.accumulate(np.concatenate(([self._earliest], late[at:end])))
                other = missing[at:end] & (grown[at:end] | (late[at:end] < earliest[:-1] - ELSEWHERE))
                if not other.any():
                    self._earliest = float(earliest[-1])
                    break
                at += int(np.argmax(other))
                found[at] = True
                self._earliest = float(late[at])
                at += 1
        return found

    def _begin(self, rows: Arrived, stamp: float) -> None:
        self._earliest = float(rows.arrival[0]) - stamp * self._tick
        self._last = (stamp, stamp, float(rows.arrival[0]), int(rows.opening[0]))

    def _text_stamps(self, rows: Arrived) -> Array:
        """Return the times in the rows; one that is missing or agrees with no neighbour is that of the row before."""
        assert self._place is not None
        values = rows.values[:, self._place].copy()
        values[np.isinf(values)] = np.nan
        first = self._last[0] if self._start >= 0 else (values[~np.isnan(values)][:1].tolist() or [0.0])[0]
        held = np.concatenate(([first], values))
        known = np.maximum.accumulate(np.where(np.isnan(held), 0, np.arange(held.size)))
        held = held[known]
        # a digit lost in the cell: the rows around it agree with each other and not with it
        a, b, c = held[:-2], held[1:-1], held[2:]
        stray = (c >= a) & ((b < a) | (b > c)) & (np.maximum(a - b, b - c) * self._tick > ELSEWHERE)
        held[1:-1][stray] = a[stray]
        return held[1:]
