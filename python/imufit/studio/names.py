"""Names in words of what the page shows: they stand first, before the id or symbol that logs and programs use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from imufit.log.columns import SENSOR_NAMES
from imufit.model.catalogue import card_of, find_effect
from imufit.printable import NAME, printable

QUANTITIES: Final[Mapping[str, str]] = {
    "t": "time",
    "temp": "temperature",
    "f": "specific force",
    "|f|": "size of the specific force",
    "omega": "angular rate",
    "omega_norm": "size of the angular rate",
    "m": "magnetic field",
    "ref_p": "position",
    "df/dt": "change of the specific force",
    "domega/dt": "change of the angular rate",
    "dm/dt": "change of the magnetic field",
}
"""Words for the symbols of covariates, as the glossary defines them; an axis follows a symbol, such as ``_x``."""


AT_REST: Final = {
    "acc_norm": "|f| at rest",
    "turn": "turn from rest to rest",
    "acc_pose": "gravity on a labelled side",
    "mag_norm": "|m| in every row",
}
"""Channels of a log that rests judge, in words."""


def effect_name(effect: str) -> str:
    """Return the name of an effect in words, such as ``gyroscope bias``.

    Parameters
    ----------
    effect : str
        Its id.
    """
    return printable(card_of(find_effect(effect)).name, NAME)


def model_name(effects: Sequence[str]) -> str:
    """Return a model in words: its effect, or how many it has.

    Parameters
    ----------
    effects : sequence of str
        Ids of its effects.
    """
    if not effects:
        return "the ideal sensor"
    return f"the model with {effect_name(effects[0]) if len(effects) == 1 else f'{len(effects)} effects'}"


def estimating(effects: Sequence[str]) -> str:
    """Return in words the work of estimating a model, and what a person gets of it.

    Parameters
    ----------
    effects : sequence of str
        Ids of its effects.
    """
    return f"estimating {model_name(effects)} from the log, for its values and its bar"


def parameter_name(effect: str, parameter: str) -> str:
    """Return a parameter of an effect in words, such as ``gyroscope bias x``.

    Parameters
    ----------
    effect : str
        Id of the effect.
    parameter : str
        Name of the parameter.
    """
    return f"{effect_name(effect)} {printable(parameter, NAME)}"


def channel_name(channel: str) -> str:
    """Return a channel in words, such as ``gyroscope x``, or a sensor's name.

    Parameters
    ----------
    channel : str
        For instance ``gyr_x``.
    """
    if channel in AT_REST or channel in SENSOR_NAMES:
        return AT_REST.get(channel) or SENSOR_NAMES[channel]
    sensor, _, axis = channel.partition("_")
    return f"{SENSOR_NAMES[sensor]} {axis}" if sensor in SENSOR_NAMES and axis else printable(channel, NAME)


def covariate_name(covariate: str) -> str:
    """Return a covariate in words, such as ``angular rate x``; a column of the log keeps its own name.

    Parameters
    ----------
    covariate : str
        Its symbol, or several with ``*`` between them.
    """
    parts = [_quantity(part) for part in covariate.split("*")]
    return " times ".join(parts) if all(parts) else printable(covariate, NAME)


def _quantity(symbol: str) -> str:
    """Return one symbol in words; empty where it is none."""
    if symbol in QUANTITIES:
        return QUANTITIES[symbol]
    base, axis = symbol[:-1].removesuffix("_"), symbol[-1:]
    return f"{QUANTITIES[base]} {axis}" if base in QUANTITIES and axis in "xyz" else ""


def with_symbol(words: str, symbol: str) -> str:
    """Return words with their symbol in parentheses, where it is another one.

    Parameters
    ----------
    words, symbol : str
        Such as ``gyroscope x`` and ``gyr_x``.
    """
    shown = printable(symbol, NAME)
    return words if words == shown else f"{words} ({shown})"
