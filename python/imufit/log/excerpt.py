"""Stretches from all over a long log, which answer for it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Final

import numpy as np

from imufit.log.log import Chunk, Log, LogSource
from imufit.log.size import HELD, NUMBER, TEXT_CELL
from imufit.log.some_rows import SomeRows

MOST_ROWS: Final = 2_000_000
"""Rows that a model is held against at most: a diagnosis takes some 40 us of the processor for each, and from so many
it knows every effect to a thousandth of what is worth correcting."""
STRETCHES: Final = 96
"""Stretches, evenly spread: two in each of the 48 blocks that show how much the residual scatters over the log."""


class Excerpt(SomeRows):
    """Stretches of a log, evenly spread over it and held in memory.

    Between two stretches its time has a gap, as a log has where its recording was interrupted. It is equal to the log
    that it is of, since it answers for it.

    Parameters
    ----------
    log : LogSource
        The log.
    rows : int
        Rows of all stretches together.
    """

    def __init__(self, log: LogSource, rows: int) -> None:
        each = rows // STRETCHES
        firsts = np.linspace(0, log.n - each, STRETCHES).astype(int).tolist()
        name = "log" if log.path is None else log.path.name
        note = f"{name}: judged by {STRETCHES} stretches of {each} rows each, evenly spread over its {log.n} rows"
        super().__init__(log, [(first, first + each) for first in firsts], note)

    @cached_property
    def _held(self) -> Log:
        return self.read()

    def chunks(self, rows: int, margin: int = 0) -> Iterator[Chunk]:
        """Cut into chunks as `SomeRows.chunks` does, without reading the log again."""
        return self._held.chunks(rows, margin)

    def __eq__(self, other: object) -> bool:
        return self is other or self._log is other or (isinstance(other, Excerpt) and self._log is other._log)

    def __hash__(self) -> int:
        return hash(self._log)


def judged_rows(log: LogSource) -> LogSource:
    """Return a log, or an excerpt of one that is too long to be held or to be judged row by row.

    Parameters
    ----------
    log : LogSource
        The log.
    """
    if isinstance(log, Excerpt) or log.n <= STRETCHES:
        return log
    first = next(iter(log.chunks(1))).log.table()
    row = sum(TEXT_CELL if cells.dtype == object else NUMBER for cells in first.values())
    rows = min(MOST_ROWS, HELD // row)
    return log if log.n <= rows else Excerpt(log, rows)
