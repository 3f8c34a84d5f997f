"""Folders and archives of text files, one file a sensor, as phones and loggers write them."""

from __future__ import annotations

import tempfile
import zipfile
import zlib
from pathlib import Path, PurePosixPath
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.formats import Recording, Table
from imufit.log.csv import CsvSource
from imufit.log.tables import too_large
from imufit.log.text import TEXT_SUFFIXES, looks_like_text, open_text
from imufit.log.transcript import TranscriptSource
from imufit.log.unpacked import copy_bounded, damaged

LARGEST: Final = 500 << 20
"""Bytes of all text files of a folder: as numbers they take about as much, and are held at once."""
MOST_FILES: Final = 200
"""Text files of a folder: loggers write some twenty."""


def recording_of_folder(path: Path) -> Recording:
    """Read the text files of a folder, a table each.

    Parameters
    ----------
    path : Path
        Folder.

    Raises
    ------
    InputError
        A table is missing in it, or it exceeds the memory.
    """
    files = sorted(file for file in path.iterdir() if file.is_file() and file.suffix.lower() in TEXT_SUFFIXES)
    return _recording(path, "folder of text files", files)


def recording_of_zip(path: Path) -> Recording:
    """Read the text files of a zip archive, a table each.

    Parameters
    ----------
    path : Path
        Archive.

    Raises
    ------
    InputError
        It is damaged or encrypted, has no table, or more than can be held in memory.
    """
    with tempfile.TemporaryDirectory(prefix="imufit-") as place:
        files = []
        try:
            with zipfile.ZipFile(path) as archive:
                members = [m for m in archive.infolist() if not m.is_dir() and _is_text(m.filename)]
                if (size := sum(member.file_size for member in members)) > LARGEST:
                    raise too_large(path, size)
                for k, member in enumerate(members[:MOST_FILES]):
                    file = Path(place) / str(k) / PurePosixPath(member.filename).name
                    file.parent.mkdir()
                    with archive.open(member) as packed, file.open("wb") as out:
                        copy_bounded(packed, out, LARGEST, path)
                    files.append(file)
        except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError) as error:
            if isinstance(error, InputError):
                raise
            raise damaged(path, error) from None
        return _recording(path, "archive of text files", files)


def _is_text(name: str) -> bool:
    member = PurePosixPath(name)
    return member.suffix.lower() in TEXT_SUFFIXES and not any(part.startswith((".", "__")) for part in member.parts)


def _recording(path: Path, form: str, files: list[Path]) -> Recording:
    if (size := sum(file.stat().st_size for file in files)) > LARGEST:
        raise too_large(path, size)
    tables: list[Table] = []
    notes: list[str] = []
    clues: list[str] = []
    for file in files[:MOST_FILES]:
        if file.stat().st_size == 0 or not looks_like_text(file):
            continue
        try:
            source = open_text(file)
            columns = columns_of(source)
        except InputError as error:
            notes.append(f"{path.name}: {file.name} left out: {error.problem}")
            continue
        tables.append(Table(file.stem, columns))
        clues += source.clues
        if tables[-1].n == 1:
            clues += [f"{file.stem}.{name}={_cell(cells[0])}" for name, cells in columns.items()]
    if len(files) > MOST_FILES:
        notes.append(f"{path.name}: {len(files) - MOST_FILES} of {len(files)} text files left out")
    if not tables:
        raise InputError(f"the {form} does not hold a table", file=path, remedy="Name a file that holds samples.")
    return Recording(form, tuple(tables), tuple(notes), clues=tuple(clues))


def _cell(cell: Any) -> str:
    """Text of a cell; truth values are kept as numbers."""
    return f"{cell:g}" if isinstance(cell, float) else str(cell)


def columns_of(source: CsvSource | TranscriptSource) -> dict[str, NDArray[Any]]:
    """All columns of a text table, in memory.

    Parameters
    ----------
    source : CsvSource or TranscriptSource
        The file.

    Raises
    ------
    InputError
        It is a transcript.
    """
    if isinstance(source, TranscriptSource):
        raise InputError("a transcript without a table")
    pieces: dict[str, list[NDArray[Any]]] = {name: [] for name in source.names}
    for _, _, _ in source.scan([]):
        pass
    for _, _, block in source.blocks(source.names):
        for name, values in block.items():
            pieces[name].append(values)
    return {name: np.concatenate(parts) if parts else np.empty(0) for name, parts in pieces.items()}
