"""Bottom region: the fall of the error step by step, undo, redo, and two models side by side."""

from __future__ import annotations

import math

from nicegui import run, ui

from imufit.figures import quantity
from imufit.printable import NAME, printable
from imufit.results import ModelComparison
from imufit.results.noise_part import NoisePart
from imufit.studio import charts
from imufit.studio.desk import Desk
from imufit.studio.session import Session, worst_channel


class FallView:
    """The fall of the error on one page.

    Parameters
    ----------
    desk : Desk
        The state that it shows.
    """

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._compared: tuple[object, object] | None = None
        with ui.element("div").classes("studio-row flex-wrap"):
            ui.html("Fall of the error", tag="h2", sanitize=False).style("flex: 1")
            self._undo = _button("undo", "Undo", lambda: desk.attempt(lambda: _session(desk).undo())).mark("undo")
            self._redo = _button("redo", "Redo", lambda: desk.attempt(lambda: _session(desk).redo())).mark("redo")
            self._keep = ui.button("Keep as second model", icon="splitscreen", on_click=self._keep_second)
            self._keep.props("flat dense no-caps size=sm").mark("second")
        self._chart = ui.plotly(charts.empty("The error stands here once a log is open.")).classes("studio-chart")
        self._chart.mark("fall")
        self._floor = ui.label("").classes("studio-muted").mark("floor")
        self._two = ui.column().classes("w-full gap-1").mark("two")

    def refresh(self) -> None:
        """Show the steps up to the present one, those that were undone paler."""
        session = self._desk.session
        begun = session is not None and session.begun
        self._undo.set_enabled(session is not None and begun and session.can_undo)
        self._redo.set_enabled(session is not None and begun and session.can_redo)
        self._keep.set_enabled(begun)
        if session is None or not begun:
            return
        numbers = [session.numbers(step.stack) for step in session.steps]
        ratios = [math.nan if item is None else item.ratio for item in numbers]
        made = session.made()
        best = None
        if made is not None and made.diagnosis is not None and not session.can_redo and not self._desk.guessing:
            candidate = made.diagnosis.best_candidate
            best = None if candidate is None else (candidate.effect, candidate.held_out_after)
        self._chart.update_figure(
            charts.fall(
                [step.label for step in session.steps],
                ratios,
                [step.expected for step in session.steps],
                session.position,
                best=best,
            )
        )
        self._floor.set_text(
            "" if made is None or made.diagnosis is None else _floor_words(session, made.diagnosis.noise)
        )
        self._keep.set_text("Put the second model away" if session.second is not None else "Keep as second model")
        ui.timer(0, self._compare, once=True)

    def _keep_second(self) -> None:
        session = _session(self._desk)
        session.second = None if session.second is not None else session.stack
        self._desk.changed.emit()

    async def _compare(self) -> None:
        """Hold the second model against the present one."""
        session = self._desk.session
        if session is None or session.second is None:
            self._compared = None
            self._two.clear()
            return
        state = (session.second.model, session.stack.model)
        if state == self._compared or session.made() is None:
            return
        self._compared = state
        self._two.clear()
        with self._two:
            if state[0] == state[1]:
                ui.label("The second model is the present one. Change the present one to compare.").classes(
                    "studio-muted"
                )
                return
            ui.label("The two models are being compared.").classes("studio-muted")
        found = await run.io_bound(session.against)
        self._two.clear()
        with self._two:
            if found is None:
                ui.label("Two models are compared on logs with a reference.").classes("studio-muted")
            else:
                _two_models(session, found)


def _two_models(session: Session, found: ModelComparison) -> None:
    """Lay out two models beside each other."""
    assert session.second is not None
    second, present = session.numbers(session.second), session.numbers()
    if second is None or present is None:
        return
    ui.label(printable(found.sentence)).classes("studio-sentence").mark("two-sentence")
    values = [{item.key: item.shown for item in numbers.parameters} for numbers in (second, present)]
    keys = list(dict.fromkeys([*values[0], *values[1]]))
    rows = [("held-out error", quantity.ratio(second.ratio), quantity.ratio(present.ratio))]
    rows += [(printable(key, NAME), values[0].get(key, "–"), values[1].get(key, "–")) for key in keys]
    with ui.element("table").classes("studio-table"):
        for k, row in enumerate([("", "second model", "present model"), *rows]):
            with ui.element("tr"):
                for cell in row:
                    with ui.element("th" if k == 0 else "td"):
                        ui.label(cell)


def _floor_words(session: Session, noise: tuple[NoisePart, ...]) -> str:
    """Say which parts make the noise floor of the worst channel."""
    made = session.made(session.steps[0].stack)
    channel = None if made is None or made.comparison is None else worst_channel(made.comparison)
    parts = sorted((part for part in noise if part.channel == channel), key=lambda part: -part.share)
    if not parts:
        return ""
    listed = ", ".join(f"{part.component.replace('_', ' ')} {quantity.share(part.share)}" for part in parts[:4])
    return f"Noise floor of {channel}: {listed} of its variance."


def _session(desk: Desk) -> Session:
    assert desk.session is not None
    return desk.session


def _button(icon: str, words: str, action: object) -> ui.button:
    button = ui.button(icon=icon, on_click=action).props(f'flat dense round aria-label="{words}"')  # type: ignore[arg-type]
    return button.tooltip(words)
