"""The element that a person points at: a list that moves under a resting pointer changes nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from nicegui import events, ui

MARK: Final = "data-pointed"
"""Attribute of an element that can be pointed at; its value is the element's name."""
EVENT: Final = "imufit-pointed"
SCRIPT: Final = f"""
(() => {{
  let place = '', last = null;
  document.addEventListener('mousemove', (event) => {{
    // Browsers send this event as well where the page moves under the pointer: its place on the screen stays then.
    const here = event.screenX + ',' + event.screenY;
    if (here === place) return;
    place = here;
    const found = event.target.closest ? event.target.closest('[{MARK}]') : null;
    // A list that was made anew has other elements: the same name counts again.
    if (found === last) return;
    last = found;
    emitEvent('{EVENT}', found ? found.getAttribute('{MARK}') : '');
  }});
}})();
"""


def on_pointing(action: Callable[[str], None]) -> None:
    """Call an action with the name of the element that the pointer has moved onto; empty where it has left them all.

    Parameters
    ----------
    action : callable
        The action.
    """

    def pointed(event: events.GenericEventArguments) -> None:
        action(str(event.args or ""))

    ui.on(EVENT, pointed)
    ui.run_javascript(SCRIPT)
