"""One hidden effect, each of the catalogue in turn, in a motion that shows it."""

from __future__ import annotations

from typing import Any

import numpy as np

from imufit.lab.grade.drawing import (
    COLUMNS,
    SCENARIOS,
    Drawn,
    ImpossibleError,
    Setting,
    drawn,
    effects,
    frame_of,
    log_uniform,
    rng_of,
)
from imufit.lab.grade.noises import everyday
from imufit.lab.grade.puzzle import Puzzle
from imufit.lab.simulate import Noise, injection, simulate

TWINS = {
    f"{sensor}.{name}": {f"{sensor}.{other}"}
    for sensor in ("acc", "gyr")
    for name, other in (("delay", "lowpass"), ("lowpass", "delay"))
}
"""Effects that differ in the second order only: no other motion is looked for because of these."""

Sizes = tuple[float, float]


def one(blind_set: str, seed: int, sizes: Sizes, realistic: bool = False) -> Puzzle:
    """Return a log with one hidden effect: number `seed` of the list, of a size drawn within `sizes`.

    Of the motions, in an order by chance, the first is taken that separates the effect from all others; else, the first
    that shows it, and the unseparated effects count as rivals.
    """
    rng, simulation_seed = rng_of(blind_set, seed)
    names = effects()
    effect = names[seed % len(names)]
    options = settings(rng, realistic)
    size = log_uniform(rng, *sizes)
    best: tuple[Setting, Drawn] | None = None
    for scenario in rng.permutation(SCENARIOS).tolist():
        setting = Setting(scenario, simulation_seed, options)
        for wanted in (size, sizes[0]):
            try:
                found = drawn(setting, effect, wanted, rng)
            except ImpossibleError:
                continue
            if best is None or len(found.rivals) < len(best[1].rivals):
                best = setting, found
            break
        if best is not None and not set(best[1].rivals) - TWINS.get(effect, set()):
            break
    if best is None:
        raise ImpossibleError(f"{effect}: no motion shows it with size {size:g}")
    return hidden_in(*best)


def settings(rng: np.random.Generator, realistic: bool) -> dict[str, Any]:
    """Return the noise, columns, frame and rig axis of a log."""
    return {
        "frame": frame_of(rng),
        "rig_axis": str(rng.choice(["x", "y", "z"])),
        "covariates": COLUMNS,
        "noise": Noise.realistic() if realistic else everyday(),
        "noise_in_metadata": not realistic,
    }


def hidden_in(setting: Setting, found: Drawn, kind: str = "", model: tuple[str, ...] = ()) -> Puzzle:
    """Return the log of a setting with one effect in it, and those of `model`, which are known."""
    effects = {**dict.fromkeys(model), found.effect: found.parameters}
    simulation = simulate(setting.scenario, effects, setting.seed, **setting.options)
    twin = None
    if setting.options["noise"].attitude_deg > 0.0:
        # A vibration of the sensor acts on the twin, too.
        shaken = {found.effect: dict.fromkeys(found.parameters, 0.0)} if injection(found.effect).vibration else {}
        twin = simulate(setting.scenario, shaken, setting.seed, **setting.options)
    return Puzzle("one", kind or found.effect, simulation, found.rivals, model, twin)
