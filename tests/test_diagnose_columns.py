"""Columns of a log are measured, too: which of two that agree within their noise is the cause, no log tells."""

import numpy as np
import pytest
from imufit import SensorModel
from imufit.fitting.column_noise import ColumnNoise
from imufit.lab import simulate

THERMOMETER = 0.05


def warmed(truth, noise=THERMOMETER, apart=0.0, seed=3):
    """Return a log whose gyroscope drifts with the temperature, or with a heater's current that follows it."""
    rng = np.random.default_rng(seed)
    sim = simulate.simulate("handheld", {}, seed, 90.0)
    warm = 25.0 + 4.0 * np.sin(2 * np.pi * sim.t / 70.0) + 0.03 * sim.t
    heater = 0.1 * warm + apart * np.sin(2 * np.pi * sim.t / 31.0)
    cause = warm if truth == "temp" else 10.0 * heater
    sim.gyr[:] += (cause - cause.mean())[:, None] * np.array([2e-3, -1.5e-3, 1e-3])
    sim.temp[:] = warm + noise * rng.standard_normal(sim.t.size)
    sim.covariates["heater"] = heater
    return sim.to_log()


@pytest.mark.parametrize("truth", ["temp", "heater"])
def test_a_column_is_not_the_cause_because_the_thermometer_is_noisy(truth):
    answer = SensorModel().fit(warmed(truth)).diagnose()
    assert answer.verdict == "ambiguous"
    assert {answer.best, *answer.ambiguous_with} == {"gyr.bias_temperature", "gyr.column:heater"}


@pytest.mark.parametrize(("truth", "effect"), [("temp", "gyr.bias_temperature"), ("heater", "gyr.column:heater")])
def test_columns_that_differ_by_more_than_their_noise_are_told_apart(truth, effect):
    answer = SensorModel().fit(warmed(truth, apart=0.2)).diagnose()
    assert (answer.verdict, answer.best) == ("missing", effect)


def test_noise_of_a_column_is_its_share_of_the_variance_however_the_parts_are_cut():
    rng = np.random.default_rng(0)
    t = np.arange(20_000) / 100
    column = 3.0 * np.sin(t) + 0.3 * rng.standard_normal(t.size)
    column[::50] = np.nan
    whole, parts = ColumnNoise(), ColumnNoise()
    whole.add(column)
    for part in np.array_split(column, 7):
        parts.add(part)
    assert whole.share == pytest.approx(0.3**2 / (4.5 + 0.3**2), rel=0.05)
    assert parts.share == pytest.approx(whole.share, rel=0.01)


@pytest.mark.parametrize("column", [np.full(100, 2.5), np.full(100, np.nan), np.array([1.0, 2.0])])
def test_a_column_that_says_nothing_has_no_noise(column):
    noise = ColumnNoise()
    noise.add(column)
    assert noise.share == 0.0


@pytest.mark.parametrize("truth", ["temp", "heater"])
def test_whitening_makes_the_noise_of_columns_louder(truth):
    """A drift that stands out of the noise looks coloured; whitened, two columns agree less than their courses do."""
    rng = np.random.default_rng(4)
    sim = simulate.simulate("handheld", {}, 4, 90.0)
    warm = 25.0 + 4.0 * np.sin(2 * np.pi * sim.t / 70.0)
    cause = warm + (0.05 if truth == "temp" else 0.02) * rng.standard_normal(sim.t.size)
    sim.gyr[:] += (warm - warm.mean())[:, None] * np.array([2e-3, -1.5e-3, 1e-3])
    sim.temp[:] = cause if truth == "temp" else warm + 0.05 * rng.standard_normal(sim.t.size)
    sim.covariates["heater"] = 0.1 * (cause if truth == "heater" else warm + 0.02 * rng.standard_normal(sim.t.size))
    answer = SensorModel().fit(sim.to_log()).diagnose()
    assert answer.verdict == "ambiguous"
    assert {answer.best, *answer.ambiguous_with} == {"gyr.bias_temperature", "gyr.column:heater"}
