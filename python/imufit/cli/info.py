"""``imufit info``: what is in a log, and what it can show."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from imufit.cli import engine
from imufit.cli.arguments import effects_from_option, json_option, keep_inputs, verbose_option
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar
from imufit.cli.reading import log_argument

if TYPE_CHECKING:
    from imufit.log import Reading


@click.command()
@log_argument
@click.option("--quick", is_flag=True, help="Leave out the effects, which take most of the time.")
@effects_from_option
@json_option
@verbose_option
def info(log: Path, *, reading: Reading, quick: bool, json_file: Path | None, verbose: bool) -> None:
    """List the contents of LOG, and the effects that it can and cannot show.

    An effect can be shown if its typical size stands out from the noise of this log: its parameters' standard errors
    follow from the log's own normal equations. Without a reference attitude the rests replace it.
    """
    keep_inputs([log], [json_file])
    out = Output(json_file)
    with ProgressBar() as progress:
        found = engine.info(engine.open_log(log, reading), effects=not quick, progress=progress)
    first, *others = found.sentences()
    out.say(first, bold=True)
    out.say(*others, *found.remarks())
    if verbose:
        out.say(*found.alike())
    out.result_tables(found, verbose)
    out.json(found.to_dict())
