"""Stretches from all over a long log, which answer for it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np

from imufit.log.log import Chunk, Log, LogSource
from imufit.log.metadata import Metadata
from imufit.log.size import HELD, NUMBER, TEXT_CELL
from imufit.log.some_rows import SomeRows

MOST_ROWS: Final = 2_000_000
"""Rows that a model is held against at most: a diagnosis takes some 40 us of the processor for each, and from so many
it knows every effect to a thousandth of what is worth correcting."""
STRETCHES: Final = 96
"""Stretches, evenly spread: two in each of the 48 blocks that tell how much the residual scatters over the log."""


class Excerpt:
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
        self._log = log
        each = rows // STRETCHES
        firsts = np.linspace(0, log.n - each, STRETCHES).astype(int).tolist()
        name = "log" if log.path is None else log.path.name
        note = f"{name}: judged by {STRETCHES} stretches of {each} rows each, evenly spread over its {log.n} rows"
        self._rows = SomeRows(log, [(first, first + each) for first in firsts], note)

    @cached_property
    def _held(self) -> Log:
        return self._rows.read()

    @property
    def n(self) -> int:
        """Number of rows."""
        return self._rows.n

    @property
    def metadata(self) -> Metadata:
        """Frame, gravity, field, rig axis, noise."""
        return self._log.metadata

    @property
    def columns(self) -> tuple[str, ...]:
        """Contract columns that are there."""
        return self._log.columns

    @property
    def path(self) -> Path | None:
        """File of the log."""
        return self._log.path

    @property
    def notes(self) -> tuple[str, ...]:
        """What reading noticed or changed, and which rows these are."""
        return self._rows.notes

    def chunks(self, rows: int, margin: int = 0) -> Iterator[Chunk]:
        """Cut into chunks of `rows` rows with up to `margin` rows more on either side.

        Parameters
        ----------
        rows : int
            Rows of a chunk's core.
        margin : int
            Rows of context on either side, fewer at the ends.
        """
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
