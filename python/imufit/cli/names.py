"""Names that a person may misspell, and the one that was probably meant."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import click
from click.shell_completion import CompletionItem

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


def no_such_option(error: click.NoSuchOption) -> str:
    """Say that a command lacks an option, and which one has a name like it or says its word in the help.

    Parameters
    ----------
    error : NoSuchOption
        The parser's error, with the options of a similar name.

    Returns
    -------
    str
        One line, such as that ``--report`` may mean ``--html``, whose help begins with "Write a report".
    """
    name = error.option_name.lstrip("-").lower()
    params = error.ctx.command.params if error.ctx else []
    helps = {each.opts[0]: each.help or "" for each in params if isinstance(each, click.Option)}
    said = [option for option, text in helps.items() if name in re.findall(r"\w+", text.lower())]
    near = said or error.possibilities or []
    return f"no option {error.option_name}: did you mean {' or '.join(near)}?" if near else error.format_message()


def beginning(names: Iterable[str], incomplete: str) -> list[CompletionItem]:
    """Return what a shell offers for a word that is begun.

    Parameters
    ----------
    names : iterable of str
        What there is.
    incomplete : str
        The word; of names with commas between only the last one is completed.
    """
    head, comma, last = incomplete.rpartition(",")
    return [CompletionItem(f"{head}{comma}{name}") for name in names if name.startswith(last)]


def complete_effect(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the effects of the catalogue that begin so."""
    from imufit.cli import engine  # noqa: PLC0415

    return beginning((card.id for card in engine.catalogue()), incomplete)


def complete_injection(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the effects that can be simulated and begin so."""
    from imufit.cli import engine  # noqa: PLC0415

    return beginning(engine.injections(), incomplete)


def complete_scenario_or_log(_ctx: click.Context, _param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Return the scenarios that begin so, and have the shell look for files besides."""
    from imufit.cli import engine  # noqa: PLC0415

    return [*beginning(engine.scenarios(), incomplete), CompletionItem(incomplete, type="file")]


class OneOf(click.Choice):  # type: ignore[type-arg]
    """One of a few words, with a guess at a misspelt one.

    Parameters
    ----------
    kind : str
        What the words stand for.
    words : sequence of str
        The words.
    case_sensitive : bool
        Whether capitals matter.
    """

    def __init__(self, kind: str, words: Sequence[str], case_sensitive: bool = True) -> None:
        super().__init__(words, case_sensitive=case_sensitive)
        self._kind = kind

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the word, or fail with the one that was probably meant."""
        known = self.choices if self.case_sensitive else [word.lower() for word in self.choices]
        if (value if self.case_sensitive else str(value).lower()) not in known:
            self.fail(unknown(self._kind, str(value), self.choices), param, ctx)
        return super().convert(value, param, ctx)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Return the words that begin so, as they are written."""
        begun = incomplete if self.case_sensitive else incomplete.upper()
        return beginning(self.choices, begun)


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

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Return the names that begin so."""
        return beginning(self._names(), incomplete)


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
