"""How a text table is laid out: encoding, separator, preamble, header, first data line."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final

from imufit.errors import InputError
from imufit.log.check import number_from_text
from imufit.log.size import LONGEST_LINE, MOST_COLUMNS, size_in_words
from imufit.log.units import lookup

_SAMPLE: Final = 1 << 16
_LINES: Final = 60
_COMMA_NUMBER: Final = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?")
_NOTHING: Final = ' \t"'
"""Texts that may stand in a line without values, besides separators."""
COMMENT: Final = ("#", "%", "//")
NOT_DATA: Final = re.compile(rb"\n[ \t]*(?:#|%|//|\r?\n)")
"""Line end before a line that holds no data: a comment or a blank line."""


@dataclass(frozen=True)
class Layout:
    """Layout of a text table.

    Parameters
    ----------
    separator : str
        Comma, semicolon, tab; a blank stands for any run of blanks.
    names : tuple of str
        Header; ``c1``, ``c2``, ... when there is none.
    header_line : int or None
        Line of the header, from 0.
    data_offset : int
        Byte at which the line after the header begins.
    data_line : int
        Line, from 0, at that byte.
    notes : tuple of str
        What was skipped.
    decimal : str
        Decimal point of its numbers: a comma where the separator is not one.
    before : tuple of str
        Lines before the header.
    """

    separator: str
    names: tuple[str, ...]
    header_line: int | None
    data_offset: int
    data_line: int
    notes: tuple[str, ...] = ()
    decimal: str = "."
    before: tuple[str, ...] = ()


def text_of(data: bytes) -> str:
    """Decode UTF-8, or else the western Windows code page."""
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def lines_in(file: IO[bytes], path: Path) -> Iterator[bytes]:
    """Give the lines of a file from where it stands.

    Raises
    ------
    InputError
        A line is longer than any line of a log: it would have to be held whole.
    """
    while data := file.readline(LONGEST_LINE + 1):
        if len(data) > LONGEST_LINE:
            raise too_long(path)
        yield data


def too_long(path: Path) -> InputError:
    """Return the error for a line that no log has."""
    return _no_rows(f"a line is longer than {size_in_words(LONGEST_LINE)}", path)


def _no_rows(fault: str, path: Path, line: int | None = None) -> InputError:
    """Return the error for a line that holds more than one row of a log."""
    return InputError(
        f"{fault}: this is not a table of rows", file=path, line=line, remedy="Export it with a line for each sample."
    )


def split_line(line: str, separator: str) -> list[str]:
    """Fields of one line, stripped."""
    if separator == " ":
        return line.split()
    try:
        return [field.strip() for field in next(csv.reader([line], delimiter=separator), [])]
    except csv.Error:
        return line.split(separator)


def is_comment(line: str) -> bool:
    """Whether a line is blank or a comment."""
    return not line.strip() or line.lstrip().startswith(COMMENT)


def read_layout(path: Path) -> Layout:
    """Find the layout of a text table from its first 64 kB.

    Raises
    ------
    InputError
        It is not text, or a header and rows cannot be found.
    """
    with path.open("rb") as file:
        raw = file.read(_SAMPLE + 1)
    if b"\0" in raw:
        raise InputError("this is not a text file", file=path, remedy="Check the suffix.")
    if b"\r" in raw and b"\n" not in raw:
        raise InputError("the lines end in CR alone", file=path, remedy="Save it with LF or CR LF line ends.")
    whole = len(raw) <= _SAMPLE
    pieces = raw[:_SAMPLE].split(b"\n")
    if not whole and len(pieces) > 1:
        pieces.pop()
    lines = [text_of(piece).rstrip("\r") for piece in pieces]
    lines[0] = lines[0].removeprefix("\ufeff")
    table = [i for i, line in enumerate(lines) if not is_comment(line)]
    if not table:
        raise InputError("the file does not hold a table", file=path, remedy="A header and rows are wanted.")
    separator, width = _separator([lines[i] for i in table])
    decimal = _decimal([lines[i] for i in table], separator)
    if decimal == ",":
        lines = [line.replace(",", ".") for line in lines]
    header, names, notes = _header(lines, table, separator, width, path)
    if len(names) > MOST_COLUMNS:
        line = (table[0] if header is None else header) + 1
        raise _no_rows(f"a line has {len(names)} columns, more than {MOST_COLUMNS}", path, line)
    first = 0 if header is None else header + 1
    if not _holds_numbers([split_line(lines[i], separator) for i in table if i >= first]):
        raise InputError(
            "this is not a table of numbers: most lines are words",
            file=path,
            remedy="Give the file with the readings: a header, and a line of numbers for each sample.",
        )
    units = next((i for i in table if i >= first), None) if header is not None else None
    if units is not None and (fields := split_line(lines[units], separator)) and _are_units(fields, len(names)):
        names = tuple(f"{name} ({unit})" if unit else name for name, unit in zip(names, fields, strict=True))
        first = units + 1
    while first < len(lines) and not lines[first].strip(_NOTHING + separator):
        # a row without a single value before the first reading, as spreadsheets leave it: not a lost sample
        first += 1
    offset = sum(len(piece) + 1 for piece in pieces[:first])
    before = tuple(line for line in lines[: table[0] if header is None else header] if line.strip())
    return Layout(separator, names, header, min(offset, path.stat().st_size), first, notes, decimal, before)


def _holds_numbers(rows: list[list[str]]) -> bool:
    """Whether at least half of the last rows that hold anything hold a number."""
    filled = [row for row in rows[-_LINES:] if any(row)]
    return 2 * sum(any(_numeric(field) for field in row) for row in filled) >= len(filled)


def _decimal(lines: list[str], separator: str) -> str:
    """Find the decimal point: a comma where numbers have one, none has a point, and the separator is another."""
    cells = [cell for line in lines[-_LINES:] for cell in split_line(line, separator)] if separator != "," else []
    commas = sum(_COMMA_NUMBER.fullmatch(cell) is not None for cell in cells)
    points = sum("." in cell and _numeric(cell) for cell in cells)
    return "," if commas and not points else "."


def _are_units(fields: list[str], width: int) -> bool:
    """Whether a line below the header holds units instead of readings."""
    known = sum(lookup(field) is not None for field in fields)
    return len(fields) == width and not any(_numeric(field) for field in fields) and 2 * known >= width


def _separator(lines: list[str]) -> tuple[str, int]:
    """Find the separator and the number of fields that most of the last lines of the sample agree on."""
    best = (0.0, 0, " ", 1)
    for order, separator in enumerate("\t;, "):
        counts = Counter(len(split_line(line, separator)) for line in lines[-_LINES:])
        width, times = max(counts.items(), key=lambda item: (item[1], item[0]))
        if width > 1:
            best = max(best, (times / sum(counts.values()), -order, separator, width))
    return best[2], best[3]


def _numeric(field: str) -> bool:
    try:
        return number_from_text(field, truth=True) is not None and field != ""
    except ValueError:
        return False


def _header(
    lines: list[str], table: list[int], separator: str, width: int, path: Path
) -> tuple[int | None, tuple[str, ...], tuple[str, ...]]:
    """Header line, its names and notes; numbered columns when the table begins without a header."""
    for position, i in enumerate(table[:_LINES]):
        fields = split_line(lines[i], separator)
        if len(fields) in (width, width - 1) and not any(_numeric(field) for field in fields) and any(fields):
            if len(fields) == width - 1 and not _trailing(lines, table[position + 1 :], separator):
                continue
            notes = (
                (f"{path.name}: {position} {'lines' if position > 1 else 'line'} before the header skipped",)
                if position
                else ()
            )
            return i, _named([*fields, *[""] * (width - len(fields))]), notes
        if len(fields) == width and all(_numeric(field) for field in fields if field):
            break
    first = split_line(lines[table[0]], separator)
    commented = [i for i, line in enumerate(lines[: table[0]]) if line.strip()]
    if commented:
        fields = split_line(lines[commented[-1]].strip().lstrip("#%/").strip(), separator)
        if len(fields) == width and not any(_numeric(field) for field in fields):
            return commented[-1], _named(fields), ()
    if not any(_numeric(field) for field in first):
        raise InputError(
            f"the header has {len(first)} names, but the rows have {width} fields",
            file=path,
            line=table[0] + 1,
            remedy="Give every column one name.",
        )
    names = tuple(f"c{k + 1}" for k in range(width))
    return None, names, (f"{path.name}: no header: the columns are called c1 to c{width}",)


def _trailing(lines: list[str], rows: list[int], separator: str) -> bool:
    """Whether the rows end with a separator that the header has not."""
    return separator != " " and bool(rows) and all(lines[i].rstrip().endswith(separator.strip()) for i in rows[:5])


def _named(fields: list[str]) -> tuple[str, ...]:
    return tuple(field or f"column_{k + 1}" for k, field in enumerate(fields))
