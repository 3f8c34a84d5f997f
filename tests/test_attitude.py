"""Attitude errors, tables at the border, and the stub of the compiled module."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from imufit import _imufit
from scipy.spatial.transform import Rotation


def scalar_first(rotation: Rotation) -> np.ndarray:
    return np.ascontiguousarray(np.atleast_2d(rotation.as_quat())[:, [3, 0, 1, 2]])


class TestAttitudeError:
    """Error e = q_est * q_ref^-1, seen in the reference frame."""

    def test_heading_inclination_and_total_of_a_known_error(self) -> None:
        ref = Rotation.random(200, rng=np.random.default_rng(0))
        tilt = Rotation.from_rotvec([0.05, -0.12, 0.0])
        turn = Rotation.from_rotvec([0.0, 0.0, 0.3])
        errors = _imufit.attitude_errors(scalar_first(tilt * turn * ref), scalar_first(ref))
        expected = [(tilt * turn).magnitude(), 0.3, 0.13, *(tilt * turn).as_euler("ZYX")[::-1]]
        np.testing.assert_allclose(errors, np.tile(expected, (200, 1)), atol=1e-13)

    def test_a_rotation_in_the_body_is_seen_in_the_reference_frame(self) -> None:
        ref = Rotation.from_euler("ZYX", [0.0, np.pi / 2, 0.0])  # body x points down in a frame with z up
        errors = _imufit.attitude_errors(scalar_first(ref * Rotation.from_rotvec([0.1, 0, 0])), scalar_first(ref))
        np.testing.assert_allclose(errors[0, :3], [0.1, -0.1, 0.0], atol=1e-12)

    def test_rmse_counts_rows_with_reference_and_mask(self) -> None:
        rng = np.random.default_rng(1)
        ref = Rotation.random(1000, rng=rng)
        est = Rotation.from_rotvec(rng.normal([0.02, 0.0, 0.05], 0.01, (1000, 3))) * ref
        q_ref, mask = scalar_first(ref), rng.random(1000) < 0.5
        q_ref[::7] = np.nan
        counted = mask & np.isfinite(q_ref[:, 0])
        rmse = _imufit.attitude_rmse(scalar_first(est), q_ref, mask)
        assert rmse is not None
        assert rmse["rows"] == counted.sum()
        e = (est * ref.inv())[counted]
        vectors = e.as_rotvec()
        assert rmse["total"] == pytest.approx(np.sqrt(np.mean(e.magnitude() ** 2)), rel=1e-12)
        assert rmse["sd"] == pytest.approx(np.sqrt(np.sum(vectors.var(axis=0))), rel=1e-10)
        euler = np.sqrt(np.mean(e.as_euler("ZYX") ** 2, axis=0))
        np.testing.assert_allclose([rmse["yaw"], rmse["pitch"], rmse["roll"]], euler, rtol=1e-10)

    def test_without_a_counted_row_there_is_no_error(self) -> None:
        q = np.tile([1.0, 0, 0, 0], (4, 1))
        assert _imufit.attitude_rmse(q, q, np.zeros(4, bool)) is None
        assert _imufit.attitude_rmse(np.full((4, 4), np.nan), q) is None


class TestBorder:
    """What the border refuses, it refuses by name, with what came and what to do."""

    @pytest.mark.parametrize(
        ("x", "message"),
        [
            (np.zeros((3, 50)), r"x has shape \(3, 50\): rows must be samples, \(n, 3\).*x\.T"),
            (np.zeros((50, 2)), r"x has shape \(50, 2\)"),
            (np.zeros(50), r"x has shape \(50,\)"),
            (np.zeros((50, 3)).T.copy().T, "x is not C-contiguous"),
            (np.zeros((100, 3))[::2], "x is not C-contiguous"),
            (np.zeros((49, 3)), "x has 49 rows but q has 50"),
        ],
    )
    def test_shape_and_memory(self, x: np.ndarray, message: str) -> None:
        with pytest.raises(ValueError, match=message):
            _imufit.rotate(np.tile([1.0, 0, 0, 0], (50, 1)), x)

    @pytest.mark.parametrize(
        ("x", "message"),
        [
            (np.zeros((50, 3), np.float32), "x has dtype float32: it must be float64"),
            (np.zeros((50, 3), ">f8"), "x has dtype.*byte order"),
            ([[0.0, 0.0, 0.0]], "x is of type list: pass a numpy array"),
            (None, "x is of type NoneType"),
        ],
    )
    def test_type(self, x: np.ndarray, message: str) -> None:
        with pytest.raises(TypeError, match=message):
            _imufit.rotate(np.tile([1.0, 0, 0, 0], (50, 1)), x)

    def test_unaligned_memory_is_refused(self) -> None:
        raw = np.zeros(50 * 24 + 1, np.uint8)[1:].view(np.float64).reshape(50, 3)
        with pytest.raises(ValueError, match="not C-contiguous"):
            _imufit.rotate(np.tile([1.0, 0, 0, 0], (50, 1)), raw)

    def test_empty_tables_give_empty_tables(self) -> None:
        assert _imufit.rotate(np.empty((0, 4)), np.empty((0, 3))).shape == (0, 3)

    @given(hnp.arrays(np.float64, hnp.array_shapes(min_dims=1, max_dims=3, max_side=5)))
    def test_no_array_breaks_the_border(self, array: np.ndarray) -> None:
        functions = (_imufit.euler_from_quaternion, _imufit.quaternion_from_euler, _imufit.quaternion_from_matrix_rows)
        for function in functions:
            try:
                out = function(array)
            except ValueError as error:
                assert str(error).split()[0] in {"q", "euler", "matrix"}  # noqa: PT017
            else:
                assert out.shape[0] == array.shape[0]

    @given(hnp.arrays(np.float64, (5, 4), elements=st.floats(allow_nan=True, allow_infinity=True)))
    def test_rows_that_are_no_attitude_give_nan_and_others_do_not(self, q: np.ndarray) -> None:
        euler = _imufit.euler_from_quaternion(q)
        # subnormal numbers count as zero
        is_attitude = np.isfinite(q).all(axis=1) & (np.abs(q).max(axis=1) >= np.finfo(float).tiny)
        with np.errstate(over="ignore", invalid="ignore"):
            is_attitude &= np.isfinite(q.sum(axis=1))
        assert np.isfinite(euler[is_attitude]).all()
        assert np.isnan(euler[~is_attitude]).all()
