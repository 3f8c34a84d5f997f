"""The words that a page uses with their definitions, folded at its end."""

from __future__ import annotations

import html
import re

from jinja2 import Environment
from markupsafe import Markup, escape

from imufit.glossary import used_in

_UNSEEN = re.compile(r"<(style|script|svg|title)\b.*?</\1>", re.DOTALL)
_TAG = re.compile(r"<[^>]*>")
_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")
_CODE = re.compile(r"`([^`]*)`")


def with_words(page: str, environment: Environment) -> str:
    """Put the section "Words used here" at the end of a page.

    Parameters
    ----------
    page : str
        The page as HTML.
    environment : Environment
        Where the template of the section is found.
    """
    seen = (html.unescape(text).strip() for text in _TAG.split(_UNSEEN.sub(" ", page)))
    words = used_in([text for text in seen if text])
    section = environment.get_template("words.html.j2").render(
        words=[
            {"word": term.word, "unit": shown(term.unit), "means": shown(term.means), "origin": shown(term.origin)}
            for term in words
        ]
    )
    before, end, after = page.rpartition("</body>")
    return f"{before}{section}{end}{after}"


def shown(text: str) -> Markup:
    """Return text as HTML: names from code are set as such, links are plain words.

    Parameters
    ----------
    text : str
        With names from code in backticks, and links as in Markdown.
    """
    return Markup(_CODE.sub(r"<code>\1</code>", str(escape(_LINK.sub(r"\1", text)))))
