"""Noise that grows with the rate or with time."""

import numpy as np
import pytest
from imufit.lab.grade.noises import NOISES
from imufit.lab.simulate import Noise, SensorNoise, simulate


def test_noise_doubles_at_one_radian_a_second_and_is_plain_at_rest():
    t, rng = np.arange(0.0, 100.0, 0.01), np.random.default_rng(1)
    rates = np.zeros((t.size, 3))
    rates[t.size // 2 :] = [0.6, 0.0, 0.8]
    drawn = SensorNoise(0.5, growth_with_rate=1.0).draw(rng, t, rates)
    assert np.std(drawn[: t.size // 2]) == pytest.approx(0.5, rel=0.03)
    assert np.std(drawn[t.size // 2 :]) == pytest.approx(1.0, rel=0.03)


def test_noise_has_doubled_at_the_end_of_the_log():
    t = np.arange(7.0, 207.0, 0.01)
    drawn = SensorNoise(0.5, growth_with_time=1.0).draw(np.random.default_rng(2), t)
    tenth = t.size // 10
    assert np.std(drawn[:tenth]) == pytest.approx(0.5 * 1.05, rel=0.03)
    assert np.std(drawn[-tenth:]) == pytest.approx(0.5 * 1.95, rel=0.03)


def test_growing_noise_of_a_log_follows_its_motion_and_adds_no_mean():
    log = simulate("handheld", seed=3, duration=60.0, noise=Noise.heteroscedastic(with_rate=1.0))
    truth = log.trajectory.at(log.t).omega
    error, speed = log.gyr - truth, np.linalg.norm(truth, axis=1)
    np.testing.assert_array_equal(log.noise["gyr"], error)
    still, fast = speed < 0.05, speed > 1.5
    white = Noise().gyr.white
    assert np.std(error[still]) == pytest.approx(white, rel=0.08)
    assert np.std(error[fast]) == pytest.approx(white * (1.0 + speed[fast].mean()), rel=0.15)
    assert np.abs(error.mean(axis=0)).max() < 4.0 * np.std(error) / np.sqrt(error.shape[0])


def test_each_kind_of_noise_has_what_its_name_says_and_no_more():
    kinds = {name: make() for name, make in NOISES.items()}
    assert {name for name, n in kinds.items() if n.gyr.coloured > 0.0} == {"coloured", "all together"}
    assert {name for name, n in kinds.items() if n.gyr.random_walk > 0.0} == {"random walk", "all together"}
    assert {name for name, n in kinds.items() if n.attitude_deg > 0.0} == {"reference noise", "all together"}
    assert {name for name, n in kinds.items() if n.mag.growth_with_rate > 0.0} == {"growing with rate"}
    assert {name for name, n in kinds.items() if n.mag.growth_with_time > 0.0} == {"growing with time"}
    assert all(n.jitter > 0.0 and n.dropped > 0.0 and n.acc.resolution > 0.0 for n in kinds.values())
