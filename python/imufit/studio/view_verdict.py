"""End of a game on the page: sentences, the hidden values beside the fitted ones, and the lesson."""

from __future__ import annotations

from nicegui import ui

from imufit.printable import NAME, printable
from imufit.studio.mystery import Verdict


def show_verdict(verdict: Verdict) -> None:
    """Lay out the end of a game.

    Parameters
    ----------
    verdict : Verdict
        The end.
    """
    for sentence in verdict.sentences:
        ui.label(printable(sentence)).classes("studio-sentence").props("data-mark=truth")
    if verdict.values:
        rows = [
            ("parameter", "hidden", "fitted ± error"),
            *((row.key, row.hidden, row.fitted) for row in verdict.values),
        ]
        # As wide as its words: three short columns over the whole page could not be read across.
        with ui.element("table").classes("studio-table studio-narrow").props("data-mark=hidden-values"):
            for k, row in enumerate(rows):
                with ui.element("tr"):
                    for cell in row:
                        with ui.element("th" if k == 0 else "td"):
                            ui.label(printable(cell, 2 * NAME))
    ui.label(verdict.lesson).classes("studio-muted").props("data-mark=lesson")
