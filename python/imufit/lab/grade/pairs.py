"""Pairs of effects that one log does not separate and another log does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from imufit.lab.grade.drawing import COLUMNS, SAME, ImpossibleError, Setting, drawn, log_uniform, rng_of
from imufit.lab.grade.noises import everyday
from imufit.lab.grade.one import hidden_in
from imufit.lab.grade.puzzle import Puzzle
from imufit.lab.simulate import Line, Mixture
from imufit.lab.simulate.environment import Temperature, covariate, stream
from imufit.results.part import Part

DURATION = 120.0
ATTEMPTS = 24
Options = Callable[[np.random.Generator, int], dict[str, Any]]
Place = tuple[tuple[str, ...], Options]
"""Motions to choose from, and the further options of such a log."""


@dataclass(frozen=True, repr=False)
class Pair(Part):
    """Two effects, where they are the same, and where they are not.

    Attributes
    ----------
    first, second : str and the parameters that are not zero (all if empty).
    together, apart : where the two are not separated, and where they are.
    model : effects that are there besides, and known: without an offset of its own, a drift since the start could be
    separated from one about the mean. sizes, sizes_apart : smallest and largest size of the hidden one there, over the
    noise.
    """

    first: tuple[str, tuple[str, ...]]
    second: tuple[str, tuple[str, ...]]
    together: Place
    apart: Place
    model: tuple[str, ...] = ()
    sizes: tuple[float, float] = (0.3, 3.0)
    sizes_apart: tuple[float, float] = (0.5, 3.0)


def _plain(_rng: np.random.Generator, _seed: int) -> dict[str, Any]:
    return {}


def _with(**options: Any) -> Options:
    return lambda _rng, _seed: dict(options)


def _ramp(rng: np.random.Generator, _seed: int) -> dict[str, Any]:
    """Let the temperature rise or fall steadily."""
    slope = rng.uniform(8.0, 15.0) / DURATION * rng.choice([-1.0, 1.0])
    return {"courses": {"temp": Line(25.0, float(slope))}}


def _heater(like_temperature: bool) -> Options:
    """Add the column `heater`: proportional to the temperature, or not."""

    def options(rng: np.random.Generator, seed: int) -> dict[str, Any]:
        temperature = Temperature.random(stream(seed, "temperature"), DURATION)
        followed = Mixture([(float(rng.uniform(0.05, 0.2)), temperature)], 0.5)
        other = covariate("heater", seed, DURATION)
        return {"courses": {"temp": temperature, "heater": followed if like_temperature else other}}

    return options


def _supply(like_current: bool) -> Options:
    """Add the column `supply_current`: proportional to that of the motor, or not."""

    def options(rng: np.random.Generator, seed: int) -> dict[str, Any]:
        current = covariate("motor_current", seed, DURATION)
        followed = Mixture([(float(rng.uniform(0.8, 1.2)), current)], 0.15)
        other = covariate("supply_current", seed, DURATION)
        return {"courses": {"motor_current": current, "supply_current": followed if like_current else other}}

    return options


_ANY = ("turntable", "poses", "arm", "handheld")
_LIVELY = ("arm", "handheld")
_RIG = (("tilt",), _with(rig_axis="x"))
_RIG_NORTH = (("tilt",), _with(rig_axis="x", frame="NED"))
_ALL: tuple[str, ...] = ()

PAIRS: Mapping[str, Pair] = {
    "acc: temperature against time": Pair(
        ("acc.bias_temperature", _ALL), ("acc.bias_drift", _ALL), (_ANY, _ramp), (_ANY, _plain), ("acc.bias",)
    ),
    "gyr: temperature against time": Pair(
        ("gyr.bias_temperature", _ALL), ("gyr.bias_drift", _ALL), (_ANY, _ramp), (_ANY, _plain), ("gyr.bias",)
    ),
    "gyr: temperature against a column like it": Pair(
        ("gyr.bias_temperature", _ALL), ("gyr.column:heater", _ALL), (_ANY, _heater(True)), (_ANY, _heater(False))
    ),
    "mag: temperature against a column like it": Pair(
        ("mag.bias_temperature", _ALL), ("mag.column:heater", _ALL), (_ANY, _heater(True)), (_ANY, _heater(False))
    ),
    "mag: motor current against a column like it": Pair(
        ("mag.current", _ALL),
        ("mag.column:supply_current", _ALL),
        (_ANY, _supply(True)),
        (_ANY, _supply(False)),
        ("mag.hard_iron",),
    ),
    "one axis: turned mount against turned reference": Pair(
        ("ref.alignment", ("x",)), ("ref.tilt", ("x",)), _RIG, (_LIVELY, _plain)
    ),
    "one axis: iron against field": Pair(
        ("mag.hard_iron", ("x",)), ("mag.field_reference", ("x",)), _RIG, (_LIVELY, _plain)
    ),
    "one axis: bias against the Earth's rate": Pair(
        ("gyr.bias", ("x",)),
        ("gyr.earth_rate", ("north",)),
        _RIG_NORTH,
        (_ANY, _plain),
        sizes=(0.3, 0.8),
        sizes_apart=(0.3, 0.8),
    ),
    "one way: scale against its asymmetry": Pair(
        ("gyr.scale", _ALL), ("gyr.scale_asymmetry", _ALL), (("one_way",), _plain), (("turntable",), _plain)
    ),
    "gyroscope alone: late sensor against late reference": Pair(
        ("gyr.delay", _ALL), ("ref.delay", _ALL), (_LIVELY, _with(sensors=("gyr", "temp"))), (_LIVELY, _plain)
    ),
    "gyroscope alone: turned mount against misalignment": Pair(
        ("ref.alignment", _ALL),
        ("gyr.misalignment", _ALL),
        (_LIVELY, _with(sensors=("gyr", "temp"))),
        (_LIVELY, _plain),
    ),
    "slow motion: delay against low-pass": Pair(
        ("acc.delay", _ALL),
        ("acc.lowpass", _ALL),
        (("turntable",), _plain),
        (("handheld",), _plain),
        sizes=(0.3, 0.8),
        sizes_apart=(6.0, 9.0),
    ),
}


def confounded(blind_set: str, seed: int) -> Puzzle:
    """Return a log in which the two effects of pair number `seed` are the same; one of them, in turn, is hidden."""
    return _hidden(blind_set, seed, together=True)


def separated(blind_set: str, seed: int) -> Puzzle:
    """Return a log in which the two effects of pair number `seed` are separated; one of them is hidden."""
    return _hidden(blind_set, seed, together=False)


def _hidden(blind_set: str, seed: int, *, together: bool) -> Puzzle:
    rng, simulation_seed = rng_of(blind_set, seed)
    name = list(PAIRS)[seed % len(PAIRS)]
    pair = PAIRS[name]
    both = (pair.first, pair.second)
    (effect, only), (rival, _) = both if (seed // len(PAIRS)) % 2 == 0 else both[::-1]
    scenarios, options = pair.together if together else pair.apart
    sizes = pair.sizes if together else pair.sizes_apart
    for attempt in range(ATTEMPTS):
        drawn_options = {"noise": everyday(), "covariates": COLUMNS, **options(rng, simulation_seed + attempt)}
        setting = Setting(str(rng.choice(scenarios)), simulation_seed + attempt, drawn_options)
        try:
            found = drawn(setting, effect, log_uniform(rng, *sizes), rng, only, pair.model)
        except ImpossibleError:
            continue
        if together and found.distances.get(rival, np.inf) < SAME:
            return replace(hidden_in(setting, found, name, pair.model), question="confounded")
        if not together and not found.rivals:
            return hidden_in(setting, found, name, pair.model)
    raise ImpossibleError(f"{name}: no log was found with seed {seed}")
