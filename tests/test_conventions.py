"""Our conventions against scipy's `Rotation`, an independent implementation.

| ours | scipy |
|---|---|
| q = [w, x, y, z] | from_quat([x, y, z, w]) |
| q_nb, body to reference: x_n = R x_b | Rotation.apply(x_b) |
| a * b: first b, then a | a * b |
| roll, pitch, yaw of Rz(yaw) Ry(pitch) Rx(roll) | as_euler("ZYX") = [yaw, pitch, roll] |
| rotation vector | as_rotvec() |
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from imufit import _imufit
from scipy.spatial.transform import Rotation

TOLERANCE = 1e-14


def random_rotations(n: int = 500, seed: int = 0) -> Rotation:
    return Rotation.random(n, rng=np.random.default_rng(seed))


def ours(rotation: Rotation) -> np.ndarray:
    return np.ascontiguousarray(rotation.as_quat()[:, [3, 0, 1, 2]])


def theirs(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(q[:, [1, 2, 3, 0]])


def angle_between(a: Rotation, b: Rotation) -> float:
    # the vector part, which unlike the arc cosine resolves small angles
    return float((2.0 * np.linalg.norm((a.inv() * b).as_quat()[:, :3], axis=1)).max())


def test_products_compose_like_scipys_rotations() -> None:
    a, b = random_rotations(seed=1), random_rotations(seed=2)
    assert angle_between(theirs(_imufit.quaternion_product(ours(a), ours(b))), a * b) < TOLERANCE


def test_a_quaternion_takes_body_vectors_into_the_reference_frame() -> None:
    rotation = random_rotations()
    x = np.random.default_rng(3).normal(size=(500, 3))
    np.testing.assert_allclose(_imufit.rotate(ours(rotation), x), rotation.apply(x), atol=1e-14)
    np.testing.assert_allclose(_imufit.rotate_back(ours(rotation), x), rotation.inv().apply(x), atol=1e-14)


def test_the_scalar_comes_first() -> None:
    quarter_turn_about_z = np.array([[np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]])
    np.testing.assert_allclose(
        _imufit.rotate(quarter_turn_about_z, np.array([[1.0, 0.0, 0.0]])), [[0, 1, 0]], atol=1e-15
    )


def test_euler_angles_are_scipys_intrinsic_zyx_reversed() -> None:
    rotation = random_rotations()
    euler = _imufit.euler_from_quaternion(ours(rotation))
    np.testing.assert_allclose(euler[:, ::-1], rotation.as_euler("ZYX"), atol=1e-11)
    assert angle_between(theirs(_imufit.quaternion_from_euler(euler)), rotation) < TOLERANCE


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, -np.pi / 2 + 1e-5])
def test_gimbal_lock_keeps_the_attitude(pitch: float) -> None:
    angles = np.array([[0.7, pitch, -1.2], [-2.5, pitch, 3.0]])
    rotation = Rotation.from_euler("ZYX", angles[:, ::-1])
    euler = _imufit.euler_from_quaternion(ours(rotation))
    assert angle_between(Rotation.from_euler("ZYX", euler[:, ::-1]), rotation) < 1e-11
    assert np.abs(euler[:, 1] - pitch).max() < 1e-7


def test_rotation_vectors_and_matrices_are_scipys() -> None:
    rotation = random_rotations()
    np.testing.assert_allclose(
        _imufit.rotation_vector_from_quaternion(ours(rotation)), rotation.as_rotvec(), atol=1e-13
    )
    assert angle_between(theirs(_imufit.quaternion_from_rotation_vector(rotation.as_rotvec())), rotation) < TOLERANCE
    matrices = rotation.as_matrix().reshape(-1, 9)
    np.testing.assert_allclose(_imufit.matrix_from_quaternion_rows(ours(rotation)), matrices, atol=1e-14)
    assert angle_between(theirs(_imufit.quaternion_from_matrix_rows(matrices)), rotation) < 1e-13


def test_a_matrix_that_is_no_rotation_goes_to_the_nearest_one() -> None:
    rng = np.random.default_rng(4)
    m = random_rotations().as_matrix() + rng.normal(scale=0.05, size=(500, 3, 3))
    u, _, vt = np.linalg.svd(m)
    nearest = Rotation.from_matrix(u @ vt)
    found = theirs(_imufit.quaternion_from_matrix_rows(np.ascontiguousarray(m.reshape(-1, 9))))
    assert angle_between(found, nearest) < 1e-13


FRAME_AXES = {  # columns: north, east, up
    "NED": np.array([[1, 0, 0], [0, 1, 0], [0, 0, -1]], float).T,
    "ENU": np.array([[0, 1, 0], [1, 0, 0], [0, 0, 1]], float).T,
    "NWU": np.array([[1, 0, 0], [0, -1, 0], [0, 0, 1]], float).T,
}


@pytest.mark.parametrize("source", FRAME_AXES)
@pytest.mark.parametrize("target", FRAME_AXES)
def test_frames_are_converted_by_their_axes(source: str, target: str) -> None:
    rotation = random_rotations(50)
    turn = Rotation.from_matrix(FRAME_AXES[target] @ FRAME_AXES[source].T)
    assert angle_between(theirs(_imufit.convert_frame(ours(rotation), source, target)), turn * rotation) < TOLERANCE


@pytest.mark.parametrize("frame", FRAME_AXES)
def test_frame_vectors_point_where_their_names_say(frame: str) -> None:
    vectors, axes = _imufit.frame_vectors(frame), FRAME_AXES[frame]
    np.testing.assert_allclose(vectors["north"], axes[:, 0])
    np.testing.assert_allclose(vectors["up"], axes[:, 2])
    assert np.dot(vectors["field"], axes[:, 0]) > 0 > np.dot(vectors["field"], axes[:, 2])


def test_an_unknown_frame_is_named_with_the_choice() -> None:
    with pytest.raises(ValueError, match=r'"ECEF" is unknown.*NED'):
        _imufit.frame_vectors("ECEF")


@given(st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3))
def test_any_rotation_vector_is_the_same_rotation_as_scipys(r: list[float]) -> None:
    q = _imufit.quaternion_from_rotation_vector(np.array([r]))
    assert abs(np.linalg.norm(q) - 1.0) < 1e-14
    assert angle_between(theirs(q), Rotation.from_rotvec([r])) < 1e-12
