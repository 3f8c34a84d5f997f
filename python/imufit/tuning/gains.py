"""Which settings of a filter are gains that a log determines, and where their search begins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from imufit import _imufit
from imufit.errors import InputError
from imufit.log.words import one_of

RANGE: Final = 1000.0
"""The search covers the start over and times this factor."""

_CHOSEN: Final[dict[str, dict[str, float]]] = {
    "complementary": {"time_constant": 0.33},
    "kalman": {"acc_noise": 5e-3, "bias_walk": 1e-5},
    "mahony": {"k_p": 0.5, "k_i": 0.005, "k_2": 1.0},
    "madgwick": {"beta": 0.16},
    "hybrid": {"k_p": 0.5, "k_i": 0.005, "k_2": 1.0},
    "mekf": {"acc_noise": 5e-3, "mag_noise": 5e-3, "bias_walk": 1e-5},
}
"""Gains of filters whose other settings repeat them (only ratios of noises matter), with a start for a default of 0."""
_NO_GAIN = ("min_angle", "_start", "_time", "_range", "_limit", "adaptive", "steady", "step")


def starts(filter_name: str, names: Sequence[str] = ()) -> dict[str, float]:
    """Return the gains to be tuned, and where each search begins: the default, or a usual value where that is 0.

    Parameters
    ----------
    filter_name : str
        A filter.
    names : sequence of str, optional
        Settings to tune; without them those that the filter is known by, or every positive setting that is a gain.

    Raises
    ------
    InputError
        No such filter or setting, or one that has no gains.
    """
    descriptions = _imufit.filter_descriptions()
    if filter_name not in descriptions:
        raise InputError(f"filter {filter_name!r} is unknown", remedy=one_of(filter_name, descriptions))
    settings = descriptions[filter_name]["settings"]
    known = {
        name: settings[name]["default"] or value
        for name, value in _CHOSEN.get(filter_name, {}).items()
        if name in settings
    }
    for name in names:
        if name not in settings:
            raise InputError(f"{filter_name} has no setting {name!r}: it has {', '.join(settings) or 'none'}")
    if names:
        chosen = {name: known.get(name, settings[name]["default"]) for name in dict.fromkeys(names)}
        zero = [name for name, value in chosen.items() if not value > 0.0]
        if zero:
            raise InputError(f"{zero[0]} of {filter_name} is 0 by default, which cannot start a search over factors")
        return chosen
    found = known or {
        name: entry["default"]
        for name, entry in settings.items()
        if entry["default"] > 0.0 and not any(part in name for part in _NO_GAIN)
    }
    if not found:
        raise InputError(f"{filter_name} has no gains to tune")
    return found
