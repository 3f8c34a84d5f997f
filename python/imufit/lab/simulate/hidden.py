"""A log with a hidden effect: for blind trials of whatever is to find it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from imufit.errors import InputError
from imufit.lab.simulate.environment import stream
from imufit.lab.simulate.injections import injection
from imufit.lab.simulate.scenarios import SCENARIOS
from imufit.lab.simulate.sealed import Truth
from imufit.lab.simulate.separation import APART, Separation
from imufit.lab.simulate.simulation import Simulation, simulate
from imufit.lab.simulate.size import SIZES
from imufit.lab.simulate.study import Study
from imufit.log.words import one_of

COLUMNS = ("motor_current", "vbat")
"""Covariates that every log with a hidden effect has, so that their presence is not informative."""

LARGEST = 20.0
"""Nothing is hidden with a parameter more than this many times its typical size: the Earth does not turn that fast."""

NOTHING = 0.25
"""Probability that nothing is hidden, where that is allowed."""

_ANYWHERE = {
    "gyr.bias": "Constant at rest and in motion, which no other effect of the gyroscope is at changing attitude.",
    "gyr.bias_temperature": "The temperature rises and falls several times, so it does not follow time or attitude.",
    "acc.bias_temperature": "As for the gyroscope; the specific force does not follow the temperature.",
    "gyr.column:motor_current": "The current is switched independently of motion and temperature.",
    "acc.column:motor_current": "The current is switched independently of motion and temperature.",
    "mag.current": "The current is switched independently of motion and temperature.",
    "gyr.column:vbat": "The voltage is switched independently of motion and current.",
    "acc.column:vbat": "The voltage is switched independently of motion and current.",
    "mag.column:vbat": "The voltage is switched independently of motion and current.",
}
_ALL_ATTITUDES = {
    "acc.bias": "Each axis sees gravity both ways, so a bias differs from scale, misalignment and a tilted table.",
    "acc.scale": "Each axis sees gravity from -g to g; only a cubic comes near, and it bends.",
    "acc.misalignment": "Each axis is seen with gravity along the other two; gyroscope and magnetometer stay right.",
    "gyr.g_sensitivity": "Gravity takes all directions in the body, also at rest, where scale errors are silent.",
    "mag.hard_iron": "The field takes all directions in the body, so an offset is not a gain.",
    "mag.soft_iron": "The field takes all directions in the body; only an equal gain of all axes is the field's own.",
}
_ALL_RATES = {
    "gyr.scale": "Each axis turns both ways and at several rates.",
    "gyr.misalignment": "All axes turn by themselves; where it is a mere rotation, acc and mag deny a turned mount.",
}
_LIVELY = {
    "acc.lever_arm": "Rates and angular accelerations about all axes; the reference gives the position.",
    "ref.alignment": "All three sensors are turned by the same rotation, in all attitudes.",
    "ref.delay": "Rates change all the time, and all three sensors show the same delay.",
}

OBSERVABLE: Mapping[str, Mapping[str, str]] = {
    # Long spins at constant rate: a late reference and a mount turned about the spin axis look alike, a lever arm is
    # nearly constant in each spin. None of these is drawn.
    "turntable": {**_ANYWHERE, **_ALL_ATTITUDES, **_ALL_RATES},
    "arm": {**_ANYWHERE, **_ALL_ATTITUDES, **_ALL_RATES, **_LIVELY},
    # Mostly at rest: what needs rates is seen in the short turns only, so lever arm and delay are not drawn. A mount
    # turned against the reference shows at rest in acc and mag alike.
    "poses": {**_ANYWHERE, **_ALL_ATTITUDES, **_ALL_RATES, "ref.alignment": _LIVELY["ref.alignment"]},
    # One axis: half of the gains are never excited, an offset in acc or mag is also a gain times what stays constant,
    # a gyroscope's bias is also its sensitivity to a gravity that keeps much of its direction. The remainder does not
    # depend on attitude, or follows the drive, or is seen by acc and mag alike.
    "tilt": {
        **{effect: reason for effect, reason in _ANYWHERE.items() if effect != "gyr.bias"},
        "rig.backlash": "Changes sign with the direction of travel and stays while the rig rests, unlike a delay.",
        "rig.flexure": "All sensors turn by the same angle, zero in the middle of the travel, which no tilt has.",
        "rig.periodic": "Several periods within the travel, which no gain, offset or flexure has.",
        "ref.tilt": "Across the axis it turns with the rig, unlike a mount; acc and mag lean by the same angle.",
        "ref.delay": "All sensors late by the same time while the rig moves, right at rest.",
        "gyr.scale": "The axis turns both ways and at several rates.",
    },
    "handheld": {**_ANYWHERE, **_ALL_ATTITUDES, **_ALL_RATES, **_LIVELY},
}
"""For each scenario the effects that it can show apart from all others, with the reason."""


def hidden(
    scenario: str,
    seed: int,
    size: str | float | None = None,
    *,
    nothing: bool | None = None,
    allow_nothing: bool = False,
    candidates: Sequence[str] | None = None,
    **options: Any,
) -> tuple[Simulation, Truth]:
    """Simulate a log with one effect drawn by chance, of a size and with parameters drawn by chance.

    Parameters
    ----------
    scenario : one of `OBSERVABLE`.
    seed : of everything; the same seed gives the same log.
    size : "large", "medium", "small" or a number; None draws one of the names.
    nothing : True hides nothing, False hides something; None leaves it to chance if `allow_nothing`, else hides one.
    allow_nothing : whether nothing may be hidden, with probability 1/4.
    candidates : effects to draw from; default those in `OBSERVABLE` that are distinguishable as drawn.
    **options : further arguments of `simulate`: duration, rate, noise, ...

    Returns
    -------
    simulation, truth

    Raises
    ------
    ValueError
        If no candidate is distinguishable in this log with this size, or as `simulate`.
    """
    if scenario not in SCENARIOS:
        raise InputError(f"unknown scenario {scenario!r}", remedy=one_of(scenario, OBSERVABLE))
    if scenario not in OBSERVABLE:
        raise ValueError(f"{scenario} shows no effect apart from all others: use one of {', '.join(OBSERVABLE)}")
    rng = stream(seed, f"hidden {scenario}")
    options = _with_columns(options)
    setting = {key: value for key, value in options.items() if key != "noise_in_metadata"}
    label = size if size is not None else str(rng.choice(list(SIZES)))
    empty = rng.random() < NOTHING
    if nothing is True or (nothing is None and allow_nothing and empty):
        simulation = simulate(scenario, {}, seed, **options)
        return simulation, simulation.truth
    pool = list(candidates) if candidates is not None else list(OBSERVABLE[scenario])
    for effect in rng.permutation(pool).tolist():
        study = Study(scenario, [effect], seed, **setting)
        for attempt in range(4):
            found = _distinguishable(study, effect, label, attempt)
            if found is not None:
                simulation = simulate(scenario, {effect: found}, seed, **options)
                named = label if isinstance(label, str) else ""
                truth = replace(simulation.truth, label=named)
                return replace(simulation, truth=truth), truth
    raise ValueError(f"no effect of size {label} is separated from all others in this log: choose a larger size")


def _with_columns(options: Mapping[str, Any]) -> dict[str, Any]:
    columns = dict.fromkeys([*COLUMNS, *options.get("covariates", ())])
    return {**options, "covariates": tuple(columns)}


def _distinguishable(study: Study, effect: str, size: str | float, attempt: int) -> dict[str, float] | None:
    """Draw parameters for the effect; None if the log lacks what it needs, or a rival stays too near."""
    try:
        parameters = study.draw(effect, size, attempt)
    except ValueError:
        return None
    entry = injection(effect)
    sizes = {} if entry.stage == "range" else entry.typical
    if any(abs(parameters[name]) > LARGEST * size for name, size in sizes.items()):
        return None
    distances = Separation(study, COLUMNS).distances(effect, parameters)
    return parameters if min(distances.values()) >= APART else None
