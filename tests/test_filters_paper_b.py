"""Paper B's four methods against formulations that share nothing with them: numpy, scipy's rotations, filterpy."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from filter_state import bias_of, own
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
from imufit import _imufit
from imufit.replaying import kalman_steady_state, tilt_angles
from scipy.linalg import solve_discrete_are
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

G = 9.80665
UP = np.array([0.0, 0.0, 1.0])  # ENU
AXES = {"x": np.array([1.0, 0.0, 0.0]), "y": np.array([0.0, 1.0, 0.0])}
NOISE = {"gyr_noise": 3e-3, "bias_walk": 2e-4, "acc_noise": 2e-2, "angle_start": 0.2, "bias_start": 0.05}
SEEDS = st.integers(0, 10**6)

Settings = Mapping[str, float]


ALONE = {"recovery": 0.0}
"""The equations of a filter, without what finds a lost attitude again."""


class OneAxis:
    """Random rates and tilts about one horizontal axis at random times; the first row is the start."""

    def __init__(self, seed: int, axis: str = "y", n: int = 150) -> None:
        rng = np.random.default_rng(seed)
        self.axis, self.t = AXES[axis], np.cumsum(rng.uniform(0.002, 0.05, n))
        self.dt = np.diff(self.t)
        self.rate = rng.normal(0.0, 2.0, n)
        self.mean_rate = 0.5 * (self.rate[1:] + self.rate[:-1])
        self.tilt = rng.uniform(-1.2, 1.2, n)
        self.start = float(rng.uniform(-1.0, 1.0))
        self.size = rng.uniform(0.5, 2.0, n)

    def run(self, name: str, settings: Settings | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Angle of every row, (n,), and the state at the end."""
        acc = Rotation.from_rotvec(np.outer(self.tilt, self.axis)).inv().apply(UP * G) * self.size[:, None]
        gyr = np.outer(self.rate, self.axis)
        first = Rotation.from_rotvec(self.start * self.axis).as_quat()[[3, 0, 1, 2]]
        made = _imufit.Filter(
            name, frame="ENU", gravity=G, settings=dict(settings or {}), rules=ALONE, initial=first.tolist()
        )
        q, skipped = made.run(self.t, np.ascontiguousarray(acc), gyr)
        assert skipped == {}
        turned = _imufit.rotation_vector_from_quaternion(q)
        assert np.abs(turned - np.outer(turned @ self.axis, self.axis)).max() < 1e-12  # about this axis alone
        return turned @ self.axis, made.state


def wrapped(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


class TestAccelerometer:
    """Eqs. (1) to (3)."""

    @settings(max_examples=50, deadline=None)
    @given(SEEDS)
    def test_the_angles_are_the_printed_quotients(self, seed: int) -> None:
        acc = np.random.default_rng(seed).normal(0.0, 10.0, (200, 3))
        x, y, z = acc.T
        found = tilt_angles(acc)
        np.testing.assert_allclose(found[:, 0], np.arctan(x / np.sqrt(y**2 + z**2)), atol=1e-13)
        np.testing.assert_allclose(found[:, 1], np.arctan(y / np.sqrt(x**2 + z**2)), atol=1e-13)
        printed = np.arctan(np.sqrt(x**2 + y**2) / z)
        np.testing.assert_allclose(found[z > 0, 2], printed[z > 0], atol=1e-13)
        np.testing.assert_allclose(found[z < 0, 2], printed[z < 0] + np.pi, atol=1e-13)
        np.testing.assert_allclose(found[:, 2], np.arccos(z / np.linalg.norm(acc, axis=1)), atol=1e-7)

    def test_the_yaw_of_the_paper_is_no_heading(self) -> None:
        tilted = Rotation.from_euler("Y", 0.3)
        headings = Rotation.from_rotvec(np.outer(np.linspace(-3.0, 3.0, 7), UP))
        acc = (headings * tilted).inv().apply(UP * G)
        np.testing.assert_allclose(tilt_angles(acc)[:, 2], 0.3, atol=1e-14)

    @settings(max_examples=20, deadline=None)
    @given(SEEDS, st.sampled_from(["x", "y"]))
    def test_about_one_axis_the_filter_is_the_tilt(self, seed: int, axis: str) -> None:
        motion = OneAxis(seed, axis)
        np.testing.assert_allclose(motion.run("accel")[0], motion.tilt, atol=1e-12)

    def test_what_shows_no_direction_has_no_angles_and_other_shapes_are_refused(self) -> None:
        found = tilt_angles([[0.0, 0.0, 0.0], [np.nan, 0.0, 1.0], [np.inf, np.nan, 1.0], [0.0, 0.0, -2.0]])
        assert np.isnan(found[:3]).all()
        np.testing.assert_array_equal(found[3], [0.0, 0.0, np.pi])
        with pytest.raises(ValueError, match=r"acc has shape \(3,\)"):
            tilt_angles([0.0, 0.0, 1.0])


class TestGyro:
    """Eq. (4)."""

    @settings(max_examples=20, deadline=None)
    @given(SEEDS, st.sampled_from(["x", "y"]))
    def test_about_one_axis_it_is_the_sum(self, seed: int, axis: str) -> None:
        motion = OneAxis(seed, axis)
        expected = motion.start + np.concatenate([[0.0], np.cumsum(motion.mean_rate * motion.dt)])
        np.testing.assert_allclose(wrapped(motion.run("gyro")[0] - expected), 0.0, atol=1e-10)


def shortest(start: Rotation, f: np.ndarray) -> np.ndarray:
    """Rotation vector in the reference frame that brings `f`, as seen from `start`, to the vertical."""
    seen = start.apply(f)
    axis = np.cross(seen, UP)
    return axis / np.linalg.norm(axis) * np.arctan2(np.linalg.norm(axis), seen @ UP)


class Tumbling:
    """Random rates and forces about all axes."""

    def __init__(self, seed: int, n: int = 80) -> None:
        rng = np.random.default_rng(seed)
        self.t = np.cumsum(rng.uniform(0.002, 0.05, n))
        self.acc, self.gyr = rng.normal(0.0, G, (n, 3)), rng.normal(0.0, 3.0, (n, 3))
        self.acc += np.sign(self.acc) * 2.0  # no free fall
        self.start = Rotation.random(rng=rng)

    def steps(self) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """Duration, mean rate, and specific force at the end of each step."""
        rates = 0.5 * (self.gyr[1:] + self.gyr[:-1])
        return list(zip(np.diff(self.t), rates, self.acc[1:], strict=True))

    def agrees(self, name: str, expected: list[Rotation], settings: Settings) -> np.ndarray:
        """Compare all rows; the state at the end."""
        first = self.start.as_quat()[[3, 0, 1, 2]].tolist()
        made = _imufit.Filter(name, frame="ENU", gravity=G, settings=dict(settings), rules=ALONE, initial=first)
        q, _ = made.run(self.t, self.acc, self.gyr)
        off = Rotation.concatenate([self.start, *expected]).inv() * Rotation.from_quat(q[:, [1, 2, 3, 0]])
        assert off.magnitude().max() < 1e-10
        return made.state


WEIGHTS: dict[str, tuple[Settings, Callable[[float], float]]] = {
    "as printed": ({"a": 0.97, "step": 0.0}, lambda _: 0.97),
    "of a step": ({"a": 0.97, "step": 0.01}, lambda dt: 0.97 ** (dt / 0.01)),
    "of a time constant": ({"time_constant": 0.4}, lambda dt: np.exp(-dt / 0.4)),
    "the accelerometer alone": ({"a": 0.0, "step": 0.0}, lambda _: 0.0),
    "the gyro alone": ({"a": 1.0, "step": 0.0}, lambda _: 1.0),
}


class TestComplementary:
    """Eq. (5)."""

    @settings(max_examples=10, deadline=None)
    @given(SEEDS, st.sampled_from(["x", "y"]), st.sampled_from(list(WEIGHTS)))
    def test_about_one_axis_it_is_the_printed_sum(self, seed: int, axis: str, weight: str) -> None:
        chosen, a_of = WEIGHTS[weight]
        motion = OneAxis(seed, axis)
        motion.rate *= 0.1
        motion.mean_rate *= 0.1
        theta, expected = motion.start, [motion.start]
        for dt, rate, measured in zip(motion.dt, motion.mean_rate, motion.tilt[1:], strict=True):
            a = a_of(dt)
            theta = a * (theta + rate * dt) + (1.0 - a) * measured
            expected.append(theta)
        np.testing.assert_allclose(motion.run("complementary", chosen)[0], expected, atol=1e-10)

    def test_at_equal_steps_it_is_a_first_order_filter(self) -> None:
        motion = OneAxis(3)
        motion.t = 0.01 * np.arange(motion.t.size)
        motion.rate *= 0.1
        drive = 0.97 * 0.1 * motion.mean_rate * 0.01 + 0.03 * motion.tilt[1:]
        expected, _ = lfilter([1.0], [1.0, -0.97], drive, zi=[0.97 * motion.start])
        found, _ = motion.run("complementary", {"a": 0.97, "step": 0.0})
        np.testing.assert_allclose(found[1:], expected, atol=1e-10)

    @settings(max_examples=10, deadline=None)
    @given(SEEDS, st.sampled_from(list(WEIGHTS)))
    def test_on_attitudes_it_turns_part_of_the_shortest_way(self, seed: int, weight: str) -> None:
        chosen, a_of = WEIGHTS[weight]
        motion = Tumbling(seed)
        r, expected = motion.start, []
        for dt, rate, f in motion.steps():
            r = r * Rotation.from_rotvec(rate * dt)
            r = Rotation.from_rotvec((1.0 - a_of(dt)) * shortest(r, f)) * r
            expected.append(r)
        motion.agrees("complementary", expected, chosen)


def textbook(dt: float, chosen: Settings) -> tuple[np.ndarray, np.ndarray, float]:
    """F, Q and R of angle and bias for a step of `dt`."""
    q = np.diag([chosen["gyr_noise"] ** 2, chosen["bias_walk"] ** 2]) * dt
    return np.array([[1.0, -dt], [0.0, 1.0]]), q, chosen["acc_noise"] ** 2 / dt


H = np.array([[1.0, 0.0]])


def start_covariance(chosen: Settings) -> np.ndarray:
    return np.diag([chosen["angle_start"] ** 2, chosen["bias_start"] ** 2])


def updated(p: np.ndarray, r: float) -> tuple[np.ndarray, np.ndarray]:
    """Gain and covariance after a measurement of variance `r`."""
    gain = p @ H.T / (H @ p @ H.T + r)
    return gain[:, 0], (np.eye(2) - gain @ H) @ p


class Shaking:
    """What the adaptive filter takes for vibration, written once more."""

    def __init__(self, first: np.ndarray, time: float) -> None:
        self.mean, self.time, self.power = first / G, time, 0.0

    def variance(self, dt: float, rate: np.ndarray, f: np.ndarray) -> float:
        self.mean = Rotation.from_rotvec(-rate * dt).apply(self.mean)
        v = f / G - self.mean
        keep = np.exp(-dt / self.time)
        self.mean = keep * self.mean + (1.0 - keep) * f / G
        self.power = keep * self.power + (1.0 - keep) * (v @ v) / 3.0
        return max(self.power, float(v @ v) / 16.27)


class TestKalman:
    """Angle and gyro bias, the accelerometer's angle as measurement."""

    @settings(max_examples=20, deadline=None)
    @given(SEEDS, st.sampled_from(["x", "y"]))
    def test_about_one_axis_it_is_filterpys(self, seed: int, axis: str) -> None:
        motion = OneAxis(seed, axis)
        motion.rate *= 0.1
        motion.mean_rate *= 0.1
        theirs = KalmanFilter(dim_x=2, dim_z=1, dim_u=1)
        theirs.x, theirs.P, theirs.H = np.array([[motion.start], [0.0]]), start_covariance(NOISE), H
        expected = [motion.start]
        for dt, rate, measured in zip(motion.dt, motion.mean_rate, motion.tilt[1:], strict=True):
            f, q, r = textbook(dt, NOISE)
            theirs.predict(u=np.array([[rate]]), B=np.array([[dt], [0.0]]), F=f, Q=q)
            theirs.update(measured, R=r)
            expected.append(theirs.x[0, 0])
        found, state = motion.run("kalman", NOISE)
        np.testing.assert_allclose(found, expected, atol=1e-10)
        np.testing.assert_allclose(bias_of(state) @ motion.axis, theirs.x[1, 0], atol=1e-10)
        np.testing.assert_allclose(own(state)[7:10], [theirs.P[0, 0], theirs.P[0, 1], theirs.P[1, 1]], atol=1e-12)

    @settings(max_examples=6, deadline=None)
    @given(SEEDS, st.sampled_from([0.0, 1.0, 5.0]), st.booleans())
    def test_on_attitudes_it_is_numpys(self, seed: int, adaptive: float, steady: bool) -> None:
        motion = Tumbling(seed, n=50)
        r, bias, p, expected = motion.start, np.zeros(3), start_covariance(NOISE), []
        shaking = Shaking(motion.acc[0], 0.3)
        for dt, rate, force in motion.steps():
            f, q, variance = textbook(dt, NOISE)
            r = r * Rotation.from_rotvec((rate - bias) * dt)
            p = f @ p @ f.T + q
            variance = max(variance, adaptive * shaking.variance(dt, rate - bias, force))
            if steady:
                gain, _ = updated(solve_discrete_are(f.T, H.T, q, [[variance]]), variance)
            else:
                gain, p = updated(p, variance)
            innovation = shortest(r, force)
            bias = bias + gain[1] * r.inv().apply(innovation)
            r = Rotation.from_rotvec(gain[0] * innovation) * r
            expected.append(r)
        chosen = {**NOISE, "adaptive": adaptive, "vibration_time": 0.3, "steady": float(steady)}
        state = motion.agrees("kalman", expected, chosen)
        np.testing.assert_allclose(bias_of(state), bias, atol=1e-9)
        if adaptive:
            np.testing.assert_allclose(own(state)[10:14], [*shaking.mean, shaking.power], atol=1e-9)

    @settings(max_examples=50, deadline=None)
    @given(st.floats(-4.0, -1.0), st.floats(-5.0, -2.0), st.floats(-4.0, -1.0), st.floats(-3.0, 0.0))
    def test_the_settled_gain_solves_the_riccati_equation(self, gyr: float, walk: float, acc: float, dt: float) -> None:
        gyr, walk, acc, dt = (10.0**power for power in (gyr, walk, acc, dt))
        f, q, r = textbook(dt, {"gyr_noise": gyr, "bias_walk": walk, "acc_noise": acc})
        gain, _ = updated(solve_discrete_are(f.T, H.T, q, [[r]]), r)
        found = kalman_steady_state(dt, {"gyr_noise": gyr, "bias_walk": walk, "acc_noise": acc})
        np.testing.assert_allclose([found.angle, found.bias], gain, rtol=1e-5)
        poles = np.linalg.eigvals((np.eye(2) - np.outer(gain, H)) @ f)
        assert dt / found.time_constant == pytest.approx(-np.log(np.abs(poles).max()), rel=1e-4, abs=1e-10)

    def test_the_filter_settles_at_that_gain_and_in_that_time(self) -> None:
        dt, n = 0.01, 20_000
        chosen = {**NOISE, "gyr_noise": 2e-2, "bias_walk": 2e-3}
        found = kalman_steady_state(dt, chosen)
        t, acc, gyr = dt * np.arange(n), np.tile(UP * G, (n, 1)), np.zeros((n, 3))
        start = Rotation.from_rotvec([0.1, 0.0, 0.0]).as_quat()[[3, 0, 1, 2]].tolist()
        made = _imufit.Filter("kalman", frame="ENU", gravity=G, settings={**chosen, "steady": 1.0}, initial=start)
        angle = _imufit.rotation_vector_from_quaternion(made.run(t, acc, gyr)[0])[:, 0]
        assert angle[1] == pytest.approx(0.1 * (1.0 - found.angle), rel=1e-12)
        late = np.flatnonzero(np.abs(angle) > 1e-9)[-1]
        first = late - round(found.time_constant / dt)
        assert angle[late] / angle[first] == pytest.approx(np.exp(-1.0), rel=0.15)
        made = _imufit.Filter("kalman", frame="ENU", gravity=G, settings=chosen)
        made.run(t, acc, gyr)
        f, q, r = textbook(dt, chosen)
        p_aa, p_ab, p_bb = own(made.state)[7:10]
        gain, _ = updated(f @ np.array([[p_aa, p_ab], [p_ab, p_bb]]) @ f.T + q, r)
        np.testing.assert_allclose(gain, [found.angle, found.bias], rtol=1e-9)

    def test_what_has_no_settled_gain_is_refused(self) -> None:
        with pytest.raises(ValueError, match="dt = 0 is out of range"):
            kalman_steady_state(0.0)
        with pytest.raises(ValueError, match='kalman has no setting "q"'):
            kalman_steady_state(0.01, {"q": 1.0})


class TestVibration:
    """`adaptive`: R grows with what shakes the sensor."""

    def rest(self, seconds: float = 40.0, rate: float = 200.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        rng = np.random.default_rng(4)
        t = np.arange(round(seconds * rate)) / rate
        acc = UP * G + [0.3, -0.2, 0.4] + rng.normal(0.0, 0.02, (t.size, 3))  # an uncalibrated sensor
        gyr = rng.normal([0.01, -0.005, 0.002], 1e-3, (t.size, 3))
        return t, acc, gyr

    def pitch(self, t: np.ndarray, acc: np.ndarray, gyr: np.ndarray, **chosen: float) -> np.ndarray:
        q, _ = _imufit.Filter("kalman", frame="ENU", gravity=G, settings=chosen).run(t, acc, gyr)
        return np.asarray(_imufit.euler_from_quaternion(q)[:, 1])

    def test_at_rest_it_changes_nothing_even_where_r_is_the_sensors_own_noise(self) -> None:
        t, acc, gyr = self.rest()
        np.testing.assert_array_equal(self.pitch(t, acc, gyr), self.pitch(t, acc, gyr, adaptive=1.0))
        tuned = {"gyr_noise": 1e-3 / np.sqrt(200.0), "bias_walk": 1e-6, "acc_noise": 0.02 / G / np.sqrt(200.0)}
        off, on = self.pitch(t, acc, gyr, **tuned), self.pitch(t, acc, gyr, **tuned, adaptive=1.0)
        late = t > 10.0
        assert np.std(on[late] - off[late]) < 0.1 * np.std(off[late])
        assert np.std(on[late]) < 1.05 * np.std(off[late])

    def test_a_hammer_blow_hardly_moves_the_angle(self) -> None:
        t, acc, gyr = self.rest()
        for blow in np.arange(20.0, 40.0, 5.0):
            since = np.clip(t - blow, 0.0, None)
            ring = np.where(t >= blow, np.exp(-since / 0.03) * np.cos(2.0 * np.pi * 67.0 * since), 0.0)
            acc += 3.0 * G * ring[:, None] * [1.0, 0.0, 0.5]
        late = t > 20.0
        swing = {on: np.ptp(self.pitch(t, acc, gyr, adaptive=on)[late]) for on in (0.0, 1.0)}
        assert swing[1.0] < 0.25 * swing[0.0]

    def test_a_wrong_start_is_found_as_fast(self) -> None:
        t, acc, gyr = self.rest(seconds=5.0)
        wrong = Rotation.from_euler("Y", 0.2).as_quat()[[3, 0, 1, 2]].tolist()
        found = []
        for adaptive in (0.0, 1.0):
            made = _imufit.Filter(
                "kalman", frame="ENU", gravity=G, initial=wrong, settings={"adaptive": adaptive, "acc_noise": 2e-2}
            )
            found.append(_imufit.euler_from_quaternion(made.run(t, acc, gyr)[0])[:, 1])
        np.testing.assert_allclose(found[0], found[1], atol=1e-12)
