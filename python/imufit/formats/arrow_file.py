"""Feather and Arrow's IPC files, read by pyarrow."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.formats.limits import COLUMNS, LIST, TEXT, WHOLE, check_expansion, check_size, check_values
from imufit.formats.recording import Recording, Table
from imufit.formats.rows import left_out_note

FORM: Final = "Arrow table"
_MAGIC: Final = b"ARROW1\0\0"
_METADATA: Final = b"imufit"
"""Key of a log's metadata, as in Parquet."""
_UNITS: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_DEPTH: Final = 8
"""Structs within structs."""


def recognises(head: bytes, _path: Path) -> bool:
    """Return whether a file begins as Arrow's IPC file does."""
    return head.startswith((_MAGIC, b"FEA1"))


def read(path: Path) -> Recording:
    """Read a table; times with a date become s since 1970."""
    import pyarrow as pa  # noqa: PLC0415 - costs a tenth of a second that other formats do not need

    size = check_size(path, WHOLE)
    with path.open("rb") as file:
        if file.read(4) == b"FEA1":
            raise InputError(
                "the file is of the first version of Feather, which current libraries do not read",
                file=path,
                remedy="Write it as Parquet with the program that made it.",
            )
    data = path.read_bytes()
    _check_buffers(path, data, pa)
    reader = pa.ipc.open_file(pa.py_buffer(data))
    table = reader.read_all()
    table.validate(full=True)
    for _ in range(_DEPTH):
        if not any(pa.types.is_struct(kind) for kind in table.schema.types):
            break
        table = table.flatten()
    check_expansion(path, size, table.nbytes)
    check_values(path, table.num_rows * table.num_columns)
    if table.num_columns > COLUMNS:
        raise InputError(f"the table has more than {COLUMNS} columns", file=path)
    columns: dict[str, NDArray[Any]] = {}
    left_out: list[str] = []
    dates = []
    for name, column in zip(table.column_names, table.columns, strict=True):
        made = _column(pa, name, column)
        if made:
            columns.update({key: values for key, values in made.items() if key not in columns})
            if pa.types.is_timestamp(column.type):
                dates.append(name)
        else:
            left_out.append(name)
    notes = (left_out_note(left_out),) if left_out else ()
    tables = (Table("", columns, dates[0] if len(dates) == 1 else None),) if columns and table.num_rows else ()
    return Recording(FORM, tables, notes, _metadata(table.schema.metadata or {}))


def _column(pa: Any, name: str, column: Any) -> dict[str, NDArray[Any]]:
    kind = column.type
    types = pa.types
    if types.is_dictionary(kind):
        column = column.cast(kind.value_type)
        kind = column.type
    if types.is_timestamp(kind) or types.is_duration(kind):
        return {name: _numbers(pa, column.cast(pa.int64())) * _UNITS[kind.unit]}
    if types.is_floating(kind) or types.is_integer(kind) or types.is_boolean(kind) or types.is_decimal(kind):
        return {name: _numbers(pa, column)}
    if types.is_string(kind) or types.is_large_string(kind):
        text = np.empty(len(column), dtype=object)
        text[:] = [None if value is None else value[:TEXT] for value in column.to_pylist()]
        return {name: text}
    if types.is_fixed_size_list(kind) and kind.list_size <= LIST:
        members = {}
        for index in range(kind.list_size):
            member = pa.compute.list_element(column, index)
            members.update(_column(pa, f"{name}[{index}]", member))
        return members
    return {}


def _numbers(pa: Any, column: Any) -> NDArray[Any]:
    values: NDArray[Any] = column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
    return values.astype(float)


def _metadata(metadata: dict[bytes, bytes]) -> dict[str, Any]:
    try:
        found = json.loads(metadata.get(_METADATA, b"{}"))
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _check_buffers(path: Path, data: bytes, pa: Any) -> None:
    """Refuse packed columns that unpack to more than readings can: each has its unpacked length in front."""
    source = pa.py_buffer(data)
    at = len(_MAGIC)
    total = 0
    while at + 8 <= len(data):
        marker, length = struct.unpack_from("<Ii", data, at)
        if marker != 0xFFFFFFFF or length <= 0:
            return
        message = pa.ipc.read_message(source.slice(at))
        body = message.body
        if message.type in ("record batch", "dictionary"):
            total += _unpacked(message.metadata.to_pybytes(), body.to_pybytes() if body is not None else b"")
            check_expansion(path, len(data), total)
        at += 8 + length + (0 if body is None else body.size)


def _unpacked(metadata: bytes, body: bytes) -> int:
    """Return the bytes that the buffers of a batch declare, by the layout of Arrow's messages (FlatBuffers)."""

    def field(table: int, index: int) -> int:
        """Return the place of a member of a table, 0 where it has none."""
        layout = table - int(struct.unpack_from("<i", metadata, table)[0])
        size = int(struct.unpack_from("<H", metadata, layout)[0])
        place = int(struct.unpack_from("<H", metadata, layout + 4 + 2 * index)[0]) if 4 + 2 * index < size else 0
        return table + place if place else 0

    def follow(place: int) -> int:
        return place + int(struct.unpack_from("<I", metadata, place)[0])

    message = follow(0)
    batch = follow(field(message, 2))
    if metadata[field(message, 1)] == 2:  # a dictionary has its batch inside
        batch = follow(field(batch, 1))
    if not field(batch, 3):  # not packed
        return len(body)
    buffers = follow(field(batch, 2))
    total = 0
    for index in range(struct.unpack_from("<I", metadata, buffers)[0]):
        offset, length = struct.unpack_from("<qq", metadata, buffers + 4 + 16 * index)
        if length >= 8:
            total += max(int(struct.unpack_from("<q", body, offset)[0]), 0)
    return total
