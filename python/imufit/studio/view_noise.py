"""The sensors at rest: mean rate and Allan deviation, worked out when the region opens."""

from __future__ import annotations

from nicegui import background_tasks, run, ui

from imufit.allan_deviation import Allan
from imufit.errors import InputError
from imufit.log import LogSource
from imufit.log.columns import SENSOR_NAMES
from imufit.printable import printable
from imufit.studio import charts
from imufit.studio.desk import Desk
from imufit.studio.standstill import standstill
from imufit.verbs import allan


class NoiseView:
    """The Allan deviation on one page.

    Parameters
    ----------
    desk : Desk
        The state that it shows.
    """

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._log: LogSource | None = None
        with ui.expansion("Noise at rest", on_value_change=self.refresh).classes("w-full").props("dense") as opened:
            self._rate = ui.label("").classes("studio-muted").props("data-mark=standstill")
            self._note = ui.label("Open a log to begin.").classes("studio-muted").props("data-mark=allan-note")
            self._place = ui.element("div").classes("studio-charts")
        self._opened = opened.props("data-mark=noise")

    def renew(self) -> None:
        """Show the noise of the present log, in the background; the region opens where nothing else is judged."""
        session = self._desk.session
        if session is not None and session.refused and session.logs[session.shown] is not self._log:
            self._opened.open()
        if self._opened.value:
            background_tasks.create(self.refresh(), name="noise at rest")

    async def refresh(self) -> None:
        """Show the noise of the log that is drawn, if the region is open and it is not there yet."""
        session = self._desk.session
        if not self._opened.value or session is None or not (session.begun or session.refused):
            return
        log = session.logs[session.shown]
        if log is self._log:
            return
        self._log = log
        self._place.clear()
        self._rate.set_text("")
        self._note.set_text("The longest rest is being looked for.")
        said = await run.io_bound(standstill, log)
        if said is None or log is not self._log:
            return  # another log was opened meanwhile
        self._rate.set_text(printable(said))
        try:
            found: Allan | None = await run.io_bound(allan, log)
        except InputError as error:
            found, words = None, printable(str(error))
        if log is not self._log:
            return
        if found is None:
            self._note.set_text(words)
            return
        self._note.set_text(
            f"Allan deviation over a rest of {found.duration:.0f} s, with its 68 % band; dotted: noise of four kinds."
        )
        channels = list(found.channels.values())
        with self._place:
            for sensor, name in SENSOR_NAMES.items():
                own = [channel for channel in channels if channel.name.startswith(f"{sensor}_")]
                if own:
                    figure = charts.allan(name, own)
                    ui.plotly(figure).classes("studio-chart").props(f"data-mark=allan-{sensor}")
