"""``imufit plot``: the readings of a log over time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from imufit.cli import engine
from imufit.cli.arguments import PLOT_ENDINGS, OutputFile, Real, keep_inputs
from imufit.cli.convert import RowRange
from imufit.cli.names import OneOf
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar
from imufit.cli.reading import log_argument

if TYPE_CHECKING:
    from imufit.inspection.plot import Show
    from imufit.log import Reading


class ColumnNames(click.ParamType):  # type: ignore[type-arg]
    """Names of columns with commas between."""

    name = "columns"

    def convert(
        self, value: str | tuple[str, ...], _param: click.Parameter | None, _ctx: click.Context | None
    ) -> tuple[str, ...]:
        """Take the names apart."""
        if isinstance(value, tuple):
            return value
        return tuple(name.strip() for name in value.split(",") if name.strip())


@click.command()
@log_argument
@click.option(
    "-o",
    "--output",
    type=OutputFile(PLOT_ENDINGS),
    metavar="FILE.png",
    help="Figure to write; without it LOG's name with .png in this directory.",
)
@click.option(
    "--columns",
    type=ColumnNames(),
    multiple=True,
    metavar="NAME[,NAME...]",
    help="Draw these columns besides, such as temp or motor_current. Repeatable.",
)
@click.option(
    "--show",
    type=OneOf("part of the figure", ("readings", "reference", "both")),
    default="both",
    show_default=True,
    help="Parts to draw: the readings, the reference's attitude and rates, or both.",
)
@click.option("--rows", type=RowRange(), metavar="FIRST:STOP", help="Draw these rows alone, counted from 0.")
@click.option("--from", "begin", type=Real(), metavar="S", help="Draw from this time on.")
@click.option("--to", "end", type=Real(), metavar="S", help="Draw up to this time.")
def plot(
    log: Path,
    *,
    reading: Reading,
    output: Path | None,
    columns: tuple[tuple[str, ...], ...],
    show: Show,
    rows: tuple[int, int] | None,
    begin: float | None,
    end: float | None,
) -> None:
    """Draw the readings of LOG over time: a panel for each sensor, and the reference's attitude.

    The rates that follow from the reference lie over those of the gyroscope. Rests are shaded, and lines are
    interrupted over gaps. A log of any length is drawn: each pixel shows the smallest and the largest reading.
    """
    made = OutputFile(PLOT_ENDINGS).convert(f"{log.stem}.png", None, None) if output is None else output
    keep_inputs([log], [made])
    out = Output()
    with ProgressBar(counted=True) as progress:
        figure = engine.plot(
            engine.open_log(log, reading),
            progress,
            columns=tuple(dict.fromkeys(name for names in columns for name in names)),
            show=show,
            rows=rows,
            begin=begin,
            end=end,
        )
    out.plot(made, figure)
