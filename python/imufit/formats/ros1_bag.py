"""Bags of ROS 1 (``.bag``): records in the order of the file, so that one that was never closed is read as well."""

from __future__ import annotations

import io
import mmap
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from imufit.formats.guard import library
from imufit.formats.limits import STREAMED, check_expansion, check_size, unpacked
from imufit.formats.recording import Recording
from imufit.formats.ros_messages import Messages

FORM: Final = "ROS 1 bag"
_MAGIC: Final = b"#ROSBAG V2.0\n"
_MESSAGE: Final = 2
_CHUNK: Final = 5
_CONNECTION: Final = 7
_HEADER: Final = 65_536
"""Bytes of the header of a record; that of a connection has its topic and little more."""
_CHUNK_BYTES: Final = 256_000_000
"""Unpacked bytes of a chunk: 768 kB unless its writer chose otherwise."""


def recognises(head: bytes, _path: Path) -> bool:
    """Return whether a file begins as a bag of ROS 1 does."""
    return head.startswith(b"#ROSBAG V")


@dataclass
class _Walk:
    """State of reading: connections, and how far the records are whole."""

    header: Any
    connections: dict[int, tuple[str, str, str]] = field(default_factory=dict)
    unpacked: int = 0
    damaged: int = 0


def read(path: Path) -> Recording:
    """Read a bag; of one that is cut off the messages that are whole."""
    reader = library("rosbags.rosbag1.reader", "ros", path, FORM)
    messages = Messages(path, "ros", FORM)
    size = check_size(path, STREAMED)
    walk = _Walk(reader.Header)
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if data[: len(_MAGIC)] != _MAGIC:
            raise ValueError("only version 2.0 of the format can be read")
        end = _records(path, data, len(_MAGIC), size, walk, messages)
    notes = messages.notes()
    if end < size:
        notes.append(
            f"The file is cut off or damaged: {100 * end / size:.2f} % of its bytes, from its beginning, are whole "
            "records; what could be read of the next one was."
        )
    if walk.damaged:
        notes.append(f"{walk.damaged} chunks of the file are damaged and were left out.")
    return Recording(FORM, messages.rows.tables(), tuple(notes))


def _records(path: Path, data: Any, start: int, size: int, walk: _Walk, messages: Messages) -> int:
    """Read the records of the file; returns where the last whole one ends."""
    end = start
    for header, body, at, whole in _split(data, start, size, walk.header):
        kind = header.get_uint8("op")
        if kind == _CHUNK:
            declared = header.get_uint32("size")
            walk.unpacked += declared
            check_expansion(path, size, walk.unpacked, STREAMED)
            check_expansion(path, size, declared, _CHUNK_BYTES)
            try:
                inner = unpacked(header.get_string("compression"), body, declared)
            except Exception:  # each compression has errors of its own
                walk.damaged += 1
                inner = b""
            for inner_header, inner_body, _, inner_whole in _split(inner, 0, len(inner), walk.header):
                if inner_whole:
                    _record(inner_header, inner_body, walk, messages)
        elif whole:
            _record(header, body, walk, messages)
        if whole:
            end = at
    return end


def _record(header: Any, body: bytes, walk: _Walk, messages: Messages) -> None:
    kind = header.get_uint8("op")
    if kind == _CONNECTION:
        about = walk.header.read(io.BytesIO(struct.pack("<L", len(body)) + body))
        definition = about.get_string("message_definition")
        walk.connections[header.get_uint32("conn")] = (header.get_string("topic"), about.get_string("type"), definition)
    elif kind == _MESSAGE:
        connection = walk.connections.get(header.get_uint32("conn"))
        if connection is not None:
            topic, name, definition = connection
            messages.add(topic, name, definition, "msg", body, True, header.get_time("time"))


def _split(data: Any, at: int, size: int, header: Any) -> Iterator[tuple[Any, bytes, int, bool]]:
    """Yield header, body and end of every record, and whether it is whole; the last one may be cut off."""
    while at + 4 <= size:
        (length,) = struct.unpack_from("<L", data, at)
        body = at + 4 + length
        if length > _HEADER or body + 4 > size:
            return
        try:
            about = header.read(io.BytesIO(data[at:body]))
            about.get_uint8("op")
        except (
            Exception
        ):  # fields that do not fit the header, names that are not text: the place of the next is unknown
            return
        (length,) = struct.unpack_from("<L", data, body)
        end = body + 4 + length
        yield about, data[body + 4 : min(end, size)], end, end <= size
        at = end
