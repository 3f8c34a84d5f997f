"""ArduPilot's DataFlash logs (``.bin``): a table a message, its columns as pymavlink describes them."""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.formats.guard import library
from imufit.formats.limits import WHOLE, check_size, check_values
from imufit.formats.recording import Recording, Table

FORM: Final = "ArduPilot DataFlash"
_START: Final = b"\xa3\x95"
_FORMAT: Final = 0x80
"""Kind of the messages that say how the others are built."""
_FORMAT_BYTES: Final = 89
_UNITS: Final = "FMTU"
"""Messages that say which column of another message is the number of the sensor: a ``#`` in its place."""
_DESCRIPTIONS: Final = frozenset({"FMT", "FMTU", "UNIT", "MULT", "PARM"})
"""Messages that describe the log or the vehicle; `PARM` has names of its own for every value."""
_INSTANCES: Final = ("I", "Instance", "IMU")
"""Columns that number the sensor in logs without the messages that say so."""
_MOST_INSTANCES: Final = 16
"""Sensors of a kind; a board has up to 5 accelerometers. A column with more values counts something else."""
_FILLED: Final = 528
"""Bytes behind the last message that memory in pages leaves unwritten; pymavlink passes over as many."""
_TEXTS: Final = {"n": 4, "N": 16, "Z": 64}
"""Kinds of column that are texts, and their bytes."""
_ARRAYS: Final = "a"
_TIMES: Final = {"TimeUS": 1e-6, "TimeMS": 1e-3}


def recognises(head: bytes, _path: Path) -> bool:
    """Return whether a message that describes others stands where such a log begins."""
    return head.startswith(_START + bytes([_FORMAT]))


def read(path: Path) -> Recording:
    """Read a DataFlash log; of one that is cut off the messages that are whole."""
    dfreader = library("pymavlink.DFReader", "ardupilot", path, FORM)
    check_size(path, WHOLE)
    data = path.read_bytes()
    walk = _Walk(data, dfreader)
    walk.run()
    check_values(path, sum(len(offsets) * len(walk.formats[kind].columns) for kind, offsets in walk.offsets.items()))
    tables: list[Table] = []
    bytes_of = np.frombuffer(data, dtype=np.uint8)
    for kind, offsets in walk.offsets.items():
        form = walk.formats[kind]
        if form.name not in _DESCRIPTIONS and len(offsets):
            tables += _tables(form, bytes_of, np.frombuffer(offsets, dtype=np.int64), dfreader.FORMAT_TO_STRUCT)
    return Recording(FORM, tuple(tables), tuple(walk.notes(tables)))


class _Walk:
    """Finds where the messages of every kind stand."""

    def __init__(self, data: bytes, dfreader: Any) -> None:
        self._data = data
        self._dfreader = dfreader
        self.formats: dict[int, Any] = {
            _FORMAT: dfreader.DFFormat(_FORMAT, "FMT", _FORMAT_BYTES, "BBnNZ", "Type,Length,Name,Format,Columns")
        }
        self.offsets: dict[int, array[int]] = {}
        self._skipped = 0
        self._end = 0

    def run(self) -> None:
        data, size, at = self._data, len(self._data), 0
        while True:
            if data[at : at + 2] != _START:
                found = data.find(_START, at)
                found = size if found < 0 else found
                self._skipped += found - at
                at = found
            if at + 3 > size:
                break
            form = self.formats.get(data[at + 2])
            if form is None or form.len < 3:
                self._skipped += 1
                at += 1
                continue
            if at + form.len > size:
                break
            if form.name in ("FMT", _UNITS):
                self._describe(form, data[at + 3 : at + form.len])
            offsets = self.offsets.get(form.type)
            if offsets is None:
                offsets = self.offsets[form.type] = array("q")
            offsets.append(at)
            at += form.len
            self._end = at

    def _describe(self, form: Any, body: bytes) -> None:
        if form.name == "FMT":
            self._define(body)
        elif len(body) >= 25:
            # the type stands before or behind a time, and the signs of the units behind the type
            offset = 8 if form.format.startswith("Q") else 0
            described = self.formats.get(body[offset])
            place = body[offset + 1 : offset + 17].find(b"#")
            if described is not None and 0 <= place < len(described.columns):
                described.instance_field = described.columns[place]

    def _define(self, body: bytes) -> None:
        kind, length = body[0], body[1]
        name, layout, columns = (
            body[first:last].split(b"\0")[0].decode("ascii", "replace") for first, last in ((2, 6), (6, 22), (22, 86))
        )
        table = self._dfreader.FORMAT_TO_STRUCT
        names = columns.split(",")
        if kind == _FORMAT or not name or kind in self.offsets or any(code not in table for code in layout):
            return
        widths = [np.dtype(_numpy(table[code][0])).itemsize for code in layout]
        if sum(widths) != length - 3 or len(names) != len(layout) or len(set(names)) < len(names):
            return
        self.formats[kind] = self._dfreader.DFFormat(kind, name, length, layout, columns, self.formats.get(kind))

    def notes(self, tables: list[Table]) -> Iterator[str]:
        size = len(self._data)
        rest = size - self._end
        last = max((float(np.nanmax(table.columns[table.time])) for table in tables if table.time), default=0.0)
        if rest > 0 and not (rest <= _FILLED and not self._data[self._end :].strip(b"\0\xff")):
            yield (
                f"The file is cut off or damaged: its last {rest} of {size} bytes do not make a whole message, and the "
                f"last message read is of {last:.3f} s."
            )
        within = self._skipped - max(rest, 0)
        if within > 0:
            yield f"{within} bytes between the messages are damaged and were left out."


def _tables(form: Any, data: NDArray[np.uint8], offsets: NDArray[np.int64], codes: dict[str, Any]) -> Iterator[Table]:
    columns: dict[str, NDArray[Any]] = {}
    at = 3
    for name, code in zip(form.columns, form.format, strict=True):
        dtype = np.dtype(_numpy(codes[code][0]))
        if code != _ARRAYS:
            raw = np.empty((len(offsets), dtype.itemsize), dtype=np.uint8)
            for place in range(dtype.itemsize):
                raw[:, place] = data[offsets + at + place]
            values = raw.view(dtype)[:, 0]
            if code in _TEXTS:
                text = np.empty(len(values), dtype=object)
                text[:] = [value.decode("latin-1") or None for value in values.tolist()]
                columns[name] = text
            else:
                factor = codes[code][1]
                columns[name] = values.astype(float) * (1.0 if factor is None else factor)
        at += dtype.itemsize
    time = next((name for name in _TIMES if name in columns and columns[name].dtype == float), None)
    if time is not None:
        columns[time] = columns[time] * _TIMES[time]
    yield from _by_instance(form, columns, time)


def _by_instance(form: Any, columns: dict[str, NDArray[Any]], time: str | None) -> Iterator[Table]:
    """Split a table by the number of the sensor, as the rows of several sensors alternate."""
    name: str = form.instance_field or next((name for name in _INSTANCES if name in columns), "")
    numbers = np.unique(columns[name]) if name in columns and columns[name].dtype == float else np.zeros(0)
    if not 0 < len(numbers) <= _MOST_INSTANCES:
        yield Table(form.name, columns, time)
        return
    for number in numbers:
        rows = columns[name] == number
        suffix = "" if len(numbers) == 1 else f".{number:.0f}"
        yield Table(f"{form.name}{suffix}", {key: column[rows] for key, column in columns.items()}, time)


def _numpy(layout: str) -> str:
    """Return numpy's name of a type of the module struct."""
    text = re.fullmatch(r"(\d+)s", layout)
    return (
        f"S{text[1]}"
        if text
        else "<"
        + {
            "b": "i1",
            "B": "u1",
            "e": "f2",
            "h": "i2",
            "H": "u2",
            "i": "i4",
            "I": "u4",
            "f": "f4",
            "d": "f8",
            "q": "i8",
            "Q": "u8",
        }[layout]
    )
