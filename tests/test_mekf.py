"""The multiplicative extended Kalman filter and the smoother on top of it."""

from dataclasses import replace

import numpy as np
import pytest
from filter_state import bias_of
from imufit import Log, _imufit
from imufit.replaying import SETTINGS, SMOOTHERS, Replay, Stream, replay
from scipy.spatial.transform import Rotation

G = 9.80665
FIELD = np.array([0.0, 18.0, -44.0])  # ENU
BIAS = np.array([0.008, -0.005, 0.011])
STEP = 0.01


def moving(seconds: float, still: float = 0.0, seed: int = 0, bias: np.ndarray = BIAS) -> tuple[Log, np.ndarray]:
    """Log of a hand-moved sensor that stands for the first seconds, and its bias; ENU, consistent at the samples."""
    rng = np.random.default_rng(seed)
    n = round(seconds / STEP)
    t = np.arange(n) * STEP
    on = np.clip((t - still) / 1.0, 0.0, 1.0)[:, None] if still else np.ones((n, 1))
    waves = rng.uniform(0.1, 0.6, (3, 3)), rng.uniform(0, 6, (3, 3)), rng.uniform(0.3, 1.0, (3, 3))
    rate = on * sum(a * np.sin(2 * np.pi * f * t[:, None] + p) for f, p, a in zip(*waves, strict=True))
    turns = Rotation.from_rotvec(0.5 * (rate[1:] + rate[:-1]) * STEP)
    q = [Rotation.from_euler("ZYX", [0.3, -0.2, 0.4])]
    for turn in turns:
        q.append(q[-1] * turn)
    attitude = Rotation.concatenate(q)
    # Bounded motion: the acceleration is that of a position which swings.
    swing = on * 1.5 * np.sin(2 * np.pi * np.array([0.7, 0.9, 1.1]) * t[:, None])
    acc = attitude.inv().apply(swing + np.array([0.0, 0.0, G])) + rng.normal(0.0, 0.02, (n, 3))
    gyr = rate + bias + rng.normal(0.0, 0.002, (n, 3))
    mag = attitude.inv().apply(FIELD) + rng.normal(0.0, 0.3, (n, 3))
    log = Log.from_arrays(t, acc=acc, gyr=gyr, mag=mag, reference=attitude, frame="ENU", mag_reference=FIELD.tolist())
    return log, rate


def total(log: Log, name: str = "mekf", rows: slice = slice(None), **settings: float) -> np.ndarray:
    """Angle of the error, deg."""
    return np.degrees(replay(log, [name], {name: settings}).row_errors(name)[rows, 0])


def both(log: Log, ranges: dict[str, float] | None = None) -> Replay:
    """Filter and smoother over a log; every attitude is finite and of unit norm."""
    result = replay(log, ["mekf", "smoother"], {"replay": ranges or {}})
    for q in result.attitude.values():
        assert np.isfinite(q).all()
        assert np.abs(np.linalg.norm(q, axis=1) - 1.0).max() < 1e-12
    return result


def stream() -> Stream:
    return Stream(["mekf"], ("acc", "gyr", "mag"), frame="ENU", mag_reference=FIELD.tolist())


def skew(x: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])


class Numpy:
    """The equations of the filter with full matrices, independent of the compiled ones; ENU, never at rest."""

    def __init__(self, q: Rotation) -> None:
        self.s = {name: setting["default"] for name, setting in SETTINGS["mekf"].items()}
        sd = np.repeat(
            [self.s["angle_start"], self.s["bias_start"], self.s["speed"], self.s["scale_start"]], [3, 3, 2, 9]
        )
        self.q, self.bias, self.v, self.k = q, np.zeros(3), np.zeros(2), np.zeros((3, 3))
        self.p = np.diag(sd**2)
        self.lost, self.field, self.departure, self.time = True, None, 0.0, 0.0

    def measured(self, h: np.ndarray, value: np.ndarray, r: np.ndarray, keep: np.ndarray | None = None) -> None:
        gain = self.p @ h.T @ np.linalg.inv(h @ self.p @ h.T + r)
        if keep is not None:
            gain[keep] = 0.0
        left = np.eye(17) - gain @ h
        self.p = left @ self.p @ left.T + gain @ r @ gain.T
        x = gain @ value
        self.q = Rotation.from_rotvec(x[:3]) * self.q
        self.bias, self.v, self.k = self.bias + x[3:6], self.v + x[6:8], self.k + x[8:].reshape(3, 3)

    def step(self, w: np.ndarray, f: np.ndarray, m: np.ndarray) -> None:
        s, dt = self.s, STEP
        r = self.q.as_matrix()
        a = np.eye(17)
        a[:3, 3:6] = -r * dt
        a[:3, 8:] = -r @ np.kron(np.eye(3), w[None, :]) * dt
        self.p = a @ self.p @ a.T
        self.p += np.diag(np.repeat([s["gyr_noise"] ** 2, s["bias_walk"] ** 2, 0.0], [3, 3, 11])) * dt
        self.q = self.q * Rotation.from_rotvec((w - self.bias - self.k @ w) * dt)
        eye = np.eye(17)
        if self.lost:
            seen = self.q.apply(f)
            across = np.cross(seen, [0.0, 0.0, 1.0])
            angle = np.arctan2(np.linalg.norm(across), seen[2])
            spread = 0.01 + 2 * abs(np.linalg.norm(f) / G - 1)
            self.measured(eye[:2], (across / np.linalg.norm(across) * angle)[:2], spread * np.eye(2))
            self.lost = False
        force = self.q.apply(f)
        self.v = self.v + force[:2] * dt
        a = np.eye(17)
        a[6:8, :3] = -skew(force)[:2] * dt
        self.p = a @ self.p @ a.T
        self.p[[6, 7], [6, 7]] += s["acc_noise"] ** 2 * dt
        self.measured(eye[6:8], -self.v, 2 * s["speed"] ** 2 * s["speed_time"] / dt * np.eye(2))
        seen = self.q.apply(m)
        parts = np.array([np.hypot(seen[0], seen[1]), seen[2]])
        self.field = parts if self.field is None else self.field
        square = np.sum((parts - self.field) ** 2) / self.field[0] ** 2
        self.departure += (square - self.departure) * (1 - np.exp(-dt / 0.5))
        departure = max(square, self.departure)
        self.time += dt
        self.field = self.field + (parts - self.field) * dt / self.time
        variance = s["mag_noise"] ** 2 + s["mag_departure"] ** 2 * departure
        value = np.array([np.arctan2(seen[0], seen[1])])
        self.measured(eye[2:3], value, np.array([[variance * 2 * s["mag_time"] / dt]]), np.array([0, 1, 6, 7]))


def test_steps_agree_with_an_independent_formulation():
    log, _ = moving(4.0)
    found = replay(log, ["mekf"], {"mekf": {"rest_gyr": 0.0}}).rotation("mekf")
    other = Numpy(found[0])
    for k in range(1, log.n):
        other.step(0.5 * (log.gyr[k] + log.gyr[k - 1]), log.acc[k], log.mag[k])
        assert (other.q.inv() * found[k]).magnitude() < 1e-9


def test_the_bias_is_found_at_rest_and_in_motion():
    for still, seconds, limit in ((10.0, 10.0, 3e-4), (0.0, 60.0, 1.5e-3)):
        log, _ = moving(seconds, still)
        live = stream()
        live.extend(log.t, log.acc, log.gyr, log.mag)
        assert np.abs(bias_of(live.state["mekf"]) - BIAS).max() < limit
        assert total(log, rows=slice(-200, None)).max() < 2.0


@pytest.mark.parametrize("name", ["free fall", "nan", "saturated"])
def test_a_disturbance_is_counted_and_gone_after_ten_seconds(name: str):
    log, _ = moving(40.0, still=5.0)
    acc, gyr, ranges = log.acc.copy(), log.gyr.copy(), {}
    if name == "free fall":
        acc[2000:2040] *= 0.01
    elif name == "saturated":
        ranges = {"gyr_range": 1.0}
        gyr[2000:2050] = np.clip(gyr[2000:2050] * 3.0, -1.0, 1.0)
        gyr[2000] = 1.0
    else:
        gyr[2000, 2] = acc[2100, 1] = np.nan
    result = both(replace(log, acc=acc, gyr=gyr), ranges)
    assert result.skipped[{"free fall": "free_fall", "saturated": "gyr_clipped"}.get(name, "gyr_not_finite")] > 0
    for each in ("mekf", "smoother"):
        assert np.degrees(result.row_errors(each)[3050:, 0]).max() < 2.0


def test_one_infinite_sample_of_a_running_device_does_no_harm():
    log, _ = moving(30.0, still=5.0)
    gyr, acc = log.gyr.copy(), log.acc.copy()
    gyr[1000, 1], acc[1100] = np.inf, -np.inf
    live = stream()
    q = live.extend(log.t, acc, gyr, log.mag)["mekf"]
    assert live.skipped == {"gyr_not_finite": 1, "acc_not_finite": 1}
    error = Rotation.from_quat(q[:, [1, 2, 3, 0]]) * Rotation.from_quat(log.ref_q[:, [1, 2, 3, 0]]).inv()
    assert np.degrees(error.magnitude()[500:]).max() < 2.0


def test_one_infinite_sample_of_a_log_does_no_harm_to_the_smoother():
    log, _ = moving(20.0, still=5.0)
    gyr, acc = log.gyr.copy(), log.acc.copy()
    gyr[1000, 1], acc[1100] = np.inf, -np.inf
    q, skipped = _imufit.smooth(log.t, acc, gyr, log.mag, frame="ENU", mag_reference=FIELD.tolist())
    assert skipped == {"gyr_not_finite": 1, "acc_not_finite": 1}
    assert np.degrees(_imufit.attitude_errors(q, log.ref_q)[:, 0]).max() < 2.0


def test_after_a_gap_of_ten_seconds_the_attitude_is_found_again():
    """The times of the filter's documentation: tilt within 10 s in motion, heading within 30 s."""
    log, _ = moving(60.0, still=5.0)
    keep = np.r_[0:1000, 2000:6000]
    columns = {name: getattr(log, name)[keep] for name in ("t", "acc", "gyr", "mag", "ref_q")}
    result = both(replace(log, **columns))
    assert result.skipped["gap"] >= 1
    errors = np.degrees(result.row_errors("mekf"))
    assert errors[1000, 0] > 20.0
    assert errors[2000:, 2].max() < 2.0
    assert errors[4000:, 0].max() < 2.0
    # The rows on both sides of the gap serve the smoother.
    errors = np.degrees(result.row_errors("smoother"))
    assert errors[2000:, 2].max() < 2.0
    assert errors[4000:, 0].max() < 2.0
    assert errors[1010:, 0].max() < 3.0


def test_a_start_in_motion_is_over_within_the_times_of_a_gap():
    log, _ = moving(50.0)
    result = both(log)
    for each in ("mekf", "smoother"):
        errors = np.degrees(result.row_errors(each))
        assert errors[1000:, 2].max() < 2.0
        assert errors[3000:, 0].max() < 2.0


def test_a_vertical_field_shows_no_heading_and_does_no_harm():
    log, _ = moving(20.0, still=5.0)
    q = Rotation.from_quat(np.asarray(log.ref_q)[:, [1, 2, 3, 0]])
    mag = log.mag.copy()
    mag[1000:1500] = q.inv().apply([0.0, 0.0, -50.0])[1000:1500]
    result = both(replace(log, mag=mag))
    assert result.skipped["no_heading"] > 400
    for each in ("mekf", "smoother"):
        assert np.degrees(result.row_errors(each)[500:, 0]).max() < 2.0


def test_a_slow_magnetometer_stands_for_the_time_between_its_readings():
    log, _ = moving(40.0, still=5.0)
    mag = np.full_like(log.mag, np.nan)
    mag[::20] = log.mag[::20]
    slow, fast = both(replace(log, mag=mag)), both(log)
    for each in ("mekf", "smoother"):
        heading = np.abs(np.degrees(slow.row_errors(each)[1000:, 1]))
        assert heading.max() < 2.0
        # 5 of 100 readings a second, yet no slower to follow them.
        assert np.abs(slow.row_errors(each) - fast.row_errors(each))[1000:, 1].max() < np.radians(1.0)


def test_a_disturbed_field_hardly_turns_the_heading():
    log, _ = moving(40.0, still=5.0)
    mag = log.mag.copy()
    mag[2000:2500] += [30.0, -10.0, 20.0]
    spoiled = replace(log, mag=mag)
    assert total(spoiled, rows=slice(2000, 2500)).max() < 4.0
    assert total(spoiled, "mahony", slice(2000, 2500)).max() > 10.0


def test_the_smoother_is_better_than_the_filter_and_needs_no_start():
    log, _ = moving(40.0)
    filtered, smoothed = total(log), total(log, "smoother")
    assert np.sqrt(np.mean(smoothed**2)) < 0.6 * np.sqrt(np.mean(filtered**2))
    assert smoothed[:300].max() < filtered[:300].max()


def test_without_a_magnetometer_the_heading_keeps_to_its_start():
    log, _ = moving(40.0, still=5.0)
    no_field = Log.from_arrays(log.t, acc=log.acc, gyr=log.gyr, reference=log.ref_q, frame="ENU")
    result = both(no_field)
    for name in ("mekf", "smoother"):
        errors = np.degrees(result.row_errors(name))
        assert errors[1000:, 2].max() < 1.0
        assert np.abs(errors[:, 1]).max() < 3.0


def test_a_stream_refuses_the_smoother():
    assert "smoother" in SMOOTHERS
    with pytest.raises(ValueError, match="smoother needs the rows to come"):
        Stream(["smoother"])
