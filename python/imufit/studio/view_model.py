"""Left region: the model as a stack of effects with switches, values and standard errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from nicegui import ui

from imufit.figures import quantity
from imufit.printable import NAME, printable
from imufit.results import Parameter
from imufit.results.phrasing import capital
from imufit.studio.attribute import attribute
from imufit.studio.desk import BEING_READ, Desk
from imufit.studio.heading import heading_of
from imufit.studio.icons import bare, one_of_two
from imufit.studio.names import effect_name, parameter_name
from imufit.studio.session import Numbers, Session
from imufit.studio.stack import Entry

ESTIMATED: Final = "estimated"
FIXED: Final = "fixed"
"""Words beside a value: whether the log gives the value, or a person has fixed it."""
CONTRADICTED: Final = "The log contradicts this value: the sentence on top gives both values."
UNUSUAL: Final = 10.0
"""Typical sizes from which on a value that a person gives is unusual: the best and the worst sensors lie within."""
LEAVES: Final = "A wrong fixed value leaves a residual: the standard errors of the other values grow with the residual."
"""Why other values become less certain once one is fixed."""


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
        self._wrong: frozenset[str] = frozenset()
        self._list = ui.column().classes("w-full gap-0")

    def refresh(self) -> None:
        """Show the present stack."""
        session = self._desk.session
        begun = session is not None and session.begun
        numbers = session.numbers() if session is not None and begun else None
        diagnosis = None if self._desk.guessing else self._desk.diagnosis
        self._wrong = frozenset(item.key for item in (() if diagnosis is None else diagnosis.contradicted))
        # A list that stays as it is keeps its elements: a click never falls on one that is being replaced.
        state = (session, begun, None if session is None else session.stack, numbers, self._wrong)
        if state == self._state:
            return
        self._state = state
        self._list.clear()
        with self._list:
            if session is None or not begun:
                words = "Open a log to begin." if session is None else BEING_READ
                ui.label(words).classes("studio-muted")
                return
            ui.label(_state(session, numbers)).classes("studio-muted").props("data-mark=model-state")
            for entry in session.stack.entries:
                self._entry(entry, session.latest_parameters(entry), fitted=numbers is not None and numbers.fitted)
            # Under the values: its coming and going moves none of them beneath the pointer.
            if session.held_apart():
                ui.label(LEAVES).classes("studio-muted").props("data-mark=holds")

    def _entry(self, entry: Entry, parameters: Sequence[Parameter], *, fitted: bool) -> None:
        desk = self._desk
        name = effect_name(entry.effect)
        with ui.element("div").classes("studio-item" + ("" if entry.on else " studio-off")):
            with ui.element("div").classes("studio-row"):
                ui.switch(
                    value=entry.on, on_change=lambda event: desk.attempt(lambda: _switch(desk, entry, event.value))
                ).props("dense " + attribute("aria-label", f"{capital(name)} in the model")).props(
                    attribute("data-mark", f"switch-{entry.effect}")
                )
                heading_of(entry.effect)
                bare(
                    "close",
                    f"Remove {name}",
                    lambda: desk.attempt(lambda: _session(desk).remove(entry.effect)),
                ).props("size=sm")
            if not entry.on:
                return
            if not parameters:
                ui.label("This effect takes a pass over the log.").classes("studio-muted")
            for parameter in parameters:
                self._parameter(parameter, fitted=fitted)

    def _parameter(self, parameter: Parameter, *, fitted: bool) -> None:
        desk = self._desk
        name = parameter_name(parameter.effect, parameter.name)
        with ui.element("div").classes("studio-parameter"):
            ui.label(printable(parameter.name, NAME)).classes("studio-muted")
            # Beside the state, the word after a fixed value would stand there twice.
            shown = f"{parameter.digits.value} {parameter.digits.unit}" if parameter.fixed else parameter.shown
            value = ui.label(shown).props(attribute("data-mark", f"value-{parameter.key}"))
            if not fitted:
                value.classes("studio-muted").tooltip("not estimated yet")
            elif parameter.typical is not None:
                value.tooltip(f"typical size {quantity.quantity(parameter.typical, parameter.unit)}")
            bare("edit", f"Edit {name}", lambda: self._edit(parameter)).props("size=sm").props(
                attribute("data-mark", f"edit-{parameter.key}")
            )
            present = FIXED if parameter.fixed else ESTIMATED
            words = f"estimate {name} again" if parameter.fixed else f"fix {name} at this value"
            one_of_two((ESTIMATED, FIXED), present, words, lambda: desk.attempt(lambda: _pin(desk, parameter))).props(
                attribute("data-mark", f"pin-{parameter.key}")
            )
        if parameter.key in self._wrong:
            self._contradiction(parameter)

    def _contradiction(self, parameter: Parameter) -> None:
        """Say of a fixed value that the log contradicts it, and offer to estimate it."""
        desk = self._desk
        name = parameter_name(parameter.effect, parameter.name)
        with ui.element("div").classes("studio-error").props(attribute("data-mark", f"contradicted-{parameter.key}")):
            ui.label(CONTRADICTED).classes("studio-muted")
            ui.button(f"Estimate {name}", on_click=lambda: desk.attempt(lambda: _pin(desk, parameter))).props(
                "dense outline size=12px"
            ).props(attribute("data-mark", f"free-{parameter.key}"))

    def _edit(self, parameter: Parameter) -> None:
        """Ask for a value in the shown unit, in the digits that its standard error warrants."""
        desk = self._desk
        shown = parameter.digits
        with ui.dialog() as dialog, ui.card():
            name = capital(parameter_name(parameter.effect, parameter.name))
            ui.label(f"{name}, {shown.unit}").classes("studio-name")
            ui.label(printable(parameter.key, NAME)).classes("studio-id")
            given = ui.number(label=f"value, {shown.unit}", value=float(shown.value)).props(
                "data-mark=edit-value autofocus"
            )
            ui.label(f"The value stays fixed until you press “{ESTIMATED}” beside it.").classes("studio-muted")
            doubt = ui.label().classes("studio-muted").props("data-mark=edit-doubt aria-live=polite")
            given.on_value_change(lambda event: doubt.set_text(unusual(parameter, event.value)))

            async def take() -> None:
                if given.value is None:
                    given.error = "Give a number."
                    return
                dialog.close()
                # A field that was left as it was fixes the value itself, not its shown digits.
                same = given.value == float(shown.value)
                value = parameter.value if same else float(given.value) / shown.factor
                await desk.attempt(lambda: _session(desk).hold(parameter.effect, parameter.name, value))

            given.on("keydown.enter", take)
            with ui.row():
                ui.button("Fix at this value", on_click=take).props("data-mark=edit-take")
                ui.button("Cancel", on_click=dialog.close).props("flat")
        dialog.on("hide", dialog.delete)
        dialog.open()


def unusual(parameter: Parameter, given: float | None) -> str:
    """Return a sentence that doubts a value far above those of such sensors; empty for any other value.

    Parameters
    ----------
    parameter : Parameter
        The parameter.
    given : float or None
        The value, in the shown unit.
    """
    if given is None or not parameter.typical:
        return ""
    if abs(given / parameter.digits.factor) <= UNUSUAL * parameter.typical:
        return ""
    size = quantity.quantity(parameter.typical, parameter.unit)
    return f"This is more than {UNUSUAL:.0f} times the typical size, {size}. Check the number and its unit."


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
        return "Values so far: a pass is under way."
    if not numbers.fitted:
        return "To first order: the estimate is under way."
    return "Estimated values ± standard errors."
