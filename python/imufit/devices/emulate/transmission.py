"""One run of an emulated device: samples when they are due, announcements, faults, and what became of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from threading import Event
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imufit.devices.emulate.clock import Clock
from imufit.devices.emulate.course import Course
from imufit.devices.emulate.device import Device
from imufit.devices.emulate.faults import FAULTS, Fault, Piece, Schedule
from imufit.devices.emulate.form import Form
from imufit.devices.emulate.line import Line
from imufit.devices.emulate.pace import Pace
from imufit.devices.emulate.sent import Sent

Array = NDArray[np.float64]

ROWS = 1024
"""Samples written at a time at most."""
PATIENCE = 1.0
"""Time (s) for which a reader may be busy before samples are discarded, as they are by the buffers of a real port."""
LEAVE = 0.05
"""Longest wait (s) without looking whether the reader has gone."""
DRAINED = 2.0
"""Longest wait (s) before the line is closed on purpose, for the reader to read what it was sent."""
PULLED = 0.3
"""Time (s) for which an unplugged line stays away at full speed, where its own time does not pass."""


@dataclass(frozen=True)
class Parts:
    """The parts of a run.

    Attributes
    ----------
    device, form, clock, line, pace, course, schedule, sent :
        See their classes.
    rng : numpy.random.Generator
        Of jitter and damage.
    """

    device: Device
    form: Form
    clock: Clock
    line: Line
    pace: Pace
    course: Course
    schedule: Schedule
    sent: Sent
    rng: np.random.Generator


class Transmission:
    """A run of a device.

    Parameters
    ----------
    parts : Parts
        What it is made of; the line is open.
    stop : threading.Event
        Ends it.

    Attributes
    ----------
    counts : Counter
        Of ``samples`` taken, ``intact`` on the line, ``unread`` without a reader, ``overrun`` with one too slow;
        ``announcements`` and ``bytes``.
    struck : list of Fault
        Faults that came about.
    starts : int
        How often the device began.
    """

    def __init__(self, parts: Parts, stop: Event) -> None:
        self._is, self._stop = parts, stop
        self._form, self._began, self._ticks = parts.form, 0.0, parts.clock.start
        self._period = parts.course.time(1) - parts.course.time(0)
        self._row, self._announce_at, self._plug_at = 0, 0.0, -np.inf
        # Whether the next byte begins a frame for the reader.
        self._clear, self._greeted = True, False
        self._asked = False
        self.counts: Counter[str] = Counter()
        self.struck: list[Fault] = []
        self.starts = 1

    @property
    def time(self) -> float:
        """Time of the device at the next sample, s."""
        return self._is.course.time(self._row)

    def await_reader(self) -> None:
        """Wait until somebody listens."""
        while not self._stop.is_set() and not self._is.line.attached():
            self._is.pace.rest(0.0)

    def run(self) -> None:
        """Send until the source ends or the run is stopped."""
        course, pace, schedule = self._is.course, self._is.pace, self._is.schedule
        pace.begin()
        while not self._stop.is_set() and self._row < course.total:
            t = course.time(self._row)
            now = pace.now()
            if t > now:
                pace.wait(t)
                continue
            if self._plug_at > -np.inf and t >= self._plug_at:
                self._plug_at = -np.inf
                self._is.line.open()
            self._asked |= self._form.asks(self._is.line.heard())
            if t >= self._announce_at or (self._asked and self._is.line.attached()):
                self._announce()
                self._asked = False
                self._announce_at = t + self._form.every
            faults = schedule.due(t)
            if faults:
                self._strike(faults)
                continue
            ahead = min(now, self._announce_at, schedule.next, self._plug_at if self._plug_at > -np.inf else np.inf)
            end = course.first_at(ahead) if np.isfinite(ahead) else course.total
            self._send(max(self._row + 1, min(end, course.total, self._row + ROWS)))

    def _take(self, stop: float) -> tuple[tuple[int, NDArray[np.uint16], NDArray[np.uint32]], Array, Array]:
        """Take samples: head, times and values of the rows from here on, in one piece of the source."""
        place, t = self._is.course.piece(self._row, stop)
        stamps = self._is.clock.ticks(t, self._period, self._is.rng, begun=self._began, start=self._ticks)
        sequence = (np.arange(len(t)) + self._form.sequence).astype(np.uint16)
        return (self._form.start, sequence, stamps), t, self._is.device.values[place]

    def _send(self, stop: float) -> None:
        """Send samples that nothing strikes."""
        head, t, values = self._take(stop)
        data, ends = self._form.rows(head[2], values)
        intact = np.zeros(len(t), np.bool_)
        if not self._listening():
            self.counts["unread"] += len(t)
        else:
            begins_clear = self._clear
            taken = self._put(data)
            intact = ends <= taken
            intact[0] &= begins_clear
            self.counts["overrun"] += int(np.sum(ends > taken))
        self._record(head, t, values, intact)

    def _record(
        self,
        head: tuple[int, NDArray[np.uint16], NDArray[np.uint32]],
        t: Array,
        values: Array,
        intact: NDArray[np.bool_],
    ) -> None:
        self.counts["samples"] += len(t)
        self.counts["intact"] += int(intact.sum())
        self._is.sent.add(head, t, self._is.pace.host(t), intact, values)
        self._row += len(t)

    def _strike(self, faults: Sequence[Fault]) -> None:
        """Send one sample, with what happens to it."""
        head, t, values = self._take(self._row + 1)
        data, _ = self._form.rows(head[2], values)
        pieces = [Piece(data, self._row)]
        for fault in faults:
            pieces = FAULTS[fault.kind].change(pieces, fault, self._is.rng)
        whole = any(piece.row is not None for piece in pieces)
        if self._listening():
            for piece in pieces:
                whole &= self._clear or piece.row is None or not piece.data
                taken = self._put(piece.data)
                whole &= piece.row is None or (piece.whole and taken == len(piece.data))
        else:
            whole = False
            self.counts["unread"] += 1
        self.struck += faults
        self._record(head, t, values, np.array([whole]))
        for fault in faults:
            if fault.kind == "unplug":
                self._unplug(float(t[0]) + fault.length)
            elif fault.kind == "reset":
                self._reset(float(t[0]), fault.length)

    def _announce(self) -> None:
        """Announce the columns of the samples."""
        data = self._form.announce()
        self.counts["announcements"] += 1
        greeted = self._greeted or not self._form.greets
        if self._listening() and greeted:
            self._put(data)

    def _unplug(self, until: float) -> None:
        """Close the line until a time of the device."""
        self._is.line.drain(DRAINED)
        self._is.line.close()
        self._clear, self._greeted = True, False
        self._plug_at = max(self._plug_at, until)
        if not self._is.pace.unhurried:
            self._is.pace.rest(PULLED)

    def _reset(self, t: float, silence: float) -> None:
        """Begin anew with the first sample after some silence."""
        course = self._is.course
        self._row = int(min(max(course.first_at(t + silence), self._row), course.total))
        if self._row < course.total:
            self._form, self._began, self._ticks = self._form.restarted(), course.time(self._row), 0
            self._announce_at = self._began
            self.starts += 1

    def _listening(self) -> bool:
        """Return whether somebody reads; at full speed wait for it, but not while the line is unplugged."""
        there = self._is.line.attached()
        while not there and not self._is.pace.unhurried and self._plug_at == -np.inf and not self._stop.is_set():
            self._is.pace.rest(0.0)
            there = self._is.line.attached()
        if not there:
            self._clear, self._greeted = True, False
        elif not self._greeted:
            self._greeted = True
            if self._form.greets:
                self._put(self._form.announce())
        return there

    def _put(self, data: bytes) -> int:
        """Write; return how many bytes were taken before the reader was too slow, or gone."""
        taken, waited = 0, 0.0
        while taken < len(data) and not self._stop.is_set():
            count = self._is.line.write(data[taken:], LEAVE)
            taken += count
            waited = 0.0 if count else waited + LEAVE
            if not count and (not self._is.line.attached() or (self._is.pace.unhurried and waited >= PATIENCE)):
                break
        if taken:
            self._clear = data[taken - 1] == self._form.end
        self.counts["bytes"] += taken
        return taken

    def summary(self) -> dict[str, Any]:
        """Return what was sent as plain values."""
        return {
            "duration_s": self.time if self.counts["samples"] else 0.0,
            **{name: self.counts[name] for name in ("samples", "intact", "unread", "overrun", "announcements")},
            "bytes": self.counts["bytes"],
            "starts": self.starts,
            "faults": [{"kind": f.kind, "at_s": f.at, "length": f.length} for f in self.struck],
        }
