"""Download of the session, and the question for it before another log takes the session's place."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from pathlib import Path

from nicegui import ui

from imufit.errors import InputError
from imufit.printable import NAME, printable
from imufit.studio.desk import Desk


def download_session(desk: Desk) -> None:
    """Give the file of the session to the person, and the log of a game besides.

    Parameters
    ----------
    desk : Desk
        The state that is saved.
    """
    try:
        text = desk.save()
    except InputError as error:
        ui.notify(str(error))
        return
    name = f"{Path(desk.files[0].name).stem}-session.toml"
    ui.download.content(text.encode(), name)
    log = desk.game_log()
    files = printable(name, NAME) if log is None else f"{printable(name, NAME)} and {log.name}"
    ui.notify(f"The browser saved {files} in its folder of downloads.")
    download_game(desk)


def download_game(desk: Desk) -> None:
    """Give the log of a game to the person: session and copied text name it.

    Parameters
    ----------
    desk : Desk
        The state with the game.
    """
    log = desk.game_log()
    if log is not None:
        ui.download.content(log.read_bytes(), log.name)


def save_first(desk: Desk, action: Callable[[], Awaitable[None]]) -> Callable[[], Awaitable[None]]:
    """Return an action that asks first where it would drop steps that are not saved.

    Parameters
    ----------
    desk : Desk
        The state that the action replaces.
    action : callable
        The action.
    """

    async def ask() -> None:
        if not desk.unsaved:
            await action()
            return
        with ui.dialog() as dialog, ui.card():
            ui.label("Save the session first?").classes("studio-name")
            ui.label("The new log takes the place of the present model, which is not saved.").classes("studio-muted")

            async def go_on() -> None:
                dialog.close()
                await action()

            async def save() -> None:
                download_session(desk)
                await go_on()

            with ui.row():
                ui.button("Save", on_click=save).props("data-mark=save-first")
                ui.button("Go on without", on_click=go_on).props("outline data-mark=replace")
                ui.button("Cancel", on_click=dialog.close).props("flat data-mark=replace-cancel")
        dialog.on("hide", dialog.delete)
        dialog.open()

    return ask
