"""Where readings are cut off, as far as the readings themselves tell."""

import numpy as np
import pytest
from imufit import SensorModel
from imufit.fitting.range_end import RangeEnd
from imufit.log import Log
from scipy.spatial.transform import Rotation

STEP = 1e-3


def swinging(seed: int, noise: float = 20 * STEP) -> np.ndarray:
    """Three axes that swing, with noise, rounded to a step."""
    rng = np.random.default_rng(seed)
    t = np.arange(4000) / 100.0
    x = np.stack([a * np.sin(2 * np.pi * f * t) for a, f in ((3.0, 0.7), (2.0, 1.1), (2.5, 0.4))], axis=1)
    return np.round((x + noise * rng.normal(size=x.shape)) / STEP) * STEP


def end(readings: np.ndarray, chunks: int = 1) -> float | None:
    found = RangeEnd()
    for part in np.array_split(readings, chunks):
        found.add(part)
    return found.end()


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("chunks", [1, 7])
def test_readings_that_turn_back_have_no_end(seed, chunks):
    assert end(swinging(seed), chunks) is None


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("chunks", [1, 7])
def test_readings_cut_off_at_every_swing_end_there(seed, chunks):
    assert end(np.clip(swinging(seed), -2.7, 2.7), chunks) == 2.7


@pytest.mark.parametrize("seed", range(5))
def test_one_long_stay_at_the_end_is_enough(seed):
    readings = swinging(seed)
    readings[1000:1012, 1] = [2.2, 2.8, 3.1, *[3.4567] * 6, 3.0, 2.6, 2.1]
    assert end(readings) == 3.4567


def test_two_equal_readings_may_be_chance():
    readings = swinging(0)
    readings[1000:1004, 1] = [3.1, 3.4567, 3.4567, 3.0]
    assert end(readings) is None


def test_a_sensor_that_often_reads_the_same_may_stand_still_at_its_largest_reading():
    readings = np.repeat(swinging(0), 5, axis=0)
    readings[1000:1012, 1] = [2.2, 2.8, 3.1, *[3.4567] * 6, 3.0, 2.6, 2.1]
    assert end(readings) is None


@pytest.mark.parametrize("seed", range(5))
def test_a_plateau_reached_slowly_is_an_end_if_the_noise_is_gone_there(seed):
    rng = np.random.default_rng(seed)
    course = np.concatenate([np.linspace(0.0, 3.5, 2000), np.full(500, 3.5), np.linspace(3.5, 0.0, 2000)])
    readings = np.round((course[:, None] * [1.0, 0.5, -0.4] + 3 * STEP * rng.normal(size=(4500, 3))) / STEP) * STEP
    assert end(readings) is None
    assert end(np.minimum(readings, 3.2)) == 3.2


def test_model_with_the_end_of_a_range_is_held_against_a_log_that_never_comes_there():
    rng = np.random.default_rng(2)
    n = 2000
    turn = Rotation.from_rotvec(np.outer(np.sin(np.arange(n) / 100), [0.0, 0.0, 1.0]))
    rate = np.stack([np.zeros(n), np.zeros(n), np.cos(np.arange(n) / 100)], axis=1)
    log = Log.from_arrays(
        np.arange(n) / 100,
        acc=[0.0, 0.0, -9.80665] + 0.02 * rng.normal(size=(n, 3)),
        gyr=rate + 1e-3 * rng.normal(size=(n, 3)),
        reference=turn.as_quat(scalar_first=True),
    )
    ends = {"acc.saturation": {"range": 500.0}, "gyr.saturation": {"range": 100.0}}
    plain = SensorModel(["gyr.bias"])
    model = SensorModel(["gyr.bias", *ends], ends)
    assert model.compare(log).sensors == pytest.approx(plain.compare(log).sensors)
    assert model.fit(log).model.parameters["gyr.saturation"] == {"range": 100.0}
