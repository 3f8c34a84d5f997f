"""How long work tells how far it is."""

from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""Called with (rows done, rows in all, what is being done)."""


def silent(done: int, total: int, label: str) -> None:
    """Tell nobody."""
