"""Logs as NPZ: one array a column, read piece by piece from the archive."""

from __future__ import annotations

import lzma
import shutil
import struct
import tempfile
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
import pyarrow as pa
from numpy.lib import format as npy
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.formats.unicode_text import unicode_only
from imufit.log.columns import GROUPS
from imufit.log.metadata import Metadata, mapping_from_json
from imufit.log.size import BLOCK, LONGEST_TEXT, NUMBER, TEXT_CELL, rows_at_once, size_in_words
from imufit.log.text_cells import cells_of

_METADATA: Final = "metadata"
_BROKEN: Final = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    EOFError,
    ValueError,
    OSError,
    # the header of an array is read as Python: too deep, too large, no literal
    SyntaxError,
    tokenize.TokenError,
    MemoryError,
    RecursionError,
    OverflowError,
    TypeError,
    KeyError,
)
"""Errors of the readers of archives and arrays about damaged bytes."""
_UNKNOWN: Final = (NotImplementedError, RuntimeError)
"""... and about a compression, a version or an encryption that they do not know."""


@dataclass(frozen=True)
class _Member:
    """One array of the archive; `column` picks one of an (n, k) array, else it is None."""

    name: str
    dtype: np.dtype[Any]
    width: int
    column: int


class NpzSource:
    """An NPZ file as a source of blocks.

    Columns are arrays (n,) under their own names, or groups (n, 3) and (n, 4) named ``acc``, ``gyr``, ``mag``,
    ``ref_q`` and ``ref_p``.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.notes: tuple[str, ...] = ()
        self.embedded: Mapping[str, Any] = {}
        self.truths: dict[str, tuple[int | None, str]] = {}
        self._members: dict[str, _Member] = {}
        self.n = 0
        lengths: dict[str, int] = {}
        try:
            with zipfile.ZipFile(path) as archive:
                for entry in archive.namelist():
                    with archive.open(entry) as file:
                        self._add(entry, file, lengths)
        except InputError:
            raise
        except _BROKEN:
            raise self._unreadable() from None
        except _UNKNOWN as error:
            raise self._unknown(error) from None
        self.names: tuple[str, ...] = tuple(self._members)
        self.clues = (path.name, *self.names)
        self.n = lengths.get("t", max(lengths.values(), default=0))
        for name, length in lengths.items():
            if length != self.n:
                raise InputError(
                    f"the array has {length} rows, but the log has {self.n}",
                    file=path,
                    column=name,
                    remedy="Write one row a sample.",
                )

    def _unknown(self, error: Exception) -> InputError:
        return InputError(
            f"the archive is encrypted, or of an unknown kind ({error})",
            file=self._path,
            remedy="Write it with numpy.savez or numpy.savez_compressed.",
        )

    def _add(self, entry: str, file: IO[bytes], lengths: dict[str, int]) -> None:
        name = entry.removesuffix(".npy")
        if name in lengths or (name == _METADATA and self.embedded):
            raise InputError("the array is stored twice", file=self._path, column=name, remedy="Save each array once.")
        shape, fortran, dtype = _header(file)
        if dtype.kind not in "fiubUS":
            kind = "Python objects" if dtype.hasobject else f"values of type {dtype}"
            raise InputError(
                f"the array holds {kind}", file=self._path, column=name, remedy="Save it as numbers or text."
            )
        most = BLOCK if shape == () else LONGEST_TEXT
        if dtype.itemsize > most:
            raise InputError(
                f"the array holds {size_in_words(dtype.itemsize)} of text a value: too much to be labels",
                file=self._path,
                column=name,
                remedy="Save the log without this array.",
            )
        if shape == ():
            if name == _METADATA:
                text = str(_values(file.read(dtype.itemsize), dtype)[0])
                self.embedded = mapping_from_json(text, self._path)
            return
        columns = GROUPS.get(name, ())
        if len(shape) == 1:
            made = {name: _Member(entry, dtype, 1, 0)}
        elif len(shape) == 2 and shape[1] == len(columns) and not fortran:
            made = {column: _Member(entry, dtype, shape[1], i) for i, column in enumerate(columns)}
        else:
            wanted = f"(n, {len(columns)}) in C order" if columns else "(n,)"
            raise InputError(
                f"the array has shape {shape}, but {wanted} is wanted",
                file=self._path,
                column=name,
                remedy=f"Save np.ascontiguousarray({name}).",
            )
        for column in made:
            if column in self._members:
                group = next(key for key, names in GROUPS.items() if column in names)
                raise InputError(
                    f"the column stands in the array {group} and in the array {column}",
                    file=self._path,
                    column=column,
                    remedy="Save only one of them: which one holds is not to be guessed.",
                )
        self._members |= made
        lengths[name] = int(shape[0])
        if dtype.kind == "b":
            self.truths |= dict.fromkeys(made, (None, ""))

    def _unreadable(self) -> InputError:
        with self._path.open("rb") as file:
            start = file.read(2)
        if start == b"PK":
            return InputError("the file is cut off or damaged", file=self._path, remedy="Copy or record it again.")
        return InputError("this is not an NPZ file", file=self._path, remedy="Check the suffix.")

    def scan(self, columns: Sequence[str]) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """Give the named columns block by block."""
        yield from self.blocks(columns)

    def blocks(self, columns: Sequence[str]) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """Give the named columns block by block."""
        members = {self._members[name].name: self._members[name] for name in columns}
        try:
            with zipfile.ZipFile(self._path) as archive, ExitStack() as stack:
                files = {entry: stack.enter_context(archive.open(entry)) for entry in members}
                for file in files.values():
                    _header(file)
                at_once = self._rows_at_once(columns)
                for start in range(0, self.n, at_once):
                    rows = min(at_once, self.n - start)
                    pieces = {entry: _read(files[entry], member, rows) for entry, member in members.items()}
                    columns_of = {name: self._members[name] for name in columns}
                    yield start, rows, {name: _array(pieces[m.name][:, m.column]) for name, m in columns_of.items()}
        except InputError:
            raise
        except _BROKEN:
            raise self._unreadable() from None
        except _UNKNOWN as error:
            raise self._unknown(error) from None

    def _rows_at_once(self, columns: Sequence[str]) -> int:
        members = [self._members[name] for name in columns]
        stored = sum(member.width * member.dtype.itemsize for member in {m.name: m for m in members}.values())
        made = sum(TEXT_CELL if member.dtype.kind in "US" else NUMBER for member in members)
        return rows_at_once(stored + made)

    @property
    def text(self) -> frozenset[str]:
        """Columns that hold text."""
        return frozenset(name for name, member in self._members.items() if member.dtype.kind in "US")

    def line_of(self, row: int) -> int | None:
        """Binary files have no lines."""
        return None


def _header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Read shape, order and type of an array, and stop at its first value."""
    version = npy.read_magic(file)
    return npy.read_array_header_1_0(file) if version == (1, 0) else npy.read_array_header_2_0(file)


def _read(file: IO[bytes], member: _Member, rows: int) -> NDArray[Any]:
    size = rows * member.width * member.dtype.itemsize
    data = file.read(size)
    if len(data) != size:
        raise EOFError
    return _values(data, member.dtype).reshape(rows, member.width)


def _values(data: bytes, dtype: np.dtype[Any]) -> NDArray[Any]:
    return unicode_only(np.frombuffer(data, dtype))


def _array(column: NDArray[Any]) -> NDArray[Any]:
    if column.dtype.kind in "US":
        return cells_of(pa.array(column.astype(str).tolist(), pa.string()))
    return column.astype(np.float64)


class NpzRows:
    """Writes columns as NPZ: an archive takes one column after the other, so that rows wait in files beside it.

    Parameters
    ----------
    file : file
        Open for writing bytes.
    path : Path
        Its place, beside which the columns wait for the last row.
    metadata : Metadata
        Goes to the 0-d array ``metadata`` as JSON.
    """

    def __init__(self, file: IO[bytes], path: Path, metadata: Metadata) -> None:
        self._file = file
        self._metadata = metadata
        self._waiting = tempfile.TemporaryDirectory(prefix=f".{path.stem}.", dir=path.parent)
        self._files: dict[str, IO[bytes]] = {}
        self._longest: dict[str, int] = {}
        self._n = 0

    def add(self, table: Mapping[str, NDArray[Any]]) -> None:
        """Keep rows.

        Parameters
        ----------
        table : mapping
            Columns: (n,) float64, or (n,) object for text with None where there is none; the same every time.
        """
        if not self._files:
            for number, name in enumerate(table):
                self._files[name] = (Path(self._waiting.name) / str(number)).open("w+b")
        for name, column in table.items():
            if column.dtype == object:
                words = np.array(["" if cell is None else cell for cell in column], str)
                self._longest[name] = max(self._longest.get(name, 1), words.dtype.itemsize // 4)
                npy.write_array(self._files[name], words, allow_pickle=False)
            else:
                self._files[name].write(np.ascontiguousarray(column, np.float64).data)
        self._n += len(next(iter(table.values())))

    def finish(self) -> None:
        """Write the archive."""
        with zipfile.ZipFile(self._file, "w", zipfile.ZIP_STORED) as archive:
            for name, file in self._files.items():
                longest = self._longest.get(name)
                dtype = np.dtype(np.float64 if longest is None else f"U{longest}")
                with archive.open(f"{name}.npy", "w", force_zip64=True) as out:
                    shape = {"descr": npy.dtype_to_descr(dtype), "fortran_order": False, "shape": (self._n,)}
                    npy.write_array_header_1_0(out, shape)
                    end = file.tell()
                    file.seek(0)
                    while longest is not None and file.tell() < end:
                        out.write(npy.read_array(file, allow_pickle=False).astype(dtype).tobytes())
                    shutil.copyfileobj(file, out)
                file.close()
            with archive.open(f"{_METADATA}.npy", "w", force_zip64=True) as out:
                npy.write_array(out, np.array(self._metadata.to_json()), allow_pickle=False)
        self._waiting.cleanup()

    def abandon(self) -> None:
        """Delete what waits."""
        for file in self._files.values():
            file.close()
        self._waiting.cleanup()
