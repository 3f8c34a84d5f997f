"""PX4's ULog (``.ulg``), read by pyulog: a table a message and instance."""

from __future__ import annotations

import io
import struct
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
_DEFINITIONS: Final = frozenset(b"BFIMPQ")
"""Kinds that stand before the readings."""
_STARTS: Final = frozenset(b"ALC")
"""Kinds of which the first ends the definitions."""
_SYNC: Final = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
"""Mark that the recorder writes twice a second for a reader that has to begin in the middle."""
_SEARCHED: Final = 200_000
"""Bytes in which messages are looked for behind a damaged one: several sectors of a memory card."""
_ROW: Final = 6
"""Readings in a row that are not an accident: one in 256 bytes looks like the beginning of one."""
_LONGEST: Final = 10_000
"""Bytes of a message, more than any of PX4's; pyulog takes longer ones for damage."""
_FLAG: Final = 11
"""Place in the message of flags, with its 3 bytes of header, of those that a reader has to know."""
_FLAGS: Final = 43
"""Bytes of the message of flags; its last 24 are the places of appended data."""
_APPENDED: Final = 0x01
"""Flag of a file with data that was appended after the log had ended; the messages before may be cut off then."""


def recognises(head: bytes, _path: Path) -> bool:
    """Return whether a file begins as a ULog does."""
    return head.startswith(_MAGIC)


def read(path: Path) -> Recording:
    """Read a ULog; of one that is cut off the messages that are whole."""
    core = library("pyulog.core", "px4", path, FORM)
    check_size(path, WHOLE)
    whole = _Whole(path.read_bytes())
    _check_formats(path, core.ULog(whole.file(), parse_header_only=True).message_formats)
    log = core.ULog(whole.file())
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
    return Recording(FORM, tuple(tables), _notes(whole, log, tables), _metadata(log))


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


def _notes(whole: _Whole, log: Any, tables: list[Table]) -> tuple[str, ...]:
    notes = []
    last = max((float(np.max(table.columns[_TIME])) for table in tables), default=0.0)
    if whole.read < whole.size:
        notes.append(
            f"The file is cut off or damaged: {100 * whole.read / whole.size:.2f} % of its bytes are whole messages, "
            f"and the last message read is of {last:.3f} s."
        )
    elif log.file_corruption:
        notes.append("Parts of the file are damaged and were left out.")
    lost = sum(dropout.duration for dropout in log.dropouts)
    if lost:
        notes.append(f"The recorder lost {lost / 1000:.3g} s in {len(log.dropouts)} dropouts.")
    return tuple(notes)


class _Whole:
    """The whole messages of a file, without what is damaged between them.

    pyulog looks for the next message byte by byte where one is damaged, which takes minutes, and near the end of the
    file forever. It is given a file that has nothing damaged.

    Parameters
    ----------
    data : bytes
        The file.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._parts = [data[:_HEADER]]
        self._defining = True
        self._appended: list[int] = []
        self.size = len(data)
        self.read = min(_HEADER, self.size)
        """Bytes of the file that are whole messages."""
        at: int | None = _HEADER
        while at is not None:
            at = self._resumed(self._chain(at))

    def file(self) -> io.BytesIO:
        """Return the file that pyulog is given."""
        return io.BytesIO(b"".join(self._parts))

    def _chain(self, at: int) -> int:
        """Take messages as long as one follows the other; returns where the last one ends."""
        data = self._data
        while (end := self._end(at)) is not None:
            kind = data[at + 2]
            if kind not in _KINDS and self._end(end) is None and end != self.size:
                break
            self.read += end - at
            self._take(kind, data[at:end])
            at = end
        return at

    def _end(self, at: int) -> int | None:
        """Return the end of the message at a place; None where it is not whole."""
        end = at + 3 + int.from_bytes(self._data[at : at + 2], "little")
        return end if at + 3 < end <= self.size else None

    def _take(self, kind: int, message: bytes) -> None:
        self._defining = self._defining and kind not in _STARTS
        if kind == ord("B") and len(message) >= _FLAGS and message[_FLAG] & _APPENDED:
            self._appended = list(struct.unpack_from("<QQQ", message, _FLAGS - 24))
            # the places no longer hold once damaged parts are gone, and are not needed then
            message = message[:_FLAG] + bytes([message[_FLAG] & ~_APPENDED]) + message[_FLAG + 1 :]
        if kind in (_DEFINITIONS if self._defining else _KINDS - {ord("S")}):
            self._parts.append(message)

    def _resumed(self, at: int) -> int | None:
        """Return where messages go on behind a damaged one.

        That is at appended data, or behind a mark of synchronisation, or, in older logs without such marks, where
        several messages follow each other.
        """
        if at >= self.size:
            return None
        appended = [place for place in self._appended if at < place < self.size]
        found = self._data.find(_SYNC, at)
        behind = [found + len(_SYNC)] if found >= 0 else []
        follow = next((place for place in range(at + 1, min(at + _SEARCHED, self.size)) if self._follow(place)), None)
        return min([*appended, *behind, *([] if follow is None else [follow])], default=None)

    def _follow(self, at: int) -> bool:
        """Return whether several readings follow each other from a place on."""
        for _ in range(_ROW):
            if self._data[at + 2 : at + 3] != b"D" or (end := self._end(at)) is None or end - at > _LONGEST:
                return False
            at = end
        return True


def _metadata(log: Any) -> dict[str, Any]:
    hardware = log.msg_info_dict.get("ver_hw")
    return {"sensor": hardware} if isinstance(hardware, str) and hardware else {}
