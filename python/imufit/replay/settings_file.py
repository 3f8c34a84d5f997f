"""Settings of filters in a TOML file: one table a filter, names and values as in `imufit.replay.SETTINGS`."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from pathlib import Path

import tomli_w

from imufit.errors import InputError
from imufit.log.documents import table_from_toml
from imufit.replay.replay import SETTINGS


def write_settings(settings: Mapping[str, Mapping[str, float]], path: str | Path) -> None:
    """Write settings of filters, SI units.

    Parameters
    ----------
    settings : mapping of mappings
        Filter (or "replay" for the rules), name, value.
    path : str or Path
        File to write.
    """
    plain = {group: {name: float(value) for name, value in values.items()} for group, values in settings.items()}
    Path(path).write_text(tomli_w.dumps(plain), encoding="utf-8")


def read_settings(path: str | Path) -> dict[str, dict[str, float]]:
    """Read settings of filters, SI units, to be given to `replay`.

    Parameters
    ----------
    path : str or Path
        As `write_settings` writes it.

    Raises
    ------
    InputError
        No TOML, an unknown filter or setting, or a value that is no number; the place is named.
    """
    path = Path(path)
    groups = table_from_toml(path)
    settings: dict[str, dict[str, float]] = {}
    for group, values in groups.items():
        _known("filter", group, SETTINGS, path)
        if not isinstance(values, dict):
            raise InputError(
                f"{group} is no table of settings", file=path, remedy=f"Write [{group}] above its settings."
            )
        for name, value in values.items():
            _known(f"setting of {group}", name, SETTINGS[group], path)
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise InputError(f"{group}.{name} is {value!r}, which is no number", file=path)
            settings.setdefault(group, {})[name] = float(value)
    return settings


def _known(kind: str, name: str, known: Mapping[str, object], path: Path) -> None:
    if name in known:
        return
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    remedy = f"Did you mean {near[0]}?" if near else f"There is {', '.join(known) or 'none'}."
    raise InputError(f"{name!r} is no {kind}", file=path, remedy=remedy)
