"""Every effect there is: the built-in ones, the user's, and those of a log's own columns."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from imufit import _imufit
from imufit.errors import InputError
from imufit.model.effect import registered, run_effects
from imufit.printable import NAME, printable
from imufit.remedy import command
from imufit.results import EffectCard, Result, Table

if TYPE_CHECKING:
    import pandas as pd

COLUMN = ".column:"


@cache
def _built_in() -> dict[str, _imufit.Effect]:
    return {effect.id: effect for effect in _imufit.built_in_effects()}


@cache
def _unnamed() -> dict[str, _imufit.Effect]:
    return {effect.id: effect for effect in _imufit.unnamed_effects()}


def effects() -> dict[str, _imufit.Effect]:
    """Built-in effects, then the user's, by id."""
    return {**_built_in(), **registered()}


def column_effects(names: Iterable[str], sensors: Iterable[str]) -> dict[str, _imufit.Effect]:
    """Effects of a log's own columns on its sensors, by id."""
    ids = [f"{sensor}{COLUMN}{name}" for name in names for sensor in sensors]
    found = {effect_id: _imufit.find_effect(effect_id) for effect_id in ids}
    return {effect_id: effect for effect_id, effect in found.items() if effect is not None}


def unnamed_effects() -> dict[str, _imufit.Effect]:
    """Effects that are fitted along and never named, by id: what the coarse steps of a converter do."""
    return dict(_unnamed())


def each_log_has_its_own(effect_id: str) -> bool:
    """Return whether the parameters of an effect belong to one log's set-up, not to the sensor.

    Parameters
    ----------
    effect_id : str
        Id such as ``gyr.bias``.

    Raises
    ------
    InputError
        The effect is unknown.
    """
    return find_effect(effect_id).scope == "log"


def find_effect(effect_id: str) -> _imufit.Effect:
    """Return the effect with this id.

    Parameters
    ----------
    effect_id : str
        Id such as ``gyr.g_sensitivity``.

    Raises
    ------
    InputError
        There is none; the message names the nearest.
    """
    known = {**effects(), **unnamed_effects()}
    effect = known.get(effect_id) or (_imufit.find_effect(effect_id) if COLUMN in effect_id else None)
    if effect is None:
        near = difflib.get_close_matches(effect_id, list(effects()), n=1, cutoff=0.4)
        every = command("explain", "imufit.catalogue()") + " lists all effects."
        remedy = f"Did you mean {near[0]}?" if near else every
        raise InputError(f"unknown effect {effect_id}", remedy=remedy)
    return effect


def card_of(effect: _imufit.Effect) -> EffectCard:
    """Return the card of an effect."""
    sensors = effect.sensors
    return EffectCard(
        id=effect.id,
        sensor=sensors[0] if len(sensors) == 1 else effect.id.split(".", 1)[0],
        parameters=tuple(effect.parameters),
        **effect.words,
    )


class Catalogue(Result, list[EffectCard]):
    """A list of cards that shows itself as a table."""

    def sentences(self) -> list[str]:
        """Return the number of effects, and the place of the details."""
        return [f"{len(self)} effects; imufit.explain(id) shows the card of each."]

    def tables(self) -> list[Table]:
        """Return a row for each effect."""
        rows = tuple((printable(card.id, NAME), printable(card.name, NAME), card.typical_sizes) for card in self)
        return [Table("", ("effect", "name", "typical size"), rows)]

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """JSON of every card by its id."""
        return {card.id: card.to_dict() for card in self}

    def to_dataframe(self) -> pd.DataFrame:
        """One row per effect."""
        import pandas as pd  # noqa: PLC0415  heavy, and only needed here

        columns = ["id", "sensor", "name", "physics", "formula", "signature", "mistaken_for", "confirm"]
        return pd.DataFrame([[getattr(card, name) for name in columns] for card in self], columns=columns)


def catalogue() -> Catalogue:
    """Cards of all effects that do not depend on a log's own columns."""
    return Catalogue(card_of(effect) for effect in effects().values())


def explain(effect_id: str) -> EffectCard:
    """Return the card of one effect: physics, formula, typical size, signature, rivals, what confirms it.

    Parameters
    ----------
    effect_id : str
        Id such as ``gyr.g_sensitivity``.

    Raises
    ------
    InputError
        The effect is unknown.
    """
    return card_of(find_effect(effect_id))


def load_effects(path: str | Path) -> list[str]:
    """Run a Python file that defines effects with ``@imufit.effect``; return the ids it added.

    Parameters
    ----------
    path : str or Path
        The file. It is run: load only what you trust.

    Raises
    ------
    InputError
        The file is missing or defines no effect. Exceptions of the file itself come out unchanged.
    """
    file = Path(path)
    if not file.is_file():
        raise InputError(f"the file {file} does not exist", file=file, remedy="Check the name.")
    before = set(registered())
    run_effects(file)
    added = [effect_id for effect_id in registered() if effect_id not in before]
    if not added:
        raise InputError("the file defines no new effect", file=file, remedy="Use the decorator @imufit.effect(...).")
    return added


def units_of(effect_id: str) -> dict[str, str]:
    """Return the SI unit of each parameter of an effect, by its name.

    Parameters
    ----------
    effect_id : str
        Its id.
    """
    return {name: unit for name, unit, _ in find_effect(effect_id).parameters}
