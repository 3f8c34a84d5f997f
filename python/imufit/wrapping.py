"""Prose broken into lines that keep a quantity whole: a value, its ± and its unit stand on one line."""

from __future__ import annotations

import re
import textwrap
from typing import Final

NO_BREAK: Final = "\N{NO-BREAK SPACE}"
"""Stands in for a blank at which a line must not end; `textwrap` breaks at ASCII blanks alone."""

_WITHIN: Final = re.compile(
    r"(?<= ±) (?=[\d.])"  # between ± and the standard error
    r"|(?<=\d) (?=±)"  # between a value and its ±
    r"|(?<=\d) (?=[^\W\d_]|[%°µ√])"  # between a number and its unit, or what it counts
    r"| (?=per )|(?<= per) "  # within a unit such as deg/s per g
)


def unbroken(text: str) -> str:
    """Return a text whose quantities hold no blank at which a line may end.

    Parameters
    ----------
    text : str
        Prose.
    """
    return _WITHIN.sub(NO_BREAK, text)


def lines_of(text: str, width: int, first: str = "", later: str = "", *, break_words: bool = True) -> list[str]:
    """Break each line of a text at blanks, none of them within a quantity.

    Parameters
    ----------
    text : str
        Prose; its own line ends stay.
    width : int
        Characters of a line.
    first, later : str
        Indentation of the first line of a paragraph, and of its other lines.
    break_words : bool
        Break a word that is longer than a line. The name of a file in a terminal stays whole: it can be copied.

    Returns
    -------
    list of str
        Lines with plain blanks.
    """
    lines: list[str] = []
    for paragraph in text.split("\n"):
        broken = textwrap.wrap(
            unbroken(paragraph),
            max(width, 1),
            initial_indent=first,
            subsequent_indent=later,
            expand_tabs=False,
            replace_whitespace=False,
            break_on_hyphens=False,
            break_long_words=break_words,
        )
        lines += [line.replace(NO_BREAK, " ") for line in broken or [""]]
    return lines
