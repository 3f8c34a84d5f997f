"""Logs as NPZ: one array a column, read piece by piece from the archive."""

from __future__ import annotations

import lzma
import struct
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log.columns import GROUPS
from imufit.log.metadata import Metadata, mapping_from_json, write_sidecar
from imufit.whole_file import whole_file

_BATCH: Final = 65_536
_METADATA: Final = "metadata"
_BROKEN: Final = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    EOFError,
    ValueError,
    OSError,
    # what the header of an array says is read as Python: too deep, too large, no literal
    SyntaxError,
    MemoryError,
    RecursionError,
    OverflowError,
    TypeError,
    KeyError,
)
"""What the readers of archives and arrays raise about damaged bytes."""
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
            f"the archive is encrypted, or of a kind that is not known ({error})",
            file=self._path,
            remedy="Write it with numpy.savez or numpy.savez_compressed.",
        )

    def _add(self, entry: str, file: IO[bytes], lengths: dict[str, int]) -> None:
        name = entry.removesuffix(".npy")
        if name in lengths or (name == _METADATA and self.embedded):
            raise InputError("the array is there twice", file=self._path, column=name, remedy="Save each array once.")
        shape, fortran, dtype = _header(file)
        if dtype.kind not in "fiubUS":
            kind = "Python objects" if dtype.hasobject else f"values of type {dtype}"
            raise InputError(
                f"the array holds {kind}", file=self._path, column=name, remedy="Save it as numbers or text."
            )
        if shape == ():
            if name == _METADATA:
                text = str(np.frombuffer(file.read(dtype.itemsize), dtype)[0])
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
                for start in range(0, self.n, _BATCH):
                    rows = min(_BATCH, self.n - start)
                    pieces = {entry: _read(files[entry], member, rows) for entry, member in members.items()}
                    columns_of = {name: self._members[name] for name in columns}
                    yield start, rows, {name: _array(pieces[m.name][:, m.column]) for name, m in columns_of.items()}
        except InputError:
            raise
        except _BROKEN:
            raise self._unreadable() from None
        except _UNKNOWN as error:
            raise self._unknown(error) from None

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
    return np.frombuffer(data, member.dtype).reshape(rows, member.width)


def _array(column: NDArray[Any]) -> NDArray[Any]:
    if column.dtype.kind in "US":
        return column.astype(str).astype(object)
    return column.astype(np.float64)


def write_npz(path: Path, table: Mapping[str, NDArray[Any]], metadata: Metadata) -> None:
    """Write columns as NPZ, and the metadata into it and to the sidecar.

    Parameters
    ----------
    path : Path
        File to write.
    table : mapping
        Columns: (n,) float64, or (n,) object for text with None where there is none.
    metadata : Metadata
        Goes to the 0-d array ``metadata`` as JSON and to the sidecar.
    """
    if _METADATA in table:
        raise InputError(
            "an NPZ log cannot hold a column of that name", file=path, column=_METADATA, remedy="Rename it."
        )
    arrays = {**table, _METADATA: np.array(metadata.to_json())}
    with whole_file(path) as whole:
        with zipfile.ZipFile(whole, "w", zipfile.ZIP_STORED) as archive:
            for name, column in arrays.items():
                array = np.array(["" if cell is None else cell for cell in column], str) if _is_text(column) else column
                with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                    npy.write_array(file, np.asarray(array, order="C"), allow_pickle=False)
        whole.flush()
        write_sidecar(path, metadata)  # only when all columns found room


def _is_text(column: NDArray[Any]) -> bool:
    return bool(column.dtype == object)
