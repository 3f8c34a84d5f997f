"""``imufit grade``: the blind protocol on many hidden logs."""

from __future__ import annotations

import secrets
from pathlib import Path

import click

from imufit.cli import engine
from imufit.cli.arguments import Whole, json_option
from imufit.cli.names import Known
from imufit.cli.output import Output
from imufit.cli.progress import ProgressBar


@click.command()
@click.option(
    "--set",
    "sets",
    multiple=True,
    type=Known("set", lambda: list(engine.blind_sets())),
    metavar="SET",
    help="Kind of logs; repeatable. Without it all of them: one, small, one-realistic, small-realistic, nothing, two, "
    "outside, confounded, separated, columns.",
)
@click.option("--logs", type=Whole(min=1), default=20, show_default=True, help="Logs of each set.")
@click.option("--seed", type=Whole(min=0), help="Of the first log of each set; fresh without it.")
@click.option("--processes", type=Whole(min=1), help="Logs at a time; one per processor without it.")
@json_option
def grade(*, sets: tuple[str, ...], logs: int, seed: int | None, processes: int | None, json_file: Path | None) -> None:
    """Diagnose many simulated logs with hidden effects, and mark the answers.

    Each log depends on its set and its seed alone: a failure is reported with both, so that it can be repeated.
    """
    out = Output(json_file)
    first = secrets.randbelow(10**9) if seed is None else seed
    if seed is None:
        out.say(f"Seeds from {first} on: --seed {first} repeats this.")
    with ProgressBar(counted=True) as progress:
        result = engine.grade_blind(sets=sets, logs=logs, seed=first, processes=processes, progress=progress)
    out.tables(result.tables())
    failures = result.lines()
    out.say("Each log that failed, with what repeats it alone:" if failures else "Nothing failed.")
    out.lines(failures)
    out.json({"seed": first, **result.to_dict()})
