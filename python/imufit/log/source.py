"""The interface of every file format, and the format of a file."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Protocol, runtime_checkable

from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.formats import Recording
from imufit.formats.find import recording_of
from imufit.log.folder import recording_of_folder, recording_of_zip
from imufit.log.npz import NpzSource
from imufit.log.parquet import ParquetSource
from imufit.log.rows_of_kinds import recording_of_instances, recording_of_kinds
from imufit.log.tables import TablesSource
from imufit.log.text import TEXT_SUFFIXES, looks_like_text, open_text
from imufit.log.unpacked import COMPRESSED, is_utf_16, open_unpacked
from imufit.remedy import command, recovering

SUFFIXES: Final = (".parquet", ".npz", *TEXT_SUFFIXES)

Block = tuple[int, int, dict[str, NDArray[Any]]]
"""First row, number of rows, and columns: (n,) float64 for numbers, (n,) object for text."""


class Source(Protocol):
    """A table in a file, read block by block as often as wanted."""

    @property
    def names(self) -> tuple[str, ...]:
        """Columns of the file, each once."""
        ...

    @property
    def n(self) -> int:
        """Number of rows; for text files known after the first `scan`."""
        ...

    @property
    def text(self) -> frozenset[str]:
        """Columns that hold text; for text files known after the first `scan`."""
        ...

    @property
    def embedded(self) -> Mapping[str, Any]:
        """Metadata inside the file."""
        ...

    @property
    def truths(self) -> Mapping[str, tuple[int | None, str]]:
        """First row with a truth value, and that value, of each column that has one; of text as far as scanned."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """Findings of the reader."""
        ...

    @property
    def clues(self) -> tuple[str, ...]:
        """Marks of its maker; see `imufit.log.makers.maker_of`."""
        ...

    def scan(self, columns: Sequence[str]) -> Iterator[Block]:
        """First pass over the file, with the named columns only (the time)."""
        ...

    def blocks(self, columns: Sequence[str]) -> Iterator[Block]:
        """Pass over the file, with the named columns."""
        ...

    def line_of(self, row: int) -> int | None:
        """Line of the file, from 1, of a data row; None for binary files."""
        ...


@runtime_checkable
class SeekingSource(Source, Protocol):
    """A source of which any rows can be read without those before them."""

    @property
    def seeks(self) -> bool:
        """Whether that is fast."""
        ...

    def blocks_between(self, columns: Sequence[str], first: int, stop: int) -> Iterator[Block]:
        """Give rows ``first <= row < stop`` with the named columns, block by block."""
        ...


_ARRAYS: Final[Mapping[str, Callable[[Path], Source]]] = {".parquet": ParquetSource, ".npz": NpzSource}
"""Formats of logs that are identified by their suffix."""


def open_source(path: Path) -> Source:
    """Open a log: Parquet and NPZ by their suffix, other programs' files and text by their content, folders as one log.

    Raises
    ------
    InputError
        The file is missing, empty, damaged or of no known format.
    """
    if not path.exists():
        raise InputError(f"the file {path} does not exist", file=path, remedy="Check the name.")
    try:
        suffix = "" if path.is_dir() else path.suffix.lower()
        if not path.is_dir() and path.stat().st_size == 0:
            raise InputError("the file is empty (0 bytes)", file=path, remedy="Record or copy it again.")
        if re.fullmatch(r"\.part\d*", suffix):
            raise InputError("this is the part of a running or killed recording", file=path, remedy=recovering(path))
        if suffix in _ARRAYS:
            return _ARRAYS[suffix](path)
        if (found := _recording(path)) is not None:
            return TablesSource(path, found)
        if suffix in COMPRESSED or is_utf_16(path):
            return open_unpacked(path)
        if suffix not in SUFFIXES and not looks_like_text(path):
            raise InputError(
                f"the suffix {suffix or '(none)'} is not a log's, and the file is not text",
                file=path,
                remedy=f"Logs are {', '.join(SUFFIXES)}: export it as text, of which "
                + command("convert", "imufit.read")
                + " makes a log.",
            )
        if (found := recording_of_kinds(path)) is not None:
            return TablesSource(path, found)
        text = open_text(path)
        split = recording_of_instances(path, text)
        return text if split is None else TablesSource(path, split)
    except OSError as error:
        raise InputError(f"the file cannot be read ({error.strerror or error})", file=path) from None


def _recording(path: Path) -> Recording | None:
    """Read what is held in memory as a whole: another program's file, a folder or an archive of text files."""
    found = recording_of(path)
    if found is None and path.is_dir():
        return recording_of_folder(path)
    return recording_of_zip(path) if found is None and path.suffix.lower() == ".zip" else found
