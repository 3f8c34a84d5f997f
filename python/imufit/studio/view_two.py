"""Region of two models side by side: held-out error, evidence, channels and parameters."""

from __future__ import annotations

import math
from typing import Final

from nicegui import ui

from imufit.figures import quantity
from imufit.results.model_comparison import DECISIVE, preferred
from imufit.studio.desk import Desk
from imufit.studio.explained import Explained
from imufit.studio.names import channel_name, parameter_name, with_symbol
from imufit.studio.reserved import FRAME, Reserved
from imufit.studio.session import Made

MOST_ODDS: Final = 1e6
"""Odds that are written out: beyond, the number says nothing more to a person."""
LARGE: Final = 1e5
"""Logarithm of the odds from which on its power of ten stands in its place: the digits say nothing more."""
CHANGED: Final = 0.005
"""Change of a channel's residual over its noise floor from which on the channel is listed: the last digit shown."""


class TwoView:
    """The kept model and the present one on one page.

    Parameters
    ----------
    desk : Desk
        The state that it shows.

    Attributes
    ----------
    kept : bool
        Whether a model is kept.
    differs : bool
        Whether the kept model is another one than the present one, so that there is something to lay out.
    """

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self.kept = self.differs = False
        self._shown: tuple[object, ...] = ()
        self._heading = ui.html("Two models", tag="h2", sanitize=False)
        with ui.element("div").classes(FRAME):
            self._two = ui.column().classes("w-full gap-1").props("data-mark=two")
        self._room = Reserved(self._two)

    def refresh(self) -> None:
        """Lay out the kept model and the present one beside each other, where one is kept."""
        session = self._desk.session
        if session is None or not session.begun or session.second is None:
            self.kept = self.differs = False
            self._shown = ()
            self._two.clear()
            return
        self.kept = True
        self.differs = self._heading.visible = session.second.model != session.stack.model
        second = session.made(session.second)
        present = session.made()
        levels = tuple(made is not None and made.comparison is not None for made in (second, present))
        factor = session.weighed()
        state = (session.second, session.stack, second, present, levels, factor)
        if state == self._shown:
            return
        self._shown = state
        self._room.about(f"{id(session)}-{self.differs}")
        self._two.clear()
        with self._two:
            if not self.differs:
                ui.label("The kept model is the present one. Change the present one to compare.").classes(
                    "studio-muted"
                )
            elif second is None or present is None:
                ui.label("The two models are being compared.").classes("studio-muted")
            else:
                _two_models(second, present, factor)


def lower(second: Made, present: Made) -> str:
    """Say which model stands lower, as the shown digits have it.

    Parameters
    ----------
    second, present : Made
        The kept model and the present one.
    """
    if quantity.ratio(second.numbers.ratio) == quantity.ratio(present.numbers.ratio):
        return "Both stand equally low."
    return f"The {'kept' if second.numbers.ratio < present.numbers.ratio else 'present'} model stands lower."


def evidence(factor: float) -> str:
    """Say which model the log prefers, with the odds, and the odds from which on there is a preference.

    Parameters
    ----------
    factor : float
        Natural logarithm of the evidence for the present model over that for the kept one.
    """
    better = "kept" if factor < 0.0 else "present"
    size = abs(factor)
    shown_size = f"{size:.1f}" if size < LARGE else quantity.large(size)
    odds = f"more than {_round(MOST_ODDS)}" if size > math.log(MOST_ODDS) else _round(math.exp(size))
    shown = f"the odds are {odds} to 1 for the {better} one (ln Bayes factor {shown_size})"
    if preferred(factor) == "neither":
        return f"The log prefers neither model: {shown}, and a preference needs {_round(math.exp(DECISIVE))} to 1."
    return f"The log prefers the {better} model: {shown}."


def _round(odds: float) -> str:
    """Return odds in two digits from ten on, thousands apart; below in one decimal place."""
    if odds < 10.0:
        return f"{odds:.1f}"
    return f"{float(f'{odds:.1e}'):,.0f}".replace(",", " ")


def _two_models(second: Made, present: Made, factor: float | None) -> None:
    """Lay out two models: held-out error, evidence, residual of each channel that changes, parameters."""
    Explained(
        f"Held-out error of all channels: {quantity.ratio(second.numbers.ratio)} times the noise floor with the kept "
        f"model, {quantity.ratio(present.numbers.ratio)} with the present one. {lower(second, present)}"
    ).classes("studio-sentence").props("data-mark=two-sentence")
    if factor is not None:
        Explained(evidence(factor)).classes("studio-sentence").props("data-mark=two-evidence")
    rows: list[tuple[str, ...]] = [
        ("held-out error of all channels", quantity.ratio(second.numbers.ratio), quantity.ratio(present.numbers.ratio))
    ]
    levels = [
        {item.channel: item.ratio for item in (made.comparison.channels if made.comparison is not None else ())}
        for made in (second, present)
    ]
    changed = [name for name in levels[0] if abs(levels[0][name] - levels[1].get(name, math.nan)) >= CHANGED]
    rows += [
        (f"{channel_name(name)} over its floor", *(quantity.ratio(level[name]) for level in levels)) for name in changed
    ]
    values = [{item.key: item.shown for item in made.numbers.parameters} for made in (second, present)]
    names = {
        item.key: with_symbol(parameter_name(item.effect, item.name), item.key)
        for made in (second, present)
        for item in made.numbers.parameters
    }
    rows += [(name, *(value.get(key, "–") for value in values)) for key, name in names.items()]
    with ui.element("table").classes("studio-table"):
        for k, row in enumerate([("", "kept model", "present model"), *rows]):
            with ui.element("tr"):
                for cell in row:
                    with ui.element("th" if k == 0 else "td"):
                        ui.label(cell)
