"""The option --set: settings of filters and of the replay's rules."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import click

from imufit.cli import engine
from imufit.cli.names import unknown

Command = TypeVar("Command", bound=Callable[..., Any])


def set_option(command: Command) -> Command:
    """Add --set."""
    return click.option(
        "--set",
        "assignments",
        multiple=True,
        metavar="FILTER.NAME=VALUE",
        help="Setting of a filter, in SI units, or of the rules as replay.NAME, e.g. kalman.acc_noise=0.01. "
        "Repeatable.",
    )(command)


def settings_from(assignments: Sequence[str]) -> dict[str, dict[str, float]]:
    """Read texts such as ``FILTER.NAME=VALUE``.

    Raises
    ------
    click.UsageError
        Not of that form, an unknown name (the message lists the known names), or not a finite number.
    """
    settings: dict[str, dict[str, float]] = {}
    for text in assignments:
        place, equals, number = text.partition("=")
        group, dot, name = (part.strip() for part in place.partition("."))
        if not (equals and dot and group and name):
            raise click.UsageError(f"--set {text!r}: write FILTER.NAME=VALUE, such as kalman.acc_noise=0.01")
        known = engine.filter_settings()
        if group not in known:
            raise click.UsageError(f"--set: {unknown('filter', group, known)}")
        if name not in known[group]:
            raise click.UsageError(
                f"--set: {unknown(f'setting of {group}', name, known[group])}"
                if known[group]
                else f"--set: {group} has no settings"
            )
        settings.setdefault(group, {})[name] = number_of("--set", text, number)
    return settings


def number_of(option: str, text: str, number: str) -> float:
    """Read the number of an assignment `text` such as ``NAME=VALUE``.

    Raises
    ------
    click.UsageError
        Not a finite number.
    """
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise click.UsageError(f"{option} {text!r}: {number.strip()!r} is not a number")
    return value
