"""Two hidden effects at once, composed as they do physically."""

from __future__ import annotations

import numpy as np

from imufit.lab.grade.drawing import (
    SCENARIOS,
    TOLD,
    ImpossibleError,
    Setting,
    effects,
    log_uniform,
    parameters_of,
    rng_of,
)
from imufit.lab.grade.one import settings
from imufit.lab.grade.puzzle import Puzzle
from imufit.lab.simulate import injection, simulate
from imufit.lab.simulate.separation import Separation

ATTEMPTS = 40


def two(blind_set: str, seed: int) -> Puzzle:
    """Return a log with two hidden effects: number `seed` of the list, and another one by chance.

    Each stays apart from every rival, also with the other effect fitted along.
    """
    rng, simulation_seed = rng_of(blind_set, seed)
    names = effects()
    options = settings(rng, realistic=False)
    for attempt in range(ATTEMPTS):
        # An effect that no motion shows beside another one gives way to the next in the list.
        first = names[(seed + attempt // 8) % len(names)]
        setting = Setting(str(rng.choice(SCENARIOS)), simulation_seed, options)
        second = str(rng.choice([name for name in names if name != first]))
        try:
            pair = _pair(setting, first, second, rng)
        except ImpossibleError:
            continue
        simulation = simulate(setting.scenario, pair, simulation_seed, **options)
        return Puzzle("two", f"{first} + {second}", simulation)
    raise ImpossibleError(f"no pair was found with seed {seed}")


def _pair(setting: Setting, first: str, second: str, rng: np.random.Generator) -> dict[str, dict[str, float]]:
    if injection(first).late and injection(second).late:
        raise ImpossibleError("two effects that are both a time")
    try:
        study = setting.study([first, second])
    except ValueError as error:
        raise ImpossibleError(str(error)) from None
    pair = {name: parameters_of(study, name, log_uniform(rng, 0.3, 3.0), rng) for name in (first, second)}
    separation = Separation(study, setting.columns)
    for name, other in ((first, second), (second, first)):
        for beside in ([], [other]):
            if min(separation.distances(name, pair[name], beside).values()) < TOLD:
                raise ImpossibleError(f"{name} is not separated from others beside {other}")
    return pair
