"""``imufit allan``: the noise of sensors at rest."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from imufit.cli import engine
from imufit.cli.arguments import LOG_ENDINGS, OutputFile, json_option, keep_inputs, plot_option
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar
from imufit.cli.reading import log_argument

if TYPE_CHECKING:
    from imufit.log import Reading


@click.command()
@log_argument
@click.option(
    "-o",
    "--output",
    type=OutputFile(LOG_ENDINGS),
    metavar="OUT",
    help="Write the log with the noise of one sample in its metadata: the noise floor of fit, diagnose and ladder.",
)
@click.option(
    "--settings",
    "settings_file",
    type=OutputFile((".toml",)),
    metavar="FILE.toml",
    help="Write the filters' noise settings, for `imufit replay --settings`.",
)
@json_option
@plot_option
def allan(
    log: Path,
    *,
    reading: Reading,
    output: Path | None,
    settings_file: Path | None,
    json_file: Path | None,
    plot_file: Path | None,
) -> None:
    """Estimate the noise of LOG at rest from its Allan deviation.

    Of a log that moves only the longest rest is used.
    """
    keep_inputs([log], [output, settings_file, json_file, plot_file])
    out = Output(json_file)
    with ProgressBar(counted=True) as progress:
        recorded = engine.read_log(log, reading)
        found = engine.allan(recorded, progress)
    settings = engine.filter_noise(found)
    out.say(found.sentence, bold=True)
    out.tables(found.tables())
    out.say(*found.remarks)
    if output is not None:
        engine.write_log(found.to_log(recorded), output)
        out.wrote(output)
    if settings_file is not None:
        engine.write_settings(settings, settings_file)
        out.wrote(settings_file)
    out.json({**found.to_dict(), "filters": settings})
    if plot_file is not None:
        out.plot(plot_file, found.plot())
