"""Output of the commands, printed and written."""

from __future__ import annotations

import json
import os
import sys
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from imufit.printable import printable
from imufit.whole_file import whole_file, write_text
from imufit.wrapping import lines_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import Console

    from imufit.figures.style import PlainFigure
    from imufit.report.pictures import Picture
    from imufit.results import Result, Table

_WIDTH_OF_FILES = 150
_LONGEST_TEXT = 20_000
"""Characters of a paragraph or a line; names within are bounded where they are read, this is for what is not."""


_PROSE = 28
"""Least characters of a column that wraps: the longest id of an effect has 27, and prose can be read in it."""


_GAPS = (3, 2)
"""Blanks between two columns, the wider one where it fits."""


@dataclass(frozen=True)
class _Layout:
    """A table as it is printed: one of its forms, whether long column names are broken, and the gap of its columns."""

    table: Table
    broken: bool = False
    gap: int = _GAPS[0]

    def narrow(self, place: int) -> bool:
        """Whether the cells of a column never wrap: first cells and numbers."""
        return place == 0 or self.table.right[place]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Column names, those of columns that never wrap broken at blanks down to the width of the cells."""
        if not self.broken:
            return self.table.names
        cells = [max((len(cell) for cell in column), default=0) for column in zip(*self.table.rows, strict=True)]
        widths = [max([width, *map(len, name.split(" "))]) for width, name in zip(cells, self.table.names, strict=True)]
        return tuple(
            "\n".join(textwrap.wrap(name, max(width, 1))) if self.narrow(place) else name
            for place, (name, width) in enumerate(zip(self.table.names, widths, strict=True))
        )

    def least_width(self) -> int:
        """Characters that it needs at least: numbers and first cells do not wrap, other cells down to `_PROSE`."""
        from rich.cells import cell_len  # noqa: PLC0415

        least = 2
        for place, (name, *cells) in enumerate(zip(self.names, *self.table.rows, strict=True)):
            widest = max(cell_len(_harmless(line)) for text in (name, *cells) for line in text.split("\n"))
            least += (widest if self.narrow(place) else min(widest, _PROSE)) + (self.gap if place else 0)
        return least


def _layouts(table: Table) -> Iterator[_Layout]:
    """Forms of a table from the best to the narrowest."""
    yield _Layout(table)
    full = table.without_empty_columns()
    yield from (_Layout(full, broken, gap) for gap in _GAPS for broken in (False, True))
    first = [row[0] for row in full.rows]
    short = all(len(cell) <= _PROSE for row in full.rows for cell in row)
    if short and all(first) and len(set(first)) == len(first):
        yield from (_Layout(full.transposed(), broken=True, gap=gap) for gap in _GAPS)


def _harmless(text: str) -> str:
    """Escape what a terminal would obey: names and labels come from files."""
    return printable(text, _LONGEST_TEXT, keep="\n\t")


def _raise(error: Exception) -> None:
    raise error


class Output:
    """Standard output for people, and the files that were requested.

    Parameters
    ----------
    json_file : Path or None
        ``-`` keeps standard output for the JSON alone.
    """

    def __init__(self, json_file: Path | None = None) -> None:
        self._json_file = json_file
        self._closed = False

    @cached_property
    def _console(self) -> Console:
        """The printer: made when there is something to say, an input that is refused does not wait for it."""
        from rich.console import Console  # noqa: PLC0415

        class Piped(Console):
            """A console that leaves a closed pipe to the program, which ends quietly."""

            def on_broken_pipe(self) -> None:
                """Hand on what rich has caught."""
                raise BrokenPipeError

        quiet = self._json_file is not None and str(self._json_file) == "-"
        width = None if sys.stdout.isatty() or "COLUMNS" in os.environ else _WIDTH_OF_FILES
        return Piped(quiet=quiet, width=width, highlight=False, markup=False, emoji=False)

    def say(self, *sentences: str, bold: bool = False) -> None:
        """Print sentences, one paragraph each."""
        for sentence in sentences:
            if sentence and not self._closed:
                for line in lines_of(_harmless(sentence), self._console.width, break_words=False):
                    self._console.print(line, style="bold" if bold else None, soft_wrap=True)

    def lines(self, lines: Iterable[str]) -> None:
        """Print lines as they are, however long."""
        for line in lines:
            self._console.print(_harmless(line), soft_wrap=True)

    def result(self, result: Result, verbose: bool) -> None:
        """Print a result: the answer, its other sentences, then the tables of the answer or, if `verbose`, all.

        A reader that has gone away ends the printing; the requested files are still written.
        """
        answer, *others = result.sentences()
        try:
            self.say(answer, bold=True)
            self.say(*others)
            self.result_tables(result, verbose)
        except BrokenPipeError as closed:
            self._closed = True
            click.get_current_context().call_on_close(partial(_raise, closed))

    def result_tables(self, result: Result, verbose: bool) -> None:
        """Print the tables of the answer and name the others; all of them if `verbose`."""
        every = [table for table in result.tables() if table.rows]
        if verbose:
            self.tables(every)
            return
        shown = [table for table in result.answer_tables() if table.rows]
        self.tables(shown)
        kept = {(table.title, len(table.rows)) for table in shown}
        more = [table.title for table in every if (table.title, len(table.rows)) not in kept]
        if more:
            self.say(f"With -v also: {'; '.join(title[0].lower() + title[1:] for title in more)}.")

    def table(self, table: Table, limit: int | None = None) -> None:
        """Print a table, if it has rows: as blocks, one a row, where each of its forms is too wide for the screen."""
        if not table.rows:
            return
        from rich import box  # noqa: PLC0415
        from rich.table import Table as RichTable  # noqa: PLC0415
        from rich.text import Text  # noqa: PLC0415

        if table.title:
            self._console.print(Text(_harmless(table.title)), style="italic")
        shown = replace(table, rows=table.rows[:limit])
        layout = next((form for form in _layouts(shown) if form.least_width() <= self._console.width), None)
        if table.blocks or layout is None:
            self._blocks(shown)
            return
        headed = any(layout.names)
        rich_table = RichTable(box=box.SIMPLE_HEAD if headed else None, pad_edge=False, show_header=headed)
        # A box has a blank of its own between two columns.
        rich_table.padding = (0, 1, 0, layout.gap - 2) if headed else (0, layout.gap, 0, 0)
        for place, (name, right) in enumerate(zip(layout.names, layout.table.right, strict=True)):
            rich_table.add_column(
                Text(_harmless(name)),
                justify="right" if right else "left",
                no_wrap=layout.narrow(place),
                overflow="fold",
            )
        for row in layout.table.rows:
            rich_table.add_row(*(Text(_harmless(cell)) for cell in row))
        self._console.print(rich_table)

    def _blocks(self, table: Table) -> None:
        """Print each row as a block: its first cell, a number with its name, then a line for each non-empty cell."""
        from rich.table import Table as RichTable  # noqa: PLC0415
        from rich.text import Text  # noqa: PLC0415

        for row in table.rows:
            head = f"{table.names[0]} {row[0]}" if table.right[0] else row[0]
            self._console.print(Text(_harmless(head), style="bold"), soft_wrap=True)
            block = RichTable.grid(padding=(0, 3, 0, 0))
            block.add_column(no_wrap=True)
            block.add_column(overflow="fold")
            for name, cell in zip(table.names[1:], row[1:], strict=True):
                if cell not in ("", "-"):
                    block.add_row(Text(f"  {_harmless(name)}"), Text(_harmless(cell)))
            self._console.print(block)
            self._console.print()

    def tables(self, tables: Iterable[Table]) -> None:
        """Print tables, those without rows left out."""
        for table in tables:
            self.table(table)

    def json(self, value: Mapping[str, Any] | list[Any]) -> None:
        """Write the JSON, if it was requested."""
        if self._json_file is None:
            return
        text = json.dumps(value, indent=2, allow_nan=False) + "\n"
        if str(self._json_file) == "-":
            sys.stdout.write(text)
        else:
            write_text(self._json_file, text)
            self.wrote(self._json_file)

    def html(self, path: Path | None, page: str) -> None:
        """Write a page."""
        if path is not None:
            write_text(path, page)
            self.wrote(path)

    def report(self, html_file: Path | None, plots: Path | None, title: str, **results: Any) -> None:
        """Write the page of results, and the figures of the page as files.

        Parameters
        ----------
        html_file : Path or None
            The page.
        plots : Path or None
            Directory of the figures; made if it does not exist.
        title : str
            Heading of the page.
        **results
            As for `imufit.report.page`.
        """
        from imufit.report import page, pictures  # noqa: PLC0415

        saved = set[str]()

        def saving(picture: Picture) -> PlainFigure:
            figure = picture.complete()
            if plots is not None:
                for ending in ("png", "svg"):
                    with whole_file(plots / f"{picture.name}.{ending}") as file:
                        figure.savefig(file, format=ending, dpi=150)
                saved.add(picture.name)
            return figure

        if plots is not None:
            plots.mkdir(parents=True, exist_ok=True)
        if html_file is not None:
            self.html(html_file, page(**results, title=title, complete=saving))
        if plots is not None:
            for picture in pictures(**results):
                if picture.name not in saved:
                    saving(picture)
            self.say(f"wrote {len(saved)} figures into {plots}")

    def plot(self, path: Path | None, figure: Figure) -> None:
        """Write a figure."""
        if path is not None:
            with whole_file(path) as file:
                figure.savefig(file, format=path.suffix[1:].lower(), dpi=150)
            self.wrote(path)

    def wrote(self, path: Path) -> None:
        """Say which file was written."""
        self.say(f"wrote {path}")

    def wrote_log(self, path: Path, columns: Iterable[str], angles: str = "") -> None:
        """Say which log was written, and in which units: they need not be those of the file that was read.

        Parameters
        ----------
        path : Path
            The file.
        columns : iterable of str
            Its columns of fixed meaning.
        angles : str
            Words for further columns that hold angles, rad.
        """
        from imufit.log.columns import GROUPS, UNITS  # noqa: PLC0415

        group = {member: name for name, members in GROUPS.items() for member in members}
        of_unit: dict[str, dict[str, None]] = {}
        for column in columns:
            if UNITS.get(column, "1") != "1":
                of_unit.setdefault(UNITS[column], {})[group.get(column, column)] = None
        if angles:
            of_unit.setdefault("rad", {})[angles] = None
        listed = "; ".join(f"{' and '.join(names)} in {unit}" for unit, names in of_unit.items())
        self.say(f"wrote {path}: {listed}")
