"""Text files by their content: a table, or a transcript with records."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from imufit.log.csv import CsvSource
from imufit.log.csv_layout import is_comment, text_of
from imufit.log.named_values import is_table_line
from imufit.log.record import find_record
from imufit.log.transcript import TranscriptSource, lines_of

TEXT_SUFFIXES: Final = (".csv", ".txt", ".tsv", ".dat", ".log")
"""Suffixes that text of a log usually has; its content decides."""
_SAMPLE: Final = 1 << 16
_LINES: Final = 60


def open_text(path: Path) -> CsvSource | TranscriptSource:
    """Open a text file as what it is.

    A file whose begin reads as a table is one, so that long tables need no pass of their own; any other is a
    transcript if records with named values can be found in it. The table's errors report any other text.

    Parameters
    ----------
    path : Path
        Text file with at least one byte.

    Raises
    ------
    InputError
        It is neither.
    """
    if not _begins_as_table(path):
        record = find_record(text for _, text in lines_of(path))
        if record is not None:
            return TranscriptSource(path, record)
    return CsvSource(path)


def looks_like_text(path: Path) -> bool:
    """Whether the begin of a file holds hardly anything but printable characters.

    Parameters
    ----------
    path : Path
        File.
    """
    with path.open("rb") as file:
        raw = file.read(_SAMPLE)
    odd = sum(raw.count(code) for code in range(32) if code not in b"\t\n\r\x1b")
    return b"\0" not in raw and odd <= 0.01 * len(raw)


def _begins_as_table(path: Path) -> bool:
    with path.open("rb") as file:
        raw = file.read(_SAMPLE + 1)
    if b"\0" in raw:
        return False
    pieces = raw[:_SAMPLE].split(b"\n")
    if len(raw) > _SAMPLE:
        pieces.pop()
    lines = [line for line in map(text_of, pieces) if not is_comment(line)][-_LINES:]
    return 2 * sum(is_table_line(line) for line in lines) > len(lines)
