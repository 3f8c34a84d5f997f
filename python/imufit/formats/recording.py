"""The content of a file of another program: one table, or several with clocks of their own rate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray


@dataclass(frozen=True)
class Table:
    """Columns that were sampled together.

    Parameters
    ----------
    name : str
        What the file calls it: a topic, a message, a sheet; empty where the file has one table without a name.
    columns : dict
        Columns by name, (n,) float64 each, NaN where a value is missing; (n,) object for text, None where there is
        none. A member of a list has its index behind the name, such as ``gyro_rad[0]``.
    time : str or None
        The column whose values are times in s on the one clock of the recording, where the format fixes that; None
        where a column of the table may be the time, which only its name can show.
    """

    name: str
    columns: Mapping[str, NDArray[Any]]
    time: str | None = None

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values()), ()))


@dataclass(frozen=True)
class Recording:
    """All tables of a file.

    Parameters
    ----------
    form : str
        The format in words, such as ``PX4 ULog``.
    tables : tuple of Table
        In the order of the file; every one with at least one row.
    notes : tuple of str
        What reading noticed: how much of a truncated file was valid, what was left out.
    metadata : dict
        Metadata of a log (`frame`, `sensor`, ...) as far as the format itself fixes them.
    clues : tuple of str
        What else stands in it that its maker may be known by.
    """

    form: str
    tables: tuple[Table, ...]
    notes: tuple[str, ...] = ()
    metadata: Mapping[str, Any] = field(default_factory=dict)
    clues: tuple[str, ...] = ()
