"""``imufit replay``: attitude filters over a log."""

from __future__ import annotations

from pathlib import Path

import click

from imufit.cli import engine
from imufit.cli.arguments import LOG_ENDINGS, OutputFile, json_option, keep_inputs, log_argument
from imufit.cli.names import FILTERS, Known
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar


@click.command(short_help="Attitude for every row, and its error.")
@log_argument
@click.option(
    "--filter",
    "filters",
    multiple=True,
    type=Known("filter", lambda: FILTERS),
    metavar="NAME",
    help=f"One of {', '.join(FILTERS)}. Repeatable; without it all that the log allows.",
)
@click.option(
    "-o", "--output", type=OutputFile(LOG_ENDINGS), metavar="OUT", help="Write the log with the attitudes added."
)
@json_option
def replay(
    log: Path, *, mapping: tuple[str, ...], filters: tuple[str, ...], output: Path | None, json_file: Path | None
) -> None:
    """Run attitude filters over LOG; where it has a reference, give their RMS errors."""
    from imufit.figures import quantity  # noqa: PLC0415
    from imufit.results import Table  # noqa: PLC0415

    keep_inputs([log], [output, json_file])
    out = Output(json_file)
    with ProgressBar() as progress:
        result = engine.replay(engine.open_log(log, mapping), tuple(dict.fromkeys(filters)), progress)
    value = result.to_dict()
    columns = ("total", "heading", "inclination", "roll", "pitch", "yaw", "sd")
    rows = tuple(
        (name, *(quantity.number((errors or {}).get(f"{column}_deg")) for column in columns))
        for name, errors in value["filters"].items()
    )
    out.say(f"{value['n']} rows replayed.", bold=True)
    out.say(*(f"{count} rows skipped: {reason}." for reason, count in value.get("skipped", {}).items() if count))
    out.table(Table("Attitude error against the reference, RMSE in deg", ("filter", *(f">{c}" for c in columns)), rows))
    if output is not None:
        engine.write_log(result.to_log(), output)
        out.wrote(output)
    out.json(value)
