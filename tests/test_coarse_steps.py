"""A converter whose steps are larger than the noise: rounding is no effect, and hides none that is larger."""

import json
from dataclasses import replace
from io import StringIO

import imufit
import numpy as np
import pandas as pd
import pytest
from imufit import Log, SensorModel
from imufit.lab import simulate
from scipy.spatial.transform import Rotation

STEPS = {"acc": 0.06, "gyr": 0.004, "mag": 1.5}
"""Some four times the noise: ten bits over the range of an analogue sensor."""


def rounded(effects, scenario="turntable", seed=3, steps=STEPS):
    """Return a simulated log with its readings rounded to steps."""
    log = simulate.simulate(scenario, effects, seed).to_log()
    return replace(log, **{s: np.round(getattr(log, s) / step) * step for s, step in steps.items()})


@pytest.mark.parametrize("scenario", ["turntable", "poses", "handheld"])
@pytest.mark.parametrize("seed", [3, 4, 5])
def test_rounding_is_not_taken_for_an_effect(scenario, seed):
    fit = SensorModel().fit(rounded({}, scenario, seed))
    answer = fit.diagnose()
    assert answer.verdict == "adequate"
    # What a step leaves counts as noise, whatever the data sheet says.
    assert fit.ratio == pytest.approx(1.0, abs=0.1)


def test_an_effect_larger_than_a_step_is_found_all_the_same():
    log = rounded({"acc.scale": {"x": 0.02, "y": -0.015, "z": 0.01}})
    fit = SensorModel(["acc.scale"]).fit(log)
    assert SensorModel().fit(log).diagnose().best == "acc.scale"
    for parameter, truth in zip(fit.parameters, (0.02, -0.015, 0.01), strict=True):
        assert parameter.value == pytest.approx(truth, abs=max(4.0 * parameter.standard_error, 3e-4))


def test_the_note_tells_the_step():
    coarse = SensorModel().fit(rounded({})).compare()
    assert any("steps of 0.06 m/s^2" in note for note in coarse.notes)
    fine = SensorModel().fit(simulate.simulate("turntable", {}, 3).to_log()).compare()
    assert not any("steps" in note for note in fine.notes)


def test_a_sensor_that_stands_on_one_value_is_left_out_and_said_so():
    # About the vertical, where gravity never leaves the step that it is in.
    t = np.arange(6000) / 50.0
    rng = np.random.default_rng(5)
    heading = np.sin(0.4 * t)
    turn = Rotation.from_rotvec(heading[:, None] * [0.0, 0.0, 1.0])
    rate = 0.4 * np.cos(0.4 * t)[:, None] * [0.0, 0.0, 1.0]
    bias = np.array([0.01, -0.02, 0.03])
    log = Log(
        t=t,
        acc=np.round(rng.normal([0.0, 0.0, -9.80665], 0.02, (t.size, 3)) / 0.6) * 0.6,
        gyr=rng.normal(rate + bias, 2e-3),
        ref_q=turn.as_quat(scalar_first=True),
    )
    answer = SensorModel().fit(log).diagnose()
    assert "gyr.bias" in (answer.best, *answer.ambiguous_with)
    assert "Every reading of the accelerometer is the same: it is left out." in answer.notes
    assert not any(c.effect == "acc.bias" for c in answer.candidates)


def test_steps_of_a_table_that_are_fine_are_no_steps():
    log = rounded({}, steps={"acc": 0.002, "gyr": 1e-4, "mag": 0.05})
    assert np.array_equal(SensorModel().fit(log).analysis.logs[0].facts.steps, np.zeros((3, 3)))


NOISELESS = """
acc_x acc_y acc_z gyr_x gyr_y gyr_z mag_x mag_y mag_z temp ref_qw ref_qx ref_qy ref_qz motor_current vbat
-0.02 -0.02 9.794 -0.001 0.001 0 -9.502 -17.798 -43.907 25.746 0 -0.517 0.856 0 0 3.7
0.009 -0.024 -9.809 -0.001 0 0.001 8.76 -17.641 44.2 23.734 0.856 0 0 0.517 0.909 3.68
0.022 0.004 9.796 0.001 -0.001 0 -9.016 -17.742 -44.214 29.063 0 0.517 -0.856 0 -0.757 3.66
-0.001 0.015 -9.755 0 0.001 0.001 -9.336 17.615 43.658 23.315 -0.517 0 0 0.856 -0.279 3.64
"""
"""Four sides up: the mean of each, to a thousandth."""


def test_rests_whose_readings_never_change_have_an_answer():
    sides = pd.read_csv(StringIO(NOISELESS), sep=" ")
    frame = sides.loc[sides.index.repeat(100)].reset_index(drop=True)
    frame.insert(0, "t", np.arange(400) / 10.0)
    answer = imufit.diagnose(frame)
    assert answer.sentence
    json.dumps(answer.to_dict(), allow_nan=False)
