"""A recording of several tables as one: a row for every time at which one of the tables in use has a sample."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.formats import Recording, Table
from imufit.log.clock import clocks_of
from imufit.log.each_once import check_each_once
from imufit.log.makers import Maker, maker_of
from imufit.log.place import Place
from imufit.log.size import BLOCK_ROWS, size_in_words
from imufit.log.words import time_columns, words_of
from imufit.printable import NAME, printable

_SHOWN: Final = 8
"""Tables that a note names at most."""


class TablesSource:
    """The tables of a recording as a source of blocks.

    Of several tables the columns are called ``TABLE.COLUMN``, and ``t`` is the time of all; only tables of which a
    column is chosen give rows. A single table keeps its own names.

    Parameters
    ----------
    path : Path
        File or folder.
    recording : Recording
        What it holds.

    Raises
    ------
    InputError
        The file holds no table, or of several tables none has a time.
    """

    def __init__(self, path: Path, recording: Recording) -> None:
        self._path = path
        self.embedded: Mapping[str, Any] = recording.metadata
        self.truths: Mapping[str, tuple[int | None, str]] = {}
        tables = tuple(table for table in recording.tables if table.n)
        if not tables:
            raise InputError(f"the {recording.form} holds no samples", file=path, remedy="Record or export it again.")
        self.several = len(tables) > 1
        self._columns: dict[str, tuple[int, NDArray[Any]]] = {}
        self._times: dict[int, NDArray[np.float64]] = {}
        lost: list[str] = []
        shown = [_whole(table, name) for table in tables for name in table.columns]
        self.clues = (path.name, *recording.clues, *(shown if self.several else tables[0].columns))
        maker = maker_of(self.clues)
        for k, table in enumerate(tables):
            time = _time_of(table, maker)
            if self.several and time is None:
                lost.append(table.name)
                continue
            if time is not None and (self.several or table.time is not None):
                self._times[k] = time[1]
            for name, values in table.columns.items():
                if k not in self._times or time is None or name != time[0]:
                    self._columns[_whole(table, name) if self.several else name] = (k, values)
        if not self._columns:
            raise InputError(
                f"of {len(tables)} tables of the {recording.form} none has a time",
                file=path,
                remedy="Export the time of each sample with it.",
            )
        self.names = (*(("t",) if self._times else ()), *self._columns)
        check_each_once(self.names, Place(path))
        self._used = sorted({k for k, _ in self._columns.values()})
        self._merge()
        self.notes = (f"{path.name}: {recording.form}", *(note.rstrip(".") for note in recording.notes))
        if lost:
            words = ", ".join(printable(name, NAME) for name in lost[:_SHOWN])
            self.notes += (f"{path.name}: left out without a time: {words}{' ...' if len(lost) > _SHOWN else ''}",)

    def choose(self, columns: Sequence[str]) -> None:
        """Take rows of those tables alone that have one of the columns."""
        used = sorted({self._columns[name][0] for name in columns if name in self._columns})
        if used and used != self._used:
            self._used = used
            self._merge()

    def _merge(self) -> None:
        """Lay the times of the tables in use beside one another."""
        if self._times:
            self._t = np.unique(np.concatenate([self._times[k] for k in self._used if k in self._times]))
            self._t = self._t[np.isfinite(self._t)]
            self.n = self._t.size
        else:
            self.n = max((values.size for _, values in self._columns.values()), default=0)

    @property
    def text(self) -> frozenset[str]:
        """Columns that hold text."""
        return frozenset(name for name, (_, values) in self._columns.items() if values.dtype == object)

    def scan(self, columns: Sequence[str]) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """Give the named columns block by block."""
        return self.blocks(columns)

    def blocks(self, columns: Sequence[str]) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """Give the named columns block by block."""
        whole = {name: self._column(name) for name in columns}
        for start in range(0, self.n, BLOCK_ROWS):
            rows = min(BLOCK_ROWS, self.n - start)
            yield start, rows, {name: values[start : start + rows] for name, values in whole.items()}

    def _column(self, name: str) -> NDArray[Any]:
        if name == "t" and self._times:
            return self._t
        k, values = self._columns[name]
        if k not in self._times:
            return values
        laid = np.full(self.n, None if values.dtype == object else np.nan, dtype=values.dtype)
        time = self._times[k]
        known = np.isfinite(time)
        laid[np.minimum(np.searchsorted(self._t, time[known]), self.n - 1)] = values[known]
        return laid

    def line_of(self, row: int) -> int | None:
        """Return None: a merged row has no line."""
        return None


def _whole(table: Table, name: str) -> str:
    """Name of a column among those of several tables."""
    return name if name.startswith(f"{table.name}.") else f"{table.name}.{name}"


def _time_of(table: Table, maker: Maker | None) -> tuple[str, NDArray[np.float64]] | None:
    """Column of a table's time, and its values in s; None without any."""
    if table.time is not None:
        return table.time, np.asarray(table.columns[table.time], np.float64)
    names = list(table.columns)
    found = time_columns(map(words_of, names))
    if not found and all(name == f"c{k + 1}" for k, name in enumerate(names)):
        found = [("c1", None, 0)]
    cells = {name: table.columns[name] for name, _, _ in found}
    fixed, ticks = (maker.unit("t", table.name), maker.ticks) if maker is not None else (None, ())
    for clock in clocks_of(found, cells, fixed, ticks):
        known = clock.seconds[np.isfinite(clock.seconds)]
        if clock.unit is not None and bool(np.all(np.diff(known) >= 0.0)):
            return clock.column, clock.seconds
    return None


def too_large(path: Path, size: float) -> InputError:
    """Return the error for what cannot be held in memory at once."""
    return InputError(
        f"the tables take {size_in_words(size)} of memory, and they have to be held at once",
        file=path,
        remedy="Export it in parts, or as Parquet.",
    )
