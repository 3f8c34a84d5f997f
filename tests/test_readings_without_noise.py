"""Readings that never change weigh nothing: no effect is named from them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from imufit import SensorModel, ladder
from imufit.errors import InputError
from imufit.log import Log

N = 2000


def at_rest(acc_noise=(0.0, 0.0, 0.0), gyr_noise=0.0, offset=0.1) -> Log:
    rng = np.random.default_rng(3)
    acc = np.array([offset, 0.0, -9.80665]) + rng.normal(size=(N, 3)) * acc_noise
    gyr = rng.normal(size=(N, 3)) * gyr_noise
    return Log.from_arrays(np.arange(N) / 100, acc=acc, gyr=gyr, reference=np.tile([1.0, 0.0, 0.0, 0.0], (N, 1)))


@pytest.mark.parametrize("offset", [0.0, 0.1])
def test_log_in_which_nothing_changes_is_not_judged(offset):
    for ask in (lambda log: SensorModel().compare(log), lambda log: SensorModel().fit(log).diagnose(), ladder):
        with pytest.raises(InputError, match="no effect can be judged, because no reading of acc or gyr ever changes"):
            ask(at_rest(offset=offset))


@pytest.mark.parametrize("offset", [0.0, 0.1])
def test_sensor_with_an_axis_that_never_changes_is_left_out_and_told(offset):
    log = at_rest((0.0, 0.02, 0.02), 1e-3, offset)
    found = SensorModel().fit(log).diagnose()
    assert found.verdict == "adequate"
    assert "Every reading of acc_x is the same: acc is left out." in found.notes
    assert set(SensorModel().compare(log).sensors) == {"gyr"}


def test_axis_without_any_value_needs_no_filter():
    log = at_rest((0.02, 0.02, 0.02), 1e-3)
    acc = log.acc.copy()
    acc[:, 0] = np.nan
    found = SensorModel().compare(dataclasses.replace(log, acc=acc))
    assert found.attitude is None
    assert set(found.sensors) == {"gyr"}
