"""Left region: the model as a stack of effects with switches, values and standard errors."""

from __future__ import annotations

from nicegui import ui

from imufit.figures import quantity
from imufit.printable import NAME, printable
from imufit.results import Parameter
from imufit.studio.attribute import attribute
from imufit.studio.desk import Desk
from imufit.studio.icons import bare
from imufit.studio.session import Numbers, Session
from imufit.studio.stack import Entry


class ModelView:
    """The stack of effects on one page.

    Parameters
    ----------
    desk : Desk
        The state that it shows.
    """

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        ui.html("Model", tag="h2", sanitize=False)
        self._state: tuple[object, ...] = ()
        self._list = ui.column().classes("w-full gap-0")

    def refresh(self) -> None:
        """Show the present stack."""
        session = self._desk.session
        begun = session is not None and session.begun
        numbers = session.numbers() if session is not None and begun else None
        # A list that stays as it is keeps its elements: a click never falls on one that is being replaced.
        state = (session, begun, None if session is None else session.stack, numbers)
        if state == self._state:
            return
        self._state = state
        self._list.clear()
        with self._list:
            if session is None or not begun:
                words = "Open a log to begin." if session is None else "The evidence is being taken."
                ui.label(words).classes("studio-muted")
                return
            ui.label(_state(session, numbers)).classes("studio-muted").props("data-mark=model-state")
            for entry in session.stack.entries:
                self._entry(entry, numbers)

    def _entry(self, entry: Entry, numbers: Numbers | None) -> None:
        desk = self._desk
        name = printable(entry.effect, NAME)
        with ui.element("div").classes("studio-item" + ("" if entry.on else " studio-off")):
            with ui.element("div").classes("studio-row"):
                ui.switch(
                    value=entry.on, on_change=lambda event: desk.attempt(lambda: _switch(desk, entry, event.value))
                ).props("dense " + attribute("aria-label", f"{entry.effect} in the model")).props(
                    attribute("data-mark", f"switch-{entry.effect}")
                )
                ui.label(name).classes("studio-id")
                bare(
                    "close",
                    f"Remove {entry.effect}",
                    lambda: desk.attempt(lambda: _session(desk).remove(entry.effect)),
                ).props("size=sm")
            if not entry.on:
                return
            if numbers is None:
                ui.label("This effect takes a pass over the log.").classes("studio-muted")
                return
            for parameter in numbers.parameters:
                if parameter.effect == entry.effect:
                    self._parameter(parameter, numbers.fitted)

    def _parameter(self, parameter: Parameter, fitted: bool) -> None:
        desk = self._desk
        with ui.element("div").classes("studio-parameter"):
            ui.label(printable(parameter.name, NAME)).classes("studio-muted")
            value = ui.label(parameter.shown).props(attribute("data-mark", f"value-{parameter.key}"))
            if not fitted:
                value.classes("studio-muted").tooltip("to first order, from the evidence")
            elif parameter.typical is not None:
                value.tooltip(f"typical size {quantity.quantity(parameter.typical, parameter.unit)}")
            bare("edit", f"Edit {parameter.key}", lambda: self._edit(parameter)).props("size=sm").props(
                attribute("data-mark", f"edit-{parameter.key}")
            )
            pin = "lock" if parameter.fixed else "lock_open"
            words = "Fit this parameter again" if parameter.fixed else "Fix at this value"
            bare(pin, f"{words}: {parameter.key}", lambda: desk.attempt(lambda: _pin(desk, parameter))).props(
                "size=sm"
            ).props(attribute("data-mark", f"pin-{parameter.key}"))

    def _edit(self, parameter: Parameter) -> None:
        """Ask for a value in the shown unit."""
        desk = self._desk
        factor, unit = quantity.shown_unit(parameter.unit, parameter.value)
        with ui.dialog() as dialog, ui.card():
            ui.label(f"{printable(parameter.key, NAME)}, {unit}").classes("studio-id")
            given = ui.number(label=f"value, {unit}", value=float(f"{factor * parameter.value:.6g}")).props(
                "data-mark=edit-value autofocus"
            )
            ui.label("The value stays fixed until you open the lock.").classes("studio-muted")

            async def take() -> None:
                if given.value is None:
                    given.error = "Give a number."
                    return
                dialog.close()
                value = float(given.value) / factor
                await desk.attempt(lambda: _session(desk).hold(parameter.effect, parameter.name, value))

            given.on("keydown.enter", take)
            with ui.row():
                ui.button("Fix at this value", on_click=take).props("data-mark=edit-take")
                ui.button("Cancel", on_click=dialog.close).props("flat")
        dialog.on("hide", dialog.delete)
        dialog.open()


def _session(desk: Desk) -> Session:
    assert desk.session is not None
    return desk.session


def _switch(desk: Desk, entry: Entry, on: bool) -> None:
    _session(desk).switch(entry.effect, on)


def _pin(desk: Desk, parameter: Parameter) -> None:
    session = _session(desk)
    if parameter.fixed:
        session.free(parameter.effect, parameter.name)
    else:
        session.hold(parameter.effect, parameter.name, parameter.value)


def _state(session: Session, numbers: Numbers | None) -> str:
    """Return how good the present numbers are."""
    if not session.stack.entries:
        return "The ideal sensor: no effect yet."
    if numbers is None:
        return "A pass over the log is under way."
    if not numbers.fitted:
        return "Values to first order, from the evidence. The fit is under way."
    return "Fitted values ± standard errors."
