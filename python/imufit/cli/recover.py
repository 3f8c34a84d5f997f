"""``imufit recover``: a log of what a crash left."""

from __future__ import annotations

from pathlib import Path

import click

from imufit.cli import engine
from imufit.cli.arguments import LOG_ENDINGS, NamedFile, OutputFile, json_option, keep_inputs
from imufit.cli.output import Output


@click.command()
@click.argument("file", metavar="FILE", type=NamedFile())
@click.option(
    "-o",
    "--output",
    type=OutputFile(LOG_ENDINGS),
    metavar="LOG",
    help="Log to write (default: the name of the interrupted recording).",
)
@click.option("--port", metavar="PORT", help="The device, to request the columns of samples before its announcement.")
@click.option("--force", is_flag=True, help="Overwrite LOG if it exists already.")
@click.option("--keep", is_flag=True, help="Keep the .part files.")
@json_option
def recover(
    file: Path, *, output: Path | None, port: str | None, force: bool, keep: bool, json_file: Path | None
) -> None:
    """Make the log of FILE, a LOG.part left by `imufit record`, with every whole batch."""
    keep_inputs([file], [output, json_file])
    out = Output(json_file)
    result = engine.recover(file, output, port=port, force=force, keep=keep)
    out.say(result.sentence, bold=True)
    out.say(*result.sentences()[1:])
    out.table(result.gap_table())
    out.wrote(Path(result.file))
    out.json(result.to_dict())
