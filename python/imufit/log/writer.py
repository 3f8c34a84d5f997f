"""A log that is written row group by row group, and is there whole or not at all."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import IO, Any, Final, Protocol

import pyarrow as pa
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log.csv import CsvRows
from imufit.log.metadata import Metadata, check_sidecar, sidecar_path, sidecar_text
from imufit.log.npz import NpzRows
from imufit.log.parquet import ParquetRows
from imufit.whole_file import whole_file, write_text

Table = Mapping[str, NDArray[Any]]
"""Columns by name: (n,) float64, or (n,) object for text with None where there is none."""


class _Rows(Protocol):
    def __init__(self, file: IO[bytes], path: Path, metadata: Metadata) -> None: ...

    def add(self, table: Table) -> None: ...

    def finish(self) -> None: ...

    def abandon(self) -> None: ...


_FORMATS: Final[dict[str, type[_Rows]]] = {".parquet": ParquetRows, ".npz": NpzRows, ".csv": CsvRows}


def write_rows(path: Path, metadata: Metadata, tables: Iterable[Table]) -> None:
    """Write a log; what stands at its place is replaced once all of it is on the disk.

    Parameters
    ----------
    path : Path
        Log to write; its suffix decides on Parquet, NPZ or CSV.
    metadata : Metadata
        Goes into Parquet and NPZ, and for NPZ and CSV to the sidecar ``NAME.toml``. A sidecar beside Parquet is written
        anew, since it would overrule the file.
    tables : iterable of mapping
        Rows, some at a time and at least once; all have the same columns.

    Raises
    ------
    InputError
        The suffix is not a log's, the disk is full, or another file would be overwritten. No log is there then.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in _FORMATS:
        raise InputError(
            f"logs are not written as {suffix or 'a file without suffix'}",
            file=path,
            remedy="Write .parquet, .npz or .csv.",
        )
    check_sidecar(path)
    try:
        with whole_file(path) as file:
            _write(_FORMATS[suffix](file, path, metadata), tables, suffix, path)
            if suffix != ".parquet" or sidecar_path(path).exists():
                file.flush()
                write_text(sidecar_path(path), sidecar_text(metadata))  # only when all rows found room
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error})", file=path) from None


def _write(rows: _Rows, tables: Iterable[Table], suffix: str, path: Path) -> None:
    try:
        for table in tables:
            _check(table, suffix, path)
            rows.add(table)
        rows.finish()
    except BaseException:
        with contextlib.suppress(OSError, ValueError, pa.ArrowException):
            rows.abandon()
        raise


def _check(table: Table, suffix: str, path: Path) -> None:
    """Refuse what a format cannot hold."""
    if suffix == ".npz" and "metadata" in table:
        raise InputError(
            "an NPZ log cannot hold a column of that name", file=path, column="metadata", remedy="Rename it."
        )
    if suffix != ".csv":
        return
    for name, column in table.items():
        if column.dtype == object and any(cell is not None and ("\n" in cell or "\r" in cell) for cell in column):
            raise InputError(
                "CSV cannot hold line breaks in text", file=path, column=name, remedy="Write .parquet or .npz."
            )
