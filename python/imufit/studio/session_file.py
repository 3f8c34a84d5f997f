"""The file of a session: its logs and how they are read, the way to the present model, the second model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from imufit.errors import InputError
from imufit.log import Reading
from imufit.model.catalogue import find_effect
from imufit.model.model_file import KIND as MODEL_KIND
from imufit.remedy import command
from imufit.studio.log_file import LogFile, reading_options
from imufit.studio.stack import Action, Entry, Stack, Step
from imufit.whole_toml import read_toml, toml_text

KIND: Final = "imufit session"
FORMAT: Final = 1
AGAIN: Final = "Save the session again."


class LogsWantedError(InputError):
    """A session whose logs are not there: their names, so that they can be brought.

    Parameters
    ----------
    session : Path
        The file of the session.
    names : sequence of str
        Of the files that are not there.
    """

    def __init__(self, session: Path, names: Sequence[str]) -> None:
        self.session, self.names = session, tuple(names)
        super().__init__(
            "the log of the session is not there",
            file=names[0],
            remedy="Lay the log beside the session, or drop the log on the studio.",
        )


@dataclass(frozen=True)
class Kept:
    """A session as its file keeps it; fits are made again from the logs.

    Attributes
    ----------
    files : tuple of LogFile
        The logs.
    steps : tuple of Step
        The way, from the ideal sensor on.
    position : int
        Number of the present step.
    second : Stack or None
        The second of two models side by side.
    """

    files: tuple[LogFile, ...]
    steps: tuple[Step, ...]
    position: int
    second: Stack | None = None


def as_toml(kept: Kept) -> str:
    """Return the text of the file of a session.

    Parameters
    ----------
    kept : Kept
        The session.
    """
    document: dict[str, Any] = {
        "kind": KIND,
        "format": FORMAT,
        "position": kept.position,
        "logs": [_file_table(file) for file in kept.files],
        "steps": [
            {
                "action": step.action.value,
                "effect": step.effect,
                "stack": _stack_list(step.stack),
                **({} if step.expected is None else {"expected": step.expected}),
                **({"parameter": step.parameter} if step.parameter else {}),
            }
            for step in kept.steps
        ],
        **({} if kept.second is None else {"second": _stack_list(kept.second)}),
    }
    return toml_text(document)


def _file_table(file: LogFile) -> dict[str, Any]:
    table: dict[str, Any] = {"file": file.name, **reading_options(file.reading)}
    if file.reference is not None:
        table["reference"] = _file_table(file.reference)
    times = {"lag": file.lag, "skew": file.skew}
    return table | {name: value for name, value in times.items() if value is not None}


def _stack_list(stack: Stack) -> list[dict[str, Any]]:
    return [{"effect": entry.effect, "on": entry.on, "held": dict(entry.held)} for entry in stack.entries]


def read_session(path: str | Path, beside: Sequence[Path] = ()) -> Kept:
    """Read the file of a session.

    Parameters
    ----------
    path : str or Path
        The file.
    beside : sequence of Path
        Folders in which a log is looked for that is not where the file states.

    Raises
    ------
    LogsWantedError
        Its logs are not there.
    InputError
        The file is damaged, or of a later format.
    """
    file = Path(path)
    document, _ = read_toml(file, "the session")
    if document.get("kind") == MODEL_KIND:
        raise InputError(
            "this is a sensor model or a calibration, not a session",
            file=file,
            remedy="It corrects the readings of a log: " + command("apply", "imufit.SensorModel.load(FILE).apply"),
        )
    if document.get("kind") != KIND:
        raise InputError(f'the key kind is {document.get("kind")!r}, not "{KIND}"', file=file)
    if document.get("format") != FORMAT:
        raise InputError(f"format {document.get('format')!r} is not known", file=file, remedy="Update imufit.")
    folders = (file.parent, *beside)
    try:
        wanted = [name for table in document["logs"] for name in _names(table) if _found(name, folders) is None]
        if wanted:
            raise LogsWantedError(file, list(dict.fromkeys(wanted)))
        files = tuple(_file(table, folders) for table in document["logs"])
        steps = tuple(
            Step(
                Action(table["action"]),
                str(table["effect"]),
                _stack(table["stack"]),
                table.get("expected"),
                str(table.get("parameter", "")),
            )
            for table in document["steps"]
        )
        position = int(document["position"])
        second = _stack(document["second"]) if "second" in document else None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"the session is damaged ({type(error).__name__}: {error})", file=file, remedy=AGAIN) from None
    if not files or not 0 <= position < len(steps) or steps[0].stack != Stack():
        raise InputError("the session has no logs, or no step at its position", file=file, remedy=AGAIN)
    for step in steps:
        for effect in step.stack.effects:
            find_effect(effect)
    return Kept(files, steps, position, second)


def _file(table: Mapping[str, Any], folders: Sequence[Path]) -> LogFile:
    name = table["file"]
    given = {key: table[key] for key in ("mapping", "frame", "noise") if key in table}
    reading = Reading(**given, drop=tuple(table.get("drop", ())))
    reference = _file(table["reference"], folders) if "reference" in table else None
    path = _found(str(name), folders)
    assert path is not None, "logs that are not there were asked for"
    return LogFile(path, str(name), reading, reference, table.get("lag"), table.get("skew"))


def _names(table: Mapping[str, Any]) -> list[str]:
    """List the files of one log: its own and that of its reference."""
    return [str(table["file"]), *(_names(table["reference"]) if "reference" in table else ())]


def _found(name: str, folders: Sequence[Path]) -> Path | None:
    """Return where a log is: as the file states, or under its bare name in one of the folders."""
    for path in (Path(name), *(folder / Path(name).name for folder in folders)):
        # A device or a pipe does not hold a log: reading one might never end.
        if path.is_file() or path.is_dir():
            return path
    return None


def _stack(entries: Sequence[Mapping[str, Any]]) -> Stack:
    return Stack(
        tuple(
            Entry(
                str(entry["effect"]),
                bool(entry["on"]),
                tuple(sorted((str(name), float(value)) for name, value in entry.get("held", {}).items())),
            )
            for entry in entries
        )
    )
