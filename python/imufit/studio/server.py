"""The studio's server: pages for one browser, at an address of this computer with a token in it."""

from __future__ import annotations

import secrets
import socket
from collections.abc import Callable
from contextlib import suppress
from typing import Final

import uvicorn
from fastapi import FastAPI
from nicegui import app, ui

from imufit.errors import InputError
from imufit.remedy import keyword
from imufit.studio.guard import HOST, Guard

TOKEN_BYTES: Final = 24
"""Random bytes of the token: 192 bits cannot be guessed."""
BACKLOG: Final = 64
"""Connections that may wait: one page opens about 40 at once."""

GOODBYE_S: Final = 2
"""Time that open pages have to leave when the server ends, s; a page that stays would hold the server."""

_paths: dict[str, str] = {}
"""Titles of the pages by path."""


def add_page(path: str, build: Callable[[], None], title: str = "imufit") -> None:
    """Serve one more page.

    Parameters
    ----------
    path : str
        Path behind the token, such as ``/live``.
    build : callable
        Makes the elements of the page; called anew for each browser that opens the page.
    title : str
        Title of the page.

    Raises
    ------
    ValueError
        The path has a page already.
    """
    if path in _paths:
        raise ValueError(f"the path {path} has a page already")
    _paths[path] = title
    # Light or dark follows the computer until the person chooses.
    ui.page(path, title=title, dark=None)(build)


def other_pages() -> list[tuple[str, str]]:
    """Return path and title of every page but the first, for links."""
    return [(path, title) for path, title in _paths.items() if path != "/"]


def address_of(port: int, token: str) -> str:
    """Return the address that a browser opens.

    Parameters
    ----------
    port : int
        Port of the server.
    token : str
        Its token.
    """
    return f"http://{HOST}:{port}/{token}/"


def serve(port: int = 0, ready: Callable[[str], None] | None = None) -> None:
    """Serve the pages until Ctrl-C.

    Parameters
    ----------
    port : int
        Port to listen on; 0 lets the operating system choose.
    ready : callable, optional
        Called with the address once the server listens.

    Raises
    ------
    InputError
        The port is taken.
    """
    token = secrets.token_urlsafe(TOKEN_BYTES)
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as listening:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind((HOST, port))
        except OSError as error:
            raise InputError(
                f"port {port} cannot be used: {error.strerror}",
                remedy="Leave out " + keyword("port") + ", or give another one.",
            ) from None
        listening.listen(BACKLOG)
        chosen = listening.getsockname()[1]
        outer = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
        ui.run_with(outer, mount_path=f"/{token}", show_welcome_message=False, reconnect_timeout=30.0)
        if ready is not None:
            app.on_startup(lambda: ready(address_of(chosen, token)))
        settings = uvicorn.Config(
            Guard(outer, token, chosen), log_level="error", access_log=False, timeout_graceful_shutdown=GOODBYE_S
        )
        # Ctrl-C is how a person ends the server, and no interruption of its work.
        with suppress(KeyboardInterrupt):
            uvicorn.Server(settings).run(sockets=[listening])
