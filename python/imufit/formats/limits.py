"""How much of a file of another program is read: memory and time stay bounded, whatever the file declares."""

from __future__ import annotations

import bz2
import io
from pathlib import Path
from typing import Any, Final

from imufit.errors import InputError

VALUES: Final = 50_000_000
"""Values of all columns together: as float64 they are 400 MB, which leaves room for a second copy within 1 GB."""
WHOLE: Final = 256_000_000
"""Bytes of a file that its library holds in memory as a whole, beside the columns: with `VALUES` within 1 GB."""
PARSED: Final = 30_000_000
"""Bytes of a file that becomes Python objects: ``[],`` was measured at 84 bytes of memory for 3 of the file."""
STREAMED: Final = 20_000_000_000
"""Bytes of a file that is read message by message: an hour with two cameras; more takes longer than anyone waits."""
RATIO: Final = 100
"""Bytes unpacked for one byte packed: sheets of constant numbers were measured at 30, readings at 1 to 5."""
UNSUSPECTED: Final = 20_000_000
"""Unpacked bytes that every file may have: a second of work for the slowest of the libraries."""
LIST: Final = 16
"""Members of a list that become columns: a 4 by 4 matrix of a pose."""
TEXT: Final = 100
"""Characters of a text in a cell: a label or the name of a mode; longer ones are messages to people."""
COLUMNS: Final = 4096
"""Columns of a table: the widest message of PX4 that was met has 100, its bound for one message 65 kB."""


def check_size(path: Path, most: int) -> int:
    """Return the size of a file in bytes, refused where it has more than `most`."""
    size = path.stat().st_size
    if size > most:
        raise InputError(
            f"the file has {size / 1e6:.0f} MB, but at most {most / 1e6:.0f} MB of this format can be read",
            file=path,
            remedy="Write the part that you need to a file of its own.",
        )
    return size


def check_values(path: Path, values: int) -> None:
    """Refuse a file that has, or declares, more values than fit into memory."""
    if values > VALUES:
        raise InputError(
            f"the file declares more than {VALUES:,} values, which do not fit into memory",
            file=path,
            remedy="Write the part that you need to a file of its own.",
        )


def check_expansion(path: Path, packed: int, unpacked: int, most: int = WHOLE) -> None:
    """Refuse packed data that unpacks to more than `most` bytes, or to more than readings can."""
    if unpacked > most or unpacked > max(UNSUSPECTED, RATIO * packed):
        raise InputError(
            f"the file would unpack from {packed / 1e6:.3g} MB to more than {unpacked / 1e6:.0f} MB",
            file=path,
            remedy="Write the part that you need to a file of its own, without compression.",
        )


def unpacked(compression: str, data: bytes, most: int) -> bytes:
    """Unpack a block, at most `most` bytes of it; of a block that is cut off what could be unpacked.

    Parameters
    ----------
    compression : str
        ``bz2``, ``lz4``, ``zstd``, or empty or ``none``.
    data : bytes
        The packed block.
    most : int
        Bytes that its file declares.

    Returns
    -------
    bytes
        Never more than `most`, whatever the block holds.
    """
    if compression in ("", "none"):
        return data[:most]
    if most == 0:
        return b""
    if compression == "bz2":
        return bz2.BZ2Decompressor().decompress(data, max_length=most)
    if compression == "lz4":
        import lz4.frame  # noqa: PLC0415 - comes with the libraries of the two formats that use the compression

        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=most))
    if compression == "zstd":
        import zstandard  # noqa: PLC0415 - as above

        stream: Any = zstandard.ZstdDecompressor().stream_reader(io.BytesIO(data))
        return bytes(stream.read(most))
    raise ValueError(f"the compression {compression} is not known")
