"""Text files whose lines are of several kinds, identified by their first cell or by the number of their sensor."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.formats import Recording, Table
from imufit.log.csv import CsvSource
from imufit.log.csv_layout import is_comment, split_line, text_of
from imufit.log.folder import LARGEST, columns_of
from imufit.log.makers import maker_of
from imufit.log.tables import too_large
from imufit.log.transcript import TranscriptSource, lines_of

_SAMPLE: Final = 1 << 16
_KIND: Final = re.compile(r"[A-Za-z]\w*")
_DEFINES: Final = "FMT"
"""Kind of line by which ArduPilot's text logs name the columns of another kind (ardupilot.org, log messages)."""
_DEFINED_FROM: Final = 5
"""Cell of such a line at which the names begin, after kind, number, length, name and types."""
_MOST_SENSORS: Final = 16
"""Sensors of one kind in a file at most; a column with more numbers counts something else."""


def recording_of_kinds(path: Path) -> Recording | None:
    """Read a file whose lines begin with the name of their kind, a table for each kind.

    The columns of a kind stand in a comment or in a line of their own: ``# UncalAccel,utcTimeMillis,...`` (Google's
    GnssLogger) or ``FMT, 129, 31, IMU, QIfff, TimeUS,I,GyrX,...`` (ArduPilot).

    Parameters
    ----------
    path : Path
        Text file.

    Returns
    -------
    Recording or None
        None where the file is not such a file: fewer than half of its first lines are of a kind with stated columns.

    Raises
    ------
    InputError
        It is too large to be held in memory.
    """
    with path.open("rb") as file:
        first = [text_of(line).rstrip("\r\n") for line in file.read(_SAMPLE).split(b"\n")]
    lines = [line for line in first if not is_comment(line)]
    told = _told(first)
    if not told or 2 * sum(_kind(line) in told or _kind(line) == _DEFINES for line in lines) < len(lines):
        return None
    if (size := path.stat().st_size) > LARGEST:
        raise too_large(path, size)
    cells: dict[str, list[list[str]]] = {}
    told, others = {}, 0
    for _, line in lines_of(path):
        told |= _told([line])
        kind = _kind(line)
        if kind in told and not is_comment(line):
            cells.setdefault(kind, []).append(split_line(line, ",")[1:])
        elif kind != _DEFINES and line.strip() and not is_comment(line):
            others += 1
    whole = [_table(kind, told[kind], rows) for kind, rows in cells.items()]
    tables = tuple(table for each in whole for table in _by_instance(path, each))
    lost = sum(map(len, cells.values())) - sum(table.n for table in whole)
    notes: tuple[str, ...] = ()
    notes += (f"{path.name}: {others} lines of kinds without named columns left out",) if others else ()
    notes += (f"{path.name}: {lost} lines with another number of cells than their kind left out",) if lost else ()
    clues = (*(line for line in first if is_comment(line)), *(name for names in told.values() for name in names))
    return Recording("lines of several kinds", tables, notes, clues=clues) if tables else None


def recording_of_instances(path: Path, source: CsvSource | TranscriptSource) -> Recording | None:
    """Split a table in which the rows of several sensors of one kind take turns, a table for each sensor.

    Parameters
    ----------
    path : Path
        Text file.
    source : CsvSource or TranscriptSource
        The same, opened.

    Returns
    -------
    Recording or None
        None where its maker has no such column, or only one sensor is in it.

    Raises
    ------
    InputError
        It is too large to be held in memory.
    """
    maker = maker_of(source.clues)
    if maker is None or not maker.instance or maker.instance not in source.names:
        return None
    if (size := path.stat().st_size) > LARGEST:
        raise too_large(path, size)
    tables = tuple(_by_instance(path, Table(path.stem, columns_of(source))))
    return Recording("rows of several sensors", tables, clues=source.clues) if len(tables) > 1 else None


def _by_instance(path: Path, table: Table) -> Iterator[Table]:
    """Split a table by the number of the sensor, as ArduPilot's binary logs are."""
    maker = maker_of((path.name, *table.columns))
    own = table.columns.get(maker.instance) if maker is not None else None
    numbers = np.unique(own[np.isfinite(own)]) if own is not None and own.dtype == float else np.empty(0)
    if own is None or not 1 < numbers.size <= _MOST_SENSORS:
        yield table
        return
    for number in numbers:
        rows = own == number
        yield Table(f"{table.name}.{number:.0f}", {name: cells[rows] for name, cells in table.columns.items()})


def _kind(line: str) -> str:
    """First cell of a line, where that is a word; empty without."""
    word = line.partition(",")[0].strip()
    return word if _KIND.fullmatch(word) else ""


def _told(lines: list[str]) -> dict[str, list[str]]:
    """Names of the columns of each kind that lines state."""
    told: dict[str, list[str]] = {}
    for line in lines:
        cells = split_line(line.strip().lstrip("#%/").strip(), ",")
        if is_comment(line):
            kind, names = cells[0] if cells else "", cells[1:]
        elif cells and cells[0] == _DEFINES and len(cells) > _DEFINED_FROM:
            kind, names = cells[3], cells[_DEFINED_FROM:]
        else:
            continue
        if _KIND.fullmatch(kind) and len(names) > 1 and all(names) and len(set(names)) == len(names):
            told.setdefault(kind, names)
    return told


def _table(kind: str, names: list[str], rows: list[list[str]]) -> Table:
    """Lines of one kind as a table: numbers where all cells of a column are, with NaN for what a line lacks."""
    width = Counter(len(row) for row in rows).most_common(1)[0][0]
    rows = [row for row in rows if len(row) == width]
    named = [*names[:width], *(f"column_{k + 1}" for k in range(len(names), width))]
    return Table(kind, {name: _cells([row[k] for row in rows]) for k, name in enumerate(named)})


def _cells(texts: list[str]) -> NDArray[Any]:
    try:
        return np.array([float(text) if text else np.nan for text in texts])
    except ValueError:
        cells = np.empty(len(texts), dtype=object)
        cells[:] = [text or None for text in texts]
        return cells
