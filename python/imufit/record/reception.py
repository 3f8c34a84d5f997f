"""Bytes of a line to rows, in whichever form of the wire protocol they come."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterator
from typing import Final

from imufit import _imufit
from imufit.errors import InputError
from imufit.record.arrived import FORMS, Arrived, of_frames, of_lines
from imufit.record.transport import Line

PAUSE: Final = (0.006, 0.012)
"""Shortest and longest wait between two reads, s: irregular, so that no rate of a device falls in step with it."""

_DOUBTFUL: Final = 50


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
        self._opening = line.opening
        self._bytes = 0
        self._damaged: int | None = None
        self._texts: list[str] = []
        self._doubtful: list[str] = []  # lines that are messages if the form is text
        self._frames = _imufit.WireDecoder()
        self._lines = _imufit.LineDecoder()
        if header is not None:
            self._lines.feed(header.encode() + b"\n")
            self._lines.interrupted()  # the first line after it may lack its beginning

    def poll(self) -> list[Arrived]:
        """Read once; return what has become whole."""
        data = self.line.read()
        now = time.monotonic()
        # what came before the line was lost was decoded then
        if self.line.opening != self._opening:
            self._opening = self.line.opening
            self._frames.interrupted()
            self._lines.interrupted()
        if not data:
            return []
        self._bytes += len(data)
        if self.form != "text":
            self._frames.feed(data)
        if self.form != "binary":
            self._lines.feed(data)
        return self._taken(now)

    def finish(self) -> list[Arrived]:
        """Nothing more is read: return samples that still wait for an announcement, if there ever was one.

        Half a frame that is left is no damage: it is this end that cuts it.
        """
        if self.form is not None:
            self._damaged = self.counts["damaged"]
        if self.form != "text":
            self._frames.finish()
        return self._taken(time.monotonic())

    def _taken(self, now: float) -> list[Arrived]:
        rows: list[Arrived] = []
        if self.form != "text":
            rows = [of_frames(batch, now, self._opening) for batch in self._frames.take()]
            texts = self._frames.take_texts()
            if self.form is None and (rows or texts or self._frames.announcement() is not None):
                self.form = "binary"
                self._doubtful = []
            self._texts += texts
        if self.form != "binary":
            rows = [of_lines(batch, now, self._opening) for batch in self._lines.take()]
            if self.form is None and rows:
                self.form = "text"
            texts = self._lines.take_texts()
            if self.form == "text":
                self._texts += self._doubtful + texts
                self._doubtful = []
            else:
                self._doubtful = (self._doubtful + texts)[-_DOUBTFUL:]
        return [part for part in rows if part.n]

    def take_texts(self) -> list[str]:
        """Messages of the device since this was last asked."""
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
    def nothing_whole(self) -> str:
        """Why nothing could be decoded so far; empty if something was."""
        frames, lines = self._frames.counts(), self._lines.counts()
        said = self._doubtful[-1] if self._doubtful else ""
        reasons = {
            "": frames["samples"] or lines["samples"],
            "nothing came from the device": not self._bytes,
            "rows of numbers came, but no header that names them: give one with --header t_ms,acc_x,...": lines[
                "unexplained"
            ],
            f"{frames['unexplained']} samples came, but no announcement that says what they hold": frames[
                "unexplained"
            ],
            "the device announced itself, but sent no sample": self._frames.announcement() is not None,
            f"no row and no frame came, but the device says {said[:80]!r}": said.isascii()
            and said.isprintable()
            and said,
        }
        otherwise = (
            f"{self._bytes} bytes came, but no whole frame and no rows under a header: check --baud, "
            "and that the device speaks the wire protocol"
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
