"""How the sets draw: seeds, effects with sizes, and whether the log separates them from all others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from imufit.lab.simulate import INJECTIONS, injection
from imufit.lab.simulate.environment import stream
from imufit.lab.simulate.separation import Separation, near
from imufit.lab.simulate.study import Study

COLUMNS = ("motor_current", "vbat")
"""Covariates of every log, so that their presence is not informative."""

TOLD = 100.0
"""Squared standard errors by which a rival must be worse to count as separated by the log: ten of them."""

SAME = 16.0
"""Squared standard errors within which two effects count as the same in a log: four of them."""

LARGEST = 15.0
"""Nothing is hidden with a parameter more than this many times its typical size."""

SCENARIOS = ("turntable", "poses", "arm", "handheld", "tilt")

Parameters = dict[str, float]


class ImpossibleError(Exception):
    """The draw is impossible with this seed and setting."""


def rng_of(blind_set: str, seed: int) -> tuple[np.random.Generator, int]:
    """Return the random stream of one log and the seed of its simulation; the set's name enters both."""
    rng = stream(seed, f"blind {blind_set}")
    return rng, int(rng.integers(2**31))


def frame_of(rng: np.random.Generator) -> str:
    """Draw a reference frame."""
    return str(rng.choice(["NED", "ENU", "NWU"]))


@dataclass(frozen=True)
class Setting:
    """Where an effect is to be hidden: the scenario, the seed, and other arguments of `simulate`."""

    scenario: str
    seed: int
    options: Mapping[str, Any]

    def study(self, effects: Sequence[str]) -> Study:
        """Return the log before anything is hidden in it."""
        options = {key: value for key, value in self.options.items() if key != "noise_in_metadata"}
        return Study(self.scenario, effects, self.seed, **options)

    @property
    def columns(self) -> tuple[str, ...]:
        """Covariates of the log."""
        courses = self.options.get("courses") or {}
        return tuple(dict.fromkeys([*self.options.get("covariates", ()), *(c for c in courses if c != "temp")]))


@dataclass(frozen=True)
class Drawn:
    """An effect with parameters, and how far (squared, in standard errors) each rival stays from it."""

    effect: str
    parameters: Parameters
    distances: Mapping[str, float]

    @property
    def rivals(self) -> tuple[str, ...]:
        """Effects that are not surely separated from it."""
        return near(self.distances, TOLD)


def parameters_of(
    study: Study, effect: str, size: float, rng: np.random.Generator, only: Sequence[str] = ()
) -> Parameters:
    """Draw parameters, those in `only` or all, with which an effect has this size; `ImpossibleError` if none do."""
    try:
        found = study.scale.draw(effect, size, rng, only)
    except ValueError as error:
        raise ImpossibleError(str(error)) from None
    entry = injection(effect)
    if entry.stage != "range" and any(abs(found[n]) > LARGEST * typical for n, typical in entry.typical.items()):
        raise ImpossibleError(f"{effect}: more than {LARGEST:g} times its typical size")
    return found


def drawn(
    setting: Setting,
    effect: str,
    size: float,
    rng: np.random.Generator,
    only: Sequence[str] = (),
    beside: Sequence[str] = (),
) -> Drawn:
    """Draw one effect and hold all others against it; `ImpossibleError` if the log cannot show it."""
    try:
        study = setting.study([effect, *beside])
    except ValueError as error:
        raise ImpossibleError(str(error)) from None
    found = parameters_of(study, effect, size, rng, only)
    distances = Separation(study, setting.columns).distances(effect, found, beside, least=TOLD)
    if distances[""] < TOLD:
        raise ImpossibleError(f"{effect} is too small to be visible in this log")
    return Drawn(effect, found, distances)


def effects() -> tuple[str, ...]:
    """Return every effect of the catalogue and, for each sensor, one column."""
    columns = ("acc.column:vbat", "gyr.column:motor_current", "mag.column:vbat")
    return (*INJECTIONS, *columns)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number between `low` and `high`, its logarithm evenly."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
