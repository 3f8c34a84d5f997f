"""A reference made from the log's own readings is named, and no other, however uneven the rows are."""

import imufit
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

NOISE = 0.002
"""Noise of the gyroscope, rad/s."""


def moving(t):
    """Attitude and angular rate, rad/s, of a hand that swings in three directions: by the attitude's derivative."""

    def attitude(at):
        angles = [1.2 * np.sin(2.1 * at), 0.8 * np.sin(3.3 * at + 1.0), 1.5 * np.sin(1.7 * at + 2.0)]
        return Rotation.from_euler("ZYX", np.column_stack(angles))

    h = 1e-5
    return attitude(t), (attitude(t - h).inv() * attitude(t + h)).as_rotvec() / (2.0 * h)


def log(own_filter):
    """Rows at steps of 4 to 16 ms, with a reference of its own or with one that integrates the readings."""
    random = np.random.default_rng(5)
    t = np.cumsum(random.uniform(0.004, 0.016, 3000))
    attitude, rate = moving(t)
    gyr = rate + random.normal(0.0, NOISE, rate.shape)
    acc = attitude.inv().apply([0.0, 0.0, 9.80665]) + random.normal(0.0, 0.02, rate.shape)
    if own_filter:
        turns = Rotation.from_rotvec(0.5 * (gyr[1:] + gyr[:-1]) * np.diff(t)[:, None])
        q = [attitude[0]]
        for turn in turns:
            q.append(q[-1] * turn)
        attitude = Rotation.concatenate(q)
    return imufit.Log(t, acc=acc, gyr=gyr, attitude=attitude, frame="ENU")


@pytest.mark.parametrize("own_filter", [False, True], ids=["instrument", "filter"])
def test_a_filter_of_the_readings_is_named_and_an_instrument_is_not(own_filter):
    faults = imufit.diagnose(log(own_filter)).data_faults
    assert ("own_filter" in [fault.fault for fault in faults]) is own_filter
