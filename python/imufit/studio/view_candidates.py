"""Right region: what is missing, with probability, expected drop and rivals, and the card of the effect looked at."""

from __future__ import annotations

from typing import Final

from nicegui import events, ui

from imufit.figures import quantity
from imufit.model.catalogue import card_of, find_effect
from imufit.printable import NAME, printable
from imufit.results import Candidate, Diagnosis
from imufit.results.diagnosis import NOT_SIGNIFICANT, NOT_TESTABLE, SIGNIFICANT
from imufit.results.parameter import in_lines
from imufit.studio.attribute import attribute
from imufit.studio.desk import Desk
from imufit.studio.presses import Presses
from imufit.studio.view_panels import PanelView

FIRST: Final = 5
"""Candidates that are shown at once: the best and its rivals; the others fold away."""

INTO_SIGHT: Final = "document.querySelector('{}').scrollIntoView({{block: 'nearest', behavior: 'smooth'}})"
"""Script that brings an element into sight, where it is not: on a phone the candidates fill the screen."""

SWITCHED_OFF: Final = "switched off in the model"
TOUCH: Final = "touch"
"""Kind of pointer, in the browser's words, with which nothing can be pointed at: a finger."""

LOWERS: Final = 0.99
"""Held-out error with a candidate over that without from which on the candidate lowers it for the eye."""


def _rank(item: Candidate, diagnosis: Diagnosis) -> tuple[bool, bool, float]:
    """Return what candidates are sorted by: those that are named, then by the probability that stands beside them."""
    return item.effect not in diagnosis.named, item.status != SIGNIFICANT, -item.probability


def _why_not(item: Candidate, diagnosis: Diagnosis) -> str:
    """Return in words why a candidate is not there; empty where it is."""
    if item.status == SIGNIFICANT:
        return ""
    outdone = item.outcome == NOT_SIGNIFICANT and item.held_out_after < LOWERS * item.held_out_before
    if outdone and diagnosis.best is not None:
        return f"; explains nothing beside {printable(diagnosis.best, NAME)}"
    return f"; {item.outcome}"


class CandidateView:
    """The candidates on one page.

    Parameters
    ----------
    desk : Desk
        The state that it shows.
    panels : PanelView
        Where the effect looked at draws what it would explain.
    """

    def __init__(self, desk: Desk, panels: PanelView) -> None:
        self._desk, self._panels = desk, panels
        self._looked_at = self._pinned = ""
        self._drawn: tuple[object, ...] | None = None
        self._off: frozenset[str] = frozenset()
        self._added = Presses()
        ui.html("Candidates", tag="h2", sanitize=False)
        self._list = ui.column().classes("w-full gap-0")
        self._card = ui.column().classes("w-full gap-1 studio-item studio-card").props("data-mark=card")
        self._card.visible = False

    def refresh(self) -> None:
        """Show the candidates on top of the present model."""
        diagnosis = self._desk.diagnosis
        session = self._desk.session
        # An effect that is switched off is a candidate again, and the model has it already.
        self._off = frozenset() if session is None else frozenset(session.stack.effects)
        state = (diagnosis, self._desk.guessing, self._off)
        if state == self._drawn:
            return
        self._drawn = state
        self._pin("")
        self._list.clear()
        self._list.classes(**({"add": "studio-long"} if self._desk.guessing else {"remove": "studio-long"}))
        with self._list:
            if diagnosis is None:
                ui.label("The candidates stand here once they are judged.").classes("studio-muted")
                return
            shown = [item for item in diagnosis.candidates if item.status != NOT_TESTABLE]
            if shown:
                ui.label("Point at an effect, or tap its name, to see what it would explain.").classes("studio-muted")
            if self._desk.guessing:
                for item in sorted(shown, key=lambda item: item.effect):
                    self._candidate(item, None)
                return
            if not shown:
                ui.label("No effect was judged on these data.").classes("studio-muted")
            shown.sort(key=lambda item: _rank(item, diagnosis))
            for item in shown[:FIRST]:
                self._candidate(item, diagnosis)
            if shown[FIRST:]:
                words = quantity.counted(len(shown) - FIRST, "more candidate")
                # A box of its own keeps the card beneath within sight.
                with ui.expansion(words).classes("w-full").props("dense"), ui.column().classes("gap-0 studio-long"):
                    for item in shown[FIRST:]:
                        self._candidate(item, diagnosis)

    def _candidate(self, item: Candidate, diagnosis: Diagnosis | None) -> None:
        """Show one candidate; without a diagnosis the evidence stays hidden, as in a game."""
        desk, effect = self._desk, item.effect
        named = diagnosis is not None and effect in diagnosis.named
        row = (
            ui.element("div")
            .classes("studio-item" + (" studio-best" if named else ""))
            .props(attribute("data-mark", f"candidate-{effect}"))
        )
        row.on("mouseenter", lambda: self.look_at(effect))
        row.on("mouseleave", lambda: self.look_at(self._pinned))
        with row:
            with ui.element("div").classes("studio-row"):
                name = ui.label(printable(effect, NAME)).classes("studio-id cursor-pointer")
                name.props("tabindex=0 role=button")

                def pin(event: events.GenericEventArguments) -> None:
                    self._pin("" if self._pinned == effect else effect)
                    # On a phone the card lies beneath the list. Beneath a mouse's pointer, no row may move.
                    if self._pinned and event.args.get("pointerType") == TOUCH:
                        ui.run_javascript(INTO_SIGHT.format(".studio-card"))

                for event in ("click", "keydown.enter"):
                    name.on(event, pin, ["pointerType"])

                async def add() -> None:
                    session = desk.session
                    # The second click of a double click finds the effect added, or another row beneath the pointer.
                    if session is None or effect in session.stack.effects or not self._added.counts():
                        return
                    self._pin("")
                    client = ui.context.client
                    client.run_javascript(INTO_SIGHT.format(".studio-fall"))
                    await desk.attempt(lambda: session.add(effect))
                    # The sentence on top has another height by now, and the effect's card is gone.
                    client.run_javascript(INTO_SIGHT.format(".studio-fall"))

                if effect in self._off:
                    ui.label(SWITCHED_OFF).classes("studio-muted").props(attribute("data-mark", f"off-{effect}"))
                else:
                    ui.button("Add", on_click=add).props("dense size=12px" + ("" if named else " outline")).props(
                        attribute("data-mark", f"add-{effect}")
                    )
            if diagnosis is None:
                return
            likely = f"{quantity.probability(item.probability)} probable{diagnosis.shared(item)}"
            words = f"{likely}, held-out error {item.error_change}{_why_not(item, diagnosis)}"
            ui.label(printable(words)).classes("studio-muted")
            if named and item.confounded_with:
                rivals = ", ".join(str(rival) for rival in item.confounded_with[:2])
                ui.label(printable(f"Rivals, with correlation: {rivals}")).classes("studio-muted")

    def _pin(self, effect: str) -> None:
        """Keep the card of an effect until another one is kept; a finger has no place to rest."""
        self._pinned = effect
        self.look_at(effect)

    def look_at(self, effect: str) -> None:
        """Show the card of an effect, and what it would explain; empty puts both away.

        Parameters
        ----------
        effect : str
            Its id.
        """
        if effect == self._looked_at:
            return
        self._looked_at = effect
        self._card.clear()
        self._card.visible = bool(effect)
        if effect:
            card = card_of(find_effect(effect))
            with self._card:
                ui.label(printable(f"{card.id}: {card.name}")).classes("studio-id")
                for heading, text in [*card.lines(), *self._predicted(effect)]:
                    ui.label(printable(f"{heading}: {text}")).classes("studio-muted")
        self._panels.propose(effect)

    def _predicted(self, effect: str) -> list[tuple[str, str]]:
        """Return what the log says of the size of an effect, unless a person is to guess it."""
        diagnosis = self._desk.diagnosis
        if diagnosis is None or self._desk.guessing:
            return []
        found = [item for item in diagnosis.candidates if item.effect == effect and item.parameters]
        return [("predicted here", "; ".join(in_lines(item.parameters))) for item in found]
