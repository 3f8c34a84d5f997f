"""The studio's start: its pages, its server, and the first log."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from nicegui import app, background_tasks

from imufit.log import Reading
from imufit.studio import server
from imufit.studio.desk import SESSION_ENDING, Desk
from imufit.studio.live import page as live
from imufit.studio.live.device import sign
from imufit.studio.log_file import LogFile
from imufit.studio.mystery import DEMO_SEED, DEMONSTRATION
from imufit.studio.page import page_of


def start(logs: Sequence[Path], reading: Reading, demo: bool, *, port: int, ready: Callable[[str], None]) -> None:
    """Serve the studio until Ctrl-C.

    Parameters
    ----------
    logs : sequence of Path
        Logs of one sensor, or the file of a session.
    reading : Reading
        How the logs are read.
    demo : bool
        Whether to open a simulated log with a hidden effect.
    port : int
        Port of 127.0.0.1; 0 lets the operating system choose.
    ready : callable
        Called with the address once the server listens.

    Raises
    ------
    InputError
        The port is taken.
    """
    desk = Desk()
    server.add_page("/", page_of(desk, sign))

    async def look_at(path: Path) -> None:
        here = Path.cwd()
        name = path.relative_to(here) if path.is_relative_to(here) else path
        await desk.bring([LogFile(path, str(name))])

    server.add_page("/live", live.page_with(look_at), "imufit live")

    async def first() -> None:
        if demo:
            await desk.play(DEMONSTRATION, DEMO_SEED)
        elif len(logs) == 1 and logs[0].suffix.lower() == SESSION_ENDING:
            await desk.reopen(logs[0])
        elif logs:
            await desk.open([LogFile(path, str(path), reading) for path in logs])

    app.on_shutdown(desk.close)
    app.on_startup(lambda: background_tasks.create(first(), name="first log"))
    server.serve(port, ready)
