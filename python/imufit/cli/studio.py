"""``imufit studio``: the loop in the browser."""

from __future__ import annotations

import webbrowser
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click

from imufit.cli import engine
from imufit.cli.arguments import NamedFile, Whole, effects_from_option
from imufit.cli.output import Output
from imufit.cli.reading import reading_options

if TYPE_CHECKING:
    from imufit.log import Reading

LARGEST_PORT = 65535
DEMO = "demo"
"""In the place of a log: a simulated one with a hidden effect."""


class LogOrDemo(NamedFile):
    """A log, or the word for a demonstration."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path."""
        return Path(DEMO) if str(value) == DEMO else super().convert(value, param, ctx)


@click.command()
@click.argument("logs", metavar="[LOG...|demo]", type=LogOrDemo(exists=True, folder=True), nargs=-1)
@reading_options
@effects_from_option
@click.option("--port", type=Whole(0, LARGEST_PORT), default=0, help="Port of 127.0.0.1; without it a free one.")
@click.option("--browser/--no-browser", default=True, help="Open the address in the browser, or only print it.")
def studio(logs: tuple[Path, ...], *, reading: Reading, port: int, browser: bool) -> None:
    """Serve the loop to the browser of this computer, at an address of 127.0.0.1 with a token in it.

    `imufit studio demo` opens a simulated log with a hidden effect. A LOG may also be a session that was saved. Ctrl-C
    ends the server.
    """
    out = Output()
    with TemporaryDirectory(prefix="imufit-") as folder:

        def ready(address: str) -> None:
            out.lines([address])
            if browser:
                webbrowser.open(_leading_to(address, Path(folder)))

        demo = [str(log) for log in logs] == [DEMO] and not logs[0].exists()
        engine.studio(() if demo else logs, reading, demo, port=port, ready=ready)


def _leading_to(address: str, folder: Path) -> str:
    """Write a page that leads to the address; its own address holds no token.

    Other users of the computer see the arguments of programs, the browser's too. They cannot read the folder.
    """
    page = folder / "studio.html"
    page.write_text(f'<!doctype html><meta http-equiv="refresh" content="0; url={escape(address)}">', encoding="utf-8")
    return page.as_uri()
