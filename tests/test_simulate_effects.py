"""Effects: each is what its physics says, has the wanted size, and leaves motion and noise as they were."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imufit.lab.simulate import INJECTIONS, SCENARIOS, SIZES, injection, simulate
from imufit.lab.simulate.environment import field_vector, gravity_vector
from imufit.lab.simulate.noise import Noise, SensorNoise
from imufit.lab.simulate.sensor import Rows, Setup, readings
from imufit.lab.simulate.separation import Separation, near
from imufit.lab.simulate.study import Study
from scipy.spatial.transform import Rotation

QUIET = Noise(acc=SensorNoise(1e-300), gyr=SensorNoise(1e-300), mag=SensorNoise(1e-300), temperature=0.0)
FIRST = [
    *(f"{s}.{e}" for s in ("acc", "gyr") for e in ("bias", "scale", "misalignment", "bias_temperature")),
    "acc.lever_arm",
    "gyr.g_sensitivity",
    "mag.hard_iron",
    "mag.soft_iron",
    "ref.alignment",
    "ref.delay",
    *(f"{s}.column:vbat" for s in ("acc", "gyr", "mag")),
]


def quiet(scenario, effects=None, **options):
    return simulate(scenario, effects, seed=3, duration=30.0, noise=QUIET, **options)


def truth(log, late=0.0):
    return log.trajectory.at(log.t - late)


GRAVITY, FIELD = gravity_vector("NED"), field_vector("NED")


def test_ideal_sensors_read_the_truth():
    log = quiet("handheld")
    np.testing.assert_allclose(log.acc, truth(log).specific_force(GRAVITY), atol=1e-12)
    np.testing.assert_allclose(log.gyr, truth(log).omega, atol=1e-12)
    np.testing.assert_allclose(log.mag, truth(log).flux_density(FIELD), atol=1e-12)
    np.testing.assert_allclose(log.ref_p, truth(log).position, atol=1e-12)
    attitude = Rotation.from_quat(log.ref_q[:, [1, 2, 3, 0]])
    np.testing.assert_allclose(attitude.as_matrix(), truth(log).rotation, atol=1e-12)
    up = attitude.apply(log.acc) - truth(log).acceleration
    np.testing.assert_allclose(up, np.broadcast_to([0.0, 0.0, -9.80665], up.shape), atol=1e-9)


def test_bias_scale_and_misalignment_are_an_affine_map_of_the_true_force():
    bias, scale = {"x": 0.1, "y": -0.2, "z": 0.3}, {"x": 0.01, "y": -0.02, "z": 0.03}
    cross = {"xy": 1e-3, "xz": 2e-3, "yx": 3e-3, "yz": 4e-3, "zx": 5e-3, "zy": 6e-3}
    log = quiet("poses", {"acc.bias": bias, "acc.scale": scale, "acc.misalignment": cross})
    gain = np.array([[1.01, 1e-3, 2e-3], [3e-3, 0.98, 4e-3], [5e-3, 6e-3, 1.03]])
    expected = truth(log).specific_force(GRAVITY) @ gain.T + [0.1, -0.2, 0.3]
    np.testing.assert_allclose(log.acc, expected, atol=1e-12)


def test_g_sensitivity_adds_a_matrix_times_the_specific_force():
    names = [r + c for r in "xyz" for c in "xyz"]
    log = quiet("handheld", {"gyr.g_sensitivity": dict(zip(names, 1e-4 * np.arange(9), strict=True))})
    expected = truth(log).omega + truth(log).specific_force(GRAVITY) @ (1e-4 * np.arange(9).reshape(3, 3)).T
    np.testing.assert_allclose(log.gyr, expected, atol=1e-12)


def test_iron_is_an_affine_map_of_the_true_field():
    soft = {r + c: 0.01 * i for i, (r, c) in enumerate((r, c) for r in "xyz" for c in "xyz")}
    log = quiet("handheld", {"mag.soft_iron": soft, "mag.hard_iron": {"x": 5.0, "y": -3.0, "z": 1.0}})
    field = truth(log).flux_density(FIELD)
    gain = np.eye(3) + 0.01 * np.arange(9).reshape(3, 3)
    np.testing.assert_allclose(log.mag, field @ gain.T + [5.0, -3.0, 1.0], atol=1e-12)


def test_lever_arm_reads_the_second_difference_of_the_displaced_position():
    r, h = {"x": 0.1, "y": -0.05, "z": 0.2}, 1e-3
    log = quiet("handheld", {"acc.lever_arm": r})
    p = [log.trajectory.at(log.t + k * h).displaced(np.array([0.1, -0.05, 0.2])).position for k in (-2, -1, 0, 1, 2)]
    acceleration = (-p[0] + 16 * p[1] - 30 * p[2] + 16 * p[3] - p[4]) / (12 * h**2)
    expected = (np.swapaxes(truth(log).rotation, 1, 2) @ (acceleration - GRAVITY)[:, :, None])[:, :, 0]
    np.testing.assert_allclose(log.acc, expected, atol=2e-5)


@pytest.mark.parametrize("sensor", ["acc", "gyr", "mag"])
def test_late_sensor_shows_the_earlier_truth_and_the_others_the_present(sensor):
    log = quiet("handheld", {f"{sensor}.delay": {"tau": 0.037}})
    for name in ("acc", "gyr", "mag"):
        then = truth(log, 0.037 if name == sensor else 0.0)
        expected = {"acc": then.specific_force(GRAVITY), "gyr": then.omega, "mag": then.flux_density(FIELD)}[name]
        np.testing.assert_allclose(getattr(log, name), expected, atol=1e-12)


def test_late_reference_shows_the_earlier_attitude_and_position():
    log = quiet("arm", {"ref.delay": {"tau": 0.02}})
    np.testing.assert_allclose(log.ref_p, truth(log, 0.02).position, atol=1e-12)
    attitude = Rotation.from_quat(log.ref_q[:, [1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(attitude, truth(log, 0.02).rotation, atol=1e-12)
    np.testing.assert_allclose(log.gyr, truth(log).omega, atol=1e-12)


def test_turned_mount_turns_what_all_sensors_see_but_not_the_reference():
    phi = {"x": 0.02, "y": -0.03, "z": 0.05}
    log, straight = quiet("handheld", {"ref.alignment": phi}), quiet("handheld")
    back = Rotation.from_rotvec([-0.02, 0.03, -0.05])
    for name in ("acc", "gyr", "mag"):
        np.testing.assert_allclose(getattr(log, name), back.apply(getattr(straight, name)), atol=1e-11)
    np.testing.assert_array_equal(log.ref_q, straight.ref_q)


def test_tilted_table_turns_gravity_and_field_but_not_the_rate():
    log, level = quiet("poses", {"ref.tilt": {"x": 0.01, "y": -0.02}}), quiet("poses")
    attitude = Rotation.from_quat(log.ref_q[:, [1, 2, 3, 0]])
    tilt = Rotation.from_rotvec([0.01, -0.02, 0.0])
    np.testing.assert_allclose(log.acc, (tilt * attitude).inv().apply(-GRAVITY), atol=1e-10)
    np.testing.assert_array_equal(log.gyr, level.gyr)


@pytest.mark.parametrize("effect", ["gyr.bias_temperature", "acc.bias_temperature", "mag.bias_temperature"])
def test_bias_follows_temperature_less_its_mean(effect):
    c = np.array([1e-3, -2e-3, 3e-3])
    sensor = effect[:3]
    log = quiet("turntable", {effect: dict(zip("xyz", c, strict=True))})
    change = getattr(log, sensor) - getattr(quiet("turntable"), sensor)
    np.testing.assert_allclose(change, np.outer(log.temp - log.temp.mean(), c), atol=1e-10)


@pytest.mark.parametrize("name", ["vbat", "motor_current", "humidity"])
def test_column_acts_less_its_mean(name):
    log = quiet("handheld", {f"gyr.column:{name}": {"x": 0.01, "y": 0.0, "z": -0.02}}, covariates=["vbat"])
    column = log.covariates[name] - log.covariates[name].mean()
    change = log.gyr - quiet("handheld").gyr
    np.testing.assert_allclose(change, np.outer(column, [0.01, 0.0, -0.02]), atol=1e-12)


def test_lag_obeys_its_differential_equation():
    tau = 0.05
    log = quiet("handheld", {"gyr.lowpass": {"tau": tau}}, rate=1000.0)
    slope = (log.gyr[2:] - log.gyr[:-2]) * 500.0
    np.testing.assert_allclose(tau * slope, truth(log).omega[1:-1] - log.gyr[1:-1], atol=2e-4)


def test_clipped_readings_stay_in_range_with_noise_and_are_untouched_within():
    log = simulate("handheld", {"acc.saturation": {"range": 7.0}}, seed=3, duration=30.0)
    free = simulate("handheld", seed=3, duration=30.0)
    assert np.max(np.abs(log.acc)) == 7.0
    assert np.mean(np.abs(free.acc) > 7.0) > 0.05
    np.testing.assert_array_equal(log.acc, np.clip(free.acc, -7.0, 7.0))


def test_rig_with_backlash_lags_behind_its_command_in_both_directions():
    log = quiet("tilt", {"rig.backlash": {"width": 0.02}})
    angle = np.unwrap(np.arctan2(-log.acc[:, 1], -log.acc[:, 2]))  # f = -R^T g about x
    error = angle - log.ref_angle
    rate = truth(log).omega[:, 0]
    assert np.max(np.abs(error)) < 0.0100001
    assert np.median(error[rate > 0.05]) == pytest.approx(-0.01)
    assert np.median(error[rate < -0.05]) == pytest.approx(0.01)


def test_flexure_and_periodic_error_change_the_angle_as_stated():
    log = quiet("tilt", {"rig.flexure": {"k": 0.01}})
    angle = np.arctan2(-log.acc[:, 1], -log.acc[:, 2])
    np.testing.assert_allclose(angle - log.ref_angle, 0.01 * np.sin(log.ref_angle), atol=1e-9)
    log = quiet("tilt", {"rig.periodic": {"a": 0.01, "b": -0.02, "N": 12}})
    angle = np.arctan2(-log.acc[:, 1], -log.acc[:, 2])
    expected = 0.01 * np.cos(12 * log.ref_angle) - 0.02 * np.sin(12 * log.ref_angle)
    np.testing.assert_allclose(angle - log.ref_angle, expected, atol=1e-9)


def test_field_reference_in_the_metadata_is_off_by_the_stated_vector():
    log = quiet("handheld", {"mag.field_reference": {"x": 1.0, "y": -2.0, "z": 3.0}})
    assert log.metadata["mag_reference"] == FIELD.tolist()
    np.testing.assert_allclose(log.mag, truth(log).flux_density(FIELD + np.array([1.0, -2.0, 3.0])), atol=1e-11)


def possible(effect, scenario):
    return SCENARIOS[scenario].rig or not effect.startswith("rig.")


POSSIBLE = [(s, e) for s in ("handheld", "tilt") for e in (*INJECTIONS, "gyr.column:vbat") if possible(e, s)]


@pytest.mark.parametrize(("scenario", "effect"), POSSIBLE)
def test_drawn_effect_has_the_wanted_size_in_the_sensor_it_affects_most(scenario, effect):
    log = simulate(scenario, {effect: None}, seed=5, duration=60.0, size="large")
    assert log.truth.sizes[effect] == pytest.approx(SIZES["large"], rel=0.02)
    assert tuple(log.truth.effects[effect]) == injection(effect).parameters


@pytest.mark.parametrize("effect", FIRST)
@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 2**31), size=st.sampled_from(list(SIZES)))
def test_size_is_the_change_of_the_reading_over_the_noise(effect, seed, size):
    log = simulate("handheld", {effect: None}, seed=seed, duration=20.0, size=size)
    parameters = log.truth.effects[effect]
    with_effect = simulate("handheld", {effect: parameters}, seed, 20.0, noise=QUIET)
    late = parameters["tau"] if effect == "ref.delay" else 0.0
    then = truth(with_effect, late)
    ideal = {"acc": then.specific_force(GRAVITY), "gyr": then.omega, "mag": then.flux_density(FIELD)}
    ratios = [
        np.sqrt(np.mean((getattr(with_effect, name) - ideal[name]) ** 2)) / Noise().white()[name]
        for name in injection(effect).sensors
    ]
    assert max(ratios) == pytest.approx(SIZES[size], rel=0.02)
    scaled = np.abs([parameters[name] / typical for name, typical in injection(effect).typical.items()])
    assert scaled.min() > 0.3 * scaled.max()


def test_effects_leave_motion_environment_and_noise_of_a_seed_alone():
    plain = simulate("handheld", seed=8, duration=20.0)
    other = simulate("handheld", {"acc.bias": {"x": 0.5}, "gyr.scale": None}, seed=8, duration=20.0)
    np.testing.assert_allclose(other.acc - plain.acc, np.broadcast_to([0.5, 0.0, 0.0], plain.acc.shape), atol=1e-12)
    for name in ("t", "mag", "temp", "ref_q", "ref_p"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(other, name))


def test_effects_compose_in_physical_order_whatever_the_order_they_are_named_in():
    effects = {"acc.saturation": {"range": 9.0}, "acc.scale": {"x": 0.1}, "acc.delay": {"tau": 0.01}}
    log = quiet("handheld", effects)
    expected = truth(log, 0.01).specific_force(GRAVITY) * [1.1, 1.0, 1.0]
    np.testing.assert_allclose(log.acc, np.clip(expected, -9.0, 9.0), atol=1e-12)


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ({"acc.wobble": None}, "unknown effect 'acc.wobble'"),
        ({"acc.bias": {"q": 1.0}}, "has no parameter 'q'"),
        ({"acc.delay": {}}, "needs the parameter 'tau'"),
        ({"acc.delay": {"tau": -0.1}}, "must not be negative"),
        ({"acc.bias": {"x": float("nan")}}, "not finite"),
        ({"rig.backlash": None}, "one-axis rig"),
        ({"mag.column:motor_current": None}, "mag.current"),
        ({"acc.column:": None}, "unknown effect"),
    ],
)
def test_impossible_effects_are_refused_by_name(effects, message):
    with pytest.raises(ValueError, match=message):
        simulate("handheld", effects, duration=5.0)


def test_effect_of_a_sensor_that_is_not_there_is_refused():
    with pytest.raises(ValueError, match="needs mag"):
        simulate("handheld", {"mag.hard_iron": None}, duration=5.0, sensors=("acc", "gyr"))


def test_effect_that_a_motion_cannot_show_is_refused_rather_than_made_huge():
    with pytest.raises(ValueError, match="hardly excited"):
        Study("tilt", ["rig.flexure"], duration=1.0).draw("rig.flexure", "large")


def test_delay_and_lag_of_one_sensor_are_too_near_and_a_bias_is_far_from_its_rivals():
    study = Study("handheld", [], duration=30.0)
    separation = Separation(study, ())
    slow = separation.distances("gyr.lowpass", study.draw("gyr.lowpass", "small"))
    assert near(slow, 1.0) == ("gyr.delay",)
    assert min(separation.distances("acc.bias", study.draw("acc.bias", "large")).values()) > 1000.0


def test_setup_without_effects_reads_ideal_values():
    study = Study("arm", [], duration=5.0)
    rows = Rows(study.rows.t)
    ideal = readings(Setup.ideal(study.trajectory, study.environment), rows)
    np.testing.assert_array_equal(ideal["gyr"], rows.kinematics(study.trajectory, 0.0).omega)
