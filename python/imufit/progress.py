"""Progress reports of long work."""

from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""Called with (done, in all, what is being done).

(0, 1, what) begins a step that is one thing: no part of it can be counted, and its duration is unknown.
Passes over the rows of a log, which can be counted, may lie within a step.
"""


def silent(done: int, total: int, label: str) -> None:
    """Report nothing."""
