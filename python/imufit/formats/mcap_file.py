"""MCAP (``.mcap``), read by mcap; messages of ROS 1 and 2 are decoded by rosbags, those in JSON directly."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from imufit.formats.guard import library
from imufit.formats.limits import STREAMED, check_expansion, check_size, unpacked
from imufit.formats.recording import Recording
from imufit.formats.ros_messages import LARGEST_MESSAGE, Messages
from imufit.formats.rows import number

FORM: Final = "MCAP"
_MAGIC: Final = b"\x89MCAP0\r\n"
_CHUNK_BYTES: Final = 256_000_000
"""Unpacked bytes of a chunk: 1 MB unless its writer chose otherwise; more would not fit beside the columns."""
_CHUNK: Final = 6
"""Kind of record that holds others, packed."""
_LANGUAGES: Final = {"ros1msg": "msg", "ros2msg": "msg", "ros2idl": "idl"}


def recognises(head: bytes, _path: Path) -> bool:
    """Return whether a file begins as an MCAP does."""
    return head.startswith(_MAGIC)


def read(path: Path) -> Recording:
    """Read an MCAP; of one that is cut off the messages that are whole."""
    messages = Messages(path, "mcap", FORM)
    notes = read_into(path, messages)
    return Recording(FORM, messages.rows.tables(), (*messages.notes(), *notes))


def read_into(path: Path, messages: Messages) -> list[str]:
    """Read the messages of an MCAP to those that were read before.

    Parameters
    ----------
    path : Path
        The file.
    messages : Messages
        Takes the rows.

    Returns
    -------
    list of str
        Notes on the file.
    """
    library("mcap", "mcap", path, FORM)
    size = check_size(path, STREAMED)
    walk = _Walk(path, size, messages)
    with path.open("rb") as file:
        walk.file(file)
    return walk.notes


class _Walk:
    def __init__(self, path: Path, size: int, messages: Messages) -> None:
        from mcap import data_stream, records, stream_reader  # noqa: PLC0415 - an optional dependency

        self._records = records
        self._reader = stream_reader.StreamReader
        self._stream = data_stream.ReadDataStream
        self._path = path
        self._size = size
        self._messages = messages
        self._schemas: dict[int, Any] = {}
        self._channels: dict[int, Any] = {}
        self._unpacked = 0
        self.notes: list[str] = []

    def file(self, file: Any) -> None:
        at = 0
        damaged = 0
        complete = False
        found = iter(self._reader(file, emit_chunks=True, record_size_limit=self._size).records)
        while True:
            at = file.tell()
            try:
                record = next(found, None)
            except Exception:  # the end of the file within a record raises what the record's fields happen to raise
                break
            if record is None:
                complete = True
                break
            if not isinstance(record, self._records.Chunk):
                self._record(record)
            elif len(record.data) < self._declared(file, at):
                break
            else:
                damaged += not self._chunk(record, True)
        if not complete:
            file.seek(at)
            self._rest(file.read(_CHUNK_BYTES))
            self.notes.append(
                f"{self._path.name} is cut off or damaged: {100 * at / self._size:.2f} % of its bytes, from its "
                "beginning, are whole records; what could be read of the next one was."
            )
        if damaged:
            self.notes.append(f"{damaged} chunks of {self._path.name} are damaged and were left out.")

    @staticmethod
    def _declared(file: Any, at: int) -> int:
        """Return the bytes that the chunk at a place declares for its records."""
        end = file.tell()
        file.seek(at + 9 + 28)
        length = int.from_bytes(file.read(4), "little")
        file.seek(length, io.SEEK_CUR)
        declared = int.from_bytes(file.read(8), "little")
        file.seek(end)
        return declared

    def _chunk(self, chunk: Any, whole: bool) -> bool:
        """Read the records of a chunk; returns whether it could be unpacked."""
        if chunk.uncompressed_size > self._size:
            check_expansion(self._path, self._size, chunk.uncompressed_size, _CHUNK_BYTES)
        self._unpacked += chunk.uncompressed_size
        check_expansion(self._path, self._size, self._unpacked, STREAMED)
        try:
            data = unpacked(chunk.compression, chunk.data, min(chunk.uncompressed_size, _CHUNK_BYTES))
        except Exception:  # each compression has errors of its own
            return not whole
        for record in self._inner(data):
            self._record(record)
        return True

    def _inner(self, data: bytes) -> Iterator[Any]:
        found = iter(self._reader(io.BytesIO(data), skip_magic=True, record_size_limit=len(data)).records)
        while True:
            try:
                yield next(found)
            except Exception:  # another sign of the end does not exist
                return

    def _rest(self, tail: bytes) -> None:
        """Read what is there of a chunk that is cut off."""
        if len(tail) < 64 or tail[0] != _CHUNK:
            return
        start = 9 + 28 + 4 + int.from_bytes(tail[9 + 28 : 9 + 32], "little") + 8
        if start < len(tail):
            self._chunk(self._records.Chunk.read(self._stream(io.BytesIO(tail[9:]))), False)

    def _record(self, record: Any) -> None:
        records = self._records
        if isinstance(record, records.Schema):
            self._schemas[record.id] = record
        elif isinstance(record, records.Channel):
            self._channels[record.id] = record
        elif isinstance(record, records.Message) and record.channel_id in self._channels:
            self._message(self._channels[record.channel_id], record)

    def _message(self, channel: Any, message: Any) -> None:
        schema = self._schemas.get(channel.schema_id)
        if channel.message_encoding == "json":
            self._json(channel.topic, message)
        elif channel.message_encoding in ("cdr", "ros1") and schema is not None and schema.encoding in _LANGUAGES:
            definition = schema.data.decode("utf-8", "replace")
            ros1 = channel.message_encoding == "ros1"
            language = _LANGUAGES[schema.encoding]
            self._messages.add(channel.topic, schema.name, definition, language, message.data, ros1, message.log_time)
        else:
            self._undecoded(channel.topic)

    def _json(self, topic: str, message: Any) -> None:
        try:
            value = json.loads(message.data) if len(message.data) <= LARGEST_MESSAGE else None
        except (ValueError, RecursionError):
            value = None
        if not isinstance(value, dict):
            self._undecoded(topic)
            return
        header = value.get("header")
        stamp = (header.pop("stamp", None) if isinstance(header, dict) else None) or value.get("timestamp")
        self._messages.rows.append(topic, self._messages.rows.flat(value), _seconds(stamp) or message.log_time * 1e-9)

    def _undecoded(self, topic: str) -> None:
        self._messages.undecoded[topic] = self._messages.undecoded.get(topic, 0) + 1


def _seconds(stamp: Any) -> float:
    """Return the seconds of a time of two numbers, as JSON made of messages of ROS and Foxglove has them; 0 if none."""
    if not isinstance(stamp, dict) or not isinstance(stamp.get("sec"), int | float):
        return 0.0
    parts = [stamp.get(key) for key in ("nanosec", "nsec")]
    nanoseconds = next((part for part in parts if isinstance(part, int | float)), 0)
    return number(stamp["sec"]) + 1e-9 * number(nanoseconds)
