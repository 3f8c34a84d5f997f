"""Bytes of a line to rows, in whichever form of the wire protocol they come."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from imufit import _imufit
from imufit.devices.record.arrived import FORMS, Arrived, Chunk, of_frames, of_lines
from imufit.devices.record.transport import Line
from imufit.errors import InputError
from imufit.remedy import keyword, option

PAUSE: Final = (0.006, 0.012)
"""Shortest and longest wait between two reads, s: irregular, so that no rate of a device falls in step with it."""

ASK_EVERY: Final = 0.1
"""Time between two requests to a device that has not announced its columns yet, s."""
ASK_FOR: Final = 1.0
"""Time for requests after the line was opened, s: then the device announces itself anyway, or sends no frames."""
_DOUBTFUL: Final = 50


@dataclass(frozen=True)
class Listening:
    """How the line was listened to.

    Attributes
    ----------
    form : {"auto", "binary", "text"}
        Form of the wire protocol, as it was asked for.
    header : str or None
        Names of the columns in text form, for a device that prints none.
    baud : int
        Speed of the line, 1/s.

    Raises
    ------
    ValueError, TypeError or OverflowError
        A value is of another kind or out of range.
    """

    form: str
    header: str | None
    baud: int

    def __post_init__(self) -> None:
        if (
            self.form not in ("auto", *FORMS)
            or not isinstance(self.header, str | None)
            or self.baud != int(self.baud)
            or self.baud <= 0
        ):
            raise ValueError("this is not how a line is listened to")


class Reception:
    """Reads a line and decodes what comes.

    Parameters
    ----------
    line : Line
        Open.
    form : {"auto", "binary", "text"}
        Form of the wire protocol; auto takes the first in which something whole comes, and loses nothing before.
    header : str, optional
        Names of the columns in text form, for a device that prints none.

    Attributes
    ----------
    form : str or None
        The form, once it is known.
    listening : Listening
        Form and header as they were given, and the speed of the line.
    chunk : Chunk or None
        What the last read brought; None if it was nothing.
    """

    def __init__(self, line: Line, form: str = "auto", header: str | None = None) -> None:
        if form not in ("auto", *FORMS):
            raise InputError(f"the form {form!r} is not known", remedy="Use auto, binary or text.")
        self.line = line
        if header is not None and form == "binary":
            raise InputError(
                "a header names the columns of text, not of binary frames", remedy="Leave one of them out."
            )
        self.form: str | None = "text" if header is not None else None if form == "auto" else form
        self.listening = Listening(form, header, line.baud)
        self.chunk: Chunk | None = None
        self._decoded = line.opening
        self._opening = -1  # of the line as it was read last: not at all
        self._asking = (0.0, 0.0)  # when to ask next, and until when
        self._bytes = 0
        self._damaged: int | None = None
        self._texts: list[str] = []
        self._doubtful: list[str] = []  # lines that are messages if the form is text
        self._frames = _imufit.WireDecoder()
        # of each call of feed from the first that may still wait for its announcement: number, arrival, opening
        self._feeds: list[tuple[float, int]] = []
        self._first_feed = 1
        self._lines = _imufit.LineDecoder()
        if header is not None:
            self._lines.feed(header.encode() + b"\n")
            self._lines.interrupted()  # the first line after it may lack its beginning

    def poll(self) -> list[Arrived]:
        """Read once; return what has become whole."""
        data = self.line.read()
        now = time.monotonic()
        self.chunk = Chunk(now, self.line.opening, data) if data else None
        rows = [] if self.chunk is None else self.take_in(self.chunk)
        self._ask(now, known=bool(rows))
        return rows

    def take_in(self, chunk: Chunk) -> list[Arrived]:
        """Decode bytes that were read, now or earlier; return what has become whole.

        Parameters
        ----------
        chunk : Chunk
            The bytes, in the order in which they were read.
        """
        if chunk.opening != self._decoded:
            # half a frame from before the line was lost does not go on
            self._decoded = chunk.opening
            self._frames.interrupted()
            self._lines.interrupted()
        self._bytes += len(chunk.data)
        if self.form != "text":
            self._frames.feed(chunk.data)
            self._feeds.append((chunk.arrival, chunk.opening))
        if self.form != "binary":
            self._lines.feed(chunk.data)
        return self._taken(chunk.arrival)

    def _ask(self, now: float, *, known: bool) -> None:
        """Ask the device to announce itself, from each opening of the line until it is known what its samples hold."""
        if self.line.opening != self._opening and self.line.lost_since is None:
            self._opening = self.line.opening
            self._asking = (now, now + ASK_FOR)
        if known or self.form == "text":
            self._asking = (np.inf, now)
        if self._asking[0] <= now <= self._asking[1]:
            self._asking = (now + ASK_EVERY, self._asking[1])
            self.line.ask()

    def finish(self) -> list[Arrived]:
        """Nothing more is read: return samples that still wait for an announcement, if there ever was one.

        A remaining half frame is not damage: it is this end that cuts it.
        """
        self.chunk = None
        if self.form is not None:
            self._damaged = self.counts["damaged"]
        if self.form != "text":
            self._frames.finish()
        return self._taken(time.monotonic())

    def _taken(self, now: float) -> list[Arrived]:
        rows: list[Arrived] = []
        if self.form != "text":
            rows = [self._of_frames(batch) for batch in self._frames.take()]
            texts = self._frames.take_texts()
            if self.form is None and (rows or texts or self._frames.announcement() is not None):
                self.form = "binary"
                self._doubtful = []
            self._texts += texts
        if self.form != "binary":
            rows = [of_lines(batch, now, self._decoded) for batch in self._lines.take()]
            if self.form is None and rows:
                self.form = "text"
            texts = self._lines.take_texts()
            if self.form == "text":
                self._texts += self._doubtful + texts
                self._doubtful = []
            else:
                self._doubtful = (self._doubtful + texts)[-_DOUBTFUL:]
        return [part for part in rows if part.n]

    def _of_frames(self, batch: Any) -> Arrived:
        """Rows of a batch, each with when it came: before an announcement explained it, perhaps on another opening."""
        if not batch["feed"].size:
            return of_frames(batch, np.empty(0), np.empty(0, np.uint32))
        place = (batch["feed"] - np.uint64(self._first_feed)).astype(np.intp)
        arrival, opening = np.array(self._feeds[: int(place[-1]) + 1]).T
        rows = of_frames(batch, arrival[place], opening[place].astype(np.uint32))
        # Rows come in order: nothing before the last one is requested again.
        del self._feeds[: int(place[-1])]
        self._first_feed += int(place[-1])
        return rows

    def take_texts(self) -> list[str]:
        """Messages of the device since the last call."""
        texts, self._texts = self._texts, []
        return texts

    @property
    def counts(self) -> dict[str, int]:
        """Bytes, samples, and what is ``lost``, ``damaged``, ``unknown``, ``unexplained``, ``restarts``."""
        nothing = dict.fromkeys(("samples", "lost", "damaged", "unknown", "unexplained", "restarts"), 0)
        of_form = {} if self.form is None else (self._lines if self.form == "text" else self._frames).counts()
        whole = {} if self._damaged is None else {"damaged": self._damaged}
        return {**nothing, **of_form, **whole, "bytes": self._bytes}

    @property
    def unexplained(self) -> int:
        """Samples that were discarded since their columns were unknown, also where no form is known."""
        return int(self._frames.counts()["unexplained"])

    @property
    def nothing_whole(self) -> str:
        """Why nothing could be decoded so far; empty if something was."""
        frames, lines = self._frames.counts(), self._lines.counts()
        said = self._doubtful[-1] if self._doubtful else ""
        header = option("header", "t_ms,acc_x,...")
        reasons = {
            "": frames["samples"] or lines["samples"],
            "nothing came from the device": not self._bytes,
            f"rows of numbers came, but no header that names them: give one, {header}": lines["unexplained"],
            f"{frames['unexplained']} samples came, but no announcement of their columns": frames["unexplained"],
            "the device announced itself, but sent no sample": self._frames.announcement() is not None,
            f"no row and no frame came, but the device reports {said[:80]!r}": said.isascii()
            and said.isprintable()
            and said,
        }
        otherwise = (
            f"{self._bytes} bytes came, but no whole frame and no rows under a header: check {keyword('baud')} "
            "and that the device uses the wire protocol"
        )
        return next((reason for reason, holds in reasons.items() if holds), otherwise)


def listen(
    reception: Reception,
    *,
    duration: float | None = None,
    give_up: float | None = None,
    stopped: Callable[[], bool] = lambda: False,
) -> Iterator[list[Arrived]]:
    """Read until it is over, some hundred times a second; most reads give a few rows or none.

    Parameters
    ----------
    reception : Reception
        On an open line.
    duration : float, optional
        Ends so long after the beginning, s.
    give_up : float, optional
        Ends when the line was lost for so long, s; without it waits for ever.
    stopped : callable
        Ends when it returns True.
    """
    end = None if duration is None else time.monotonic() + duration
    while not stopped():
        yield reception.poll()
        now = time.monotonic()
        lost = reception.line.lost_since
        if (end is not None and now >= end) or (give_up is not None and lost is not None and now - lost >= give_up):
            return
        time.sleep(random.uniform(*PAUSE))
