"""The time of every row of a recording: its clock is fitted in one pass over the rows, and applied in another."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imufit.devices.record.arrived import Arrived
from imufit.devices.record.clock import CLOSE, ClockFit, fit_clock, spread, spread_arrivals, typical_step
from imufit.devices.record.ticks import Unwrapper, guessed_unit, time_column

Array = NDArray[np.float64]

FEW = 1000
"""Rows of a run of the clock that its usual step is taken of at least, where it has so many."""


@dataclass(frozen=True)
class Clock:
    """The source of the times of the rows under one announcement.

    Attributes
    ----------
    unit : float or None
        Unit of the column of time, s, where its name does not state it.
    fit : ClockFit or None
        None where the device sends no time.
    notes : tuple of str
        What was taken for granted.
    """

    unit: float | None
    fit: ClockFit | None
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Timing:
    """Time of n rows under one announcement.

    Attributes
    ----------
    t : (n,) array
        On the host's clock (`time.monotonic`), s, strictly increasing.
    run : (n,) int array
        Number of the run of the device's clock.
    fit : ClockFit or None
        None where the device sends no time.
    notes : tuple of str
        What was taken for granted.
    """

    t: Array
    run: NDArray[np.int64]
    fit: ClockFit | None
    notes: tuple[str, ...]


def timed(rows: Arrived) -> Timing:
    """Compute the time of rows.

    Parameters
    ----------
    rows : Arrived
        All rows under one announcement.
    """
    clock = clock_of([rows])
    pieces = list(timed_blocks([rows], clock))
    t, run = (np.concatenate(values) for values in zip(*((t, run) for _, t, run in pieces), strict=True))
    return Timing(t, run, clock.fit, clock.notes)


def clock_of(blocks: Iterable[Arrived]) -> Clock:
    """Fit the clock of the rows under one announcement.

    Of rows that were read together only the last is kept: it waited least.

    Parameters
    ----------
    blocks : iterable of Arrived
        All of these rows, some at a time.
    """
    unit: float | None = None
    notes: list[str] = []
    unwrapper: Unwrapper | None = None
    kept: list[tuple[NDArray[Any], ...]] = []
    last: tuple[NDArray[Any], ...] | None = None
    for rows in blocks:
        if unwrapper is None:
            if rows.announced.form == "text":
                found = time_column(rows.announced.columns)
                if found is None:
                    note = (
                        "the rows have no column of time (t, t_ms, t_us, millis, micros, ...): they are timed as they "
                        "arrived"
                    )
                    return Clock(None, None, (note,))
                if found[1] is None:
                    name = rows.announced.columns[found[0]]
                    unit = guessed_unit(rows.values[:, found[0]], rows.arrival)
                    words = {1.0: "s", 1e-3: "ms", 1e-6: "us", 1e-9: "ns"}[unit]
                    notes.append(f"column {name} does not name its unit: by the computer's clock it is {words}")
            unwrapper = Unwrapper(rows.announced, unit)
        device, segment = unwrapper.add(rows)
        told: tuple[NDArray[Any], ...] = (device, rows.arrival, segment, rows.start)
        # The last row of a read may stand in the block before, and its first row in the next one.
        joined = told if last is None else tuple(np.concatenate(pair) for pair in zip(last, told, strict=True))
        ends = _ends_of_reads(joined[1], joined[2])
        kept.append(tuple(values[:-1][ends] for values in joined))
        last = tuple(values[-1:] for values in joined)
    assert last is not None
    kept.append(last)
    device, arrival, segment, start = (np.concatenate(values) for values in zip(*kept, strict=True))
    fit = fit_clock(device, arrival, segment, start)
    if fit.alien:
        notes.append("the rows came at another rate than their time states: the device's seconds were used unchanged")
    return Clock(unit, fit, tuple(notes))


def _ends_of_reads(arrival: NDArray[Any], segment: NDArray[Any]) -> NDArray[np.bool_]:
    """Mark, of all rows but the last, those that end a read, and those that begin a piece of the clock."""
    new = np.diff(segment) != 0
    begins = np.concatenate(([True], new[:-1])) if new.size else new
    return np.asarray((np.diff(arrival) != 0.0) | new | begins)


def timed_blocks(blocks: Iterable[Arrived], clock: Clock) -> Iterator[tuple[Arrived, Array, NDArray[np.int64]]]:
    """Give rows with their time (s, on the host's clock, strictly increasing) and the run of the device's clock.

    Rows that share a stamp are spread up to the next one, for which those at the end of a block wait.

    Parameters
    ----------
    blocks : iterable of Arrived
        All rows under one announcement, some at a time.
    clock : Clock
        Fitted to the same rows.
    """
    if clock.fit is None:
        yield from _as_they_arrived(blocks)
        return
    fit = clock.fit
    number = np.cumsum(np.concatenate(([0], (np.diff(fit.offsets) != 0.0).astype(np.int64))))
    unwrapper: Unwrapper | None = None
    waiting: tuple[Arrived, Array, NDArray[np.int64]] | None = None
    runs = Runs()
    for rows in blocks:
        unwrapper = unwrapper or Unwrapper(rows.announced, clock.unit)
        device, segment = unwrapper.add(rows)
        raw, run = fit.offsets[segment] + fit.rate * device, number[segment]
        if waiting is not None:
            rows = Arrived.joined([waiting[0], rows])  # noqa: PLW2901
            raw, run = np.concatenate((waiting[1], raw)), np.concatenate((waiting[2], run))
        t = runs.told(raw, run, whole=False)
        if t.size:
            yield rows.part(0, t.size), t, run[: t.size]
        waiting = rows.part(t.size, rows.n), raw[t.size :], run[t.size :]
    if waiting is not None and waiting[0].n:
        yield waiting[0], runs.told(waiting[1], waiting[2], whole=True), waiting[2]


class Runs:
    """Makes times increase with the rows: runs of the clock that overlap are moved behind each other."""

    def __init__(self) -> None:
        self._close: float | None = None
        self._run = -1
        self._step = self._shift = 0.0
        self._floor = self._end = -np.inf

    def told(self, raw: Array, run: NDArray[np.int64], *, whole: bool) -> Array:
        """Compute the times of as many of the rows, from the first, as are determined yet.

        Parameters
        ----------
        raw : (n,) array
            Time on the host's clock as the device's clock gives it, s; rows that waited come again.
        run : (n,) int array
            Number of the run of the device's clock.
        whole : bool
            Whether these are the last rows, so that none has to wait.

        Returns
        -------
        (k,) array
            Strictly increasing, s; the other rows wait for what follows.
        """
        if self._close is None:
            self._close = CLOSE * typical_step(raw)
        edges = [0, *(np.flatnonzero(np.diff(run)) + 1).tolist(), raw.size]
        out = [self._told(raw[a:b], int(run[a]), whole=whole or b < raw.size) for a, b in pairwise(edges) if b > a]
        return np.concatenate(out) if out else np.empty(0)

    def _told(self, raw: Array, run: int, *, whole: bool) -> Array:
        assert self._close is not None
        begins = run != self._run
        if begins and raw.size < FEW and not whole:
            return np.empty(0)
        if begins:
            self._floor = -np.inf
        held = np.maximum.accumulate(np.maximum(raw, self._floor))
        if begins:
            self._run = run
            self._step = typical_step(held)
            self._shift = max(0.0, self._end + self._close - float(held[0])) if held[0] <= self._end else 0.0
        known = raw.size if whole else int(np.searchsorted(held, held[-1]))
        self._floor = float(held[-1])
        t = spread(held, self._step)[:known] + self._shift
        if t.size:
            self._end = float(t[-1])
        return t


def _as_they_arrived(blocks: Iterable[Arrived]) -> Iterator[tuple[Arrived, Array, NDArray[np.int64]]]:
    """Compute the times of rows of a device that sends none: those of the last read wait for the rest of it."""
    waiting: Arrived | None = None
    step: float | None = None
    before = -np.inf
    for rows in blocks:
        if waiting is not None:
            rows = Arrived.joined([waiting, rows])  # noqa: PLW2901
        if step is None:
            step = typical_step(rows.arrival)
        known = int(np.searchsorted(rows.arrival, rows.arrival[-1]))
        if known:
            told = rows.part(0, known)
            yield told, spread_arrivals(told.arrival, before, step), np.zeros(known, np.int64)
            before = float(told.arrival[-1])
        waiting = rows.part(known, rows.n)
    if waiting is not None and waiting.n and step is not None:
        yield waiting, spread_arrivals(waiting.arrival, before, step), np.zeros(waiting.n, np.int64)
