"""Words put into a sentence: its first letter, and names in a row."""

from __future__ import annotations

from collections.abc import Sequence


def capital(text: str) -> str:
    """Return text with a capital at its beginning.

    Parameters
    ----------
    text : str
        Such as the name of an effect.
    """
    return text[:1].upper() + text[1:]


def listed(names: Sequence[str]) -> str:
    """Write names with commas, and the last one with "and".

    Parameters
    ----------
    names : sequence of str
        At least one.
    """
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
