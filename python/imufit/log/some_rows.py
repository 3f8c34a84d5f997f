"""Some of the rows of a log, as a log of their own: a part, or stretches from all over it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from imufit.errors import InputError
from imufit.log.cut import cut
from imufit.log.log import Chunk, Log, LogSource, gathered
from imufit.log.metadata import Metadata
from imufit.log.origin import Origin
from imufit.log.parquet import ROW_GROUP
from imufit.log.size import BLOCK_ROWS
from imufit.log.writer import write_rows

Span = tuple[int, int]
"""First row, and the row after the last one, counted from 0."""


class SomeRows:
    """Some of the rows of a log, which stays where it is.

    Parameters
    ----------
    log : LogSource
        The log.
    spans : sequence of (int, int)
        Stretches of its rows, ascending.
    note : str
        Notes on it; empty for nothing.

    Raises
    ------
    InputError
        The log has no such rows.
    """

    def __init__(self, log: LogSource, spans: Sequence[Span], note: str = "") -> None:
        ends = [0, *(end for span in spans for end in span)]
        if not spans or any(first >= stop for first, stop in spans) or ends != sorted(ends) or ends[-1] > log.n:
            told = ", ".join(f"{first}:{stop}" for first, stop in spans)
            raise InputError(
                f"rows {told} are not rows of this log",
                file=log.path,
                remedy=f"It has {log.n} rows: take them out of 0:{log.n}.",
            )
        self._log = log
        self._spans = tuple(spans)
        self._note = note
        self.n = sum(stop - first for first, stop in spans)

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
        """Findings and changes of the reader, and the rows."""
        return (*self._log.notes, *([self._note] if self._note else []))

    @property
    def origin(self) -> Origin:
        """Columns of the file that those of the log were made of."""
        return self._log.origin

    def pieces(self) -> Iterator[Log]:
        """Give the rows in order, some at a time."""
        spans = iter(self._spans)
        first, stop = next(spans)
        for chunk in self._log.chunks(BLOCK_ROWS):
            end = chunk.start + chunk.end - chunk.begin
            while first < end:
                low, high = max(first, chunk.start), min(stop, end)
                yield chunk.core.rows(low - chunk.start, high - chunk.start).with_fields(notes=self.notes)
                if stop > end:
                    break
                if (span := next(spans, None)) is None:
                    return
                first, stop = span

    def chunks(self, rows: int, margin: int = 0) -> Iterator[Chunk]:
        """Cut into chunks of `rows` rows with up to `margin` rows more on either side.

        Parameters
        ----------
        rows : int
            Rows of a chunk's core.
        margin : int
            Rows of context on either side, fewer at the ends of the log.
        """
        yield from cut(self.pieces(), rows, margin)

    def read(self) -> Log:
        """Hold these rows in memory."""
        return gathered(self.pieces(), self.n)

    def write(self, path: str | Path) -> None:
        """Write these rows as a log of their own.

        Parameters
        ----------
        path : str or Path
            Ending in ``.parquet``, ``.npz`` or ``.csv``.
        """
        write_rows(Path(path), self.metadata, (chunk.core.table() for chunk in self.chunks(ROW_GROUP)))
