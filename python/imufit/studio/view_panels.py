"""Middle region: residual against a covariate, spectrum, and trace over time of one channel."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from nicegui import events, run, ui

from imufit.figures import quantity
from imufit.fitting.passes import UNITS
from imufit.log.columns import GROUPS
from imufit.model.catalogue import find_effect
from imufit.results import Comparison, Diagnosis, Spectrum, Unexplained
from imufit.results.comparison import OFFSET, Panel
from imufit.results.noise_part import NoisePart
from imufit.results.phrasing import capital
from imufit.results.sentences import leading
from imufit.studio import charts
from imufit.studio.against import against, opens_on
from imufit.studio.attribute import attribute
from imufit.studio.desk import BEING_READ, Desk
from imufit.studio.explained import Explained
from imufit.studio.icons import bare
from imufit.studio.names import channel_name, covariate_name, effect_name, with_symbol
from imufit.studio.session import Session, worst_channel
from imufit.studio.stack import Stack

PIXELS: Final = 1200
"""Points of a trace: as many as a wide screen shows beside each other."""
FAILS_WHERE: Final = "Where it fails"
TIME: Final = "t"
RISES: Final = " If the cause is {cause}, the residual follows the dotted line."
UNDER_WAY: Final = "The estimate is under way: spectrum and trace are those of the model before."
ZOOM_BY_MOUSE: Final = "Drag over a figure to zoom, double-click to see all of it."
ZOOM_BY_FINGER: Final = "A swipe scrolls the page. These buttons zoom the figure over time:"
NARROWER: Final = 0.5
"""Width of the window after a press that zooms in, over that before: four presses show a sixteenth of the log."""
ONWARD: Final = 0.5
"""Part of the window's width by which a press moves the window: half of what was seen stays in sight."""
SMALL: Final = 0.005
"""Share of the noise floor's variance below which a part is not listed."""
NO_SPECTRUM: Final = "The log has no stretch without a gap for a spectrum."
LOW: Final = 90
"""Height of the place of a figure that a log never has, px: the sentence, and the margins around it."""
NO_SPECTRUM_AT_REST: Final = "A spectrum needs a reference."
SHARES: Final = (
    "The percentages are the parts of the excess over the noise floor that each entry explains alone. Entries overlap: "
    "together they may explain more than 100 %."
)
CONSTANT: Final = " A constant offset is {share} of the excess over this floor."
RESIDUAL: Final = "residual"
READING: Final = "reading"


class PanelView:
    """The panels on one page.

    Parameters
    ----------
    desk : Desk
        The state that it shows.
    """

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._proposed = ""
        self._session: Session | None = None
        self._window: tuple[float, float] | None = None
        self._shown = ""
        self._kind = RESIDUAL
        self._state: tuple[Any, ...] = ()
        self._setting = False
        self._title = ui.html(FAILS_WHERE, tag="h2", sanitize=False)
        with ui.element("div").classes("studio-row flex-wrap"):
            self._channel = ui.select([], label="channel", on_change=self._chosen).props("dense outlined")
            self._channel.classes("min-w-28").props("data-mark=channel")
            self._covariate = ui.select([], label="against", on_change=self._chosen, with_input=True)
            self._covariate.classes("studio-against").props("dense outlined data-mark=covariate")
            self._covariate.props(attribute("title", SHARES))
        self._note = Explained().classes("studio-muted")
        self._floor = Explained().classes("studio-muted").props("data-mark=floor")
        with ui.element("div").classes("studio-charts"):
            # The element around both is hidden: Plotly cannot resize a figure that is hidden itself.
            with ui.element("div").classes("studio-pair") as self._pair:
                self._panel = ui.plotly(charts.empty("Open a log to begin.")).classes("studio-chart")
                self._panel.props("data-mark=panel")
                self._spectrum = ui.plotly(charts.empty("")).classes("studio-chart").props("data-mark=spectrum")
            with ui.element("div").classes("studio-chart studio-wide"):
                ui.label(ZOOM_BY_MOUSE).classes("studio-muted studio-mouse").props("data-mark=zoom-mouse")
                self._zoom_buttons()
                # The choice stands over the one figure that it changes.
                self._trace_kind = ui.toggle(
                    {RESIDUAL: "residual", READING: "reading"}, value=RESIDUAL, on_change=self._other_kind
                ).props('dense padding="2px 10px"')
                self._trace = ui.plotly(charts.empty("")).classes("studio-chart").props("data-mark=trace")
        ui.timer(1.0, self._grow)
        self._trace.on("plotly_relayout", self._zoomed, throttle=0.1)
        self._trace.on("plotly_doubleclick", lambda: self._zoom(None))

    def _zoom_buttons(self) -> None:
        """Offer what a mouse does by dragging: a finger's drag scrolls the page."""
        with ui.element("div").classes("studio-finger").props("data-mark=zoom-finger"):
            ui.label(ZOOM_BY_FINGER).classes("studio-muted")
            with ui.row().classes("gap-1"):
                for icon, words, width, move in (
                    ("zoom_in", "Zoom in", NARROWER, 0.0),
                    ("zoom_out", "Zoom out", 1.0 / NARROWER, 0.0),
                    ("chevron_left", "Earlier", 1.0, -ONWARD),
                    ("chevron_right", "Later", 1.0, ONWARD),
                ):
                    bare(icon, words, partial(self._to_window, width, move))
                bare("zoom_out_map", "All of it", partial(self._zoom, None))

    # --- choice of channel and covariate

    def refresh(self) -> None:
        """Show the panels of the present model."""
        session = self._desk.session
        if session is None:
            return
        if session is not self._session:
            self._session, self._window, self._state, self._shown = session, None, (), ""
            self._setting = True
            for choice in (self._channel, self._covariate):
                choice.set_options([], value=None)
            self._setting = False
            self._trace.update_figure(charts.empty("The rows are being read."))
            for chart in (self._panel, self._spectrum):
                chart.update_figure(charts.empty(BEING_READ))
        made = session.made()
        found = None if made is None else made.comparison
        judged = session.begun
        self._covariate.visible = judged
        # Before a residual is there, the readings are drawn, and there is nothing to choose.
        self._trace_kind.visible = judged and bool(self._desk.models)
        failing = (judged or session.has_reference) and not session.refused
        self._title.set_content(FAILS_WHERE if failing else "Readings")
        self._pair.visible = failing
        if not judged:
            if session.refused:
                words = "The log cannot be judged: the readings alone are drawn."
            else:
                words = "The readings are drawn while the evidence is taken."
            self._note.set_text(words)
            self._refresh_readings()
            return
        if found is None:
            self._draw_at_once(session)
            return
        second = None if session.second is None else session.made(session.second)
        desk = self._desk
        traced = [desk.models.get(model) for model in (Stack(), session.stack.model)]
        traced.append(None if session.second is None else desk.models.get(session.second.model))
        diagnosis, shares = (None, None) if made is None else (made.diagnosis, made.shares)
        shown = (desk.channel, desk.covariate, self._proposed)
        state = (found, diagnosis, shares, second and second.comparison, *shown, *traced)
        if all(a is b or a == b for a, b in zip(state, self._state, strict=False)) and len(state) == len(self._state):
            return
        self._state = state
        known = {item.channel for item in found.channels}
        channel = desk.channel if desk.channel in known else self._failing(found)
        if channel is None:
            return
        self._shown = channel
        self._offer(found, channel)
        self._draw(found, None if second is None else second.comparison, channel)

    def _failing(self, found: Comparison) -> str | None:
        """Return the channel that the verdict speaks of, or the one that fails most.

        Of several effects that explain the log alike the channels of the first one's sensors are looked at. Where none
        fails any more, the one that was looked at stays, so that the residual is seen gone.
        """
        if (left := self._left(found)) is not None:
            return left.channel
        told = self._told()
        if told is not None and told.best is not None:
            return self._of_clearest_value(told) or worst_channel(found, find_effect(told.best).sensors)
        worst = worst_channel(found)
        if worst in found.failing:
            return worst
        return self._shown or worst_channel(self._at_start() or found)

    def _of_clearest_value(self, told: Diagnosis) -> str | None:
        """Return the channel on which the value acts that the sentence over the page states."""
        best = told.best_candidate if told.verdict == "missing" else None
        clearest = None if best is None else leading(best.parameters)
        return None if clearest is None or self._session is None else self._session.channel_of(clearest)

    def _left(self, found: Comparison) -> Unexplained | None:
        """Return the dependence that the sentence over the page names first, where a panel shows it."""
        told = self._told()
        left = () if told is None or told.best is not None else told.unexplained[:1]
        return next((item for item in left if item.covariate in self._names(found, item.channel)), None)

    def _told(self) -> Diagnosis | None:
        """Return the diagnosis that the sentence over the page states; None in a game that is not over."""
        return None if self._desk.guessing else self._desk.diagnosis

    def _names(self, found: Comparison, channel: str) -> dict[str, str]:
        """Return what a channel's residual can stand against, with its words in the list."""
        session = self._session
        if session is None:
            return {}
        return against(found, channel, session.causes(channel), self._shares(channel))

    def _shares(self, channel: str) -> dict[str, float] | None:
        """Return the part of a channel's excess that each cause without a name explains; None until this is known."""
        made = None if self._session is None else self._session.made()
        return None if made is None or made.shares is None else made.shares.get(channel, {})

    def _at_start(self) -> Comparison | None:
        """Return where the ideal sensor fails."""
        made = None if self._session is None else self._session.made(Stack())
        return None if made is None else made.comparison

    def _draw_at_once(self, session: Session) -> None:
        """Show the residual that the evidence gives to first order, until the fit is there."""
        shown = session.panels_at_once()
        panel = _panel_of(shown, self._channel.value, self._covariate.value)
        if panel is not None:
            self._state = ()
            self._panel.update_figure(charts.residual_panel(panel))
        self._note.set_text(UNDER_WAY)

    def _refresh_readings(self) -> None:
        """Show the readings over time, before the evidence is there or of a log that cannot be judged."""
        desk = self._desk
        channels = [] if desk.traces is None else [item.name for item in desk.traces.channels if item.name[:3] in UNITS]
        state = (desk.traces, desk.channel)
        if not channels or state == self._state:
            return
        self._state = state
        channel = desk.channel if desk.channel in channels else channels[0]
        self._setting = True
        self._channel.set_options({name: _channel(name) for name in channels}, value=channel)
        self._setting = False
        self._say_floor(channel)
        ui.timer(0, lambda: self._draw_trace(channel), once=True)

    def _grow(self) -> None:
        """Draw the rows read so far, while a long log is being read."""
        traces = self._desk.traces
        if traces is not None and not traces.built:
            self._state = ()
            self.refresh()

    def _offer(self, found: Comparison, channel: str) -> None:
        """Fill the two lists, the worst first."""
        ratios = sorted(found.channels, key=lambda item: -item.ratio if np.isfinite(item.ratio) else np.inf)
        covariate = self._present_covariate(found, channel)
        self._setting = True
        self._channel.set_options(
            {item.channel: f"{_channel(item.channel)}, {quantity.ratio(item.ratio)} × its floor" for item in ratios},
            value=channel,
        )
        self._covariate.set_options(self._names(found, channel), value=covariate)
        self._setting = False

    def _present_covariate(self, found: Comparison, channel: str) -> str | None:
        """Return the covariate that the person chose, or the one that explains most of a channel's residual.

        Where the channel does not fail any more, this is the covariate of the start: the panel shows the residual gone.
        """
        names = self._names(found, channel)
        if self._desk.covariate in names:
            return self._desk.covariate
        left = self._left(found)
        if left is not None and left.channel == channel:
            return left.covariate
        fails = channel in found.failing
        judged = found if fails else self._at_start() or found
        opens = opens_on(judged, channel, self._shares(channel) if fails else {})
        if opens in names:
            return opens
        # Where no covariate explains a part worth naming, time shows what is constant and what is not.
        return TIME if TIME in names else next(iter(names), None)

    def _chosen(self) -> None:
        if not self._setting:
            self._desk.channel, self._desk.covariate = self._channel.value, self._covariate.value
            self._desk.changed.emit()

    def _other_kind(self) -> None:
        if self._setting:
            return
        self._kind = self._trace_kind.value
        self._state = ()
        self.refresh()

    def propose(self, effect: str) -> None:
        """Draw what an effect would explain; empty draws nothing of that kind.

        Parameters
        ----------
        effect : str
            Its id.
        """
        self._proposed = effect
        self.refresh()

    @property
    def _effect(self) -> str:
        """The effect whose share is drawn, in words."""
        return effect_name(self._proposed) if self._proposed else ""

    # --- drawing

    def _draw(self, found: Comparison, second: Comparison | None, channel: str) -> None:
        panels = [panel for panel in found.panels if panel.channel == channel]
        covariate = self._present_covariate(found, channel)
        panel = next((item for item in panels if item.covariate == covariate), None)
        after = None
        if self._proposed and self._desk.session is not None:
            explained = self._desk.session.explained(self._proposed)
            after = _panel_of(explained, channel, covariate)
        other = None if second is None else _panel_of(second.panels, channel, covariate)
        if panel is not None:
            self._panel.update_figure(charts.residual_panel(panel, after, other, effect=self._effect))
        elif covariate is None:
            self._panel.update_figure(charts.empty("No covariate is seen in this channel."))
        else:
            ui.timer(0, lambda: self._draw_cause(channel, covariate), once=True)
        spectrum = _spectrum_of(found, channel)
        by_rows = self._session is not None and self._session.has_reference
        both = None if second is None else _spectrum_of(second, channel)
        self._spectrum.update_figure(
            (charts.empty(NO_SPECTRUM) if by_rows else charts.empty(NO_SPECTRUM_AT_REST, LOW))
            if spectrum is None
            else charts.spectrum(spectrum, both)
        )
        level = next(item for item in found.channels if item.channel == channel)
        rises = "" if panel is not None or covariate is None else RISES.format(cause=covariate_name(covariate))
        beside = _without_effect_on(self._proposed, channel)
        alone = f"{capital(channel_name(channel))} alone: its residual stands at {quantity.ratio(level.ratio)}"
        offset = next((item for item in found.where if (item.channel, item.covariate) == (channel, OFFSET)), None)
        constant = "" if offset is None else CONSTANT.format(share=quantity.share(offset.share))
        self._note.set_text(f"{alone} times its noise floor.{constant}{rises}{beside}")
        self._say_floor(channel)
        ui.timer(0, lambda: self._draw_trace(channel), once=True)

    def _say_floor(self, channel: str) -> None:
        """State which parts make the noise floor of the channel that is shown."""
        found = self._desk.diagnosis
        # As long as an effect is missing, its part of the residual passes for a random walk of the zero.
        slow = found is not None and found.verdict == "adequate"
        self._floor.set_text("" if found is None else _floor_words(found.noise, channel, slow=slow))

    async def _draw_cause(self, channel: str, cause: str) -> None:
        """Draw the residual against the part of it that a cause without a name explains."""
        session, state, proposed, effect = self._session, self._state, self._proposed, self._effect
        if session is None:
            return
        found = await run.io_bound(lambda: session.against_cause(channel, cause, proposed))
        if found is None or state is not self._state:
            return
        panel, after, other = found
        self._panel.update_figure(
            charts.empty("Too few rows show this cause.")
            if panel is None
            else charts.residual_panel(panel, after, other, effect=effect, explained=True)
        )

    async def _draw_trace(self, channel: str) -> None:
        """Draw the visible points of the window."""
        desk = self._desk
        traces, session = desk.traces, desk.session
        if traces is None or session is None or (span := traces.span) is None:
            self._trace.update_figure(charts.empty("The rows are being read."))
            return
        begin, end = self._window or span
        start, now = desk.models.get(Stack()), desk.models.get(session.stack.model)
        kept = None if session.second is None else desk.models.get(session.second.model)
        # Before the residuals are there, and on a log that has none, the readings stand in their place.
        kind = READING if start is None and now is None else self._kind
        # A channel of rests is not a column: the readings of its sensor are drawn.
        columns = [item.name for item in traces.channels]
        sensor = channel[:3] if channel[:3] in UNITS else "gyr"
        of_sensor = [name for name in GROUPS[sensor] if name in columns]

        def work() -> list[tuple[str, Any, Any]]:
            lines = []
            if channel not in columns:
                found = traces.window(of_sensor, begin, end, PIXELS)
                lines += [(name[-1], *points.line()) for name, points in found.items()]
            elif kind == READING:
                lines.append(("measured", *traces.window([channel], begin, end, PIXELS)[channel].line()))
                if now is not None:
                    lines.append(("predicted", *now.window([channel], begin, end, PIXELS)[channel][1].line()))
            else:
                # The dashes of the kept model lie upon the line of the present one, where both agree.
                for name, model in {"ideal sensor": start, "now": now, "kept model": kept}.items():
                    # The same model is drawn once: under its first name, the present one as such.
                    others = {"kept model": (start, now), "now": (start,)}.get(name, ())
                    if model is not None and all(model is not other for other in others):
                        lines.append((name, *model.window([channel], begin, end, PIXELS)[channel][0].line()))
            return lines

        lines = await run.io_bound(work)
        drawn = channel if channel in columns else sensor
        at_rest = session.rests.tolist()
        self._trace.update_figure(
            charts.trace(drawn, UNITS[sensor], lines or [], (begin, end), title=kind, at_rest=at_rest)
        )

    async def _zoomed(self, event: events.GenericEventArguments) -> None:
        given = event.args if isinstance(event.args, dict) else {}
        ends = [given.get(f"xaxis.range[{k}]") for k in (0, 1)]
        if all(isinstance(end, int | float) for end in ends):
            await self._zoom((float(ends[0]), float(ends[1])))  # type: ignore[arg-type]
        elif given.get("xaxis.autorange"):
            await self._zoom(None)

    async def _to_window(self, width: float, move: float) -> None:
        """Show a window of another width or place; one as wide as the log shows all of it."""
        traces = self._desk.traces
        if traces is None or (span := traces.span) is None:
            return
        begin, end = self._window or span
        half = 0.5 * width * (end - begin)
        if 2.0 * half >= span[1] - span[0]:
            await self._zoom(None)
            return
        middle = 0.5 * (begin + end) + move * (end - begin)
        middle = min(max(middle, span[0] + half), span[1] - half)
        await self._zoom((middle - half, middle + half))

    async def _zoom(self, window: tuple[float, float] | None) -> None:
        if window != self._window:
            self._window = window
            if self._channel.value is not None:
                await self._draw_trace(self._channel.value)


def _without_effect_on(effect: str, channel: str) -> str:
    """Return the sentence on an effect of another sensor: with it, the channel's residual stays as it is."""
    if not effect or channel[:3] in find_effect(effect).sensors:
        return ""
    return f" {capital(effect_name(effect))} does not act on {channel_name(channel)}."


def _channel(channel: str) -> str:
    """Return a channel in words with its name in logs behind."""
    return with_symbol(channel_name(channel), channel)


def _floor_words(noise: Sequence[NoisePart], channel: str, *, slow: bool) -> str:
    """Say which parts make the noise floor of a channel, and which slow changes of the zero stand beside it."""
    parts = [part for part in noise if part.channel == channel and part.share >= SMALL and (slow or not part.beyond)]
    parts.sort(key=lambda part: -part.share)
    if not parts:
        return ""
    names = [(part.beyond, f"{part.component.replace('_', ' ')} {quantity.share(part.share)}") for part in parts[:4]]
    floor = ", ".join(words for beyond, words in names if not beyond)
    beside = ", ".join(words for beyond, words in names if beyond)
    added = f" Slow changes of the zero add to it: {beside} of that variance." if beside else ""
    return f"Noise floor of {channel_name(channel)}: {floor or 'not known'} of its variance.{added}"


def _panel_of(panels: Any, channel: str, covariate: str | None) -> Panel | None:
    found: Panel | None = next(
        (item for item in panels if (item.channel, item.covariate) == (channel, covariate)), None
    )
    return found


def _spectrum_of(found: Comparison, channel: str) -> Spectrum | None:
    return next((item for item in found.spectra if item.channel == channel), None)
