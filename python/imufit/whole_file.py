"""Files that are written whole or not at all: every file that imufit writes goes this way.

Output goes to a new file in the same folder, which takes the place of the old one when it is complete and on
the disk. A reader finds the old file or the new one, never a part; an error, a full disk or a crash leaves the old
one as it was. The name of the new file cannot be foreseen and nothing may stand there yet, so that no link leads the
writing elsewhere. Nothing is ever written through a hard link: its other names keep what they held.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import IO

_NAME_BYTES = 8
"""Random bytes in the name of the new file: 2**64 names are too many to be guessed or taken."""
_NAME_KEPT = 200
"""Characters of the file's own name in that of the new file: common file systems allow 255 bytes in all."""
_NEW = os.O_CREAT | os.O_EXCL | os.O_WRONLY
_FLAGS = _NEW | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[IO[bytes]]:
    """Open a file for writing that takes its place at `path` when the block ends without an exception.

    A symbolic link stays one: the file that it leads to is replaced. Mode and owner of a file that is replaced are
    kept, as far as that is allowed. A device, a pipe or a socket is written to directly.

    Parameters
    ----------
    path : str or Path
        The file; one that exists is replaced.

    Yields
    ------
    file
        Open for writing bytes.

    Raises
    ------
    OSError
        The file may not be written, its folder takes no new file, or the disk is full.
    """
    target = _target(Path(path))
    if target is None:
        with Path(path).open("wb") as direct:
            yield direct
        return
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
    new = target.with_name(f".{target.name[:_NAME_KEPT]}.{os.urandom(_NAME_BYTES).hex()}.new")
    try:
        with os.fdopen(os.open(new, _FLAGS, 0o666), "wb") as file:
            yield file
            file.flush()
            _take_over(file, target)
            os.fsync(file.fileno())
        new.replace(target)
    except OSError as error:
        # of the two names only the one that the user gave is informative
        if error.filename not in (None, str(new), new):
            raise
        raise type(error)(error.errno, error.strerror or str(error), str(path)) from None
    finally:
        with contextlib.suppress(OSError):
            new.unlink(missing_ok=True)
    _sync_folder(target.parent)


def write_text(path: str | Path, text: str) -> None:
    """Write a text as UTF-8, whole or not at all.

    Parameters
    ----------
    path : str or Path
        The file; one that exists is replaced.
    text : str
        What it will hold.

    Raises
    ------
    OSError
        As :func:`whole_file`.
    """
    with whole_file(path) as file:
        file.write(text.encode())


def identity(path: Path) -> tuple[int, int] | Path:
    """Return what two names have in common if, and only if, they are the same file.

    Device and number of a file that exists, whatever links lead to it; of one that does not exist yet its place.

    Parameters
    ----------
    path : Path
        Name of the file.
    """
    try:
        found = path.stat()
    except OSError:
        return Path(os.path.realpath(path))
    return found.st_dev, found.st_ino


def _target(path: Path) -> Path | None:
    """Return the file to be replaced, at the end of all links; None for anything that is not a file and stays."""
    try:
        # The system follows the links, and refuses those that it takes for a trap in a folder of everybody.
        if not stat.S_ISREG(path.stat().st_mode):
            return None
    except FileNotFoundError:
        pass
    # Links such as /dev/stdout name an open file: another one in its place would not be the one that is open.
    if path.absolute().parts[1:2] in (("dev",), ("proc",)):
        return None
    return Path(os.path.realpath(path))


def _take_over(file: IO[bytes], target: Path) -> None:
    """Give the new file the owner and the mode of the one that it replaces."""
    try:
        old = target.stat()
    except FileNotFoundError:
        return
    # not all systems have owners, and only some users may give a file to another
    with contextlib.suppress(OSError, AttributeError):
        os.fchown(file.fileno(), old.st_uid, old.st_gid)
    with contextlib.suppress(OSError, AttributeError):
        os.fchmod(file.fileno(), stat.S_IMODE(old.st_mode))


def _sync_folder(folder: Path) -> None:
    """Put the names in a folder on the disk, where that is known."""
    with contextlib.suppress(OSError):  # Windows opens no folders
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
