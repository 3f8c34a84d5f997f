"""Effects outside the catalogue do what their physics say."""

import numpy as np
import pytest
from imufit.lab.simulate import INJECTIONS, OUTSIDE, Noise, SensorNoise, simulate
from imufit.lab.simulate.outside import beyond, past, play, vee

QUIET = Noise(acc=SensorNoise(1e-300), gyr=SensorNoise(1e-300), mag=SensorNoise(1e-300), temperature=0.0)
COLUMNS = ("motor_current", "vbat")


def change(name, parameters, scenario="handheld", seed=5, duration=40.0):
    """Return the log with an effect, and what the effect changes in its sensor, (n, 3)."""
    sensor = name.partition(".")[0]
    options = {"duration": duration, "noise": QUIET, "covariates": COLUMNS}
    with_it, without = (simulate(scenario, effects, seed, **options) for effects in ({name: parameters}, {}))
    return with_it, getattr(with_it, sensor) - getattr(without, sensor)


def three(x, y, z, **inner):
    return {"x": x, "y": y, "z": z, **inner}


def explained(signal, *courses):
    """Return the share of a signal's square that a straight line in the courses explains."""
    design = np.stack([np.ones_like(signal), *courses], axis=1)
    fit, *_ = np.linalg.lstsq(design, signal, rcond=None)
    return 1.0 - np.sum((signal - design @ fit) ** 2) / np.sum((signal - signal.mean()) ** 2)


def test_there_are_more_than_ten_kinds_and_none_is_in_the_catalogue():
    assert len({entry.kind for entry in OUTSIDE.values()}) >= 10
    assert not set(OUTSIDE) & set(INJECTIONS)
    assert {name.partition(".")[0] for name in OUTSIDE} == {"acc", "gyr", "mag"}


@pytest.mark.parametrize("name", OUTSIDE)
def test_each_changes_its_sensor_alone_and_no_more_than_its_size_says(name):
    entry = OUTSIDE[name]
    options = {"duration": 30.0, "size": 2.0, "covariates": COLUMNS}
    with_it, without = (simulate(entry.scenarios[0], effects, 2, **options) for effects in ({name: None}, {}))
    for sensor in ("acc", "gyr", "mag"):
        apart = getattr(with_it, sensor) - getattr(without, sensor)
        size = np.sqrt(np.mean(apart**2)) / Noise().white()[sensor]
        assert size == pytest.approx(2.0 if sensor == name[:3] else 0.0, rel=0.01)


def test_vee_is_even_about_the_middle_of_the_range():
    course = np.linspace(-3.0, 5.0, 101)
    np.testing.assert_allclose(vee(course), vee(course)[::-1], atol=1e-12)
    assert vee(course).mean() == pytest.approx(0.0, abs=1e-12)
    log, apart = change("gyr.current_vee", three(1e-3, 0.0, 0.0))
    current = log.covariates["motor_current"]
    middle = 0.5 * (current.min() + current.max())
    np.testing.assert_allclose(apart[:, 0], 1e-3 * vee(current - current.mean()), atol=1e-12)
    assert explained(apart[:, 0], np.abs(current - middle)) > 0.999


def test_threshold_is_flat_below_and_rises_above():
    course = np.linspace(0.0, 1.0, 1001)
    shape = beyond(course, 0.8)
    assert np.ptp(shape[course < 0.8]) == pytest.approx(0.0, abs=1e-12)
    assert np.diff(shape[course > 0.81]).min() == pytest.approx(1e-3)


def test_hysteresis_depends_on_the_direction_and_not_on_the_temperature_alone():
    warming = np.concatenate([np.linspace(0.0, 10.0, 500), np.linspace(10.0, 0.0, 500)])
    lag = play(warming, 2.0) - warming
    np.testing.assert_allclose(lag[200:500], -1.0)
    np.testing.assert_allclose(lag[700:], 1.0, atol=0.05)
    log, apart = change("acc.thermal_hysteresis", three(0.1, 0.0, 0.0, width=0.2), duration=120.0)
    assert np.abs(apart[:, 0]).max() == pytest.approx(0.1, rel=1e-6)
    falling = np.gradient(log.temp) < 0.0
    assert apart[falling, 0].mean() > 0.03
    assert apart[~falling, 0].mean() < -0.03


def test_gain_follows_the_current():
    log, apart = change("gyr.scale_current", three(1e-2, 0.0, 0.0))
    rate = log.trajectory.at(log.t).omega[:, 0]
    current = log.covariates["motor_current"]
    np.testing.assert_allclose(apart[:, 0], 1e-2 * (current - current.mean()) * rate, atol=1e-12)


def test_dead_zone_shows_nothing_of_slow_turning_and_all_of_fast():
    log, apart = change("gyr.dead_zone", three(0.1, 0.2, 0.05))
    rate = log.trajectory.at(log.t).omega
    slow = np.abs(rate) < [0.1, 0.2, 0.05]
    assert np.abs(log.gyr[slow]).max() < 1e-12
    np.testing.assert_allclose(apart[~slow], 0.0, atol=1e-12)


def test_step_of_the_bias_happens_once():
    log, apart = change("acc.bias_step", three(0.3, -0.2, 0.1, at=0.4))
    jumps = np.abs(np.diff(apart, axis=0)).max(axis=1) > 1e-9
    assert jumps.sum() == 1
    assert log.t[1:][jumps][0] == pytest.approx(0.4 * log.t[-1], abs=0.02)
    np.testing.assert_allclose(apart[-1] - apart[0], [0.3, -0.2, 0.1])


def test_another_level_lasts_as_long_as_it_says():
    log, apart = change("gyr.other_level", three(5e-3, 0.0, -2e-3, at=0.3, length=0.1))
    inside = (log.t > 0.3 * log.t[-1]) & (log.t < 0.4 * log.t[-1])
    np.testing.assert_allclose(apart[inside].mean(axis=0) - apart[~inside].mean(axis=0), [5e-3, 0.0, -2e-3], rtol=0.02)
    assert np.ptp(apart[inside][5:-5], axis=0).max() < 1e-12


def test_field_of_a_passing_magnet_falls_with_the_cube_of_its_distance():
    log, apart = change("mag.passing_magnet", three(3.0, 0.0, 0.0, at=0.5, width=0.02))
    field, away = apart[:, 0] - apart[:, 0].min(), np.abs(log.t - 0.5 * log.t[-1]) / (0.02 * log.t[-1])
    assert np.ptp(field) == pytest.approx(3.0, rel=0.01)
    near, far = (field[np.argmin(np.abs(away - distance))] for distance in (5.0, 10.0))
    assert near / far == pytest.approx(8.0, rel=0.1)


def test_hum_is_fast_in_nature_and_slow_in_the_log():
    log, apart = change("mag.mains_hum", three(1.0, 0.0, 0.0, frequency=100.05, phase=0.3))
    np.testing.assert_allclose(apart[:, 0], np.sin(2 * np.pi * 0.05 * (log.t - log.t[0]) + 0.3), atol=1e-9)


def test_error_of_one_axis_follows_the_rate_of_the_next():
    log, apart = change("gyr.cross_rate", three(1e-2, 0.0, 0.0))
    rate = np.abs(log.trajectory.at(log.t).omega)
    assert explained(apart[:, 0], rate[:, 1]) > 0.999
    assert explained(apart[:, 0], rate[:, 0]) < 0.9
    assert OUTSIDE["gyr.cross_rate"].causes == (("omega_y",), ("omega_z",), ("omega_x",))


def test_product_of_two_covariates_is_no_sum_of_them():
    log, apart = change("acc.current_voltage", three(1.0, 0.0, 0.0), duration=120.0)
    current, voltage = (log.covariates[name] - log.covariates[name].mean() for name in COLUMNS)
    np.testing.assert_allclose(apart[:, 0], current * voltage, atol=1e-12)
    assert explained(apart[:, 0], current, voltage) < 0.5


def test_field_that_varies_in_space_has_no_sources():
    name = "mag.field_gradient"
    parameters = {"x": 2.0, "y": -1.0, "xy": 0.5, "xz": 1.5, "yz": -0.5}
    log, apart = change(name, parameters, scenario="arm")
    truth = log.trajectory.at(log.t)
    world = np.einsum("nij,nj->ni", truth.rotation, apart)
    position = truth.position - truth.position.mean(axis=0)
    gradient, *_ = np.linalg.lstsq(position, world, rcond=None)
    np.testing.assert_allclose(position @ gradient, world, atol=1e-9)
    assert np.trace(gradient) == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(gradient, gradient.T, atol=1e-9)


def test_a_creeping_sensor_follows_a_step_by_and_by():
    since = np.arange(0.0, 30.0, 0.01)
    step = np.where(since > 5.0, 1.0, 0.0)[:, None]
    behind = past(step, since, 3.0)[:, 0]
    np.testing.assert_allclose(behind[since > 5.0], 1.0 - np.exp(-(since[since > 5.0] - 5.0) / 3.0), atol=5e-3)
    log, apart = change("acc.creep", three(0.01, 0.0, 0.0, forgotten=3.0), scenario="poses")
    force = log.acc - apart
    np.testing.assert_allclose(apart[:, 0], 0.01 * (past(force, log.t, 3.0) - force)[:, 0], atol=1e-9)


def test_a_knock_turns_what_is_measured_and_keeps_its_length():
    log, apart = change("acc.knock", three(0.0, 0.0, 1e-3, at=0.5), scenario="poses")
    force = log.acc - apart
    before = log.t < 0.49 * log.t[-1]
    np.testing.assert_allclose(apart[before], np.cross(force[before], [0.0, 0.0, -5e-4]), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(log.acc, axis=1), np.linalg.norm(force, axis=1), rtol=1e-6)


def test_a_tone_has_its_frequency():
    log, apart = change("gyr.tone", three(5e-3, 0.0, 0.0, frequency=1.7, phase=0.2))
    np.testing.assert_allclose(apart[:, 0], 5e-3 * np.sin(2 * np.pi * 1.7 * (log.t - log.t[0]) + 0.2), atol=1e-9)


def test_errors_follow_heading_and_speed():
    log, apart = change("acc.heading", three(0.05, 0.0, 0.0))
    heading = np.arctan2(*log.trajectory.at(log.t).rotation[:, [1, 0], 0].T)
    assert explained(apart[:, 0], np.cos(2.0 * heading)) > 0.999
    log, apart = change("gyr.speed", three(0.02, 0.0, 0.0), scenario="arm")
    speed = np.linalg.norm(np.gradient(log.trajectory.at(log.t).position, log.t, axis=0), axis=1)
    assert explained(apart[:, 0], speed**2) > 0.99
