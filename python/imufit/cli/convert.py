"""``imufit convert``: whatever can be read becomes a log, and is summed up."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from imufit.cli import engine
from imufit.cli.arguments import LOG_ENDINGS, OutputFile, json_option, keep_inputs
from imufit.cli.output import Output
from imufit.cli.reading import LOG, reading_options
from imufit.printable import NAME, printable

if TYPE_CHECKING:
    from imufit.log import Contents, Reading
    from imufit.log.contents import ColumnContents
    from imufit.results import Table

_LABELS = 8


class RowRange(click.ParamType):  # type: ignore[type-arg]
    """Two numbers of rows, such as ``1000:2000``: the first, and the one after the last."""

    name = "rows"

    def convert(
        self, value: str | tuple[int, int], param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        """Take the numbers apart."""
        if isinstance(value, tuple):
            return value
        first, colon, stop = value.partition(":")
        if not (colon and first.isdecimal() and stop.isdecimal() and int(first) < int(stop)):
            self.fail(f"{value!r} is not a range of rows: write FIRST:STOP, such as 0:1000000", param, ctx)
        return int(first), int(stop)


@click.command()
@click.argument("file", metavar="FILE", type=LOG)
@reading_options
@click.option("-o", "--output", type=OutputFile(LOG_ENDINGS), required=True, metavar="LOG", help="Log to write.")
@click.option("--rows", type=RowRange(), metavar="FIRST:STOP", help="Take these rows alone, counted from 0.")
@json_option
def convert(
    file: Path, *, reading: Reading, output: Path, rows: tuple[int, int] | None, json_file: Path | None
) -> None:
    """Make a log of FILE: a table of numbers, a serial transcript with named values, or another log.

    Tables are separated by commas, semicolons, tabs or blanks; without a header their columns are c1, c2, ... In a
    transcript the most frequent line of the kind accel=(1, 2, 3) temp=21 is the record, the other lines are ignored.

    FILE may be of any length. --rows 0:1000000 takes the first million rows, for commands that cannot hold all.
    """
    keep_inputs([file], [output, json_file])
    out = Output(json_file)
    log = engine.open_log(file, reading)
    if rows is not None:
        log = engine.some_rows(log, rows)
    found = engine.contents(log)
    engine.write_log(log, output)
    rate = "" if found.rate is None else f" over {found.duration:.4g} s, {found.rate:.4g} Hz"
    out.say(f"{found.n} row{'' if found.n == 1 else 's'}{rate}.", bold=True)
    out.say(*(f"{note}." for note in found.notes))
    out.table(_table(found))
    out.say(f"Missing: {found.missing_words}." if found.missing else "")
    out.wrote(output)
    out.json({"log": str(output), **found.to_dict()})


def _table(found: Contents) -> Table:
    """One row for each column, so that a wrong column or unit is seen at once."""
    from imufit.results import Table  # noqa: PLC0415

    header = ("column", "unit", ">samples", ">smallest", ">median", ">largest")
    return Table("", header, tuple(_row(column) for column in found.columns))


def _row(column: ColumnContents) -> tuple[str, ...]:
    if column.labels:
        first = [printable(label, NAME) for label in column.labels[:_LABELS]]
        shown = " ".join(first) + (" ..." if len(column.labels) > _LABELS else "")
        return column.name, shown, str(column.samples), "", "", ""
    numbers = ("-" if value is None else f"{value:.4g}" for value in (column.low, column.median, column.high))
    return column.name, column.unit, str(column.samples), *numbers
