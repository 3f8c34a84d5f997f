"""Right region: what is missing, with probability, expected drop and rivals; a card opens in its candidate's row."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Final

from nicegui import events, ui

from imufit.figures import quantity
from imufit.model.catalogue import card_of, find_effect
from imufit.printable import printable
from imufit.results import Candidate, Diagnosis
from imufit.results.diagnosis import NOT_SIGNIFICANT, NOT_TESTABLE, SIGNIFICANT
from imufit.results.parameter import in_lines
from imufit.studio.attribute import attribute
from imufit.studio.by_sensor import by_sensor
from imufit.studio.desk import Desk
from imufit.studio.heading import heading_of
from imufit.studio.names import effect_name
from imufit.studio.pointing import MARK, on_pointing
from imufit.studio.presses import Presses
from imufit.studio.view_panels import PanelView

FIRST: Final = 5
"""Candidates that are shown at once: the best and its rivals; the others fold away."""
MORE: Final = "more"
"""Name of the fold of the others."""

ROW_INTO_SIGHT: Final = (
    "requestAnimationFrame(() => document.getElementById('{}')"
    ".scrollIntoView({{block: 'nearest', behavior: 'smooth'}}))"
)
"""Script that brings a candidate with its card into sight, as far as it is not, once the card is laid out."""
BARS_INTO_SIGHT: Final = "document.querySelector('.studio-fall').scrollIntoView({block: 'end', behavior: 'smooth'})"
"""Script that lays the bars at the lower edge of the window: the sentence on top stands over them."""

LOOKED_AT: Final = "studio-looked"
"""Class of the row of the candidate that the figure draws."""
ADD: Final = "Add"
SWITCH_ON: Final = "Switch on"
"""Word on the button of a candidate that stands in the model, switched off."""
BY_MOUSE: Final = "Point at an effect to see what it would explain, or press its name for its card."
BY_FINGER: Final = "Tap an effect to see what it would explain, or its name for its card."
FIGURES: Final = "Each line gives the probability, and the held-out error of all channels without and with the effect."
CONTRADICTED: Final = (
    "The candidates stand here without figures: each would make up for the fixed value that the log contradicts. "
    "The model marks this value."
)
"""Sentence over the candidates beside a wrong fixed value, whose error each of them would explain."""

WIDE: Final = (
    "Until the effect is added, its own residual counts as noise: the standard errors are wider than after it."
)
ALIKE: Final = 2
"""Effects that are named as those that look most like another one."""
HELPS: Final = " alone; lowers the error beside the other missing effects"

LOWERS: Final = 0.99
"""Held-out error with a candidate over that without from which on the candidate lowers it for the eye."""


def _ranked(shown: Sequence[Candidate], diagnosis: Diagnosis) -> list[Candidate]:
    """Sort candidates: those that are named, then what looks most like them, then by probability."""
    named = [item for item in diagnosis.candidates if item.effect in diagnosis.named]
    alike = {rival.effect for item in named for rival in item.confounded_with[:ALIKE]}

    def rank(item: Candidate) -> tuple[bool, bool, bool, float]:
        is_named = item.effect in diagnosis.named
        return not is_named, item.status != SIGNIFICANT, item.effect not in alike, -item.probability

    return sorted(shown, key=rank)


def _why_not(item: Candidate, diagnosis: Diagnosis) -> str:
    """Return in words why a candidate is not there; empty where it is."""
    if item.status == SIGNIFICANT:
        return "" if item.held_out_after < item.held_out_before else HELPS
    outdone = item.outcome == NOT_SIGNIFICANT and item.held_out_after < LOWERS * item.held_out_before
    if outdone and diagnosis.best is not None:
        return f" alone; explains nothing more beside {effect_name(diagnosis.best)}"
    return f"; {item.outcome}"


def _shared(item: Candidate, diagnosis: Diagnosis) -> str:
    """Say which rivals share the probability of a candidate, and that one of them is enough; often empty."""
    rivals = " or ".join(map(effect_name, diagnosis.sharing(item)))
    return f" alone, explains nothing more beside {rivals}" if rivals else ""


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
        self._looked_at = ""
        self._rows: dict[str, ui.element] = {}
        self._opened: list[str] = []
        self._unfolded: set[str] = set()
        self._drawn: tuple[object, ...] | None = None
        self._stacked: frozenset[str] = frozenset()
        self._added = Presses()
        ui.html("Candidates", tag="h2", sanitize=False)
        self._list = ui.column().classes("w-full gap-0")
        on_pointing(lambda effect: self.look_at(effect or (self._opened[-1] if self._opened else "")))

    def refresh(self) -> None:
        """Show the candidates on top of the present model."""
        diagnosis = self._desk.diagnosis
        session = self._desk.session
        self._stacked = frozenset() if session is None else frozenset(session.stack.effects)
        state = (diagnosis, self._desk.guessing, self._stacked, self._desk.replacing)
        if state == self._drawn:
            return
        self._drawn = state
        self._opened = []
        self.look_at("")
        self._rows = {}
        self._list.clear()
        with self._list:
            # While another log is loaded, nothing can be added to the model of the present one.
            if self._desk.replacing:
                ui.label("Another log is being opened.").classes("studio-muted")
                return
            if diagnosis is None:
                ui.label("The effects of the catalogue are being compared with the log.").classes("studio-muted")
                return
            shown = [item for item in diagnosis.candidates if item.status != NOT_TESTABLE]
            if not shown:
                ui.label("No effect was judged on these data.").classes("studio-muted")
            elif self._desk.guessing:
                _how_to_look()
                by_effect = {item.effect: item for item in shown}
                for part, effects in by_sensor(by_effect).items():
                    # A list of all would lie between the sentence and the figures on a phone.
                    with self._folded(part, quantity.counted(len(effects), "effect")):
                        for effect in effects:
                            self._candidate(by_effect[effect], None)
            else:
                self._judged(_ranked(shown, diagnosis), diagnosis)

    def _judged(self, shown: list[Candidate], diagnosis: Diagnosis) -> None:
        """List the candidates, the best first; beside a fixed value that the log contradicts without their figures."""
        if diagnosis.contradicted:
            ui.label(CONTRADICTED).classes("studio-muted").props("data-mark=without-figures")
        else:
            _how_to_look()
            ui.label(FIGURES).classes("studio-muted")
        figures = None if diagnosis.contradicted else diagnosis
        for item in shown[:FIRST]:
            self._candidate(item, figures)
        if shown[FIRST:]:
            # The page scrolls, and nothing in it besides; the figures stay in sight beside the list.
            with self._folded(MORE, quantity.counted(len(shown) - FIRST, "more candidate")):
                for item in shown[FIRST:]:
                    self._candidate(item, figures)

    @contextmanager
    def _folded(self, name: str, count: str) -> Iterator[None]:
        """Fold candidates away under a name and their number; what a person unfolded stays so after a step."""

        def turn(event: events.ValueChangeEventArguments[bool]) -> None:
            (self._unfolded.add if event.value else self._unfolded.discard)(name)

        words = count if name == MORE else f"{name}: {count}"
        fold = ui.expansion(words, value=name in self._unfolded, on_value_change=turn).classes("w-full")
        with fold.props("dense").props(attribute("data-mark", f"fold-{name}")), ui.column().classes("w-full gap-0"):
            yield

    def _candidate(self, item: Candidate, diagnosis: Diagnosis | None) -> None:
        """Show one candidate; without a diagnosis the evidence stays hidden, as in a game."""
        desk, effect = self._desk, item.effect
        named = diagnosis is not None and effect in diagnosis.named
        row = (
            ui.element("div")
            .classes("studio-item" + (" studio-best" if named else ""))
            .props(attribute("data-mark", f"candidate-{effect}"))
            .props(attribute(MARK, effect))
        )
        self._rows[effect] = row
        with row:
            with ui.element("div").classes("studio-row"):
                name = heading_of(effect).classes("cursor-pointer").props("tabindex=0 role=button aria-expanded=false")

                async def add() -> None:
                    session = desk.session
                    # The second click of a double click finds the effect added, or another row beneath the pointer.
                    if session is None or effect in session.stack.model.effects or not self._added.counts():
                        return
                    client = ui.context.client
                    client.run_javascript(BARS_INTO_SIGHT)
                    await desk.attempt(lambda: session.add(effect))
                    # The sentence on top has another height by now.
                    client.run_javascript(BARS_INTO_SIGHT)

                # A candidate that stands in the stack is switched off there: to add it is to switch it on.
                words = SWITCH_ON if effect in self._stacked else ADD
                ui.button(words, on_click=add).props("dense size=12px" + ("" if named else " outline")).props(
                    attribute("data-mark", f"add-{effect}")
                )
            if diagnosis is not None:
                _figures(item, diagnosis)
            # The card opens in its own row: no other row moves from beneath the pointer.
            card = ui.column().classes("w-full gap-1 studio-card").props(attribute("data-mark", f"card-{effect}"))
            card.visible = False

        def turn() -> None:
            self._open_or_close(effect, card)
            name.props(f"aria-expanded={str(card.visible).lower()}")
            if card.visible:
                ui.run_javascript(ROW_INTO_SIGHT.format(row.html_id))

        for event in ("click", "keydown.enter"):
            name.on(event, turn)

    def _open_or_close(self, effect: str, card: ui.column) -> None:
        """Open the card of an effect, or close it; what the card opened last would explain stays drawn."""
        card.clear()
        card.visible = effect not in self._opened
        if not card.visible:
            self._opened.remove(effect)
            return
        self._opened.append(effect)
        self.look_at(effect)
        with card:
            for heading, text in [*card_of(find_effect(effect)).lines(), *self._predicted(effect)]:
                ui.label(printable(f"{heading}: {text}")).classes("studio-muted")

    def look_at(self, effect: str) -> None:
        """Draw what an effect would explain; empty draws nothing of that kind.

        Parameters
        ----------
        effect : str
            Its id.
        """
        if effect != self._looked_at:
            for name, change in ((self._looked_at, "remove"), (effect, "add")):
                if name in self._rows:
                    self._rows[name].classes(**{change: LOOKED_AT})
            self._looked_at = effect
            self._panels.propose(effect)

    def _predicted(self, effect: str) -> list[tuple[str, str]]:
        """Return what the log says of the size of an effect, unless a person is to guess it."""
        diagnosis = self._desk.diagnosis
        if diagnosis is None or self._desk.guessing:
            return []
        found = [item for item in diagnosis.candidates if item.effect == effect and item.parameters]
        return [("predicted here", f"{'; '.join(in_lines(item.parameters))}. {WIDE}") for item in found]


def _how_to_look() -> None:
    """Say how an effect is looked at, in the gestures of a mouse or of a finger."""
    for words, pointer in ((BY_MOUSE, "studio-mouse"), (BY_FINGER, "studio-finger")):
        ui.label(words).classes(f"studio-muted {pointer}")


def _figures(item: Candidate, diagnosis: Diagnosis) -> None:
    """Write probability, error and rivals of a candidate."""
    likely = f"{quantity.probability(item.probability)} probable{_shared(item, diagnosis)}"
    words = f"{likely}, error of all channels {item.error_change}{_why_not(item, diagnosis)}"
    ui.label(printable(words)).classes("studio-muted")
    if item.effect in diagnosis.named and item.confounded_with:
        rivals = ", ".join(
            f"{effect_name(rival.effect)} (correlation {quantity.number(rival.correlation, 2)})"
            for rival in item.confounded_with[:ALIKE]
        )
        ui.label(f"Looks most like: {rivals}").classes("studio-muted")
