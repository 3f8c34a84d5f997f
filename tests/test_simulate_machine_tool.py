"""A machine tool's table: what its axis does, what a blow does to it, and the noise of the MPU6050 on it."""

import numpy as np
import pytest
from imufit.lab.simulate import Noise, SensorNoise, hidden, simulate
from imufit.lab.simulate.scenarios import build

RATE = 180.0
ANGLES = {"machine_at_1": 1.0, "machine_at_1.5": 1.5, "machine_at_5": 5.0, "machine_move": -5.0}
QUIET = Noise(acc=SensorNoise(0.0), gyr=SensorNoise(0.0))


def tilt(sim):
    return np.degrees(np.arctan2(sim.acc[:, 1], sim.acc[:, 2]))


@pytest.mark.parametrize("name", ANGLES)
def test_the_table_stands_at_zero_and_then_at_the_angle(name):
    sim = simulate(name, duration=40.0, noise=QUIET, frame="ENU")
    angle = np.degrees(sim.ref_angle)
    assert np.all(angle[sim.t < 14.0] == 0.0)
    np.testing.assert_allclose(angle[sim.t > 35.0], ANGLES[name], atol=1e-9)
    np.testing.assert_allclose(tilt(sim), angle, atol=1e-9)
    assert np.degrees(np.abs(sim.gyr)).max() <= 20.0 + 1e-9
    assert sim.mag is None


def test_the_sweep_reaches_both_ends_and_rests_after_each_step():
    sim = simulate("machine_sweep", seed=3, duration=120.0, noise=QUIET, frame="ENU")
    angle = np.degrees(sim.ref_angle)
    assert (angle.min(), angle.max()) == (pytest.approx(-110.0), pytest.approx(30.0))
    still = np.abs(sim.gyr[:, 0]) < 1e-12
    rests = np.unique(np.round(angle[still], 6))
    assert rests.size > 12
    assert 0.25 < still.mean() < 0.75
    assert np.degrees(np.abs(sim.gyr)).max() <= 5.0 + 1e-9


def test_a_blow_shakes_the_sensor_while_the_machine_reports_that_it_stands():
    sim = simulate("machine_struck", seed=5, duration=20.0, rate=1000.0, noise=QUIET, frame="ENU")
    assert not np.any(sim.ref_angle)
    np.testing.assert_array_equal(sim.ref_q, np.tile([1.0, 0.0, 0.0, 0.0], (sim.t.size, 1)))
    before, ringing, after = sim.t < 8.0, (sim.t > 8.0) & (sim.t < 9.0), sim.t > 11.0
    assert not np.any(sim.gyr[before])
    assert 10.0 < np.abs(sim.acc[ringing, 1]).max() < 50.0
    rocking = np.degrees(np.cumsum(sim.gyr[:, 0]) / 1000.0)
    assert 0.005 < np.abs(rocking[ringing]).max() < 0.03
    assert np.abs(rocking[after]).max() < 1e-3
    assert np.abs(sim.acc[after] - [0.0, 0.0, 9.80665]).max() < 0.02
    # It rocks on its feet, half a metre below: the table is accelerated by that times the angular acceleration.
    turning = np.gradient(sim.gyr[:, 0], 1e-3)
    free = (sim.t > 8.01) & (sim.t < 9.0)
    assert np.corrcoef(turning[free], sim.acc[free, 1])[0, 1] < -0.99


def test_the_ringing_frame_moves_with_exact_derivatives():
    path, h = build("machine_struck", np.random.default_rng(6), 20.0).actual, 1e-5
    t = np.linspace(7.9, 8.5, 400)
    before, here, after = (path.at(t + k * h) for k in (-1, 0, 1))
    for value, derivative in (("position", "velocity"), ("velocity", "acceleration"), ("omega", "alpha")):
        found = (getattr(after, value) - getattr(before, value)) / (2 * h)
        expected = getattr(here, derivative)
        assert np.abs(found - expected).max() < 1e-3 * np.abs(expected).max()


def test_a_machine_tool_hides_nothing():
    with pytest.raises(ValueError, match=r"machine_at_5 shows no effect apart from all others: use one of turntable"):
        hidden("machine_at_5", 1)


def test_noise_behind_a_low_pass_has_the_density_and_colour_of_its_physics():
    noise = SensorNoise.from_density(0.01, 20.0)
    assert noise.white == pytest.approx(0.01 * np.sqrt(np.pi / 2 * 20.0))
    t = np.cumsum(np.random.default_rng(1).choice([0.002, 0.011], 60000))
    drawn = noise.draw(np.random.default_rng(2), t)
    assert np.std(drawn) == pytest.approx(noise.white, rel=0.02)
    for gap in (0.002, 0.011):
        pairs = np.flatnonzero(np.abs(np.diff(t) - gap) < 1e-6)
        correlation = np.mean(drawn[pairs] * drawn[pairs + 1]) / np.mean(drawn**2)
        assert correlation == pytest.approx(np.exp(-2 * np.pi * 20.0 * gap), abs=0.02)


def test_the_standing_mpu6050_has_the_published_deviation_and_a_colour():
    for seed in (21, 22):
        still = tilt(simulate("machine_at_1", {}, seed, 60.0, RATE, frame="ENU"))[: int(25 * RATE)]
        assert np.std(still) == pytest.approx(0.1175, rel=0.1)
        assert np.corrcoef(still[1:], still[:-1])[0, 1] == pytest.approx(np.exp(-2 * np.pi * 21.0 / RATE), abs=0.04)
