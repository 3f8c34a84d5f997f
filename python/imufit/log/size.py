"""How much of a log is held in memory at once: computed from rows and columns, not from the file's size."""

from __future__ import annotations

from typing import Final

NUMBER: Final = 8
"""Bytes of a number in memory."""
TEXT_CELL: Final = 96
"""Bytes that a cell of text is counted with: its place, and a word of its own if no two are the same."""
HELD: Final = 200 << 20
"""Bytes up to which a log is held in memory. A filter's or a fit's own arrays are some three times as many, so that no
command takes more than 1 GB."""
KEPT: Final = 500 << 20
"""Bytes up to which a log is held together with what a command makes of each row."""
BLOCK: Final = 32 << 20
"""Bytes of the rows that are read from a file at once, at most."""
BLOCK_ROWS: Final = 65_536
"""Rows that are read from a file at once, at most."""
LONGEST_TEXT: Final = 4096
"""Bytes of a cell of text: labels are words. A longer one would take memory for nothing."""
LONGEST_LINE: Final = 1 << 20
"""Bytes of a line of text: a thousand columns take a fiftieth of it."""
MOST_COLUMNS: Final = 1024
"""Columns of a text table. An optical system with 300 markers has 900; a file without its line ends has thousands. The
time to recognise columns grows with the square of their number: 5720 took 13 s."""
TEXT_GROUP: Final = 64 << 20
"""Bytes of a column of text in one row group of Parquet, as it stands when it is unpacked: that is done at once."""


def rows_at_once(row_bytes: int) -> int:
    """Rows to read at once.

    Parameters
    ----------
    row_bytes : int
        Bytes of one row in memory.
    """
    return max(1, min(BLOCK_ROWS, BLOCK // max(row_bytes, 1)))


def size_in_words(size: float) -> str:
    """Bytes in readable form, such as ``3.1 GB``.

    Parameters
    ----------
    size : float
        Bytes.
    """
    for unit, factor in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= factor:
            return f"{size / factor:.3g} {unit}"
    return f"{size:.0f} bytes"
