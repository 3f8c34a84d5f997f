"""The present model as text that makes it again: Python, and commands of a shell."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Final

from imufit.studio.log_file import LogFile, reading_options
from imufit.studio.stack import Stack

JOINED: Final = "joined{}.parquet"
"""Log that the shell's commands write where two files are joined."""


UNITS: Final = "# Values are in SI units; shares are parts of one."
"""Comment over copied text that holds fixed values, in Python and in a shell."""


def as_python(files: Sequence[LogFile], way: Sequence[Stack]) -> str:
    """Return a program that makes the present model, to the last digit.

    Parameters
    ----------
    files : sequence of LogFile
        The logs.
    way : sequence of Stack
        Models from the ideal sensor to the present one, each fitted from the one before.
    """
    lines = ["import imufit", "", *([UNITS] if way[-1].holds else [])]
    names = []
    for k, file in enumerate(files):
        names.append("log" if len(files) == 1 else f"log_{k + 1}")
        lines.append(f"{names[-1]} = {_python_log(file)}")
    lines.append(f"fit = imufit.fit({names[0] if len(names) == 1 else '[' + ', '.join(names) + ']'})")
    for before, after in pairwise(way):
        lines += _python_step(before, after)
    return "\n".join([*lines, "print(fit.ratio)", "print(fit.params)", ""])


def _python_log(file: LogFile) -> str:
    if file.reference is None:
        return f"imufit.open_log({_call(file.name, reading_options(file.reading))})"
    own = f"imufit.read({_call(file.name, reading_options(file.reading))})"
    other = file.reference
    if other.path == file.path:
        source = own
    else:
        options = {"bare": True, **reading_options(other.reading)}
        source = f"imufit.LogStream({_call(other.name, options)}).read()"
    times = {name: value for name, value in (("lag", file.lag), ("skew", file.skew)) if value is not None}
    return f"imufit.join({own}, {source}{''.join(f', {name}={value!r}' for name, value in times.items())}).log"


def _call(name: str, options: dict[str, Any]) -> str:
    return ", ".join([repr(name), *(f"{key}={value!r}" for key, value in options.items())])


def _added(before: Stack, after: Stack) -> str | None:
    """Return the effect that a step adds as `imufit add` does; None if more changes, or anything is held."""
    new = [effect for effect in after.effects if effect not in before.effects]
    alone = len(new) == 1 and set(before.effects) < set(after.effects) and not after.holds and not before.holds
    return new[0] if alone else None


def _python_step(before: Stack, after: Stack) -> list[str]:
    """Return the calls of `imufit.studio.session.moved`."""
    if (added := _added(before, after)) is not None:
        return [f"fit = fit.add({added!r}).fit"]
    new = [effect for effect in after.effects if effect not in before.effects]
    gone = [effect for effect in before.effects if effect not in after.effects]
    lines = ["model = fit.model.copy()"]
    lines += [f"model = model.without_effect({effect!r})" for effect in gone]
    lines += [f"model = model.with_effect({effect!r})" for effect in new]
    for entry in after.entries:
        held = dict(entry.held)
        was = dict(before.entry(entry.effect).held) if entry.effect in before.effects else {}
        for name in sorted({*held, *was}):
            given = f"value={held[name]!r}, vary=False" if name in held else "vary=True"
            lines.append(f"model.params[{f'{entry.effect}.{name}'!r}].set({given})")
    return [*lines, "fit = fit.moved(model)"]


def as_shell(files: Sequence[LogFile], way: Sequence[Stack]) -> str:
    """Return the commands that fit the present model and write it to ``model.toml``.

    A way that adds effects alone goes the same way in the shell, to the last digit. Any other model is fitted at once:
    where effects are not linear together, both stop within a hundredth of a standard error.

    Parameters
    ----------
    files : sequence of LogFile
        The logs.
    way : sequence of Stack
        Models from the ideal sensor to the present one, each fitted from the one before.
    """
    model = way[-1]
    lines: list[str] = [UNITS] if model.holds else []
    logs: list[str] = []
    for k, file in enumerate(files):
        if file.reference is None:
            logs.append(shlex.quote(_path(file)))
            continue
        name = JOINED.format("" if len(files) == 1 else k + 1)
        lines.append(_shell_join(file, name))
        logs.append(name)
    # Logs that are read alike share their options; `imufit` reads all logs of one call the same way.
    options = [] if files[0].reference is not None else _shell_options(files[0])
    if not model.effects:
        lines.append(" ".join(["imufit compare", *logs, *options]))
        return "\n".join([*lines, ""])
    added = [_added(before, after) for before, after in pairwise(way)]
    if None not in added:
        first, *others = (shlex.quote(str(effect)) for effect in added)
        then = [f"--then {effect}" for effect in others]
        lines.append(" ".join(["imufit add", first, *logs, *options, *then, "-o model.toml"]))
    else:
        effects = shlex.quote(",".join(model.effects))
        fixed = [
            f"--fix {shlex.quote(f'{entry.effect}.{name}={value!r}')}"
            for entry in model.entries
            for name, value in entry.held
        ]
        lines.append(" ".join(["imufit fit", *logs, *options, "--effects", effects, *fixed, "-o model.toml"]))
    return "\n".join([*lines, ""])


def _path(file: LogFile) -> str:
    """Return a name that no command takes for an option."""
    return f"./{file.name}" if file.name.startswith("-") else file.name


def _shell_options(file: LogFile, prefix: str = "") -> list[str]:
    way = file.reading
    options: list[str] = []
    for column, source in (way.mapping or {}).items():
        options += [f"--{prefix}map", shlex.quote(f"{column}={source}")]
    if way.frame is not None and not prefix:
        options += ["--frame", way.frame]
    for sensor, value in way.noise.items() if not prefix else ():
        options += ["--noise", f"{sensor}={value!r}"]
    for column in way.drop:
        options += [f"--{prefix}drop", shlex.quote(column)]
    return options


def _shell_join(file: LogFile, output: str) -> str:
    other = file.reference
    assert other is not None
    parts = ["imufit join", shlex.quote(_path(file)), shlex.quote(_path(other)), *_shell_options(file)]
    parts += _shell_options(other, "reference-") if other.path != file.path else []
    parts += [] if file.lag is None else ["--lag", repr(file.lag)]
    parts += [] if file.skew is None else ["--skew", repr(1e6 * file.skew)]
    return " ".join([*parts, "-o", output])
