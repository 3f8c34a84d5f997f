"""``imufit export``: a model for use elsewhere."""

from __future__ import annotations

from pathlib import Path

import click

from imufit.cli import engine
from imufit.cli.arguments import EXISTING, OutputFile, effects_from_option, json_option, keep_inputs
from imufit.cli.names import FORMS, Known
from imufit.cli.output import Output
from imufit.whole_file import write_text


@click.command()
@click.argument("model", metavar="MODEL", type=EXISTING)
@effects_from_option
@click.option(
    "--to",
    "form",
    required=True,
    type=Known("form", lambda: list(FORMS)),
    metavar="|".join(FORMS),
    help="; ".join(f"{name}: {summary}" for name, summary in FORMS.items()) + ".",
)
@click.option("-o", "--output", type=OutputFile(), metavar="FILE", help="Write to this file, not to standard output.")
@json_option
def export(model: Path, *, form: str, output: Path | None, json_file: Path | None) -> None:
    """Export gains and offsets of MODEL: corrected = A raw + b for each sensor.

    A comment names the effects that are not a constant gain or offset; `imufit apply` undoes them all.
    """
    keep_inputs([model], [output, json_file])
    out = Output(json_file)
    text = engine.export(model, form)
    if output is not None:
        write_text(output, text)
        out.wrote(output)
    elif str(json_file) != "-":
        click.echo(text, nl=False)
    if json_file is not None:
        import json  # noqa: PLC0415

        out.json(json.loads(engine.export(model, "json")))
