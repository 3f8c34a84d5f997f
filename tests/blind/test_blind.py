"""Blind logs: the answer is given before the seal is broken.

Every run draws new seeds; IMUFIT_SEED repeats one (it is printed with the table).
"""

from __future__ import annotations

import os
import secrets

import numpy as np
import pytest
from imufit.grade import FIRST_EFFECTS, NOTHING, BlindGrade, grade, plan

SEED = int(os.environ.get("IMUFIT_SEED", secrets.randbelow(10**6)))


@pytest.fixture(scope="module")
def marks() -> BlindGrade:
    result = grade(logs=60, nothing=30, seed=SEED, processes=2)
    print(f"IMUFIT_SEED={SEED}\n{result}")
    return result


def test_large_and_medium_effects_are_named(marks: BlindGrade) -> None:
    trials = [*marks.of("large"), *marks.of("medium")]
    right = [trial for trial in trials if trial.mark in ("right", "named among rivals")]
    assert len(trials) == 40
    assert len(right) >= 0.95 * len(trials), f"IMUFIT_SEED={SEED}\n{marks}"


def test_nothing_hidden_is_hardly_ever_named(marks: BlindGrade) -> None:
    trials = marks.of(NOTHING)
    assert len(trials) == 30
    assert sum(trial.mark == "false alarm" for trial in trials) <= 1, f"IMUFIT_SEED={SEED}\n{marks}"


def test_error_falls_to_the_noise(marks: BlindGrade) -> None:
    ends = [trial.ratio_end for trial in marks.trials if trial.size != NOTHING]
    assert abs(np.median(ends) - 1.0) <= 0.05


def test_standard_errors_are_what_they_say(marks: BlindGrade) -> None:
    assert 0.90 <= marks.coverage <= 0.99, f"IMUFIT_SEED={SEED}\n{marks}"


@pytest.fixture(scope="module")
def tilt_rig() -> BlindGrade:
    result = grade(logs=20, nothing=6, seed=SEED + 500_000, scenarios=["tilt"], processes=2)
    print(f"IMUFIT_SEED={SEED}\n{result}")
    return result


def test_on_a_tilt_rig_sensor_and_rig_effects_are_named(tilt_rig: BlindGrade) -> None:
    trials = [trial for trial in tilt_rig.trials if trial.size != NOTHING]
    right = [trial for trial in trials if trial.mark in ("right", "named among rivals")]
    assert len(trials) == 20
    assert len(right) >= 19, f"IMUFIT_SEED={SEED}\n{tilt_rig}"
    alarms = [trial for trial in tilt_rig.of(NOTHING) if trial.mark == "false alarm"]
    assert len(alarms) <= 1, f"IMUFIT_SEED={SEED}\n{tilt_rig}"


def test_every_first_effect_is_drawn_in_the_long_run() -> None:
    seeds = [seed for _, seed, _ in plan(60, 30, 0)]
    assert len(set(seeds)) == 90
    assert len(set(FIRST_EFFECTS)) == len(FIRST_EFFECTS)
