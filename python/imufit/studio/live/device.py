"""The one device of the server, which every page shares, and the sign of it on the studio's page."""

from __future__ import annotations

import asyncio
from typing import Final

from nicegui import app, ui

from imufit.studio.icons import bare
from imufit.studio.live.listening import Listening, Recorded, Source

EVERY: Final = 0.5
"""Time between two looks at the device, s."""
STOPS: Final = "Stop the recording, or let go of the device"


class Device:
    """The one device of the server: a page that is loaded again finds the recording running."""

    def __init__(self) -> None:
        self.listening: Listening | None = None
        self._last = Recorded()

    @property
    def recorded(self) -> Recorded:
        """The present recording, or the last one: it is there to be opened after its device has gone."""
        own = None if self.listening is None else self.listening.recorded
        return self._last if own is None or own.path is None else own

    @property
    def state(self) -> str:
        """The device in two words, for a page that does not show it; empty where none is followed."""
        if self.listening is None:
            return ""
        return "Live: recording" if self.recorded.running else "Live: listening"

    async def connect(self, source: Source) -> None:
        """Follow a device.

        Parameters
        ----------
        source : Source
            The device.
        """
        await self.disconnect()
        made = Listening(source)
        await asyncio.to_thread(made.open)
        self.listening = made

    async def disconnect(self) -> None:
        """Let go of the device."""
        held, self.listening = self.listening, None
        if held is not None:
            await asyncio.to_thread(held.close)
            if held.recorded.path is not None:
                self._last = held.recorded

    async def end(self) -> None:
        """End the recording; without one, let go of the device."""
        if self.listening is not None and self.recorded.running:
            self.listening.stop()
        else:
            await self.disconnect()


device = Device()
# The end of the server ends a recording, and makes the log of it.
app.on_shutdown(device.disconnect)


def sign() -> None:
    """Show on a page that a device is followed, with a button that ends this."""
    with ui.element("div").classes("studio-sign").props("data-mark=live-sign") as shown:
        words = ui.label()
        bare("stop", STOPS, device.end).props(f'size=sm data-mark=live-stop title="{STOPS}"')

    def look() -> None:
        shown.visible = bool(device.state)
        words.set_text(device.state)

    look()
    ui.timer(EVERY, look)
