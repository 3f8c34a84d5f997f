"""TOML files that end in a mark: a file that was cut off, at whatever byte, is refused and not used in part.

A cut leaves valid TOML more often than not: ``x = 0.35`` becomes ``x = 0.3``, a table a shorter table.
The first line of a file that imufit writes is therefore ``last = "[end]"``, and the last ones are::

    [end]
    complete = true

Without them such a file is refused. Values may be edited by hand: nothing counts or sums them. A file that was written
by hand needs neither, but has to end with a whole line; its reader checks that it is complete.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from imufit.errors import InputError
from imufit.log.documents import table_from_toml
from imufit.whole_file import write_text

LAST = "last"
"""Key at the begin of a file that ends in the mark."""
END = "end"
"""Table at the end of a file that is whole."""
COMPLETE = {"complete": True}
"""Its content."""
MARK = [f"[{END}]", "complete=true"]
"""The last two lines, without spaces."""
AGAIN = "Copy or save it again."
HOW_TO_END = "If nothing is missing, end it with the lines [end] and complete = true."


def toml_text(document: Mapping[str, Any]) -> str:
    """Return the text of a TOML file with the mark at its end.

    Parameters
    ----------
    document : mapping
        The content of the file.
    """
    return tomli_w.dumps({LAST: f"[{END}]", **document, END: COMPLETE})


def write_toml(path: str | Path, document: Mapping[str, Any]) -> None:
    """Write a TOML file with the mark at its end, whole or not at all.

    Parameters
    ----------
    path : str or Path
        The file; one that exists is replaced.
    document : mapping
        What it will hold.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    try:
        write_text(path, toml_text(document))
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error})", file=path) from None


def read_toml(path: str | Path, what: str) -> tuple[dict[str, Any], bool]:
    """Read a TOML file, and whether it ends in the mark.

    Parameters
    ----------
    path : str or Path
        The file.
    what : str
        What it is, for messages: "the model".

    Returns
    -------
    tuple
        What it holds without the mark, and whether the mark is there.

    Raises
    ------
    InputError
        The file cannot be read, is not TOML, holds nothing, or ends within the mark; or it has no mark and ends within
        a line, which may be incomplete.
    """
    file = Path(path)
    try:
        document = table_from_toml(file, f"Name {what} here, a TOML file. If it is cut off: {AGAIN.lower()}")
        text = file.read_bytes().decode("utf-8")
    except OSError as error:
        raise InputError(f"{what} cannot be read ({error.strerror})", file=file, remedy="Check the name.") from None
    if not document:
        raise InputError(f"{what} is empty", file=file, remedy=AGAIN)
    marked = END in document
    if document.pop(LAST, None) is not None and not marked:
        raise InputError("the file is cut off: its last lines are missing", file=file, remedy=AGAIN)
    if marked and document.pop(END) != COMPLETE:
        raise InputError("the file is cut off: its table [end] does not hold complete = true", file=file, remedy=AGAIN)
    if marked and _last_lines(text) != MARK:
        raise InputError("text follows the table [end]", file=file, remedy="Move [end] to the end.")
    if not marked and not text.endswith("\n"):
        raise InputError("the last line does not end: the file may be cut off", file=file, remedy=HOW_TO_END)
    return document, marked


def _last_lines(text: str) -> list[str]:
    """Return the last two lines that hold more than a comment, without spaces."""
    lines = ("".join(line.split("#")[0].split()) for line in text.splitlines())
    return [line for line in lines if line][-2:]
