"""Attributes of a page's elements whose values may hold names from files."""

from __future__ import annotations

from imufit.printable import printable


def attribute(name: str, value: str) -> str:
    """Return the text that gives an element an attribute, for ``element.props``.

    Parameters
    ----------
    name : str
        For instance ``aria-label``.
    value : str
        Any text; what is not printable is escaped.
    """
    quoted = printable(value).replace("\\", "\\\\").replace('"', '\\"')
    return f'{name}="{quoted}"'
