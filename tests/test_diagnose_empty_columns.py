"""Columns without any value take nothing from the rest of a log, and are told of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from imufit import SensorModel
from imufit.lab import simulate
from imufit.log import Log

BIAS = {"gyr.bias": {"x": 0.002, "y": -0.002, "z": 0.003}}


@pytest.fixture(scope="module")
def log() -> Log:
    return simulate.simulate("arm", BIAS, 5, 60.0).to_log()


def test_a_covariate_without_values_is_noted_and_the_rest_is_diagnosed(log: Log) -> None:
    empty = replace(log, covariates={**log.covariates, "humidity": np.full(log.n, np.nan)})
    found = SensorModel().fit(empty).diagnose()
    assert found.best == "gyr.bias"
    assert "Column humidity has no value in any row." in found.notes


def test_a_sensor_with_a_dead_axis_is_left_out_and_noted(log: Log) -> None:
    assert log.acc is not None
    dead = log.acc.copy()
    dead[:, 0] = np.nan
    found = SensorModel().fit(replace(log, acc=dead)).diagnose()
    assert found.best == "gyr.bias"
    assert "acc_x has no value in any row: acc is left out." in found.notes


def test_a_log_without_such_columns_says_nothing_of_them(log: Log) -> None:
    assert not [note for note in SensorModel().fit(log).diagnose().notes if "no value" in note]
