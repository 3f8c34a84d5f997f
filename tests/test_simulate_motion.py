"""The true motion: its derivatives, its frames, and what an ideal sensor on it reads."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imufit.lab.simulate.environment import FRAMES, GRAVITY, Temperature, field_vector, gravity_vector
from imufit.lab.simulate.motion import Cruise, Product, Ringing, Sinusoids, Steps, Sum
from imufit.lab.simulate.rig import Backlash, Flexure, Periodic
from imufit.lab.simulate.scenarios import SCENARIOS, build
from imufit.lab.simulate.truth import Kinematics, quaternion_from_matrix, rotation_from_vector
from scipy.spatial.transform import Rotation

STEP = 5e-4


def five_point(values, step):
    """Central difference of order four; values at -2, -1, 1, 2 steps."""
    a, b, c, d = values
    return (a - 8.0 * b + 8.0 * c - d) / (12.0 * step)


def relative(found, expected):
    return np.max(np.abs(found - expected)) / np.max(np.abs(expected))


def smooth_times(n=800):
    return np.linspace(-3.0, 65.0, n) + 1e-4 * np.sqrt(2.0)


def motion(name, seed, t):
    return build(name, np.random.default_rng(seed), 60.0).at(t)


@pytest.mark.parametrize("name", [name for name in SCENARIOS if name != "machine_struck"])  # which stands still
@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_rates_and_accelerations_are_the_derivatives_of_attitude_and_position(name, seed):
    t, h = smooth_times(), STEP
    path = build(name, np.random.default_rng(seed), 60.0)
    here = path.at(t)
    around = [path.at(t + k * h) for k in (-2, -1, 1, 2)]
    turned = [Rotation.from_matrix(np.swapaxes(here.rotation, 1, 2) @ other.rotation).as_rotvec() for other in around]
    assert relative(five_point(turned, h), here.omega) < 1e-6
    assert relative(five_point([k.omega for k in around], h), here.alpha) < 1e-4  # its third derivative has corners
    if SCENARIOS[name].position:
        assert relative(five_point([k.position for k in around], h), here.velocity) < 1e-6
        assert relative(five_point([k.velocity for k in around], h), here.acceleration) < 1e-6
    else:
        assert not np.any(here.position)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_each_scalar_motion_knows_its_derivatives(seed):
    rng = np.random.default_rng(seed)
    swing = Sinusoids.random(rng, 0.2, 2.0, 5)
    steps = Steps(np.array([1.0, 4.0]), np.array([2.0, 3.0]), rng.normal(size=3))
    cruise = Cruise(np.array([1.0, 5.0]), np.array([1.5, 2.0]), rng.normal(size=3), angle=0.3)
    for signal in (
        swing,
        steps,
        cruise,
        Product(steps, swing),
        Product(steps, Ringing(0.5, 0.02, 3.0, 0.04)),
        Sum([cruise, swing]),
        Flexure(swing, 0.01),
        Periodic(cruise, 0.01, -0.02, 9),
    ):
        t, h = np.linspace(0.0, 9.0, 300), 1e-3
        around = [signal.at(t + k * h) for k in (-2, -1, 1, 2)]
        assert relative(five_point([s.value for s in around], h), signal.at(t).rate) < 1e-6
        assert relative(five_point([s.rate for s in around], h), signal.at(t).acceleration) < 1e-6


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("name", SCENARIOS)
def test_specific_force_at_rest_is_gravity_upwards(name, frame):
    t = np.arange(0.0, 60.0, 0.05)
    now = build(name, np.random.default_rng(1), 60.0, frame).at(t)
    force = now.specific_force(gravity_vector(frame))
    rest = (np.linalg.norm(now.omega, axis=1) < 1e-9) & (np.linalg.norm(now.acceleration, axis=1) < 1e-9)
    assert rest.sum() > 20
    up = {"NED": -1.0, "ENU": 1.0, "NWU": 1.0}[frame]
    in_frame = (now.rotation[rest] @ force[rest][:, :, None])[:, :, 0]
    np.testing.assert_allclose(in_frame, np.broadcast_to([0.0, 0.0, up * GRAVITY], in_frame.shape), atol=1e-7)


def test_field_points_north_and_down_in_each_frame():
    np.testing.assert_array_equal(field_vector("NED"), [20.0, 0.0, 44.0])
    np.testing.assert_array_equal(field_vector("ENU"), [0.0, 20.0, -44.0])
    np.testing.assert_array_equal(field_vector("NWU"), [20.0, 0.0, -44.0])


def test_displaced_point_has_the_second_difference_of_its_position_as_acceleration():
    r, t, h = np.array([0.3, -0.2, 0.1]), smooth_times(300), 1e-3
    path = build("handheld", np.random.default_rng(4), 60.0)
    p = [path.at(t + k * h).displaced(r).position for k in (-2, -1, 0, 1, 2)]
    second = (-p[0] + 16 * p[1] - 30 * p[2] + 16 * p[3] - p[4]) / (12 * h**2)
    assert relative(second, path.at(t).displaced(r).acceleration) < 1e-6


def test_mounted_frame_reads_the_same_vectors_turned():
    now = motion("handheld", 2, smooth_times(50))
    phi = np.array([0.1, -0.2, 0.3])
    turned = now.mounted(rotation_from_vector(phi))
    for before, after in ((now.omega, turned.omega), (now.alpha, turned.alpha)):
        np.testing.assert_allclose(after, Rotation.from_rotvec(-phi).apply(before), atol=1e-14)
    np.testing.assert_allclose(turned.rotation, now.rotation @ Rotation.from_rotvec(phi).as_matrix(), atol=1e-14)


def test_motion_of_a_tilted_base_is_turned_as_a_whole():
    now = motion("arm", 2, smooth_times(50))
    base = rotation_from_vector(np.array([0.02, -0.01, 0.0]))
    moved = now.carried(base)
    assert isinstance(moved, Kinematics)
    np.testing.assert_allclose(moved.acceleration, now.acceleration @ base.T, atol=1e-14)
    np.testing.assert_array_equal(moved.omega, now.omega)


def test_quaternions_are_unit_continuous_and_rotate_body_vectors_into_the_frame():
    now = motion("turntable", 3, np.arange(0.0, 60.0, 0.01))
    q = quaternion_from_matrix(now.rotation)
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-12)
    assert np.all(np.sum(q[1:] * q[:-1], axis=1) > 0.9)
    np.testing.assert_allclose(Rotation.from_quat(q[:, [1, 2, 3, 0]]).as_matrix(), now.rotation, atol=1e-12)


def test_turntable_turns_about_one_axis_at_a_time_and_about_each():
    now = motion("turntable", 5, np.arange(0.0, 60.0, 0.05))
    fast = np.linalg.norm(now.omega, axis=1) > 1.0
    share = np.max(np.abs(now.omega[fast]), axis=1) / np.linalg.norm(now.omega[fast], axis=1)
    single = share > 1.0 - 1e-9
    assert single.mean() > 0.8
    assert set(np.argmax(np.abs(now.omega[fast][single]), axis=1)) == {0, 1, 2}


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_tilt_turns_about_the_rig_axis_only(axis):
    now = build("tilt", np.random.default_rng(0), 60.0, "NED", axis).at(np.arange(0.0, 60.0, 0.1))
    others = [i for i in range(3) if i != axis]
    assert np.max(np.abs(now.omega[:, axis])) > 0.1
    assert not np.any(now.omega[:, others])


def test_handheld_is_as_lively_as_a_hand():
    now = motion("handheld", 6, np.arange(0.0, 60.0, 0.01))
    assert 1.0 < np.sqrt(np.mean(np.sum(now.omega**2, axis=1))) < 2.5
    assert 1.0 < np.sqrt(np.mean(np.sum(now.acceleration**2, axis=1))) < 3.0


def test_backlash_stands_still_after_a_reversal_until_the_play_is_crossed():
    drive = Steps(np.array([1.0, 4.0]), np.array([2.0, 2.0]), np.array([0.0, 1.0, 0.0]))
    axis = Backlash(drive, 0.2, 0.0, 8.0)
    t = np.linspace(0.5, 7.5, 20001)
    real, commanded = axis.at(t), drive.at(t)
    assert axis.at(np.array([3.5])).value == pytest.approx(0.9)
    assert axis.at(np.array([7.0])).value == pytest.approx(0.1)
    waiting = (t > 4.0) & (commanded.value > 0.8 + 1e-9)
    assert waiting.sum() > 1000
    np.testing.assert_allclose(real.value[waiting], 0.9)
    assert not np.any(real.rate[waiting])
    np.testing.assert_allclose(np.gradient(real.value, t), real.rate, atol=0.25)  # the axis starts with a jerk


def test_backlash_remembers_where_it_came_from():
    up = Steps(np.array([1.0]), np.array([1.0]), np.array([-1.0, 0.0]))
    down = Steps(np.array([1.0]), np.array([1.0]), np.array([1.0, 0.0]))
    t = np.array([3.0])
    assert up.at(t).value == down.at(t).value == 0.0
    assert Backlash(up, 0.1, 0.0, 4.0).at(t).value == pytest.approx(-0.05)
    assert Backlash(down, 0.1, 0.0, 4.0).at(t).value == pytest.approx(0.05)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_temperature_is_no_function_of_time_alone_and_spans_some_ten_kelvin(seed):
    t = np.linspace(0.0, 120.0, 500)
    course = Temperature.random(np.random.default_rng(seed), 120.0).at(t)
    assert 4.0 < np.ptp(course) < 18.0
    assert np.any(np.diff(course) > 0.0)
    assert np.any(np.diff(course) < 0.0)


def test_unknown_scenario_is_refused_by_name():
    with pytest.raises(ValueError, match="unknown scenario 'swing'"):
        build("swing", np.random.default_rng(0), 10.0)
