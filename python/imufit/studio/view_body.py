"""The attitudes of the log on a body in three dimensions, worked out when a person opens the region."""

from __future__ import annotations

from typing import Any, Final

from nicegui import background_tasks, run, ui

from imufit.errors import InputError
from imufit.printable import printable
from imufit.studio.attitudes import Track, measured_track, predicted_track, reference_track
from imufit.studio.body import Player
from imufit.studio.desk import Desk
from imufit.studio.session import Made, Session

EXPLAINED: Final = {
    "measured": "measured: the filter mekf on the readings",
    "predicted": "predicted: the same filter on the readings that the model predicts",
    "reference": "reference: the log's own attitude",
}
"""Meaning of each body, in a sentence above the player."""


class BodyView:
    """The player on one page.

    Parameters
    ----------
    desk : Desk
        The state that it shows.
    """

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._state: tuple[Any, ...] = ()
        self._player: Player | None = None
        with ui.expansion("Attitude in 3-D", on_value_change=self.refresh).classes("w-full").props("dense") as opened:
            self._note = ui.label("Open a log to begin.").classes("studio-muted")
            self._place = ui.column().classes("w-full")
        self._opened = opened.props("data-mark=body")

    def renew(self) -> None:
        """Show the attitudes of the present model, in the background."""
        if self._opened.value:
            background_tasks.create(self.refresh(), name="attitudes")

    async def refresh(self) -> None:
        """Show the attitudes of the present model, if the region is open and they are not there yet."""
        session = self._desk.session
        made = None if session is None or not session.begun else session.made()
        state = (session, None if session is None else session.stack.model, made is not None)
        if not self._opened.value or state == self._state or session is None or made is None:
            return
        self._state = state
        self._note.set_text("The filter runs over the log.")
        try:
            tracks = await run.io_bound(_tracks, session, made)
        except InputError as error:
            self._note.set_text(printable(str(error)))
            return
        if state != self._state:
            return  # another model was chosen meanwhile
        time = None if self._player is None else self._player.time
        if self._player is not None:
            self._player.close()
        self._place.clear()
        self._player = None
        if not tracks:
            self._note.set_text("The log has neither a reference nor the sensors that a filter needs.")
            return
        self._note.set_text(". ".join(EXPLAINED[track.name] for track in tracks) + ".")
        with self._place:
            self._player = Player(tracks)
        if time is not None:
            self._player.seek(time)


def _tracks(session: Session, made: Made) -> list[Track]:
    """Work out the attitudes of the log that is drawn."""
    log = session.logs[session.shown]
    found = [measured_track(log), reference_track(log)]
    if session.has_reference:
        found.insert(1, predicted_track(made.fit, log, session.shown))
    return [track for track in found if track is not None]
