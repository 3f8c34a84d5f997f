"""The file of a running recording: append-only, so that a crash leaves all but the last quarter of a second."""

from __future__ import annotations

import json
import os
import time
import zlib
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from imufit.devices.record.arrived import Announced, Arrived
from imufit.devices.record.circumstances import Circumstances
from imufit.errors import InputError
from imufit.remedy import command

try:
    import fcntl
except ImportError:  # Windows keeps others from a file that is open anyway
    fcntl = None  # type: ignore[assignment]

VERSION: Final = 1
SYNC: Final = 1.0
"""Time after which what is written is on the disk, s: a power cut loses no more."""
BLOCK_ROWS: Final = 65_536
"""Rows from which on those of several batches are given at once."""
STALL: Final = 0.05
"""Time for which the disk may keep the line from being read, s."""
_KEY: Final = b"imufit_part"
_RAW: Final[dict[str, Any]] = {
    "arrival": np.float64,
    "opening": np.uint32,
    "start": np.uint8,
    "stamps": np.uint32,
    "sequence": np.uint16,
    "lost": np.uint32,
}
"""Columns before those of the device: how each row arrived, see `Arrived`."""


def part_path(log: Path, number: int = 1) -> Path:
    """Place of a part of a log: ``walk.parquet.part``, then ``walk.parquet.part2`` and so on.

    Parameters
    ----------
    log : Path
        The log to be.
    number : int
        From 1.
    """
    return log.with_name(f"{log.name}.part" + ("" if number == 1 else str(number)))


def parts_of(log: Path) -> list[Path]:
    """Parts of a log that are there, in order.

    Parameters
    ----------
    log : Path
        The log to be.
    """
    parts: list[Path] = []
    while (path := part_path(log, len(parts) + 1)).exists():
        parts.append(path)
    return parts


class _Bytes:
    """Takes what Arrow writes, to be written to the file at once."""

    closed = False

    def __init__(self) -> None:
        self.held = bytearray()

    def write(self, data: Any) -> int:
        self.held += memoryview(data).cast("B")
        return len(data)

    def flush(self) -> None:
        """Keep everything."""


class PartFile:
    """One part: an Arrow IPC stream of rows under one announcement, each batch with a check sum.

    Parameters
    ----------
    path : Path
        File to make.

    Attributes
    ----------
    rows : int
        Rows that are in the file.

    Raises
    ------
    FileExistsError
        It is there already.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY | getattr(os, "O_BINARY", 0), 0o666)
        if fcntl is not None:
            fcntl.flock(self._file, fcntl.LOCK_EX)
        self._whole = 0
        self._synced = time.monotonic()
        # a disk that stalls must not keep the line from being read
        self._writer, self._syncer = ThreadPoolExecutor(1), ThreadPoolExecutor(1)
        self._writing: deque[Future[None]] = deque()
        self._syncing: Future[None] | None = None
        self._failed: OSError | None = None
        self.rows = 0
        self._sink = _Bytes()
        self._stream: Any = None
        self._schema: Any = None
        self.announced: Announced | None = None

    def begin(self, announced: Announced, about: Circumstances) -> None:
        """Write what the rows will hold.

        Parameters
        ----------
        announced : Announced
            The device's announcement.
        about : Circumstances
            All else that has to be known to make a log of them.
        """
        self.announced = announced
        told = json.dumps({**about.to_json(), "version": VERSION, "announced": asdict(announced)})
        self._schema = _schema(announced).with_metadata({_KEY: told.encode()})
        self._stream = pa.ipc.new_stream(pa.PythonFile(self._sink, "w"), self._schema)
        self._append(0)

    def write(self, rows: Arrived | None, told: Mapping[str, Any]) -> None:
        """Append rows at once: all of them come into the file, or none.

        That is so when this returns, unless the disk stalls for longer than `STALL`; then they wait in memory.

        Parameters
        ----------
        rows : Arrived or None
            At least one row; None for a batch of notes only.
        told : mapping
            What is known now: plain values.

        Raises
        ------
        OSError
            The disk is full or gone. The file ends with the last whole batch, and nothing more is written.
        """
        width = 0 if self.announced is None else len(self.announced.columns)
        raw = [np.empty(0, k) if rows is None else getattr(rows, name) for name, k in _RAW.items()]
        values = np.empty((width, 0)) if rows is None else np.ascontiguousarray(rows.values.T)
        columns = [*raw, *values]
        batch = pa.RecordBatch.from_arrays([_array(c) for c in columns], schema=self._schema)
        note = json.dumps({**told, "check": _check(columns)}).encode()
        self._stream.write_batch(batch, custom_metadata={_KEY: note})
        self._append(0 if rows is None else rows.n)
        if time.monotonic() - self._synced > SYNC and (self._syncing is None or self._syncing.done()):
            if self._syncing is not None:
                self._syncing.result()
            self._syncing = self._syncer.submit(os.fsync, self._file)
            self._synced = time.monotonic()

    def settle(self) -> None:
        """Wait until everything is written.

        Raises
        ------
        OSError
            The disk is full or gone.
        """
        while self._writing:
            self._writing.popleft().result()

    def close(self) -> None:
        """Close the file; it needs no end."""
        self._writer.shutdown()
        self._syncer.shutdown()
        os.close(self._file)

    def _append(self, rows: int) -> None:
        data, self._sink.held = self._sink.held, bytearray()
        self._writing.append(self._writer.submit(self._put, data, rows))
        while self._writing:
            wait([self._writing[0]], STALL)
            if not self._writing[0].done():
                return
            self._writing.popleft().result()

    def _put(self, data: bytearray, rows: int) -> None:
        """Write a batch; after one that failed, none: there would be a hole."""
        if self._failed is not None:
            raise self._failed
        done = 0
        try:
            while done < len(data):
                done += os.write(self._file, memoryview(data)[done:])
        except OSError as error:
            self._failed = error
            os.ftruncate(self._file, self._whole)
            os.lseek(self._file, self._whole, os.SEEK_SET)
            raise
        self._whole += done
        self.rows += rows


def _array(column: NDArray[Any]) -> Any:
    """Return a column as Arrow has it; pa.array would load pandas first, while the line is not read."""
    whole = np.ascontiguousarray(column)
    return pa.Array.from_buffers(pa.from_numpy_dtype(whole.dtype), whole.size, [None, pa.py_buffer(whole)])


def _schema(announced: Announced) -> Any:
    """Arrow's types of the columns."""
    fields = [pa.field(name, pa.from_numpy_dtype(kind)) for name, kind in _RAW.items()]
    return pa.schema([*fields, *(pa.field(name, pa.float64()) for name in announced.columns)])


@dataclass(frozen=True)
class Part:
    """The content of a part.

    Attributes
    ----------
    path : Path
        The file.
    announced : Announced
        The device's announcement.
    about : Circumstances
        All else that was written at its beginning.
    n : int
        Rows of whole batches.
    told : list of dict
        The notes of each batch.
    dropped : int
        Bytes behind the last whole batch.
    """

    path: Path
    announced: Announced
    about: Circumstances
    n: int
    told: list[dict[str, Any]]
    dropped: int

    def blocks(self) -> Iterator[Arrived]:
        """Give the rows of whole batches in order, some at a time."""
        with pa.OSFile(str(self.path), "rb") as file:
            held: list[Arrived] = []
            for batch in islice(_batches(pa.ipc.open_stream(file), file), len(self.told)):
                if batch.rows is not None:
                    held.append(Arrived(self.announced, **batch.rows))
                if sum(rows.n for rows in held) >= BLOCK_ROWS:
                    yield Arrived.joined(held)
                    held = []
            if held:
                yield Arrived.joined(held)

    @property
    def rows(self) -> Arrived | None:
        """All rows of whole batches at once; None if there is none."""
        blocks = list(self.blocks())
        return Arrived.joined(blocks) if blocks else None


def read_part(path: Path) -> Part | None:
    """Read the whole batches of a part, whatever stands behind them.

    Parameters
    ----------
    path : Path
        File; it may be cut off anywhere.

    Returns
    -------
    Part or None
        None if not even its beginning is whole.

    Raises
    ------
    InputError
        The file is not a part of a recording, or a recording is still running.
    """
    with path.open("rb") as file:
        if fcntl is not None:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except OSError:
                raise InputError("this recording is still running", file=path, remedy="Stop it first.") from None
        size = path.stat().st_size
        with pa.OSFile(str(path), "rb") as data:
            return _read(path, data, size)


def _read(path: Path, data: Any, size: int) -> Part | None:
    """Check the beginning of a part, and count what whole batches stand behind it."""
    try:
        stream = pa.ipc.open_stream(data)
    except (pa.ArrowException, OSError):
        stream = None
    metadata = (stream.schema.metadata or {}) if stream is not None else {}
    if stream is None or _KEY not in metadata:
        if stream is None and _is_cut_off(path, size):
            return None
        raise InputError(
            "this is not a part of a recording",
            file=path,
            remedy=command("record", "imufit.devices.record.record") + " writes LOG.part while it runs.",
        )
    try:
        plain = json.loads(metadata[_KEY])
        version = plain.pop("version")
        if version != VERSION:
            raise InputError(
                f"this part was written by another version (form {version}, known is {VERSION})",
                file=path,
                remedy="Use the imufit that recorded it.",
            )
        said: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in plain.pop("announced").items()}
        announced = Announced(**said)
        about = Circumstances.from_json(plain)
        as_written = stream.schema.equals(_schema(announced))
    except InputError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError):
        as_written = False
    if not as_written:
        raise InputError("the beginning of this part is damaged", file=path, remedy="Record again.")
    n, told, whole = 0, [], int(data.tell())
    for batch in _batches(stream, data):
        n += batch.n
        told.append(batch.note)
        whole = batch.end
    return Part(path, announced, about, n, told, size - whole)


def _is_cut_off(path: Path, size: int) -> bool:
    """Whether a file without a whole beginning is nothing, zeros, or the beginning of an Arrow stream."""
    with path.open("rb") as file:
        start = file.read(4)
    return start == b"\xff\xff\xff\xff"[: len(start)] or not any(start) or size == 0


@dataclass(frozen=True)
class _Batch:
    """A whole batch: its columns, its notes, and its end."""

    n: int
    rows: dict[str, Any] | None
    note: dict[str, Any]
    end: int


def _batches(stream: Any, data: Any) -> Iterator[_Batch]:
    """Whole batches, up to the first that is not."""
    while True:
        try:
            batch, custom = stream.read_next_batch_with_custom_metadata()
            note = json.loads(custom[_KEY])
            columns = [np.asarray(column.to_numpy(zero_copy_only=False)) for column in batch.columns]
            if note.pop("check") != _check(columns):
                return
        except (StopIteration, pa.ArrowException, OSError, KeyError, TypeError, ValueError, AttributeError):
            return
        rows: dict[str, Any] | None = None
        if batch.num_rows:
            rows = {**dict(zip(_RAW, columns, strict=False)), "values": np.stack(columns[len(_RAW) :], axis=1)}
        yield _Batch(batch.num_rows, rows, note, int(data.tell()))


def _check(columns: Sequence[NDArray[Any]]) -> int:
    """CRC-32 of all columns."""
    check = 0
    for column in columns:
        check = zlib.crc32(np.ascontiguousarray(column).tobytes(), check)
    return check
