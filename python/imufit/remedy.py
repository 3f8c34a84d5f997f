"""The remedy of a problem, in the words of Python and in those of the command line.

A process has one reader. A program that imports the package reads Python's words. The program ``imufit`` states once,
at its start, that its reader sits at a shell. Text that is made of a remedy is in the words of that reader.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, Final


class Reader(Enum):
    """Who reads what is said."""

    PYTHON = "python"
    SHELL = "shell"


_reader = Reader.PYTHON


@contextmanager
def told_to(reader: Reader) -> Iterator[None]:
    """Say everything in the words of a reader, in all threads of the process, until the block ends.

    Parameters
    ----------
    reader : Reader
        Who reads it.
    """
    global _reader  # noqa: PLW0603  a process has one reader, as it has one locale
    before, _reader = _reader, reader
    try:
        yield
    finally:
        _reader = before


MAP: Final = "--map"
"""Option that maps the columns of a log."""
REFERENCE_MAP: Final = "--reference-map"
"""Option of a join that maps the columns of its reference."""

Option = tuple[str, Any]
"""A keyword argument of the library and its value: ``("frame", "ENU")``, ``("mapping", {"acc_x": "AccX[g]"})``."""


@dataclass(frozen=True)
class Remedy:
    """A remedy in both languages; text before it or after it is added with ``+``.

    Parameters
    ----------
    python, shell : str
        The words of Python, such as ``frame='ENU'``, and those of the command line, such as ``--frame ENU``.
    options : tuple of Option
        The options that the words name with a value, for a program that applies them.
    """

    python: str
    shell: str
    options: tuple[Option, ...] = field(default=(), compare=False)

    @classmethod
    def of(cls, words: str | Remedy) -> Remedy:
        """Return a remedy; words that are the same in both languages make one.

        Parameters
        ----------
        words : str or Remedy
            The remedy, in a sentence.
        """
        return words if isinstance(words, Remedy) else cls(words, words)

    def __add__(self, other: str | Remedy) -> Remedy:
        more = Remedy.of(other)
        return Remedy(self.python + more.python, self.shell + more.shell, self.options + more.options)

    def __radd__(self, before: str) -> Remedy:
        return Remedy.of(before) + self

    def __str__(self) -> str:
        return self.python if _reader is Reader.PYTHON else self.shell


def command(name: str, call: str | None = None) -> Remedy:
    """Name a command and what asks the same in Python, such as ``imufit.diagnose`` and ``imufit diagnose``.

    Parameters
    ----------
    name : str
        Of the command.
    call : str, optional
        Its form in Python, if that is not a function of the same name.
    """
    return Remedy(f"imufit.{name}" if call is None else call, f"imufit {name}")


def keyword(name: str) -> Remedy:
    """Name a keyword argument and the option of the same name without a value, such as ``baud`` and ``--baud``.

    Parameters
    ----------
    name : str
        Of the keyword argument.
    """
    return Remedy(name, f"--{name}")


def option(name: str, value: str | float, *, shell: str | None = None) -> Remedy:
    """Name a keyword argument and the option of the same name, such as ``frame='ENU'`` and ``--frame ENU``.

    Parameters
    ----------
    name : str
        Of the keyword argument.
    value : str or float
        Its value.
    shell : str, optional
        The option's value, where it is written in another way.
    """
    given = str(value) if shell is None else shell
    return Remedy(f"{name}={value!r}", f"--{name} {shlex.quote(given)}", ((name, value),))


def recovering(part: str | Path, port: str | None = None) -> Remedy:
    """Name the call that makes a log of what a recording left.

    Parameters
    ----------
    part : str or Path
        The part of the recording, or the name of its log.
    port : str, optional
        Where the device is plugged in.
    """
    ports = ("", "") if port is None else (f", port={port!r}", f" --port {shlex.quote(port)}")
    return Remedy(
        f"imufit.devices.record.recover({str(part)!r}{ports[0]})", f"imufit recover {shlex.quote(str(part))}{ports[1]}"
    )


def mapped(columns: Mapping[str, str], shell: str = MAP) -> Remedy:
    """Name the mapping that makes columns of a log, such as ``mapping={'acc_x': 'AccX[g]'}`` and ``--map acc_x=...``.

    Parameters
    ----------
    columns : mapping
        Source text for each column of the log.
    shell : str
        The option, where it is another one; empty where it was named before.
    """
    text = ",".join(f"{target}={source}" for target, source in columns.items())
    quoted = shlex.quote(text)
    # Also where a shell needs no quotes: they show where the mapping ends and the sentence goes on.
    quoted = f"'{text}'" if quoted == text else quoted
    return Remedy(f"mapping={dict(columns)!r}", f"{shell} {quoted}".lstrip(), (("mapping", dict(columns)),))


def template(sensor: str) -> Remedy:
    """Show how the columns of a sensor are named, where nothing is known of what they are called.

    Parameters
    ----------
    sensor : str
        Its prefix, such as ``acc``.
    """
    return Remedy(f"mapping={{'{sensor}_x': 'COLUMN[UNIT]', ...}}", f"--map {sensor}_x=COLUMN[UNIT],...")


def reading(file: str | Path | None, how: Remedy) -> Remedy:
    """Name the call that reads a log in another way; the command line has the option alone.

    Parameters
    ----------
    file : str, Path or None
        Of the log; None for a table in memory.
    how : Remedy
        Keyword argument and option.
    """
    if file is None:
        return Remedy(f"imufit.Log.from_dataframe(df, {how.python})", how.shell, how.options)
    return Remedy(f"imufit.read({str(file)!r}, {how.python})", how.shell, how.options)


_READERS: Final = " in imufit.read or imufit.Log.from_dataframe"


def when_read(how: Remedy) -> Remedy:
    """Name a keyword argument of the functions that read a log, for what is found once the log has been read.

    Parameters
    ----------
    how : Remedy
        Keyword argument and option.
    """
    return how + Remedy(_READERS, "")
