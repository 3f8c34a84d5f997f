"""A log that is written row group by row group, and is there whole or not at all."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final, Protocol

from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log.csv import CsvRows
from imufit.log.metadata import Metadata, check_sidecar, sidecar_path, sidecar_text
from imufit.log.npz import NpzRows
from imufit.log.parquet import ParquetRows

Table = Mapping[str, NDArray[Any]]
"""Columns by name: (n,) float64, or (n,) object for text with None where there is none."""


class _Rows(Protocol):
    def __init__(self, path: Path, metadata: Metadata) -> None: ...

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
        The suffix is no log's, the disk is full, or another file would be overwritten. No log is there then.
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
    target = Path(os.path.realpath(path))
    new = target.with_name(f".{target.stem}.new{suffix}")
    rows: _Rows | None = None
    try:
        rows = _FORMATS[suffix](new, metadata)
        for table in tables:
            _check(table, suffix, path)
            rows.add(table)
        rows.finish()
        rows = None
        _settle(new)
        if suffix != ".parquet" or sidecar_path(path).exists():
            sidecar_path(new).write_text(sidecar_text(metadata), encoding="utf-8")
            sidecar_path(new).replace(sidecar_path(path))
        new.replace(target)
        _settle_directory(target.parent)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error})", file=path) from None
    finally:
        if rows is not None:
            with contextlib.suppress(OSError):
                rows.abandon()
        for left in (new, sidecar_path(new)):
            with contextlib.suppress(OSError):
                left.unlink(missing_ok=True)


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


def _settle(path: Path) -> None:
    """Put a file on the disk."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def _settle_directory(directory: Path) -> None:
    """Put the names in a directory on the disk, where that is known."""
    with contextlib.suppress(OSError):  # Windows opens no directories
        handle = os.open(directory, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
