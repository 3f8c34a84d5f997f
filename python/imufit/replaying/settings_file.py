"""Settings of filters in a TOML file: one table a filter, names and values as in `imufit.replaying.SETTINGS`."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from pathlib import Path

from imufit.errors import InputError
from imufit.replaying.replay import SETTINGS
from imufit.whole_toml import read_toml, write_toml


def write_settings(settings: Mapping[str, Mapping[str, float]], path: str | Path) -> None:
    """Write settings of filters, SI units.

    Parameters
    ----------
    settings : mapping of mappings
        Filter (or "replay" for the rules), name, value.
    path : str or Path
        File to write; one that exists is replaced. It is written whole or not at all.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    plain = {group: {name: float(value) for name, value in values.items()} for group, values in settings.items()}
    write_toml(path, plain)


def read_settings(path: str | Path) -> dict[str, dict[str, float]]:
    """Read settings of filters, SI units, to be given to `replay`.

    Parameters
    ----------
    path : str or Path
        As `write_settings` writes it.

    Raises
    ------
    InputError
        Not TOML, cut off, an unknown filter or setting, or a value that is not a number; the place is named.
    """
    path = Path(path)
    groups, _ = read_toml(path, "the file of settings")
    settings: dict[str, dict[str, float]] = {}
    for group, values in groups.items():
        _known("filter", group, SETTINGS, path)
        if not isinstance(values, dict):
            raise InputError(
                f"{group} is not a table of settings", file=path, remedy=f"Write [{group}] above its settings."
            )
        for name, value in values.items():
            _known(f"setting of {group}", name, SETTINGS[group], path)
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise InputError(f"{group}.{name} is {value!r}, which is not a number", file=path)
            settings.setdefault(group, {})[name] = float(value)
    return settings


def _known(kind: str, name: str, known: Mapping[str, object], path: Path) -> None:
    if name in known:
        return
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    remedy = f"Did you mean {near[0]}?" if near else f"There is {', '.join(known) or 'none'}."
    raise InputError(f"unknown {kind} {name!r}", file=path, remedy=remedy)
