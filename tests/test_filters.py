"""The filters against independent implementations, and the rules that all of them share."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from filter_state import bias_of, own
from hypothesis import given, settings
from hypothesis import strategies as st
from imufit import _imufit
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation, RotationSpline

G = 9.80665
FIELD = {"NED": [19.0, 1.5, 44.0], "ENU": [1.5, 19.0, -44.0], "NWU": [19.0, -1.5, -44.0]}
UP = {"NED": [0, 0, -1.0], "ENU": [0, 0, 1.0], "NWU": [0, 0, 1.0]}
FRAMES = tuple(UP)
NAMES = tuple(_imufit.filter_descriptions())


def scalar_first(rotation: Rotation) -> np.ndarray:
    return np.ascontiguousarray(np.atleast_2d(rotation.as_quat())[:, [3, 0, 1, 2]])


def rotation_of(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(q[:, [1, 2, 3, 0]])


def angles(a: Rotation, b: Rotation) -> np.ndarray:
    return 2.0 * np.linalg.norm((a.inv() * b).as_quat()[..., :3], axis=-1)


class Motion:
    """A smooth attitude with its ideal readings, made with scipy alone."""

    def __init__(self, n: int = 2000, dt: float = 0.01, frame: str = "NED", seed: int = 0, noise: float = 0.0) -> None:
        rng = np.random.default_rng(seed)
        self.frame, self.t = frame, np.arange(n) * dt
        knots = np.linspace(0.0, self.t[-1] + dt, max(4, int(n * dt)))
        steps = Rotation.from_rotvec(rng.normal(0.0, 0.4, (len(knots), 3)))
        turned = [Rotation.random(rng=rng)]
        for step in steps[1:]:
            turned.append(turned[-1] * step)
        spline = RotationSpline(knots, Rotation.concatenate(turned))
        self.truth = spline(self.t)
        self.gyr = np.ascontiguousarray(spline(self.t, 1))
        back = self.truth.inv()
        self.acc = np.ascontiguousarray(back.apply(np.array(UP[frame]) * G))
        self.mag = np.ascontiguousarray(back.apply(FIELD[frame]))
        if noise:
            self.gyr += rng.normal(0.0, noise * 0.01, self.gyr.shape)
            self.acc += rng.normal(0.0, noise * 0.1, self.acc.shape)
            self.mag += rng.normal(0.0, noise * 0.5, self.mag.shape)

    def run(self, name: str, **options: object) -> tuple[np.ndarray, dict[str, int]]:
        made = _imufit.Filter(name, **{"frame": self.frame, "gravity": G, "mag_reference": FIELD[self.frame]} | options)
        return made.run(self.t, self.acc, self.gyr, self.mag)


def turn_behind(name: str, motion: Motion) -> float:
    """Lag of a filter by its own equations: Madgwick's (42) compares a row with the attitude of the row before."""
    return float(np.linalg.norm(motion.gyr, axis=1).max() * np.diff(motion.t).max()) if name == "madgwick" else 0.0


def test_the_rate_of_the_synthetic_motion_is_the_body_rate() -> None:
    motion = Motion(dt=0.001)
    steps = (motion.truth[:-1].inv() * motion.truth[1:]).as_rotvec() / 0.001
    assert np.abs(steps - 0.5 * (motion.gyr[1:] + motion.gyr[:-1])).max() < 1e-4


class TestGyro:
    """Paper B, eq. (4), on attitudes."""

    def test_a_constant_rate_is_integrated_exactly_at_irregular_times(self) -> None:
        rng = np.random.default_rng(0)
        t = np.cumsum(rng.uniform(0.001, 0.05, 5000))
        omega = np.array([0.4, -1.3, 2.2])
        start = Rotation.random(rng=rng)
        q, skipped = _imufit.Filter("gyro", initial=scalar_first(start)[0].tolist()).run(
            t, gyr=np.tile(omega, (5000, 1))
        )
        expected = start * Rotation.from_rotvec(np.outer(t - t[0], omega))
        assert angles(expected, rotation_of(q)).max() < 1e-11
        assert skipped == {}

    def test_coning_motion_converges_to_the_analytic_attitude_with_the_second_order(self) -> None:
        # R = Rz(a t) Ry(b) Rz(-a t): the body rate is known in closed form
        a, b = 5.0, 0.3
        worst = []
        for dt in (0.01, 0.005):
            t = np.arange(0.0, 10.0, dt)
            truth = Rotation.from_euler("ZYZ", np.column_stack([a * t, np.full_like(t, b), -a * t]))
            s, c = np.sin(a * t), np.cos(a * t)
            gyr = a * np.column_stack([-np.sin(b) * c, -np.sin(b) * s, np.cos(b) - 1.0 + 0.0 * t])
            q, _ = _imufit.Filter("gyro", initial=scalar_first(truth[0])[0].tolist()).run(t, gyr=gyr)
            worst.append(angles(truth, rotation_of(q)).max())
        assert worst[0] < 5e-3
        assert 3.5 < worst[0] / worst[1] < 4.5


class TestTriad:
    """Against scipy's `align_vectors` with the first vector met exactly (infinite weight)."""

    @pytest.mark.parametrize("frame", FRAMES)
    def test_noisy_vectors_give_scipys_attitude(self, frame: str) -> None:
        motion = Motion(200, frame=frame, noise=5.0)
        q, _ = motion.run("triad")
        for k in range(200):
            expected, _ = Rotation.align_vectors(
                [UP[frame], FIELD[frame]], [motion.acc[k], motion.mag[k]], weights=[np.inf, 1.0]
            )
            assert angles(expected, rotation_of(q[k : k + 1])[0]) < 1e-9

    def test_ideal_vectors_give_the_true_attitude(self) -> None:
        motion = Motion()
        q, _ = motion.run("triad")
        assert angles(motion.truth, rotation_of(q)).max() < 1e-13

    def test_a_field_along_gravity_holds_the_heading_and_keeps_the_inclination_fresh(self) -> None:
        motion = Motion(400)
        motion.mag[100:300] = motion.acc[100:300] * -5.0
        q, skipped = motion.run("triad")
        assert skipped == {"no_heading": 200}
        up_seen = rotation_of(q).apply(motion.acc / G)
        np.testing.assert_allclose(up_seen, np.tile(UP["NED"], (400, 1)), atol=1e-12)
        assert angles(motion.truth[300:], rotation_of(q[300:])).max() < 1e-13


def mahony_by_numpy(motion: Motion, start: Rotation, gains: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Paper C, eqs. (5) to (7), matrices throughout: w_mes as the printed vex of outer products."""

    def vex(m: np.ndarray) -> np.ndarray:
        return np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]]) / 2.0

    k_1, k_2, k_i, k_p = gains
    up, north = np.array(UP[motion.frame]), np.array(FIELD[motion.frame]) * [1, 1, 0]
    north = north / np.linalg.norm(north)
    r, bias, out = start.as_matrix(), np.zeros(3), [start.as_matrix()]
    for k in range(1, len(motion.t)):
        dt = motion.t[k] - motion.t[k - 1]
        rate = (motion.gyr[k] + motion.gyr[k - 1]) / 2.0 - bias
        r = r @ Rotation.from_rotvec(rate * dt).as_matrix()
        v_1 = motion.acc[k] / np.linalg.norm(motion.acc[k])
        m_n = r @ motion.mag[k]
        m_n[2] = 0.0
        v_2 = r.T @ (m_n / np.linalg.norm(m_n))
        total = np.zeros((3, 3))
        for k_v, v, estimate in ((k_1, v_1, r.T @ up), (k_2, v_2, r.T @ north)):
            total += k_v / 2.0 * (np.outer(v, estimate) - np.outer(estimate, v))
        w_mes = -vex(total)
        bias = bias - 0.5 * k_i * w_mes * dt
        r = r @ Rotation.from_rotvec(k_p * w_mes * dt).as_matrix()
        out.append(r)
    return np.array(out), bias


class TestMahony:
    """Against numpy, and against the differential equation itself."""

    @pytest.mark.parametrize("frame", FRAMES)
    @pytest.mark.parametrize("gains", [(1.0, 1.0, 0.2, 20.0), (5.0, 0.1, 0.2, 10.0), (1.0, 1.0, 0.005, 0.5)])
    def test_an_independent_integration_gives_the_same(self, frame: str, gains: tuple[float, ...]) -> None:
        motion = Motion(1500, frame=frame, noise=3.0, seed=1)
        start = Rotation.from_rotvec([0.3, -0.2, 0.4]) * motion.truth[0]
        expected, bias = mahony_by_numpy(motion, start, gains)
        chosen = dict(zip(("k_1", "k_2", "k_i", "k_p"), gains, strict=True))
        made = _imufit.Filter(
            "mahony",
            frame=frame,
            gravity=G,
            mag_reference=FIELD[frame],
            settings=chosen,
            rules={"recovery": 0.0},
            initial=scalar_first(start)[0].tolist(),
        )
        q, _ = made.run(motion.t, motion.acc, motion.gyr, motion.mag)
        assert angles(Rotation.from_matrix(expected), rotation_of(q)).max() < 1e-9
        np.testing.assert_allclose(bias_of(made.state), bias, atol=1e-9)

    def test_small_steps_approach_the_differential_equation(self) -> None:
        # a standing sensor without a field: eqs. (5) to (7) are an ordinary differential equation in q and b
        up, k_i, k_p, offset = np.array(UP["NED"]), 0.2, 4.0, np.array([0.02, -0.05, 0.0])
        start = Rotation.from_rotvec([0.5, 0.3, 0.0])

        def rate(_: float, y: np.ndarray) -> np.ndarray:
            r = Rotation.from_quat(y[:4])
            w_mes = 0.5 * np.cross(up, r.inv().apply(up))
            omega = offset - y[4:] + k_p * w_mes
            v, w = y[:3], y[3]
            return np.concatenate([0.5 * (w * omega + np.cross(v, omega)), [-0.5 * v @ omega], -0.5 * k_i * w_mes])

        y0 = np.concatenate([start.as_quat(), np.zeros(3)])
        exact = solve_ivp(rate, (0.0, 5.0), y0, rtol=1e-11, atol=1e-12).y[:4, -1]
        worst = []
        for dt in (0.002, 0.001):
            t = np.arange(round(5.0 / dt) + 1) * dt
            made = _imufit.Filter("mahony", initial=scalar_first(start)[0].tolist(), settings={"k_i": k_i, "k_p": k_p})
            q, _ = made.run(t, np.tile(up * G, (t.size, 1)), np.tile(offset, (t.size, 1)))
            worst.append(float(angles(Rotation.from_quat(exact), rotation_of(q[-1:])[0])))
        assert worst[0] < 1e-3
        assert worst[0] / worst[1] == pytest.approx(2.0, abs=0.2)

    def test_a_slow_magnetometer_pulls_the_heading_as_fast_as_a_quick_one(self) -> None:
        n = 2000
        t, acc, gyr = np.arange(n) * 0.01, np.tile([0, 0, -G], (n, 1)), np.zeros((n, 3))
        mag = np.tile([20.0, 0.0, 40.0], (n, 1))
        slow = mag.copy()
        slow[np.arange(n) % 10 != 0] = np.nan
        start = scalar_first(Rotation.from_euler("Z", 0.5))[0].tolist()
        headings = []
        for column in (mag, slow):
            q, _ = _imufit.Filter("mahony", initial=start, settings={"k_i": 0.0}).run(t, acc, gyr, column)
            headings.append(_imufit.euler_from_quaternion(q)[1000, 2])
        assert headings[0] == pytest.approx(headings[1], rel=0.03)
        assert 0.0 < headings[0] < 0.1


@pytest.mark.parametrize("name", NAMES)
def test_frames_give_the_same_physical_attitude(name: str) -> None:
    motion = Motion(1500, frame="NED", noise=2.0)
    start = scalar_first(motion.truth[0])
    results = {}
    for frame in FRAMES:
        motion.frame = frame
        initial = _imufit.convert_frame(start, "NED", frame)[0].tolist()
        q, _ = motion.run(name, initial=initial)
        results[frame] = rotation_of(_imufit.convert_frame(q, frame, "NED"))
    if name == "accel":  # it holds the yaw of its frame, which differs between frames once the sensor tilts
        ups = {frame: r.inv().apply(UP["NED"]) for frame, r in results.items()}
        for frame in FRAMES:
            np.testing.assert_allclose(ups[frame], ups["NED"], atol=1e-9)
        return
    for frame in FRAMES:
        assert angles(results["NED"], results[frame]).max() < 1e-9


@pytest.mark.parametrize("name", NAMES)
def test_every_filter_follows_ideal_readings(name: str) -> None:
    motion = Motion(3000, dt=0.005, frame="ENU")
    q, skipped = motion.run(name, initial=scalar_first(motion.truth[0])[0].tolist())
    errors = _imufit.attitude_errors(q, scalar_first(motion.truth))
    allowed = 2e-3 + turn_behind(name, motion)
    assert skipped == {}
    assert errors[:, 2].max() < allowed  # inclination
    if name != "accel":
        assert errors[:, 0].max() < allowed


def spoiled_column(rng: np.random.Generator, column: np.ndarray) -> np.ndarray:
    bad = rng.random(column.shape) < 0.03
    column = column.copy()
    column[bad] = rng.choice([np.nan, np.inf, -np.inf, 0.0, 1e300, -1e300, 1e-310], bad.sum())
    return column


class TestRules:
    """Gaps, values that are not finite, free fall, the start: the same for every filter."""

    @settings(max_examples=40, deadline=None)
    @given(st.integers(0, 10**6), st.lists(st.integers(0, 300), max_size=4))
    def test_any_cut_with_the_state_handed_over_gives_the_same_bits(self, seed: int, cuts: list[int]) -> None:
        rng = np.random.default_rng(seed)
        motion = Motion(300, seed=seed, noise=3.0)
        motion.t[rng.integers(1, 300) :] += 2.0
        motion.t[rng.integers(0, 300)] = rng.choice([np.nan, -1.0])
        columns = [spoiled_column(rng, column) for column in (motion.acc, motion.gyr, motion.mag)]
        for name in NAMES:
            whole, _ = _imufit.Filter(name).run(motion.t, *columns)
            pieces, state = [], _imufit.Filter(name).state
            edges = [0, *sorted(cuts), 300]
            for a, b in pairwise(edges):
                part = _imufit.Filter(name)
                part.state = state
                pieces.append(part.run(motion.t[a:b], *(column[a:b] for column in columns))[0])
                state = part.state
            assert np.concatenate(pieces).tobytes() == whole.tobytes()
            started = np.isfinite(whole[:, 0])
            assert np.abs(np.linalg.norm(whole[started], axis=1) - 1.0).max(initial=0.0) < 1e-12
            assert np.isfinite(own(state)).all()

    @pytest.mark.parametrize("name", NAMES)
    def test_row_by_row_is_the_same_filter_as_one_batch(self, name: str) -> None:
        motion = Motion(200, noise=1.0)
        whole, _ = motion.run(name)
        live = _imufit.Filter(name, gravity=G, mag_reference=FIELD["NED"])
        rows = [
            live.run(motion.t[k : k + 1], motion.acc[k : k + 1], motion.gyr[k : k + 1], motion.mag[k : k + 1])[0]
            for k in range(200)
        ]
        assert np.concatenate(rows).tobytes() == whole.tobytes()

    @settings(max_examples=30, deadline=None)
    @given(st.integers(0, 10**6), st.lists(st.tuples(st.integers(1, 40), st.booleans()), max_size=12))
    def test_single_steps_and_pieces_in_any_order_give_the_bits_of_one_batch(
        self, seed: int, pieces: list[tuple[int, bool]]
    ) -> None:
        rng = np.random.default_rng(seed)
        motion = Motion(200, seed=seed, noise=3.0)
        motion.t[rng.integers(1, 200) :] += 2.0
        motion.t[rng.integers(0, 200)] = rng.choice([np.nan, -1.0])
        acc, gyr, mag = (spoiled_column(rng, column) for column in (motion.acc, motion.gyr, motion.mag))
        for name in NAMES:
            whole, counted = _imufit.Filter(name).run(motion.t, acc, gyr, mag)
            live, found, at = _imufit.Filter(name), [], 0
            for rows, single in [*pieces, (200, False)]:
                part = slice(at, min(at + rows, 200))
                if single:
                    found += [live.step(motion.t[k], acc[k], gyr[k], mag[k])[None] for k in range(200)[part]]
                else:
                    found.append(live.run(motion.t[part], acc[part], gyr[part], mag[part])[0])
                at = part.stop
            assert np.concatenate(found).tobytes() == whole.tobytes()
            assert live.skipped == counted

    def test_a_step_takes_lists_and_arrays_and_names_what_it_cannot_take(self) -> None:
        made = _imufit.Filter("complementary")
        first = made.step(0.0, [0.0, 0.0, -G], (0.1, 0.0, 0.0))
        np.testing.assert_allclose(first, [1.0, 0.0, 0.0, 0.0], atol=1e-15)
        second = made.step(0.01, np.array([0.0, 0.0, -G]), np.array([0.1, 0.0, 0.0, 9.0])[:3])
        assert second[1] == pytest.approx(0.97 * 0.0005, rel=1e-3)
        with pytest.raises(ValueError, match="gyr is 2 numbers: pass three numbers"):
            made.step(0.02, [0.0, 0.0, -G], [0.1, 0.0])
        with pytest.raises(ValueError, match="acc is of type str"):
            made.step(0.02, "up", [0.1, 0.0, 0.0])
        with pytest.raises(ValueError, match="complementary needs acc"):
            made.step(0.02, gyr=[0.1, 0.0, 0.0])

    def test_a_log_longer_than_a_window_is_the_same_as_its_pieces(self) -> None:
        n = (1 << 18) + 1000
        rng = np.random.default_rng(0)
        t, gyr = np.arange(n) * 0.01, rng.normal(size=(n, 3))
        whole, _ = _imufit.Filter("gyro").run(t, gyr=gyr)
        made = _imufit.Filter("gyro")
        pieces = [made.run(t[a : a + 100_000], gyr=gyr[a : a + 100_000])[0] for a in range(0, n, 100_000)]
        assert np.concatenate(pieces).tobytes() == whole.tobytes()

    def test_reset_forgets_everything(self) -> None:
        motion = Motion(300, noise=2.0)
        made = _imufit.Filter("mahony")
        first, _ = made.run(motion.t, motion.acc, motion.gyr, motion.mag)
        made.reset()
        again, _ = made.run(motion.t, motion.acc, motion.gyr, motion.mag)
        assert first.tobytes() == again.tobytes()

    def test_missing_rates_are_bridged(self) -> None:
        motion = Motion(1000)
        motion.gyr[500] = np.nan
        motion.gyr[700, 1] = np.inf
        q, skipped = motion.run("gyro", initial=scalar_first(motion.truth[0])[0].tolist())
        assert skipped == {"gyr_missing": 1, "gyr_not_finite": 1}
        assert np.isfinite(q).all()
        assert np.array_equal(q[500], q[499])
        held = [500, 700]
        errors = angles(motion.truth, rotation_of(q))
        assert np.delete(errors, held).max() < 5e-4

    @pytest.mark.parametrize("name", NAMES)
    def test_a_time_that_does_not_increase_is_passed_over(self, name: str) -> None:
        motion = Motion(300, noise=1.0)
        expected, _ = motion.run(name)
        keep = np.r_[0:150, 149, 10, 150:300]
        for column in ("t", "acc", "gyr", "mag"):
            setattr(motion, column, np.ascontiguousarray(getattr(motion, column)[keep]))
        motion.t[151] = motion.t[149] - 5.0
        q, skipped = motion.run(name)
        assert skipped == {"time_not_increasing": 2}
        assert np.delete(q, [150, 151], axis=0).tobytes() == expected.tobytes()

    @pytest.mark.parametrize("name", [name for name in NAMES if name not in ("accel", "triad", "quest")])
    def test_the_attitude_is_held_over_a_gap(self, name: str) -> None:
        motion = Motion(300)
        motion.gyr += 1.0
        motion.t[200:] += 5.0
        q, skipped = motion.run(name)
        assert skipped == {"gap": 1}
        assert angles(rotation_of(q[199:200])[0], rotation_of(q[200:201])[0]) < 1e-12
        longer, none = motion.run(name, rules={"max_gap": 10.0})
        assert none == {}
        assert angles(rotation_of(longer[199:200])[0], rotation_of(longer[200:201])[0]) > 0.1

    @pytest.mark.parametrize("name", NAMES)
    def test_free_fall_shows_no_vertical(self, name: str) -> None:
        motion = Motion(600)
        motion.acc[200:300] = np.random.default_rng(0).normal(0.0, 0.3, (100, 3))
        q, skipped = motion.run(name, initial=scalar_first(motion.truth[0])[0].tolist())
        assert skipped == {"free_fall": 100}
        if name not in ("accel", "triad", "quest"):
            assert angles(motion.truth, rotation_of(q)).max() < 5e-3 + turn_behind(name, motion)

    def test_the_start_takes_both_vectors_then_one_then_none(self) -> None:
        motion = Motion(500)
        motion.mag[:7] = np.nan
        q, skipped = motion.run("mahony")
        assert skipped == {"mag_missing": 7, "not_started": 7}
        assert angles(motion.truth[7], rotation_of(q[7:8])[0]) < 1e-13
        levelled, _ = _imufit.Filter("mahony").run(motion.t, motion.acc, motion.gyr)
        euler = _imufit.euler_from_quaternion(levelled[:1])[0]
        yaw, pitch, roll = motion.truth[0].as_euler("ZYX")
        np.testing.assert_allclose(euler, [roll, pitch, 0.0], atol=1e-12)
        assert yaw != 0.0
        alone, _ = _imufit.Filter("gyro").run(motion.t, gyr=motion.gyr)
        np.testing.assert_array_equal(alone[0], [1.0, 0.0, 0.0, 0.0])

    def test_a_magnetometer_that_never_comes_does_not_stop_the_start(self) -> None:
        motion = Motion(300)
        motion.mag[:] = np.nan
        q, skipped = motion.run("mahony")
        assert skipped == {"mag_missing": 300, "not_started": 100}
        assert np.isfinite(q[100:]).all()

    @pytest.mark.parametrize("spoil", [lambda x: x * np.nan, lambda x: x * np.inf, lambda x: x * 0.0])
    @pytest.mark.parametrize("name", NAMES)
    def test_a_log_without_any_usable_value_breaks_nothing(
        self, name: str, spoil: Callable[[np.ndarray], np.ndarray]
    ) -> None:
        motion = Motion(300)
        motion.acc, motion.gyr, motion.mag = spoil(motion.acc), spoil(motion.gyr), spoil(motion.mag)
        q, _ = motion.run(name)
        started = np.isfinite(q[:, 0])
        np.testing.assert_allclose(np.linalg.norm(q[started], axis=1), 1.0, atol=1e-12)
        assert started[-1]

    def test_no_rows_are_no_attitudes(self) -> None:
        q, skipped = _imufit.Filter("gyro").run(np.empty(0), gyr=np.empty((0, 3)))
        assert (q.shape, skipped) == ((0, 4), {})


class TestRefusals:
    """What cannot be, is refused with the name and what to do."""

    def test_names_and_settings(self) -> None:
        with pytest.raises(ValueError, match=r'"mahoni" is unknown.*mahony'):
            _imufit.Filter("mahoni")
        with pytest.raises(ValueError, match=r'mahony has no setting "kp".*k_p'):
            _imufit.Filter("mahony", settings={"kp": 1.0})
        with pytest.raises(ValueError, match="k_p = -1 is out of range"):
            _imufit.Filter("mahony", settings={"k_p": -1.0})
        with pytest.raises(ValueError, match="max_gap = NaN is out of range"):
            _imufit.Filter("gyro", rules={"max_gap": np.nan})
        with pytest.raises(ValueError, match=r"gravity is -9\.8"):
            _imufit.Filter("gyro", gravity=-9.8)
        with pytest.raises(ValueError, match="no horizontal part"):
            _imufit.Filter("gyro", mag_reference=[0, 0, 40.0])
        with pytest.raises(ValueError, match="initial is zero"):
            _imufit.Filter("gyro", initial=[0, 0, 0, 0])
        with pytest.raises(ValueError, match="initial is 3 numbers"):
            _imufit.Filter("gyro", initial=[0, 0, 1])

    def test_missing_sensors_and_other_lengths(self) -> None:
        t, x = np.arange(5.0), np.ones((5, 3))
        with pytest.raises(ValueError, match="triad needs mag"):
            _imufit.Filter("triad").run(t, acc=x)
        with pytest.raises(ValueError, match="gyr has 4 rows but t has 5"):
            _imufit.Filter("gyro").run(t, gyr=x[:4])
        with pytest.raises(ValueError, match=r"gyr has shape \(3, 5\).*gyr\.T"):
            _imufit.Filter("gyro").run(t, gyr=np.ones((3, 5)))

    def test_foreign_states(self) -> None:
        made = _imufit.Filter("mahony")
        for state in (_imufit.Filter("gyro").state, np.zeros(19), np.full(19, np.nan), np.empty(0)):
            with pytest.raises(ValueError, match="state does not belong to mahony"):
                made.state = state
