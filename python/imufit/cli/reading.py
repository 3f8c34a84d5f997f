"""The options with which every command reads a log: --map, --frame, --noise, --drop."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

import click

from imufit.cli.arguments import NamedFile
from imufit.cli.names import FRAMES, OneOf
from imufit.whole_file import identity

Command = TypeVar("Command", bound=Callable[..., Any])

LOG = NamedFile(exists=True, folder=True)
"""A log, or a folder of files that make one."""

_DECLARATIONS = (
    click.option(
        "--map",
        "mapping",
        multiple=True,
        metavar="COL=NAME[unit]",
        help="Column COL of the log is the file's column NAME in that unit, e.g. acc_x=AccX[g], or a number in every "
        "row, e.g. temp=21. Repeatable.",
    ),
    click.option(
        "--frame",
        type=OneOf("frame", FRAMES, case_sensitive=False),
        metavar="|".join(FRAMES),
        help="Frame of the reference attitude, overriding the file.",
    ),
    click.option(
        "--noise",
        multiple=True,
        metavar="SENSOR=VALUE",
        help="White noise of one sample, overriding the file: acc in m/s^2, gyr in rad/s, mag in uT, e.g. "
        "acc=0.02,gyr=0.05[deg/s]. Repeatable.",
    ),
    click.option(
        "--drop",
        multiple=True,
        metavar="COLUMN",
        help="Leave this column out; acc, gyr, mag, ref_q and ref_p stand for all of their columns. Repeatable.",
    ),
)


def map_option(command: Command) -> Command:
    """Add --map alone, for what comes from a device."""
    return _DECLARATIONS[0](command)


def reading_options(command: Command) -> Command:
    """Add the options with which a log is read; the command gets them as one `Reading`, called ``reading``."""

    @wraps(command)
    def with_reading(
        *arguments: Any,
        mapping: tuple[str, ...],
        frame: Any,
        noise: tuple[str, ...],
        drop: tuple[str, ...],
        **options: Any,
    ) -> Any:
        from imufit.cli import engine  # noqa: PLC0415

        return command(*arguments, reading=engine.reading(mapping, frame, noise, drop), **options)

    declared: Any = with_reading
    for declaration in reversed(_DECLARATIONS):
        declared = declaration(declared)
    return declared  # type: ignore[no-any-return]


def log_argument(command: Command) -> Command:
    """Add LOG and the options with which it is read."""
    return click.argument("log", metavar="LOG", type=LOG)(reading_options(command))


def logs_argument(command: Command) -> Command:
    """Add LOG... and the options with which they are read: one log, or several of one sensor."""
    declare = click.argument("logs", metavar="LOG...", type=LOG, nargs=-1, required=True, callback=_each_once)
    return declare(reading_options(command))


def _each_once(_ctx: click.Context, _param: click.Parameter, logs: tuple[Path, ...]) -> tuple[Path, ...]:
    """Refuse a file that is named twice: its rows must not count twice."""
    known = [identity(path) for path in logs]
    for k, path in enumerate(logs):
        if known[k] in known[:k]:
            raise click.UsageError(f"{str(path)!r} is named twice: each log counts once")
    return logs
