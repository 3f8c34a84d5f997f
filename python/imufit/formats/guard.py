"""A foreign library at work: nothing of what it prints or raises reaches the user."""

from __future__ import annotations

import contextlib
import importlib
import io
import logging
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from imufit.errors import InputError


class _Nowhere(io.TextIOBase):
    """Takes what a library prints; a damaged file can make it print a line a byte, so nothing is kept."""

    def write(self, text: str) -> int:
        return len(text)


def library(name: str, extra: str, path: Path, form: str) -> Any:
    """Import the library that reads a format.

    Parameters
    ----------
    name : str
        Its module.
    extra : str
        The optional dependency of imufit that installs it.
    path : Path
        The file that needs it, for the message.
    form : str
        The format in words.

    Returns
    -------
    module

    Raises
    ------
    InputError
        It is not installed; the remedy is the line that installs it.
    """
    try:
        with _quiet():
            return importlib.import_module(name)
    except ImportError:
        raise InputError(
            f"reading {form} needs the package {name.partition('.')[0]}, which is not installed",
            file=path,
            remedy=f"Install it with: pip install 'imufit[{extra}]'.",
        ) from None


@contextlib.contextmanager
def guarded(path: Path, form: str) -> Iterator[None]:
    """Run a library on a file: silent, and with every failure as an `InputError`.

    Parameters
    ----------
    path : Path
        The file.
    form : str
        The format in words.

    Raises
    ------
    InputError
        The file cannot be read.
    """
    try:
        with _quiet():
            yield
    except InputError:
        raise
    except MemoryError:
        raise InputError(f"the {form} declares more than fits into memory", file=path) from None
    except FileNotFoundError:
        raise InputError("the file does not exist", file=path) from None
    except IsADirectoryError:
        raise InputError("this is a folder, not a file", file=path) from None
    except PermissionError:
        raise InputError("the file may not be read", file=path) from None
    except Exception as error:  # a library on damaged bytes raises whatever its code happens to run into
        reason = " ".join(str(error).replace(str(path), path.name).split()) or type(error).__name__
        raise InputError(
            f"the file is cut off or damaged, or not of the format {form}: its reader says: {reason[:200]}",
            file=path,
            remedy="Copy the file again from where it was recorded, or export it as CSV.",
        ) from None


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with (
            contextlib.redirect_stdout(_Nowhere()),
            contextlib.redirect_stderr(_Nowhere()),
            warnings.catch_warnings(),
            np.errstate(all="ignore"),
        ):
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)
