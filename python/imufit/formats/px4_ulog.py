"""PX4's ULog (``.ulg``), read by pyulog: a table a message and instance."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from imufit.errors import InputError
from imufit.formats.guard import library
from imufit.formats.limits import COLUMNS, WHOLE, check_size, check_values
from imufit.formats.recording import Recording, Table

FORM: Final = "PX4 ULog"
_MAGIC: Final = b"ULog\x01\x12\x35"
_TIME: Final = "timestamp"
_TIMES: Final = (_TIME, "timestamp_sample")
"""Columns that have times of the recorder's clock, us, in every message of PX4."""
_HEADER: Final = 16
"""Bytes before the first message, by the definition of the format."""
_KINDS: Final = frozenset(b"FDIMPQARSOLCB")
"""Kinds of message that the format defines."""
_APPENDED: Final = 0x01
"""Flag of a file with data that was appended after the log had ended; the messages before may be cut off then."""


def recognises(head: bytes, _path: Path) -> bool:
    """Return whether a file begins as a ULog does."""
    return head.startswith(_MAGIC)


def read(path: Path) -> Recording:
    """Read a ULog; of one that is cut off the messages that are whole."""
    core = library("pyulog.core", "px4", path, FORM)
    check_size(path, WHOLE)
    _check_formats(path, core.ULog(str(path), parse_header_only=True).message_formats)
    log = core.ULog(str(path))
    check_values(path, sum(len(data.data) * len(data.data[_TIME]) for data in log.data_list if _TIME in data.data))
    several = {data.name for data in log.data_list if data.multi_id}
    tables = []
    for data in log.data_list:
        if _TIME not in data.data or not len(data.data[_TIME]):
            continue
        columns = {
            name: values.astype(float)
            for name, values in data.data.items()
            if not name.rpartition(".")[2].startswith("_padding")
        }
        for time in _TIMES:
            if time in columns:
                columns[time] *= 1e-6
        name = data.name if data.name not in several or data.multi_id == 0 else f"{data.name}.{data.multi_id}"
        tables.append(Table(name, columns, _TIME))
    return Recording(FORM, tuple(tables), _notes(path, log, tables), _metadata(log))


def _check_formats(path: Path, formats: dict[str, Any]) -> None:
    """Refuse messages that hold more fields than a table has columns: they nest, and the library writes all out."""
    known: dict[str, int] = {}

    def fields(name: str, within: tuple[str, ...]) -> int:
        if name not in formats:
            return 1
        if name in within:
            raise InputError(f"the message {name} of the file contains itself", file=path)
        if name not in known:
            total = 0
            for kind, length, _ in formats[name].fields:
                total += max(length, 1) * (1 if kind == "char" and length else fields(kind, (*within, name)))
            known[name] = total
        return known[name]

    for name in formats:
        if fields(name, ()) > COLUMNS:
            raise InputError(f"the message {name} of the file has more than {COLUMNS} fields", file=path)


def _notes(path: Path, log: Any, tables: list[Table]) -> tuple[str, ...]:
    notes = []
    whole, size = _whole_messages(path)
    last = max((float(np.max(table.columns[_TIME])) for table in tables), default=0.0)
    if whole < size and not log.has_data_appended:
        notes.append(
            f"The file is cut off or damaged: {100 * whole / size:.2f} % of its bytes are whole messages from its "
            f"beginning, and the last message read is of {last:.3f} s."
        )
    elif log.file_corruption:
        notes.append("Parts of the file are damaged and were left out.")
    lost = sum(dropout.duration for dropout in log.dropouts)
    if lost:
        notes.append(f"The recorder lost {lost / 1000:.3g} s in {len(log.dropouts)} dropouts.")
    return tuple(notes)


def _whole_messages(path: Path) -> tuple[int, int]:
    """Return how many bytes from the beginning are whole messages, and how many there are."""
    data = path.read_bytes()
    at = _HEADER
    while at + 3 <= len(data):
        end = at + 3 + int.from_bytes(data[at : at + 2], "little")
        if end > len(data) or data[at + 2] not in _KINDS:
            break
        at = end
    return at, len(data)


def _metadata(log: Any) -> dict[str, Any]:
    hardware = log.msg_info_dict.get("ver_hw")
    return {"sensor": hardware} if isinstance(hardware, str) and hardware else {}
