"""``imufit grade``: the blind protocol on many hidden logs."""

from __future__ import annotations

from pathlib import Path

import click

from imufit.cli import engine
from imufit.cli.arguments import json_option
from imufit.cli.names import Known
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar


@click.command(short_help="The blind protocol: how often the answer is right.")
@click.option("--logs", type=click.IntRange(min=0), default=60, show_default=True, help="Logs with a hidden effect.")
@click.option("--nothing", type=click.IntRange(min=0), default=30, show_default=True, help="Logs with none.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="First seed.")
@click.option(
    "--scenario",
    "scenarios",
    multiple=True,
    type=Known("scenario", lambda: list(engine.scenarios())),
    metavar="SCENARIO",
    help="Motion of the logs; repeatable. Without it turntable, poses, arm, handheld.",
)
@json_option
def grade(*, logs: int, nothing: int, seed: int, scenarios: tuple[str, ...], json_file: Path | None) -> None:
    """Diagnose many simulated logs without knowing what was done to them, and grade the answers."""
    if logs + nothing == 0:
        raise click.UsageError("--logs and --nothing are both 0: there is nothing to grade")
    out = Output(json_file)
    with ProgressBar() as progress:
        result = engine.grade_blind(logs=logs, nothing=nothing, seed=seed, scenarios=scenarios, progress=progress)
    out.say(str(result))
    out.json(result.to_dict())
