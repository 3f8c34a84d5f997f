"""The bytes that a recording begins with, kept until rows come out of them: the device may announce itself late."""

from __future__ import annotations

import json
import os
import struct
import zlib
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from imufit.devices.record.arrived import Chunk
from imufit.devices.record.circumstances import Circumstances
from imufit.devices.record.part import STALL
from imufit.devices.record.reception import Listening
from imufit.errors import InputError

MOST: Final = 1 << 24
"""Bytes that are kept at most: minutes of the fastest line, while a device announces itself once a second."""
_VERSION: Final = 1
_MARK: Final = b"imufit beginning\n"
_HEAD: Final = struct.Struct("<dIII")  # arrival (s), opening, bytes, CRC-32 of the bytes


def beginning_path(log: Path) -> Path:
    """Place of the bytes that a recording began with: ``walk.parquet.part0``, before all parts.

    Parameters
    ----------
    log : Path
        The log to be.
    """
    return log.with_name(f"{log.name}.part0")


class BeginningFile:
    """Bytes as they were read, each chunk with when it came and a check sum, written at once.

    Parameters
    ----------
    path : Path
        File to make.
    about : Circumstances
        All that has to be known to make a log of the rows.
    how : Listening
        All that has to be known to decode them.

    Raises
    ------
    OSError
        It cannot be made, or is there already.
    """

    def __init__(self, path: Path, about: Circumstances, how: Listening) -> None:
        self.path = path
        self._file = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_BINARY", 0), 0o666)
        self._room = MOST
        # a disk that stalls must not keep the line from being read
        self._writer = ThreadPoolExecutor(1)
        self._over = False
        self._last: Future[None] | None = None
        told = {"about": about.to_json(), "how": asdict(how), "version": _VERSION}
        self._append(_MARK + json.dumps(told).encode() + b"\n")

    def keep(self, chunk: Chunk) -> None:
        """Append a chunk, as long as there is room.

        Raises
        ------
        OSError
            The disk is full or gone.
        """
        self._room -= len(chunk.data)
        if self._room >= 0:
            head = _HEAD.pack(chunk.arrival, chunk.opening, len(chunk.data), zlib.crc32(chunk.data))
            self._append(head + chunk.data)

    def discard(self) -> None:
        """Delete the file, some time until `close`: every row of it is written elsewhere."""
        if not self._over:
            self._over = True
            self._writer.submit(self.path.unlink, missing_ok=True)

    def close(self) -> None:
        """Close the file once everything is written."""
        self._writer.shutdown()
        os.close(self._file)

    def _append(self, data: bytes) -> None:
        if self._last is not None and self._last.done():
            self._last.result()
        self._last = self._writer.submit(self._put, data)
        wait([self._last], STALL)
        if self._last.done():
            self._last.result()

    def _put(self, data: bytes) -> None:
        done = 0
        while done < len(data):
            done += os.write(self._file, memoryview(data)[done:])


@dataclass(frozen=True)
class Beginning:
    """The content of such a file.

    Attributes
    ----------
    about : Circumstances
        As it was given.
    how : Listening
        As it was given.
    chunks : tuple of Chunk
        All whole ones, in order.
    """

    about: Circumstances
    how: Listening
    chunks: tuple[Chunk, ...]


def read_beginning(path: Path) -> Beginning | None:
    """Read the whole chunks, whatever stands behind them.

    Parameters
    ----------
    path : Path
        File; it may be cut off anywhere.

    Returns
    -------
    Beginning or None
        None if not even what is said at its head is whole.

    Raises
    ------
    InputError
        Another version wrote it, or something else, or it is damaged.
    """
    data = path.read_bytes()
    if not data.startswith(_MARK[: len(data)]):
        raise InputError("the file does not hold the first bytes of a recording", file=path, remedy="Delete it.")
    end = data.find(b"\n", len(_MARK))
    if end < 0:
        return None
    try:
        told = json.loads(data[len(_MARK) : end])
        if (version := told["version"]) != _VERSION:
            raise InputError(
                f"this was written by another version (form {version}, known is {_VERSION})",
                file=path,
                remedy="Use the imufit that recorded it.",
            )
        about, how = Circumstances.from_json(told["about"]), Listening(**told["how"])
    except InputError:
        raise
    except (ValueError, KeyError, TypeError, OverflowError):
        raise InputError("the beginning of this file is damaged", file=path, remedy="Record again.") from None
    chunks: list[Chunk] = []
    at = end + 1
    while at + _HEAD.size <= len(data):
        arrival, opening, n, check = _HEAD.unpack_from(data, at)
        piece = data[at + _HEAD.size : at + _HEAD.size + n]
        if len(piece) < n or zlib.crc32(piece) != check:
            break
        chunks.append(Chunk(arrival, opening, piece))
        at += _HEAD.size + n
    return Beginning(about, how, tuple(chunks))
