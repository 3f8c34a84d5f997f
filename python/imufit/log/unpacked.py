"""Text files that are compressed, or in UTF-16: unpacked to a file of their own for as long as they are read."""

from __future__ import annotations

import codecs
import gzip
import tempfile
import weakref
import zlib
from pathlib import Path
from typing import IO, Final

from imufit.errors import InputError
from imufit.log.csv import CsvSource
from imufit.log.size import size_in_words
from imufit.log.text import open_text
from imufit.log.transcript import TranscriptSource

COMPRESSED: Final = (".gz", ".zst")
_UTF_16: Final = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
LARGEST: Final = 64 << 30
"""Bytes of one unpacked text file: a day at 8 kHz has 50 GB. A longer one was made to fill a disk."""
_PIECE: Final = 1 << 20


def is_utf_16(path: Path) -> bool:
    """Whether a file begins as text in UTF-16 does."""
    with path.open("rb") as file:
        return file.read(2) in _UTF_16


def open_unpacked(path: Path) -> CsvSource | TranscriptSource:
    """Open a text file that ends in ``.gz`` or ``.zst``, or is in UTF-16.

    Unpacked files are deleted with the source.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    InputError
        It is damaged, or holds no text that is a log.
    """
    place = tempfile.TemporaryDirectory(prefix="imufit-")
    compressed = path.suffix.lower() in COMPRESSED
    file = Path(place.name) / (path.stem if compressed else path.name)
    try:
        with file.open("wb") as out:
            if compressed:
                with _opened(path) as packed:
                    copy_bounded(packed, out, LARGEST, path)
            else:
                with path.open(encoding="utf-16", newline="") as text:
                    while piece := text.read(_PIECE):
                        out.write(piece.encode())
        if file.stat().st_size == 0:
            raise InputError("the file is empty", file=path, remedy="Record or copy it again.")
        source = open_text(file)
    except InputError as error:
        raise InputError(
            error.problem, file=path, row=error.row, column=error.column, line=error.line, remedy=error.advice
        ) from None
    except (zlib.error, EOFError, OSError, ValueError) as error:
        raise damaged(path, error) from None
    weakref.finalize(source, place.cleanup)
    return source


def _opened(path: Path) -> IO[bytes]:
    if path.suffix.lower() == ".gz":
        return gzip.open(path)  # type: ignore[return-value]
    import pyarrow as pa  # noqa: PLC0415  heavy, and only needed here

    return pa.input_stream(str(path), compression="zstd")  # type: ignore[no-any-return]


def copy_bounded(packed: IO[bytes], out: IO[bytes], most: int, path: Path) -> None:
    """Write what is unpacked, up to a bound: a small archive may hold any amount.

    Parameters
    ----------
    packed, out : file
        Open for reading and for writing bytes.
    most : int
        Bound, bytes.
    path : Path
        File to name in errors.

    Raises
    ------
    InputError
        It is more.
    """
    size = 0
    while piece := packed.read(_PIECE):
        size += len(piece)
        if size > most:
            raise InputError(f"the file holds more than {size_in_words(most)}", file=path, remedy="Split it.")
        out.write(piece)


def damaged(path: Path, error: Exception) -> InputError:
    """Return the error for an archive that cannot be unpacked.

    Parameters
    ----------
    path : Path
        Archive.
    error : Exception
        The error of its library.
    """
    return InputError(f"the file is cut off, damaged or encrypted ({error})", file=path, remedy="Copy it again.")
