"""End of a game on the page: sentences, the hidden values beside the fitted ones, and the lesson."""

from __future__ import annotations

from collections.abc import Sequence

from nicegui import ui

from imufit.printable import NAME, printable
from imufit.studio.heading import heading_of
from imufit.studio.mystery import Compared, Verdict


def show_verdict(verdict: Verdict) -> None:
    """Lay out the end of a game.

    Parameters
    ----------
    verdict : Verdict
        The end.
    """
    with ui.element("div").classes("studio-verdict"):
        with ui.column().classes("gap-2"):
            for sentence in verdict.sentences:
                ui.label(printable(sentence)).classes("studio-sentence").props("data-mark=truth")
            ui.label(verdict.lesson).classes("studio-muted").props("data-mark=lesson")
        for effect in verdict.truth:
            with ui.element("div"):
                heading_of(effect)
                _values([row for row in verdict.values if row.key.rpartition(".")[0] == effect])


def _values(values: Sequence[Compared]) -> None:
    """Lay out the hidden values of one effect beside the estimated ones."""
    rows = [
        ("", "hidden", "estimated ± standard error"),
        *((row.key.rpartition(".")[2], row.hidden, row.fitted) for row in values),
    ]
    # As wide as its words: three short columns over the whole page could not be read across.
    with ui.element("table").classes("studio-table studio-narrow").props("data-mark=hidden-values"):
        for k, row in enumerate(rows):
            with ui.element("tr"):
                for cell in row:
                    with ui.element("th" if k == 0 else "td"):
                        ui.label(printable(cell, 2 * NAME))
