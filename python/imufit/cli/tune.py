"""``imufit tune``: the gains of a filter from a log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from imufit.cli import engine
from imufit.cli.arguments import OutputFile, Real, json_option, keep_inputs, plot_option
from imufit.cli.names import FILTERS, Known, OneOf
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar
from imufit.cli.reading import log_argument
from imufit.cli.settings import set_option, settings_from

if TYPE_CHECKING:
    from imufit.log import Reading


@click.command()
@log_argument
@click.option(
    "--filter",
    "filter_name",
    required=True,
    type=Known("filter", lambda: FILTERS),
    metavar="NAME",
    help=f"Out of {', '.join(FILTERS)}.",
)
@click.option(
    "--gain", "gains", multiple=True, metavar="NAME", help="Setting to tune. Repeatable; without it the gains."
)
@set_option
@click.option(
    "--by",
    type=OneOf("criterion", ("error", "prediction")),
    help="The minimised error; without it the error where LOG has a reference.",
)
@click.option(
    "--metric",
    type=OneOf("part of the error", ("total", "heading", "inclination")),
    help="Of which angle; without it the total, or the inclination for a log without magnetometer.",
)
@click.option(
    "--horizon",
    type=Real(min=0.0, min_open=True),
    default=1.0,
    show_default=True,
    metavar="S",
    help="Time that a prediction runs, s.",
)
@click.option("--map-of", nargs=2, metavar="NAME NAME", help="Gains of the map; without it the first two.")
@click.option(
    "-o",
    "--output",
    type=OutputFile((".toml",)),
    metavar="FILE.toml",
    help="Write the tuned settings, for `imufit replay --settings`.",
)
@json_option
@plot_option
def tune(
    log: Path,
    *,
    reading: Reading,
    filter_name: str,
    gains: tuple[str, ...],
    assignments: tuple[str, ...],
    by: str | None,
    metric: str | None,
    horizon: float,
    map_of: tuple[str, str] | None,
    output: Path | None,
    json_file: Path | None,
    plot_file: Path | None,
) -> None:
    """Tune the gains of a filter on LOG, judge them on data they were not tuned on, and measure their influence."""
    keep_inputs([log], [output, json_file, plot_file])
    settings = settings_from(assignments)
    out = Output(json_file)
    with ProgressBar(counted=True) as progress:
        found = engine.tune(
            engine.read_log(log, reading),
            filter_name,
            progress,
            by=by,
            metric=metric,
            gains=gains,
            fixed=settings.get(filter_name, {}),
            rules=settings.get("replay", {}),
            horizon=horizon,
            map_of=map_of,
        )
    out.say(found.sentence, bold=True)
    out.tables(found.tables())
    out.say(*found.remarks)
    if output is not None:
        engine.write_settings(found.settings, output)
        out.wrote(output)
    out.json(found.to_dict())
    if plot_file is not None:
        out.plot(plot_file, found.plot())
