"""Bags of ROS 2: a folder with ``metadata.yaml``, or a single ``.db3``."""

from __future__ import annotations

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from imufit.errors import InputError
from imufit.formats.guard import library
from imufit.formats.limits import STREAMED, check_size
from imufit.formats.recording import Recording
from imufit.formats.ros_messages import Messages

FORM: Final = "ROS 2 bag"
_MAGIC: Final = b"SQLite format 3\x00"
_DESCRIPTION: Final = "metadata.yaml"
_TABLES: Final = ("messages", "topics")


def recognises(head: bytes, path: Path) -> bool:
    """Return whether this is a folder with the description of a bag, or a database."""
    return (path / _DESCRIPTION).is_file() if path.is_dir() else head.startswith(_MAGIC)


def read(path: Path) -> Recording:
    """Read a bag; of a database that is damaged the messages before the damage."""
    storage = library("rosbags.rosbag2.storage_sqlite3", "ros", path, FORM)
    messages = Messages(path, "ros", FORM)
    notes: list[str] = []
    for file in _storages(path):
        check_size(file, STREAMED)
        if file.suffix == ".mcap":
            from imufit.formats import mcap_file  # noqa: PLC0415 - only these bags need the other format

            notes += mcap_file.read_into(file, messages)
        else:
            notes += _read_database(file, storage, messages)
    return Recording(FORM, messages.rows.tables(), (*messages.notes(), *notes))


def _storages(path: Path) -> list[Path]:
    if not path.is_dir():
        return [path]
    found = sorted(file for file in path.iterdir() if file.suffix in (".db3", ".mcap") and file.is_file())
    if not found:
        packed = any(file.suffix == ".zstd" for file in path.iterdir())
        raise InputError(
            "the folder of the bag holds no .db3 or .mcap file",
            file=path,
            remedy="Unpack its .zstd files with: zstd -d." if packed else None,
        )
    return found


def _read_database(path: Path, storage: Any, messages: Messages) -> list[str]:
    _check_tables(path)
    reader = storage.Sqlite3Reader(path)
    reader.open()
    count = 0
    total = reader.metadata.message_count
    notes: list[str] = []
    try:
        for connection, time_ns, raw in _until_damaged(reader, notes):
            count += 1
            if connection.ext.serialization_format not in ("cdr", ""):
                messages.undecoded[connection.topic] = messages.undecoded.get(connection.topic, 0) + 1
                continue
            language = "idl" if connection.msgdef.format.name == "IDL" else "msg"
            definition = connection.msgdef.data
            messages.add(connection.topic, connection.msgtype, definition, language, bytes(raw), False, time_ns)
    finally:
        with contextlib.suppress(Exception):
            reader.close()
    if notes:
        notes = [f"{path.name} is cut off or damaged: {count} of its {total} messages could be read."]
    return notes


def _until_damaged(reader: Any, notes: list[str]) -> Iterator[tuple[Any, int, bytes]]:
    if not reader.connections:
        return
    try:
        yield from reader.messages(reader.connections)
    except GeneratorExit:
        raise
    except Exception as error:  # the database's own errors, of which the library lets all through
        notes.append(str(error))


def _check_tables(path: Path) -> None:
    """Refuse a database whose columns are computed: reading one would run what its writer chose."""
    with contextlib.closing(sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1", uri=True)) as database:
        for table in (*_TABLES, "message_definitions"):
            hidden = [row for row in database.execute(f"PRAGMA table_xinfo({table})") if row[6] not in (0,)]
            if hidden:
                raise InputError(f"the table {table} of the bag has computed columns", file=path)
