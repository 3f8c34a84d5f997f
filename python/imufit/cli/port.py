"""Arguments and options of the commands that listen to a device."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from imufit.cli.arguments import Real, Whole
from imufit.cli.names import FRAMES, Known, OneOf

frame_option = click.option(
    "--frame",
    type=Known("frame", lambda: FRAMES),
    metavar="|".join(FRAMES),
    default="NED",
    show_default=True,
    help="Reference frame of the attitude: for a sensor that lies z up, NWU or ENU.",
)
Command = TypeVar("Command", bound=Callable[..., Any])


def port_argument(command: Command) -> Command:
    """Add PORT, --baud, --form and --header."""
    command = click.option(
        "--header",
        metavar="NAMES",
        help="Names of the columns for text that has none, e.g. t_ms,acc_x,acc_y,acc_z.",
    )(command)
    command = click.option(
        "--form",
        type=OneOf("form", ("auto", "binary", "text")),
        default="auto",
        show_default=True,
        help="Form of the wire protocol.",
    )(command)
    command = click.option("--baud", type=Whole(min=1), default=115200, show_default=True, help="Bits per second.")(
        command
    )
    return click.argument("port", metavar="PORT")(command)


def duration_option(command: Command) -> Command:
    """Add --duration and --give-up."""
    command = click.option(
        "--give-up",
        type=Real(min=0.0),
        metavar="S",
        help="Stop when the line was lost for so long; without it wait for ever.",
    )(command)
    return click.option(
        "--duration", type=Real(min=0.0, min_open=True), metavar="S", help="Stop after so many seconds."
    )(command)
