"""``imufit studio``: the loop in the browser."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

import click

from imufit.cli import engine
from imufit.cli.arguments import Whole
from imufit.cli.output import Output
from imufit.cli.reading import LOG, reading_options

if TYPE_CHECKING:
    from imufit.log import Reading

LARGEST_PORT = 65535


@click.command()
@click.argument("logs", metavar="[LOG...]", type=LOG, nargs=-1)
@reading_options
@click.option("--port", type=Whole(0, LARGEST_PORT), default=0, help="Port of 127.0.0.1; without it a free one.")
@click.option("--browser/--no-browser", default=True, help="Open the address in the browser, or only print it.")
def studio(logs: tuple[Path, ...], *, reading: Reading, port: int, browser: bool) -> None:
    """Serve the loop to the browser of this computer, at an address of 127.0.0.1 with a token in it.

    Ctrl-C ends it.
    """
    out = Output()

    def ready(address: str) -> None:
        out.lines([address])
        if browser:
            webbrowser.open(address)

    engine.studio(logs, reading, port=port, ready=ready)
