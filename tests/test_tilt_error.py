"""The error of a tilt, and the rests, moves and vibrations it is judged over."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imufit.log import Log
from imufit.replaying.stretches import find_stretches
from imufit.replaying.tilt_error import TiltReference, inclination_of_z
from scipy.spatial.transform import Rotation

AXIS = {"x": np.array([1.0, 0, 0]), "y": np.array([0, 1.0, 0]), "z": np.array([0, 0, 1.0])}


def scalar_first(rotation: Rotation) -> np.ndarray:
    return rotation.as_quat()[:, [3, 0, 1, 2]]


def reference(rotation: Rotation, axis: str | None, frame: str = "NWU") -> TiltReference:
    n = len(rotation)
    found = TiltReference.of(
        Log.from_arrays(0.01 * np.arange(n), acc=np.ones((n, 3)), reference=rotation, rig_axis=axis, frame=frame)
    )
    assert found is not None
    return found


@settings(max_examples=60, deadline=None)
@given(
    axis=st.sampled_from(["x", "y"]),
    frame=st.sampled_from(["NED", "ENU", "NWU"]),
    error=st.floats(-2.5, 2.5),
    heading=st.floats(-3.1, 3.1),
)
def test_the_angle_about_a_level_axis_is_found_at_every_angle_and_heading(axis, frame, error, heading) -> None:
    angle = np.linspace(-3.1, 3.1, 40)
    true = Rotation.from_rotvec(angle[:, None] * AXIS[axis])
    estimate = Rotation.from_rotvec([0, 0, heading]) * true * Rotation.from_rotvec(error * AXIS[axis])
    found = reference(true, axis, frame).error(scalar_first(estimate))
    np.testing.assert_allclose(found[:, 0], error, atol=1e-9)


def test_with_the_right_heading_it_is_the_twist_about_the_axis() -> None:
    rng = np.random.default_rng(0)
    true = Rotation.from_rotvec(rng.uniform(-3, 3, 200)[:, None] * AXIS["x"])
    away = Rotation.from_rotvec(1e-4 * rng.normal(size=(200, 3)))
    found = reference(true, "x").error(scalar_first(true * away))
    q = scalar_first(away)
    np.testing.assert_allclose(found[:, 0], 2.0 * np.arctan2(q[:, 1], q[:, 0]), atol=1e-7)


def test_a_vertical_axis_shows_the_heading_over_any_number_of_turns() -> None:
    angle = np.linspace(0.0, 3.0, 300)
    drift = np.linspace(0.0, -9.0, 300)
    true = Rotation.from_rotvec(angle[:, None] * AXIS["z"])
    found = reference(true, "z")
    assert found.kind == "heading"
    estimate = scalar_first(true * Rotation.from_rotvec(drift[:, None] * AXIS["z"]))
    np.testing.assert_allclose(found.error(estimate, bounded=False)[:, 0], drift, atol=1e-9)
    assert np.abs(found.error(estimate)).max() <= np.pi
    assert np.isnan(found.error_of_force(np.ones((300, 3)))).all()
    np.testing.assert_allclose(found.angle(), angle, atol=1e-9)


@pytest.mark.parametrize("frame", ["NED", "ENU"])
def test_without_a_rig_it_is_the_horizontal_part_of_the_error(frame) -> None:
    rng = np.random.default_rng(1)
    true = Rotation.from_rotvec(rng.normal(size=(200, 3)))
    error = 1e-4 * rng.normal(size=(200, 3))
    heading = Rotation.from_rotvec(rng.uniform(-3, 3, 200)[:, None] * AXIS["z"])
    found = reference(true, None, frame)
    np.testing.assert_allclose(found.error(scalar_first(Rotation.from_rotvec(error) * true)), error[:, :2], atol=1e-7)
    # The heading of the estimate does not matter, whatever it is.
    length = np.linalg.norm(found.error(scalar_first(heading * Rotation.from_rotvec(error) * true)), axis=1)
    np.testing.assert_allclose(length, np.linalg.norm(error[:, :2], axis=1), atol=1e-7)
    up = np.array([0.0, 0.0, -1.0 if frame == "NED" else 1.0])
    q = scalar_first(Rotation.from_rotvec([[0.3, 0.0, 1.0]]))
    assert inclination_of_z(q, up)[0] == pytest.approx(np.arccos(Rotation.from_rotvec([0.3, 0, 1.0]).as_matrix()[2, 2]))


def test_specific_force_shows_the_tilt_it_points_to() -> None:
    rng = np.random.default_rng(2)
    angle, error = rng.uniform(-3, 3, 100), rng.uniform(-0.5, 0.5, 100)
    true = Rotation.from_rotvec(angle[:, None] * AXIS["y"])
    force = Rotation.from_rotvec((angle + error)[:, None] * AXIS["y"]).inv().apply([0.0, 0.0, 7.0])
    np.testing.assert_allclose(reference(true, "y").error_of_force(force)[:, 0], error, atol=1e-12)


def moved(angle: np.ndarray, acc: np.ndarray | None = None, quantum: float = 0.0):
    t = 0.01 * np.arange(angle.size)
    seen = np.round(angle / quantum) * quantum if quantum else angle
    q = scalar_first(Rotation.from_rotvec(np.radians(seen)[:, None] * AXIS["x"]))
    return find_stretches(t, q, acc)


@pytest.mark.parametrize("quantum", [0.0, 0.088])
def test_rests_and_moves_are_found_to_a_few_rows(quantum) -> None:
    t = 0.01 * np.arange(6000)
    angle = np.interp(t, [0, 20, 22, 40, 40.5, 60], [0, 0, -5, -5, 1, 1])
    found = moved(angle, quantum=quantum)
    edges = [t[row] for rest in found.rests for row in (rest.start, rest.stop - 1)]
    np.testing.assert_allclose(edges, [0.0, 20.0, 22.0, 40.0, 40.5, 59.99], atol=0.06)
    assert [rest.after_move for rest in found.rests] == [False, True, True]
    assert [rest.before_move for rest in found.rests] == [True, True, False]
    assert np.degrees(found.rests[1].turn) == pytest.approx(5.0, abs=0.1)
    assert len(found.moves) == 2
    inside = (t > 20.1) & (t < 21.9)
    assert found.moving[inside].all()


def test_a_reference_slower_than_the_log_and_one_with_noise_rest_as_well() -> None:
    t = 0.01 * np.arange(3000)
    angle = np.interp(t, [0, 10, 12, 30], [0, 0, 5, 5])
    q = scalar_first(Rotation.from_rotvec(np.radians(angle)[:, None] * AXIS["x"]))
    q[np.arange(3000) % 5 != 0] = np.nan
    slow = find_stretches(t, q, None)
    assert len(slow.rests) == 2
    assert len(slow.moves) == 1
    noisy = moved(angle + 0.03 * np.random.default_rng(1).normal(size=3000))
    assert len(noisy.rests) == 2
    assert len(noisy.moves) == 1


def test_a_log_that_never_rests_has_no_rests() -> None:
    t = 0.01 * np.arange(3000)
    found = moved(90.0 - 90.0 * np.cos(t), quantum=0.088)
    assert found.rests == ()
    assert found.moving.all()


def test_a_blow_from_the_side_is_found_and_noise_is_not() -> None:
    t = 0.01 * np.arange(3000)
    rng = np.random.default_rng(3)
    acc = np.array([0.0, 0.0, 9.81]) + rng.normal(0.0, 0.03, (3000, 3))
    still = np.zeros(3000)
    assert moved(still, acc).vibrations == ()
    blow = (t >= 12.0) & (t < 12.6)
    acc[blow, 1] += 2.0 * np.exp(-(t[blow] - 12.0) / 0.2) * np.sin(2 * np.pi * 20.0 * t[blow])
    (rows,) = moved(still, acc).vibrations
    assert t[rows[0]] == pytest.approx(12.0, abs=0.15)
    assert 12.3 < t[rows[1]] < 12.9
    # A move shakes the sensor too, and a stop rings: neither is a vibration at rest.
    moving = np.interp(t, [0, 11.7, 12.5, 30], [0, 0, 5, 5])
    assert moved(moving, acc).vibrations == ()


def test_a_log_without_reference_has_no_tilt_error() -> None:
    assert TiltReference.of(Log.from_arrays([0.0, 1.0], acc=np.ones((2, 3)))) is None
