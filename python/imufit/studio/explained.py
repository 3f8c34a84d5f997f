"""Text of the page in which the words of the glossary show their definitions while they are pointed at or focused."""

from __future__ import annotations

import html

from nicegui import ui

from imufit.glossary import places_in
from imufit.printable import printable
from imufit.wrapping import unbroken


class Explained(ui.html):
    """A paragraph with the glossary's words marked.

    Parameters
    ----------
    text : str
        Any text; it may hold names from files.
    seen : set of str, optional
        Words that paragraphs above have marked: they are not marked again, and those of this one are added.
    """

    def __init__(self, text: str = "", seen: set[str] | None = None) -> None:
        super().__init__(marked(text, seen), sanitize=False)
        self.classes("studio-explained")

    def set_text(self, text: str) -> None:
        """Show another text.

        Parameters
        ----------
        text : str
            Any text.
        """
        self.set_content(marked(text))


def marked(text: str, seen: set[str] | None = None) -> str:
    """Return text as HTML in which each word of the glossary holds its definition where it first stands.

    Parameters
    ----------
    text : str
        Any text; it may hold names from files.
    seen : set of str, optional
        Words that are marked elsewhere already; those of this text are added.
    """
    seen = set() if seen is None else seen
    shown = unbroken(printable(text))
    out: list[str] = []
    at = 0
    for begin, end, term in places_in(shown):
        if term.word in seen:
            continue
        seen.add(term.word)
        unit = f" Unit: {term.unit}." if term.unit else ""
        means = html.escape(f"{term.means}{unit}".replace("`", ""))
        out.append(html.escape(shown[at:begin]))
        out.append(f'<span class="studio-term" tabindex="0" aria-description="{means}">')
        out.append(f"{html.escape(shown[begin:end])}</span>")
        at = end
    return "".join([*out, html.escape(shown[at:])])
