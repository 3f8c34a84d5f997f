"""Nothing hidden, under every kind of noise."""

from __future__ import annotations

from imufit.lab.grade.drawing import COLUMNS, SCENARIOS, frame_of, rng_of
from imufit.lab.grade.noises import NOISES
from imufit.lab.grade.puzzle import Puzzle
from imufit.lab.simulate import simulate


def nothing(blind_set: str, seed: int) -> Puzzle:
    """Return a log with nothing hidden: kinds of noise and motions in turn, figures of noise in every other one."""
    rng, simulation_seed = rng_of(blind_set, seed)
    kind = list(NOISES)[seed % len(NOISES)]
    simulation = simulate(
        SCENARIOS[seed % len(SCENARIOS)],
        {},
        simulation_seed,
        frame=frame_of(rng),
        rig_axis=str(rng.choice(["x", "y", "z"])),
        covariates=COLUMNS,
        noise=NOISES[kind](),
        noise_in_metadata=bool(seed % 2),
    )
    noisy_reference = NOISES[kind]().attitude_deg > 0.0
    return Puzzle("nothing", kind, simulation, twin=simulation if noisy_reference else None)
