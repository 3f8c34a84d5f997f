"""TOML and JSON that a person or another program wrote, as nested tables that can be worked with."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from imufit.errors import InputError
from imufit.printable import NAME, printable

DEEPEST: Final = 32
"""Tables within tables; a model file has three, and Python's own limit for what walks through them is 1000."""
LARGEST_INTEGER: Final = 64
"""Bits of an integer, those of TOML and of every counter: what is longer may not even become a float."""
LARGEST_FILE: Final = 16 << 20
"""Bytes of a document, 16 MB: the largest JSON of a diagnosis has 1 MB."""

LONGEST_LINE: Final = 16_384
"""Characters of a line of TOML: the parser needs memory with the square of the parts of a dotted key. That is under
100 MB here, and was 2.4 GB at 200,000 characters. The longest line that imufit writes is a sentence."""


def table_from_toml(path: Path, remedy: str | None = None) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : Path
        The file.
    remedy : str, optional
        Remedy for a file that is not TOML.

    Raises
    ------
    InputError
        The file is not TOML, or is nested too deeply.
    OSError
        The file cannot be opened.
    """
    text = _text_of(path, "TOML", remedy)
    long = next((number for number, line in enumerate(text.split("\n"), 1) if len(line) > LONGEST_LINE), None)
    if long is not None:
        raise InputError(f"the line has more than {LONGEST_LINE} characters", file=path, line=long, remedy=remedy)
    try:
        return _checked(tomllib.loads(text), path)
    # ValueError: TOMLDecodeError, and a number with more digits than Python reads
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"not valid TOML ({error})", file=path, remedy=remedy) from None
    except RecursionError:
        raise _too_deep(path, None) from None


def table_from_json(text: str | bytes, file: Path, column: str | None = None) -> dict[str, Any]:
    """Read a JSON object.

    Parameters
    ----------
    text : str or bytes
        UTF-8.
    file : Path
        File that it stands in.
    column : str, optional
        Where in that file.

    Raises
    ------
    InputError
        It is not a JSON object, or is nested too deeply.
    """
    what, valid = ("the metadata are", "valid JSON") if column else ("this is", "JSON")
    try:
        values = json.loads(text)
    except json.JSONDecodeError as error:
        line = None if column else error.lineno
        raise InputError(f"{what} not {valid} ({error})", file=file, column=column, line=line) from None
    except ValueError as error:
        raise InputError(f"{what} not {valid} ({error})", file=file, column=column) from None
    except RecursionError:
        raise _too_deep(file, column) from None
    if not isinstance(values, dict):
        raise InputError(f"{what} not a JSON object", file=file, column=column)
    return _checked(values, file, column)


def table_from_json_file(path: Path) -> dict[str, Any]:
    """Read a file that holds one JSON object.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    InputError
        As for `table_from_json`.
    OSError
        The file cannot be opened.
    """
    return table_from_json(_text_of(path, "JSON", None), path)


def _text_of(path: Path, form: str, remedy: str | None) -> str:
    if path.stat().st_size > LARGEST_FILE:
        raise InputError(f"the file is too large to be {form} of imufit", file=path, remedy=remedy)
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"not valid {form} ({error})", file=path, remedy=remedy) from None


def _checked(values: dict[str, Any], file: Path, column: str | None = None) -> dict[str, Any]:
    """Refuse what is nested too deeply, for whoever writes it again goes down all of it, and boundless integers."""
    level: list[tuple[str, Any]] = list(values.items())
    for _ in range(DEEPEST):
        for key, value in level:
            if isinstance(value, int) and value.bit_length() > LARGEST_INTEGER:
                raise InputError(
                    f"{printable(key, NAME)} is an integer of more than {LARGEST_INTEGER} bits",
                    file=file,
                    column=column,
                    remedy="Write a number that the quantity can have.",
                )
        level = [inner for key, outer in level for inner in _inside(key, outer)]
        if not level:
            return values
    raise _too_deep(file, column)


def _inside(key: str, value: Any) -> Iterable[tuple[str, Any]]:
    """Return what a table or a list holds, the items of a list under its key."""
    if isinstance(value, dict):
        return value.items()
    return ((key, inner) for inner in value) if isinstance(value, list) else ()


def _too_deep(file: Path, column: str | None) -> InputError:
    return InputError(
        f"more than {DEEPEST} lists or tables stand within one another",
        file=file,
        column=column,
        remedy="Nothing that imufit reads is nested like that: write it anew.",
    )
