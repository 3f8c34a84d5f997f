"""Text that others wrote, such as names in a file: made harmless and bounded before a person sees it.

A terminal obeys control characters, and text with marks of direction reads as something else than it is. The sender of
a log decides the names of its columns; what is shown of it must be only text, and no more of it than can be read.
"""

from __future__ import annotations

import unicodedata
from typing import Final

NAME: Final = 100
"""Characters that are shown of a name or a cell; the longest names of a column that were met have about 60."""
MESSAGE: Final = 1000
"""Characters of a part of a message: some ten lines of a terminal, enough for a list of columns to choose from."""

_ACTIVE: Final = frozenset({"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"})
"""Unicode's control characters, marks of direction, halves of characters, unassigned ones, and line separators."""


def printable(text: str, most: int = MESSAGE, keep: str = "") -> str:
    r"""Return text with every character escaped that is not there to be read, shortened to a length.

    Parameters
    ----------
    text : str
        From a file, a device or the command line.
    most : int
        Characters that it may have; of what is longer the middle is left out, for ``...``.
    keep : str
        Control characters that stay, such as a line end.

    Returns
    -------
    str
        ``\x1b`` for an escape; text without such characters as it was.
    """
    text = _shortened(text, most)
    if text.isascii() and text.isprintable():
        return text
    shown = "".join(
        character.encode("unicode_escape").decode("ascii")
        if character not in keep and unicodedata.category(character) in _ACTIVE
        else character
        for character in text
    )
    return _shortened(shown, most)


def _shortened(text: str, most: int) -> str:
    """Cut out of the middle: a message has its remedy at its end."""
    if len(text) <= most:
        return text
    head = 2 * most // 3
    return f"{text[:head]}...{text[head + 3 - most :]}"
