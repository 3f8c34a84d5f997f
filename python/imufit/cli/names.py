"""Names that a person may misspell, and the one that was probably meant."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import click

FILTERS = (
    "accel",
    "gyro",
    "complementary",
    "kalman",
    "triad",
    "mahony",
    "madgwick",
    "quest",
    "hybrid",
    "mekf",
    "smoother",
)
FRAMES = ("NED", "ENU", "NWU")
FORMS = {
    "c-header": "C99 header, SI units",
    "arduino": "sketch with a function to call after reading the sensor, SI units",
    "imufusion": "Python for imufusion (xio Fusion), g and deg/s",
    "ahrs": "Python that makes the arrays for the filters of ahrs",
    "json": "matrices, offsets and standard errors",
}


def unknown(kind: str, name: str, known: Iterable[str]) -> str:
    """Say that a name is not known, and which one is near.

    Parameters
    ----------
    kind : str
        For instance ``effect``.
    name : str
        As it was given.
    known : iterable of str
        What there is.

    Returns
    -------
    str
        One line.
    """
    names = list(known)
    plain = {each.lower().replace("-", "_"): each for each in names}
    near = difflib.get_close_matches(name.lower().replace("-", "_"), plain, n=3, cutoff=0.55)
    if near:
        return f"unknown {kind} {name!r}: did you mean {' or '.join(plain[each] for each in near)}?"
    if len(names) > 12:
        return f"unknown {kind} {name!r}: `imufit explain` lists all that there are"
    return f"unknown {kind} {name!r}: there is {', '.join(names)}"


class Known(click.ParamType):  # type: ignore[type-arg]
    """A name out of a list that is only fetched when it is needed.

    Parameters
    ----------
    kind : str
        What the names stand for.
    names : callable
        Returns the names.
    """

    def __init__(self, kind: str, names: Callable[[], Sequence[str]]) -> None:
        self.name = kind
        self._names = names

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the name, or fail with the one that was probably meant."""
        names = self._names()
        if value not in names:
            self.fail(unknown(self.name, str(value), names), param, ctx)
        return str(value)


class KnownList(Known):
    """Names out of such a list, separated by commas."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, ...]:  # type: ignore[override]
        """Return the names, or fail with the one that was probably meant."""
        if isinstance(value, tuple):
            return value
        names = [name.strip() for name in str(value).split(",")]
        given = [name for name in names if name]
        if not given:
            self.fail(f"{str(value)!r} names no {self.name}", param, ctx)
        return tuple(super(KnownList, self).convert(name, param, ctx) for name in given)


def check_effects(effects: Sequence[str]) -> None:
    """Refuse effects that are not in the catalogue.

    Raises
    ------
    click.UsageError
        Names the effect and the nearest one there is.
    """
    from imufit.cli import engine  # noqa: PLC0415

    known = [card.id for card in engine.catalogue()]
    for effect in effects:
        sensor, colon, column = effect.partition(".column:")
        if effect in known or (colon and column and sensor in ("acc", "gyr", "mag")):
            continue
        raise click.UsageError(unknown("effect", effect, known))
