"""Words of the page with their definitions, those of the glossary that the present answer uses."""

from __future__ import annotations

from typing import Final

from nicegui import ui

from imufit.glossary import used_in
from imufit.studio.desk import Desk

ALWAYS: Final = ("residual", "noise floor", "held-out error", "covariate")
"""Words that stand on the page whatever the answer."""


class WordsView:
    """The words on one page, folded away.

    Parameters
    ----------
    desk : Desk
        The state that it shows.
    """

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._texts: tuple[str, ...] = ()
        with ui.expansion("Words used here").classes("w-full").props("dense data-mark=words"):
            self._list = ui.column().classes("w-full gap-1")

    def refresh(self) -> None:
        """List the words of the present answer."""
        diagnosis = None if self._desk.guessing else self._desk.diagnosis
        said: tuple[str | None, ...] = ()
        if diagnosis is not None:
            outcomes = dict.fromkeys(item.outcome for item in diagnosis.candidates)
            said = ("probability", diagnosis.sentence, diagnosis.experiment, *diagnosis.notes, *outcomes)
        texts = (*ALWAYS, *(text for text in said if text))
        if texts == self._texts:
            return
        self._texts = texts
        self._list.clear()
        with self._list:
            for term in used_in(texts):
                ui.label(f"{term.word}: {term.means.replace('`', '')}").classes("studio-muted")
