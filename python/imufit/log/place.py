"""Where a row of a log comes from, for messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from imufit.errors import InputError
from imufit.printable import NAME, printable
from imufit.remedy import MAP, Remedy, mapped, reading


@dataclass(frozen=True)
class Place:
    """Names the file, and for text files the line, of a row.

    Parameters
    ----------
    file : Path or None
        File concerned; None for tables in memory.
    line_of : callable, optional
        Gives the line in the file (from 1) of a data row (from 0).
    option : str
        Option of the command line that maps columns of this file.
    """

    file: Path | None = None
    line_of: Callable[[int], int | None] | None = None
    option: str = MAP

    @property
    def name(self) -> str:
        """Name of the file for notes."""
        return "log" if self.file is None else printable(self.file.name, NAME)

    def mapped(self, columns: Mapping[str, str]) -> Remedy:
        """Name the call, or the option, that reads this log with other columns.

        Parameters
        ----------
        columns : mapping
            Source text for each column of the log.
        """
        return reading(self.file, mapped(columns, self.option))

    def error(
        self, problem: str, *, row: int | None = None, column: str | None = None, remedy: str | Remedy | None = None
    ) -> InputError:
        """Make the error for this place; raise it yourself."""
        line = self.line_of(row) if self.line_of is not None and row is not None else None
        return InputError(
            problem,
            file=self.file or "log",
            row=None if row is None else int(row),
            column=column,
            remedy=remedy,
            line=line,
        )
