"""How every result shows itself: as text, in a notebook, and in one line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from imufit.results.table import Table, html, page

LONGEST: Final = 400
"""Most characters of a result in one line: five lines of a terminal of 80 columns."""


class Result:
    """A result made of sentences and tables; its line in a shell is its first sentence."""

    def sentences(self) -> Sequence[str]:
        """Return the result as text, the answer first."""
        raise NotImplementedError

    def tables(self) -> Sequence[Table]:
        """Every table, most important first."""
        return ()

    def answer_tables(self) -> Sequence[Table]:
        """Tables that belong to the answer: a terminal shows the others on request."""
        return self.tables()

    def paragraphs(self) -> Sequence[str]:
        """Return the sentences that stand above the tables where the whole result is shown."""
        return self.sentences()

    def _repr_html_(self) -> str:
        return html(self.paragraphs(), self.tables())

    def __str__(self) -> str:
        return page(self.paragraphs(), self.tables())

    def __repr__(self) -> str:
        return shortened(next(iter(self.sentences()), "") or type(self).__name__, LONGEST)


def shortened(line: str, most: int) -> str:
    """Return a line, cut at its end where it has more characters than `most`.

    Parameters
    ----------
    line : str
        Text.
    most : int
        Characters.
    """
    return line if len(line) <= most else f"{line[: most - 1]}…"
