"""JSON: a list of objects, an object of lists, or an object a line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np

from imufit.errors import InputError
from imufit.formats.arrays import Named, tables_of
from imufit.formats.limits import PARSED, STREAMED, check_size
from imufit.formats.recording import Recording
from imufit.formats.rows import Rows, number

FORM: Final = "JSON"
_LINES: Final = (".jsonl", ".ndjson")
_LINE: Final = 1_000_000
"""Characters of a line; an object a line is a sample, of some hundred."""
_DEPTH: Final = 16
"""Objects within objects."""


def recognises(_head: bytes, _path: Path) -> bool:
    """Return False: a bracket at the beginning is too little, so that only the suffix decides."""
    return False


def read(path: Path) -> Recording:
    """Read a file of JSON."""
    if path.suffix.lower() in _LINES:
        return _read_lines(path)
    check_size(path, PARSED)
    text = path.read_bytes().decode("utf-8-sig")
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        if "\n" in text.strip() and text.lstrip().startswith("{") and error.msg == "Extra data":
            return _read_lines(path)
        raise InputError(
            f"the file is cut off or not JSON: {error.msg} at character {error.pos} of {len(text)}",
            file=path,
            line=error.lineno,
        ) from None
    rows = Rows(path)
    if isinstance(content, list):
        _add_rows(rows, "", content)
        return Recording(FORM, rows.tables(), rows.notes())
    named = Named(".")
    if isinstance(content, dict):
        _add(named, rows, "", content, 0)
    tables, notes = tables_of(path, named)
    return Recording(FORM, (*rows.tables(), *tables), (*rows.notes(), *notes))


def _read_lines(path: Path) -> Recording:
    check_size(path, STREAMED)
    rows = Rows(path)
    bad = 0
    with path.open("rb") as file:
        while line := file.readline(_LINE):
            if not line.strip():
                continue
            try:
                value = json.loads(line)
            except (ValueError, RecursionError):
                value = None
            if isinstance(value, dict):
                rows.append("", rows.flat(value))
            else:
                bad += 1
    notes = rows.notes()
    if bad:
        notes = (*notes, f"{bad} lines are not an object of JSON and were left out; a file that is cut off ends so.")
    return Recording(FORM, rows.tables(), notes)


def _add_rows(rows: Rows, table: str, content: list[Any]) -> None:
    for value in content:
        if isinstance(value, dict):
            rows.append(table, rows.flat(value))
        elif isinstance(value, list) and value and all(isinstance(member, int | float) for member in value):
            rows.append(table, {f"c{index + 1}": number(member) for index, member in enumerate(value)})


def _add(named: Named, rows: Rows, name: str, value: Any, depth: int) -> None:
    """Add what an object holds: lists of objects are tables of their own, lists of numbers columns."""
    if isinstance(value, dict) and depth < _DEPTH:
        for key, member in value.items():
            _add(named, rows, f"{name}.{key}" if name else str(key), member, depth + 1)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        _add_rows(rows, name, value)
    elif isinstance(value, list) and value:
        named.add(name, _array(value))
    elif isinstance(value, bool | int | float):
        named.add(name, value)


def _array(value: list[Any]) -> Any:
    """Return a list as an array of numbers, with NaN for null, or of texts; as it is where it is neither."""
    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return (
            np.array(value, dtype=object) if all(isinstance(k, str) for k in value) else np.array([None], dtype=object)
        )
