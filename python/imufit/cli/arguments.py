"""Arguments and options that several commands share."""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from imufit.whole_file import identity

Command = TypeVar("Command", bound=Callable[..., Any])

LOG_ENDINGS = (".parquet", ".csv", ".npz")
MODEL_ENDINGS = (".toml",)
PLOT_ENDINGS = (".png", ".svg", ".pdf")


_ALIKE = 0.8
"""Likeness, of 1, from which on another file may have been meant: one letter in five is wrong."""
LARGEST_NUMBER = 1e9
"""Largest number an option takes: 30 years in seconds, and beyond every rate in Hz and every share in ppm."""
LARGEST_WHOLE = 2**63 - 1
"""Largest whole number an option takes: seeds and counts have 64 bits below."""


class Real(click.FloatRange):
    """A number within bounds, refused where it is none, infinite, or too large to be meant.

    Parameters
    ----------
    min, max : float, optional
        Bounds; without them plus and minus `LARGEST_NUMBER`.
    min_open : bool
        Whether `min` itself is refused.
    """

    def __init__(self, min: float = -LARGEST_NUMBER, max: float = LARGEST_NUMBER, min_open: bool = False) -> None:
        super().__init__(min=min, max=max, min_open=min_open)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number."""
        number = float(super(click.FloatRange, self).convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number", param, ctx)
        return float(super().convert(number, param, ctx))


class Whole(click.IntRange):
    """A whole number within bounds.

    Parameters
    ----------
    min, max : int
        Bounds.
    """

    def __init__(self, min: int, max: int = LARGEST_WHOLE) -> None:
        super().__init__(min=min, max=max)


class NamedFile(click.Path):
    """A file to be read, by a name that a file can have.

    Parameters
    ----------
    exists : bool
        Whether it must be there.
    folder : bool
        Whether it may be a folder.
    """

    def __init__(self, exists: bool = False, folder: bool = False) -> None:
        super().__init__(exists=exists, dir_okay=folder, readable=True, path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path."""
        _check_name(self, value, param, ctx)
        if self.exists and not os.path.lexists(value) and (near := _neighbours(Path(value))):
            self.fail(f"{str(value)!r} does not exist: did you mean {' or '.join(near)}?", param, ctx)
        return super().convert(value, param, ctx)


def _neighbours(path: Path) -> list[str]:
    """Return the files of the same folder whose names are nearly that of `path`."""
    try:
        names = [entry.name for entry in os.scandir(path.parent)]
    except OSError:
        return []
    return [str(path.with_name(name)) for name in difflib.get_close_matches(path.name, names, n=2, cutoff=_ALIKE)]


def _check_name(kind: click.ParamType, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> None:  # type: ignore[type-arg]
    """Refuse what can name no file: whatever looks for it would fail in its own way."""
    if "\0" in str(value):
        kind.fail("a file's name cannot hold the character NUL", param, ctx)


class OutputFile(click.ParamType):  # type: ignore[type-arg]
    """A file to be written, refused before the work starts if it cannot be.

    Parameters
    ----------
    endings : iterable of str
        Endings that the file may have; none means any.
    standard_output : bool
        Whether ``-`` stands for standard output.
    """

    name = "file"

    def __init__(self, endings: Iterable[str] = (), standard_output: bool = False) -> None:
        self.endings = tuple(endings)
        self.standard_output = standard_output

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Return the path."""
        _check_name(self, value, param, ctx)
        path = Path(value)
        if str(value) == "-" and self.standard_output:
            return path
        if self.endings and path.suffix.lower() not in self.endings:
            self.fail(f"{path.name!r} must end in {' or '.join(self.endings)}", param, ctx)
        if path.is_dir():
            self.fail(f"{str(path)!r} is a directory", param, ctx)
        if not path.parent.is_dir():
            self.fail(f"the directory {str(path.parent)!r} does not exist", param, ctx)
        if not os.access(path if path.exists() else path.parent, os.W_OK):
            self.fail(f"{str(path)!r} cannot be written", param, ctx)
        return path


class OutputDirectory(click.ParamType):  # type: ignore[type-arg]
    """A directory to be made where it does not exist yet."""

    name = "directory"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Return the path."""
        _check_name(self, value, param, ctx)
        path = Path(value)
        if path.exists() and not path.is_dir():
            self.fail(f"{str(path)!r} is a file, not a directory", param, ctx)
        return path


EXISTING = NamedFile(exists=True)


def title_of(logs: Sequence[Path]) -> str:
    """Return what a page about one log, or about several, is called."""
    return logs[0].name if len(logs) == 1 else f"{logs[0].name} and {len(logs) - 1} more"


def model_option(command: Command) -> Command:
    """Add --model and --effects-from."""
    command = effects_from_option(command)
    return click.option(
        "--model", type=EXISTING, metavar="MODEL", help="Start from this model file; without it from the ideal sensor."
    )(command)


def effects_from_option(command: Command) -> Command:
    """Add --effects-from, which runs before anything looks at the catalogue."""
    return click.option(
        "--effects-from",
        type=EXISTING,
        multiple=True,
        metavar="FILE.py",
        is_eager=True,
        expose_value=False,
        callback=_load_effects,
        help="Run this Python file and use the effects that it defines. Repeatable.",
    )(command)


def _load_effects(_ctx: click.Context, _param: click.Parameter, files: tuple[Path, ...]) -> None:
    """Load the user's effects."""
    from imufit.cli import engine  # noqa: PLC0415

    for file in files:
        engine.load_effects(file)


def json_option(command: Command) -> Command:
    """Add --json."""
    return click.option(
        "--json",
        "json_file",
        type=OutputFile(standard_output=True),
        metavar="FILE",
        help="Write the result as JSON; - is standard output, where nothing else is printed then.",
    )(command)


def html_option(command: Command) -> Command:
    """Add --html."""
    return click.option(
        "--html",
        "html_file",
        type=OutputFile(),
        metavar="FILE",
        help="Write a report, an HTML page that opens offline.",
    )(command)


def plot_option(command: Command) -> Command:
    """Add --plot."""
    return click.option(
        "--plot", "plot_file", type=OutputFile(PLOT_ENDINGS), metavar="FILE.png", help="Write the main figure."
    )(command)


def plots_option(command: Command) -> Command:
    """Add --plots."""
    return click.option(
        "--plots", "plots", type=OutputDirectory(), metavar="DIR", help="Write every figure as PNG and SVG into DIR."
    )(command)


def verbose_option(command: Command) -> Command:
    """Add -v."""
    return click.option("-v", "--verbose", is_flag=True, help="Show every table, not only those of the answer.")(
        command
    )


def model_output(command: Command) -> Command:
    """Add -o for a model file."""
    return click.option(
        "-o", "--output", type=OutputFile(MODEL_ENDINGS), metavar="MODEL.toml", help="Write the fitted model."
    )(command)


def keep_inputs(inputs: Iterable[Path | None], outputs: Iterable[Path | None]) -> None:
    """Refuse outputs that would overwrite an input, the metadata beside an input, or each other.

    Files are compared, not names: a link to an input is that input.

    Raises
    ------
    click.UsageError
        Names the file.
    """
    given = [path for path in inputs if path is not None]
    taken = {identity(path) for path in given}
    beside = {identity(path) for path in _sidecars(given) if path.exists()}
    written = [path for path in outputs if path is not None and str(path) != "-"]
    for path in written:
        if identity(path) in taken | beside:
            raise click.UsageError(f"{str(path)!r} would be overwritten: give each output its own file")
        taken.add(identity(path))
    for path in _sidecars(path for path in written if path.suffix.lower() != ".parquet"):
        if identity(path) in taken:
            raise click.UsageError(f"{str(path)!r} would be overwritten by a log's metadata: give each its own name")


def _sidecars(paths: Iterable[Path]) -> list[Path]:
    """Where the metadata of those files that are logs stand, as in `imufit.log.metadata.sidecar_path`."""
    return [path.with_suffix(".toml") for path in paths if path.suffix.lower() in LOG_ENDINGS]
