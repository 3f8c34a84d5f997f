"""Words of screens and reports with their definitions, which lie in ``glossary.toml``.

``docs/glossary.md`` and the section "Words used here" of every HTML report are made of the same definitions.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files


@dataclass(frozen=True)
class Term:
    """A word and what it means.

    Attributes
    ----------
    word : str
        The word; a ``*`` in it stands for letters, digits and ``_``, as in ``ref.*``.
    also : tuple of str
        Other spellings.
    unit : str
        Unit of its values; empty where it has none.
    means : str
        Definition in one or two sentences; names from code stand between backticks.
    origin : str
        Where the value or the word comes from, with links into ``docs/``.
    group : str
        Title of its group in the glossary.
    whole : bool
        True for a plain English word, which counts in a text only as a whole piece of it.
    """

    word: str
    also: tuple[str, ...]
    unit: str
    means: str
    origin: str
    group: str
    whole: bool

    @property
    def spellings(self) -> tuple[str, ...]:
        """The word and its other spellings."""
        return (self.word, *self.also)


@cache
def terms() -> tuple[Term, ...]:
    """Return every word in the order of the glossary."""
    text = files("imufit").joinpath("glossary.toml").read_text(encoding="utf-8")
    return tuple(
        Term(
            word=entry["word"],
            also=tuple(entry.get("also", ())),
            unit=entry.get("unit", ""),
            means=entry["means"],
            origin=entry["origin"],
            group=group["title"],
            whole=entry.get("whole", group.get("whole", False)),
        )
        for group in tomllib.loads(text)["group"]
        for entry in group["term"]
    )


def explained(word: str) -> Term | None:
    """Return the term that explains a word, or None.

    Parameters
    ----------
    word : str
        As a screen or a report writes it.
    """
    return next((term for term in terms() if _alone(term).fullmatch(word.strip())), None)


def used_in(texts: Sequence[str]) -> tuple[Term, ...]:
    """Return the terms that pieces of text use, in the order of the glossary.

    Parameters
    ----------
    texts : sequence of str
        Paragraphs, cells of tables, headings. A term of one letter, or one that is marked so, counts only where it is a
        whole piece, or stands before a colon: elsewhere a letter may be a unit, and the word plain English.
    """
    together = "\n".join(texts)
    first = {text.partition(":")[0].strip() for text in texts}
    return tuple(term for term in terms() if _anywhere(term).search(together) or first.intersection(term.spellings))


def places_in(text: str) -> tuple[tuple[int, int, Term], ...]:
    """Return where each term first stands in a text, from left to right; of terms that overlap the longer one.

    Parameters
    ----------
    text : str
        A paragraph.
    """
    hits = ((found, term) for term in terms() for found in [_anywhere(term).search(text)] if found)
    found: list[tuple[int, int, Term]] = []
    for hit, term in sorted(hits, key=lambda item: item[0].start() - item[0].end()):
        if all(hit.end() <= begin or hit.start() >= end for begin, end, _ in found):
            found.append((hit.start(), hit.end(), term))
    return tuple(sorted(found, key=lambda place: place[0]))


def _pattern(spelling: str) -> str:
    """Return a spelling as a regular expression."""
    return re.escape(spelling).replace(r"\*", r"\w+") if spelling.count("*") == 1 else re.escape(spelling)


@cache
def _alone(term: Term) -> re.Pattern[str]:
    """Return what matches any spelling of a term, small or capital."""
    return re.compile("|".join(map(_pattern, term.spellings)), re.IGNORECASE)


@cache
def _anywhere(term: Term) -> re.Pattern[str]:
    """Return what finds a spelling of more than one letter in a text."""
    found = "|".join(_pattern(spelling) for spelling in term.spellings if len(spelling) > 1 and not term.whole)
    return re.compile(rf"(?<![\w.])(?:{found})(?!\w|\.\w)" if found else r"(?!)", re.IGNORECASE)
