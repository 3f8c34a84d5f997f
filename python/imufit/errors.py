"""The one exception that unusable input raises: it states what is wrong, where, and what to do."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from imufit.printable import NAME, printable
from imufit.remedy import Remedy


class InputError(ValueError):
    """Input that cannot be used, reported in one line.

    The message reads ``file: row R, column C: problem. Remedy.``, with the parts that apply. Rows are counted from 0
    and are data rows as in the table; for text files the line of the file (counted from 1) stands behind it, as in
    ``row 57 (line 59)``. The parts may hold text from files: the message shows it printable and bounded.

    Parameters
    ----------
    problem : str
        What is wrong, without the final stop.
    file : str or Path, optional
        File concerned; the message shows its name.
    row : int, optional
        Data row, counted from 0.
    column : str, optional
        Column or metadata key concerned.
    remedy : str or Remedy, optional
        The user's remedy, a full sentence. A :class:`imufit.remedy.Remedy` has the words of Python and those of the
        command line.
    line : int, optional
        Line of the text file, counted from 1.
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | Path | None = None,
        row: int | None = None,
        column: str | None = None,
        remedy: str | Remedy | None = None,
        line: int | None = None,
    ) -> None:
        self.problem = printable(problem, keep="\n\t\r")
        self.file = None if file is None else str(file)
        self.row = row
        self.column = column
        self.advice = None if remedy is None else _shown(Remedy.of(remedy))
        self.line = line
        super().__init__(self._message())

    @property
    def remedy(self) -> str | None:
        """The user's remedy in Python; in the words of the command line where that is running."""
        return None if self.advice is None else str(self.advice)

    @property
    def shell_remedy(self) -> str | None:
        """The user's remedy in the words of the command line."""
        return None if self.advice is None else self.advice.shell

    @property
    def where(self) -> str:
        """Row, line and column, as far as they are known."""
        where = []
        if self.row is not None:
            where.append(f"row {self.row}" + ("" if self.line is None else f" (line {self.line})"))
        elif self.line is not None:
            where.append(f"line {self.line}")
        if self.column is not None:
            column = printable(self.column, NAME)
            if not self.problem.startswith(f"column {column} "):
                where.append(f"column {column}")
        return ", ".join(where)

    @property
    def statement(self) -> str:
        """The message without the remedy."""
        return self._message(with_remedy=False)

    def __str__(self) -> str:
        return self._message()

    def _message(self, *, with_remedy: bool = True) -> str:
        parts = [printable(Path(self.file).name or self.file, NAME)] if self.file else []
        parts += [self.where] if self.where else []
        text = ": ".join([*parts, self.problem])
        if not text.endswith((".", "?", "!")):
            text += "."
        if with_remedy and self.remedy:
            text += f" {self.remedy}"
        return " ".join(text.split())

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle with all parts, so that the error returns unchanged from a worker process."""
        where: dict[str, Any] = {
            "file": self.file,
            "row": self.row,
            "column": self.column,
            "remedy": self.advice,
            "line": self.line,
        }
        return partial(InputError, self.problem, **where), ()


def _shown(remedy: Remedy) -> Remedy:
    """Words that a person may see."""
    python, shell = (printable(text, keep="\n\t\r") for text in (remedy.python, remedy.shell))
    return Remedy(python, shell, remedy.options)
