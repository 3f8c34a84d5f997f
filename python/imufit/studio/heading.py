"""Heading of an effect on the page: its name in words, and its id after it, smaller."""

from __future__ import annotations

from nicegui import ui

from imufit.printable import NAME, printable
from imufit.results.phrasing import capital
from imufit.studio.names import effect_name


def heading_of(effect: str) -> ui.element:
    """Lay out the heading of an effect.

    Parameters
    ----------
    effect : str
        Its id.
    """
    heading = ui.element("div").classes("studio-name")
    with heading:
        ui.label(capital(effect_name(effect)))
        ui.label(printable(effect, NAME)).classes("studio-id")
    return heading
