"""Presses of a button in a list that changes beneath the pointer: the second of a double click does not count."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

DOUBLE_CLICK: Final = 0.5
"""Longest time between the two clicks of a double click, s: the default of Windows (500 ms)."""


class Presses:
    """Presses of all buttons of one list.

    Parameters
    ----------
    clock : callable, optional
        Time, s.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._last = -DOUBLE_CLICK

    def counts(self) -> bool:
        """Return whether a press now is one of its own, and not the second of a double click."""
        now = self._clock()
        own = now - self._last >= DOUBLE_CLICK
        if own:
            self._last = now
        return own
