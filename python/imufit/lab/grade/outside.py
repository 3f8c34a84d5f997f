"""One effect that no catalogue holds."""

from __future__ import annotations

from imufit.lab.grade.drawing import ImpossibleError, Setting, log_uniform, parameters_of, rng_of
from imufit.lab.grade.one import settings
from imufit.lab.grade.puzzle import Puzzle
from imufit.lab.simulate import OUTSIDE, simulate
from imufit.lab.simulate.separation import Separation

NAMED_AT_MOST = 0.65
"""Share of the effect's square that a single effect of the catalogue may explain."""

LEFT_AT_LEAST = 0.1
"""Share of it that all effects of the catalogue together must leave, and `SEEN` squared standard errors."""

SEEN = 200.0
ATTEMPTS = 12


def outside(blind_set: str, seed: int) -> Puzzle:
    """Return a log with number `seed` of the effects outside the catalogue, which no effect in it comes near."""
    rng, simulation_seed = rng_of(blind_set, seed)
    name = list(OUTSIDE)[seed % len(OUTSIDE)]
    entry = OUTSIDE[name]
    options = settings(rng, realistic=False)
    for attempt in range(ATTEMPTS):
        setting = Setting(str(rng.choice(entry.scenarios)), simulation_seed + attempt, options)
        study = setting.study([name])
        try:
            found = parameters_of(study, name, log_uniform(rng, 0.5, 3.0), rng)
        except ImpossibleError:
            continue
        whole, nearest, left = Separation(study, setting.columns).all_together(name, found)
        if whole - nearest > NAMED_AT_MOST * whole or left < max(LEFT_AT_LEAST * whole, SEEN):
            continue
        simulation = simulate(setting.scenario, {name: found}, setting.seed, **options)
        sensor = name.partition(".")[0]
        causes = {f"{sensor}_{axis}": cause for axis, cause in zip("xyz", entry.causes, strict=True)}
        return Puzzle("outside", f"{name}: {entry.kind}", simulation, causes=causes)
    raise ImpossibleError(f"{name}: the catalogue comes too near with seed {seed}")
