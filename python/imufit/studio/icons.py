"""Buttons that show an icon: with its words beneath, or with the words beside it while it is pointed at or focused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from nicegui import ui

from imufit.studio.attribute import attribute

KEPT: Final = "imufit-colours"
"""Name under which the browser keeps the choice of light or dark."""


def with_words(icon: str, words: str, action: Callable[[], object] | None) -> ui.button:
    """Return a button of a page's head: the words stand on it.

    Parameters
    ----------
    icon, words : str
        Icon and words.
    action : callable, optional
        The action; None for the button of a menu.
    """
    with ui.button(icon=icon, on_click=action).props(
        f'flat dense stack aria-label="{words}" title="{words}"'
    ) as button:
        ui.label(words).classes("studio-words")
    return button.classes("studio-worded")


def link_with_words(icon: str, words: str, address: str) -> ui.button:
    """Return a link of a page's head that looks like its buttons.

    Parameters
    ----------
    icon, words : str
        Icon and words.
    address : str
        The page, seen from the present one.
    """
    return with_words(icon, words, None).props(attribute("href", address))


def bare(icon: str, words: str, action: Callable[[], object]) -> ui.button:
    """Return a small button that shows its words while it is pointed at or focused.

    Parameters
    ----------
    icon, words : str
        Icon and words; the words may hold names from files.
    action : callable
        The action.
    """
    button = ui.button(icon=icon, on_click=action).props("flat dense round " + attribute("aria-label", words))
    return button.classes("studio-bare")


def one_of_two(states: tuple[str, str], present: str, words: str, action: Callable[[], object]) -> ui.element:
    """Return two states side by side: the present one stands out, and the other one is a button.

    Parameters
    ----------
    states : (str, str)
        Each state in one word.
    present : str
        The present one.
    words : str
        The work of a press on the other one; may hold names from files.
    action : callable
        Changes to the other one.
    """
    with ui.element("div").classes("studio-two-states").props("role=group") as both:
        for state in states:
            if state == present:
                ui.label(state).classes("studio-present").props("aria-current=true")
            else:
                button = ui.button(state, on_click=action).props("flat dense size=12px")
                button.props(attribute("aria-label", f"{state}: {words}"))
    return both


def light_or_dark() -> ui.button:
    """Return the button that changes between light and dark on all pages, where the computer chose before."""
    dark = ui.dark_mode(value=None)

    async def turn() -> None:
        dark.value = not await ui.run_javascript("Quasar.Dark.isActive")
        ui.run_javascript(f"localStorage.setItem('{KEPT}', '{'dark' if dark.value else 'light'}')")

    async def recall() -> None:
        kept = await ui.run_javascript(f"localStorage.getItem('{KEPT}')")
        if kept in ("dark", "light"):
            dark.value = kept == "dark"

    # The browser keeps the choice, and can be asked once it is connected.
    ui.timer(0, recall, once=True)
    return with_words("dark_mode", "Light or dark", turn)
