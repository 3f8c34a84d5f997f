"""Region over the model: the fall of the error step by step, undo and redo; the names of the steps stand apart."""

from __future__ import annotations

import math
from typing import Final

from nicegui import ui

from imufit.log.columns import SENSOR_NAMES
from imufit.printable import NAME, printable
from imufit.results import Diagnosis
from imufit.results.phrasing import listed
from imufit.studio import charts
from imufit.studio.desk import BEING_READ, Desk
from imufit.studio.icons import bare
from imufit.studio.session import Session
from imufit.studio.stack import Action, Step

OF_ALL: Final = "Held-out error of all channels together"


class FallView:
    """The fall of the error on one page.

    Parameters
    ----------
    desk : Desk
        The state that it shows.
    """

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        with ui.element("div").classes("studio-row flex-wrap"):
            ui.html("Fall of the error", tag="h2", sanitize=False).style("flex: 1 0 auto; white-space: nowrap")
            self._undo = bare("undo", "Undo", lambda: desk.attempt(lambda: _session(desk).undo())).props(
                "data-mark=undo"
            )
            self._redo = bare("redo", "Redo", lambda: desk.attempt(lambda: _session(desk).redo())).props(
                "data-mark=redo"
            )
        # In a row of its own: its other words must not move Undo beneath the pointer.
        self._keep = ui.button("Keep to compare", icon="splitscreen", on_click=self._keep_second)
        self._keep.props("flat dense size=12px").props("data-mark=second")
        self._judged = ui.label(OF_ALL).classes("studio-muted").props("data-mark=judged")
        self._chart = ui.plotly(charts.empty("Open a log to begin.")).classes("studio-chart")
        self._chart.props("data-mark=fall")
        self._named: tuple[object, ...] = ()

    def lay_names(self) -> None:
        """Give the names of the steps their place: under what they must not move when one more comes."""
        ui.html("Steps", tag="h2", sanitize=False).classes("studio-under")
        self._steps = ui.element("div").classes("studio-steps").props("data-mark=steps")

    def refresh(self) -> None:
        """Show the steps up to the present one, those that were undone paler."""
        session = self._desk.session
        begun = session is not None and session.begun
        self._undo.set_enabled(session is not None and begun and session.can_undo)
        self._redo.set_enabled(session is not None and begun and session.can_redo)
        self._keep.set_enabled(begun)
        if session is None or not begun:
            self._chart.update_figure(charts.empty(BEING_READ))
            self._steps.clear()
            self._named = ()
            return
        self._judged.set_text(_of_judged(self._desk.diagnosis))
        numbers = [session.numbers(step.stack) for step in session.steps]
        ratios = [math.nan if item is None else item.ratio for item in numbers]
        made = session.made()
        best = None
        if made is not None and made.diagnosis is not None and not session.can_redo and not self._desk.guessing:
            # Beside a wrong fixed value no effect is proposed: it would explain the error of that value.
            candidate = None if made.diagnosis.contradicted else made.diagnosis.best_candidate
            if candidate is not None:
                best = Step(Action.ADD, candidate.effect, session.stack), candidate.held_out_after
        figure = charts.fall(
            [step.label for step in session.steps],
            ratios,
            [step.expected for step in session.steps],
            session.position,
            best=None if best is None else (best[0].label, best[1]),
        )
        self._name_steps(session, None if best is None else best[0])
        if figure != self._chart.figure:
            self._chart.update_figure(figure)
        self._keep.set_text("End the comparison" if session.second is not None else "Keep to compare")

    def _name_steps(self, session: Session, proposed: Step | None) -> None:
        """Name the steps by the numbers under their bars: words first, the id after them."""
        named = (tuple(session.steps), session.position, proposed)
        if named == self._named:
            return
        self._named = named
        self._steps.clear()
        steps = [(str(k), step) for k, step in enumerate(session.steps)]
        steps += [] if proposed is None else [(charts.NEXT, proposed)]
        with self._steps:
            for k, (number, step) in enumerate(steps):
                undone = session.position < k < len(session.steps)
                with ui.element("div").classes("studio-step" + (" studio-off" if undone else "")):
                    ui.label(number).classes("studio-muted")
                    with ui.element("div"):
                        ui.label(f"{step.label} ").classes("inline")
                        if step.key:
                            ui.label(printable(step.key, NAME)).classes("studio-id inline")

    async def _keep_second(self) -> None:
        """Keep the present model beside later ones, or put the kept one away."""
        session = _session(self._desk)
        session.second = None if session.second is not None else session.stack
        self._desk.changed.emit()
        await self._desk.update()


def _of_judged(diagnosis: Diagnosis | None) -> str:
    """Say whose error the bars are."""
    if diagnosis is None or all(item.judged for item in diagnosis.judged):
        return OF_ALL
    names = [SENSOR_NAMES[item.sensor] for item in diagnosis.judged if item.judged]
    return f"Held-out error of the {listed(names)} alone" if names else OF_ALL


def _session(desk: Desk) -> Session:
    assert desk.session is not None
    return desk.session
