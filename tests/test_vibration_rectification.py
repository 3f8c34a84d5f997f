"""The power of a vibration is known well enough that its coefficient comes out as it was put in."""

import imufit
import numpy as np
import pytest
from imufit.lab.simulate import simulate

EFFECT = "gyr.vibration_rectification"
SMALL = 0.03
"""Relative error that is allowed: tones of the machine beat, which the power of the simulator does not."""


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_coefficient_is_that_of_the_sensor_whose_machine_runs_now_and_then(seed):
    made = simulate("turntable", {EFFECT: None}, seed, duration=60.0, rate=100.0, size="large")
    found = imufit.fit(made.to_log(), EFFECT).params
    truth = made.truth.effects[EFFECT]
    parameters = {axis: found[f"{EFFECT}.{axis}"] for axis in truth}
    assert np.allclose([parameters[axis].value / truth[axis] for axis in truth], 1.0, atol=SMALL)
    assert all(parameter.stderr < SMALL * abs(parameter.value) for parameter in parameters.values())
    assert imufit.ladder(made.to_log()).diagnosis.verdict == "adequate"
