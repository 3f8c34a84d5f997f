"""A line that shows that a command which runs until it is stopped is alive: renewed in place, or now and then."""

from __future__ import annotations

import sys
import time
from collections import deque
from types import TracebackType
from typing import Final, Self

HOW_TO_STOP: Final = "Ctrl-C ends it"
EVERY: Final = 0.2
"""Time between two states of the line on a terminal, s."""
SPARSE: Final = 10.0
"""Time between two lines where no terminal is, s: a file of one hour has 360 of them."""
_WINDOW: Final = 2.0
"""Time over which the rate is taken, s."""


class LifeLine:
    """Shows seconds, samples, rate and the key to stop on standard error; a context manager that ends the line."""

    def __init__(self) -> None:
        self._in_place = sys.stderr.isatty()
        self._begin = time.monotonic()
        self._next = self._begin + (0.0 if self._in_place else SPARSE)
        self._marks: deque[tuple[float, int]] = deque()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._in_place:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()

    def __call__(self, samples: int, more: str = "") -> None:
        """Show the state when it is time.

        Parameters
        ----------
        samples : int
            Samples so far.
        more : str
            What else is to be said.
        """
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + (EVERY if self._in_place else SPARSE)
        self._marks.append((now, samples))
        while now - self._marks[0][0] > _WINDOW and len(self._marks) > 2:
            self._marks.popleft()
        passed, gained = now - self._marks[0][0], samples - self._marks[0][1]
        if not passed:
            passed, gained = max(now - self._begin, EVERY), samples
        words = [f"{now - self._begin:.0f} s", f"{samples} samples", f"{gained / passed:.0f} Hz"]
        line = "  ".join([*words, *([more] if more else []), HOW_TO_STOP])
        sys.stderr.write(f"\r{line}\x1b[K" if self._in_place else f"{line}\n")
        sys.stderr.flush()
