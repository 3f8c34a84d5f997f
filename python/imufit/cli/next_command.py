"""Commands that go on from an answer, printed as they can be pasted."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

import click
from click.core import ParameterSource

from imufit.cli.output import Output

_OF_THE_LOG = ("mapping", "frame", "noise", "drop", "effects_from")
"""Options of the logs and of the catalogue, which the next command needs too."""


def say_next(output: Output, words: str, commands: Sequence[str], logs: Sequence[Path], model: Path | None) -> None:
    """Print the commands that go on with the same logs and the same model.

    Parameters
    ----------
    output : Output
        Where they are printed.
    words : str
        Their purpose, after "Next".
    commands : sequence of str
        Commands with their own arguments.
    logs : sequence of Path
        The logs.
    model : Path or None
        The model's file.
    """
    context = click.get_current_context()
    given = any(context.get_parameter_source(name) is ParameterSource.COMMANDLINE for name in _OF_THE_LOG)
    options = ", with the options of the log as here" if given else ""
    output.say(f"Next, {words}{options}:")
    named = shlex.join([*map(str, logs), *([] if model is None else ["--model", str(model)])])
    output.lines([f"  imufit {command} {named}" for command in commands])
