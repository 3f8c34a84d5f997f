"""Tables that grow row by row: messages of a bag, objects of a JSON list, cells of a sheet."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from imufit.formats.limits import COLUMNS, LIST, TEXT, check_values
from imufit.formats.recording import Table

_DEPTH: Final = 16
"""Levels of objects within objects; the deepest message of the standard packages of ROS has 6."""

_COLUMN: Final = 64
"""Values whose memory a column without rows takes: its name, its place in the table and its array, 500 bytes."""

Value = float | str | None


class Rows:
    """The tables of one file while they are read.

    Parameters
    ----------
    path : Path
        The file, for messages.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._tables: dict[str, _Growing] = {}
        self._values = 0
        self.left_out: dict[str, None] = {}
        """Parts that did not become a column, in the order of the file."""

    def append(self, table: str, values: Mapping[str, Value], time: float | None = None) -> None:
        """Add a row.

        Parameters
        ----------
        table : str
            Its table; a new one begins with its first row.
        values : dict
            Numbers and texts by column; what is missing stays empty.
        time : float, optional
            s on the clock of the recording.
        """
        growing = self._tables.get(table)
        if growing is None:
            growing = self._tables[table] = _Growing()
        width = growing.append(values, time)
        # a column that begins late is filled up from the first row, and needs memory of its own even if short
        self._values += len(values) + 1 + width * (growing.n + _COLUMN)
        check_values(self._path, self._values)

    def tables(self) -> tuple[Table, ...]:
        """Return all tables with at least one column."""
        check_values(self._path, sum(growing.n * (len(growing.columns) + 1) for growing in self._tables.values()))
        made = (growing.table(name) for name, growing in self._tables.items())
        return tuple(table for table in made if len(table.columns) > (table.time is not None))

    def flat(self, value: Any, prefix: str = "") -> dict[str, Value]:
        """Return the numbers and short texts of nested objects by their path.

        Parameters
        ----------
        value : object
            A mapping, a list, a number, a text or None, as JSON has them.
        prefix : str
            Path that leads to `value`.

        Returns
        -------
        dict
            ``linear_acceleration.x``, ``gyro[0]``.
        """
        found: dict[str, Value] = {}
        self._flatten(value, prefix, found, 0)
        return found

    def _flatten(self, value: Any, name: str, found: dict[str, Value], depth: int) -> None:
        if isinstance(value, str):
            if len(value) <= TEXT:
                found[name] = value
            else:
                self.left_out[name] = None
        elif value is None:
            found[name] = None
        elif isinstance(value, bool | int | float | np.number | np.bool_):
            found[name] = number(value)
        elif depth == _DEPTH or len(found) >= COLUMNS:
            self.left_out[name] = None
        elif isinstance(value, Mapping):
            for key, member in value.items():
                self._flatten(member, f"{name}.{key}" if name else str(key), found, depth + 1)
        elif isinstance(value, Sequence | np.ndarray) and 0 < len(value) <= LIST and not isinstance(value, bytes):
            for index, member in enumerate(value):
                self._flatten(member, f"{name}[{index}]", found, depth + 1)
        elif not isinstance(value, Sequence | np.ndarray) or len(value):
            self.left_out[name] = None

    def notes(self) -> tuple[str, ...]:
        """Return one note on everything that was left out, or none."""
        if not self.left_out:
            return ()
        return (left_out_note(tuple(self.left_out)),)


def left_out_note(names: Sequence[str]) -> str:
    """Return the sentence on columns that were left out."""
    shown = ", ".join(names[:5]) + ("" if len(names) <= 5 else f" and {len(names) - 5} more")
    return f"Left out, because they are not single numbers or short texts: {shown}."


def number(value: Any) -> float:
    """Return a number as a float; an integer beyond the range of floats is infinite."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def time_name(columns: Mapping[str, Any]) -> str:
    """Return a name for a column of time that no other column has."""
    name = "t"
    while name in columns:
        name = f"{name}_recorded"
    return name


class _Growing:
    def __init__(self) -> None:
        self.n = 0
        self.times = array("d")
        self.timed = False
        self.columns: dict[str, array[float] | list[str | None]] = {}

    def append(self, values: Mapping[str, Value], time: float | None) -> int:
        """Add a row; returns how many columns begin with it."""
        begun = 0
        for name, value in values.items():
            column = self.columns.get(name)
            if column is None:
                if value is None or len(self.columns) >= COLUMNS:
                    continue  # it is not yet determined whether it holds numbers or texts
                column = self.columns[name] = [] if isinstance(value, str) else array("d")
                begun += 1
            if len(column) < self.n:
                self._fill(column, self.n)
            if isinstance(column, list):
                column.append(None if value is None else value if isinstance(value, str) else f"{value:g}")
            else:
                column.append(_as_number(value))
        self.timed = self.timed or time is not None
        self.times.append(math.nan if time is None else time)
        self.n += 1
        return begun

    @staticmethod
    def _fill(column: array[float] | list[str | None], n: int) -> None:
        missing = n - len(column)
        if missing > 0:
            if isinstance(column, list):
                column.extend([None] * missing)
            else:
                column.extend(array("d", [math.nan]) * missing)

    def table(self, name: str) -> Table:
        """Return the table, its rows in the order of time where they have one."""
        columns: dict[str, Any] = {}
        time = None
        if self.timed:
            time = time_name(self.columns)
            columns[time] = np.frombuffer(self.times, dtype=float)
        for key, column in self.columns.items():
            self._fill(column, self.n)
            if isinstance(column, list):
                text = np.empty(self.n, dtype=object)
                text[:] = column
                columns[key] = text
            else:
                columns[key] = np.frombuffer(column, dtype=float)
        if time is not None and np.any(np.diff(columns[time]) < 0):
            # several writers to one topic, and messages on their way, arrive in another order than they were sent
            order = np.argsort(columns[time], kind="stable")
            columns = {key: column[order] for key, column in columns.items()}
        return Table(name, columns, time)


def _as_number(value: Value) -> float:
    if isinstance(value, str):
        try:
            return float(value)
        except ValueError:
            return math.nan
    return math.nan if value is None else value
