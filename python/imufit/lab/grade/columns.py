"""A column among several that have nothing to do with it."""

from __future__ import annotations

import numpy as np

from imufit.lab.grade.drawing import ImpossibleError, Setting, drawn, frame_of, log_uniform, rng_of
from imufit.lab.grade.noises import everyday
from imufit.lab.grade.one import hidden_in
from imufit.lab.grade.puzzle import Puzzle
from imufit.lab.simulate import Course, Line, Mixture, Wandering
from imufit.lab.simulate.environment import Temperature, covariate, stream
from imufit.lab.simulate.injections import effect_of_column

DURATION = 120.0
SCENARIOS = ("turntable", "poses", "arm", "handheld")
ATTEMPTS = 12


def courses(rng: np.random.Generator, seed: int) -> dict[str, Course]:
    """Return temperature and seven columns: switched, a random walk, with a slope, like the temperature."""
    temperature = Temperature.random(stream(seed, "temperature"), DURATION)

    def wandering(number: int, time: float) -> Wandering:
        return Wandering((seed, number), DURATION, time)

    likeness = rng.uniform(0.3, 0.6, 2)
    return {
        "temp": temperature,
        "motor_current": covariate("motor_current", seed, DURATION),
        "vbat": covariate("vbat", seed, DURATION),
        "pump": covariate("pump", seed, DURATION),
        "pressure": Mixture([(1.0, wandering(1, float(rng.uniform(2.0, 6.0)))), (1.0, Line(0.0, 0.01))], 1013.0),
        "humidity": Mixture([(3.0, wandering(2, float(rng.uniform(8.0, 20.0))))], 45.0),
        "fan": Mixture([(likeness[0], temperature), (1.0, wandering(3, float(rng.uniform(2.0, 5.0))))]),
        "heater": Mixture([(-likeness[1], temperature), (1.0, covariate("heater", seed, DURATION))]),
    }


def columns(blind_set: str, seed: int) -> Puzzle:
    """Return a log with seven columns of which one, in turn, disturbs a sensor, in turn."""
    rng, simulation_seed = rng_of(blind_set, seed)
    for attempt in range(ATTEMPTS):
        drawn_courses = courses(rng, simulation_seed + attempt)
        names = [name for name in drawn_courses if name != "temp"]
        column, sensor = names[seed % len(names)], ("acc", "gyr", "mag")[seed % 3]
        effect = effect_of_column(sensor, column)
        options = {"courses": drawn_courses, "noise": everyday(), "frame": frame_of(rng), "duration": DURATION}
        setting = Setting(SCENARIOS[seed % len(SCENARIOS)], simulation_seed + attempt, options)
        try:
            found = drawn(setting, effect, log_uniform(rng, 0.3, 3.0), rng)
        except ImpossibleError:
            continue
        if not found.rivals:
            return hidden_in(setting, found)
    raise ImpossibleError(f"no column stood apart with seed {seed}")
