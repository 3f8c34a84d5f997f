"""Checks of the physics and of the answers in ``lab_failures.py``; the tool under judgement is not used."""

from __future__ import annotations

from functools import cache

import lab_failures as lab
import numpy as np
import pytest
from case import Case

SEED = 5
SLOW_ROWS = {name for name in lab.ROWS if "4khz" in name or "8khz" in name or "1khz_reference_int" in name}
NAMED = frozenset({"adequate", "missing", "ambiguous", "unknown", "refused"})


@cache
def made(name: str) -> Case:
    """Build a row once."""
    return lab.ROWS[name](SEED)


def columns(name: str, prefix: str, axes: str = "xyz") -> lab.Array:
    """Return columns of a row as one array."""
    return made(name).frame[[f"{prefix}{axis}" for axis in axes]].to_numpy()


def poses_of(name: str) -> lab.Array:
    """Return the reference quaternions of a row."""
    return columns(name, "ref_q", "wxyz")


def rate_of(q: lab.Array, step: float) -> lab.Array:
    """Return the body rate at inner nodes by a central difference over two steps."""
    turn = lab.multiply(q[:-2] * np.array([1.0, -1.0, -1.0, -1.0]), q[2:])
    turn = turn * np.sign(turn[:, :1])
    sine = np.linalg.norm(turn[:, 1:], axis=1, keepdims=True)
    return turn[:, 1:] / np.maximum(sine, 1e-15) * 2.0 * np.arctan2(sine, turn[:, :1]) / (2.0 * step)


@pytest.fixture(scope="module")
def motion() -> lab.Motion:
    """Return a lively motion."""
    return lab.draw_motion(np.random.default_rng(0), rate=1.5, fastest=3.0, acceleration=3.0)


def test_rate_and_acceleration_are_exact_derivatives(motion: lab.Motion) -> None:
    """Central differences of attitude, rate and position agree with the analytic values."""
    t, h = np.linspace(0.0, 20.0, 301), 1e-4
    ends = np.stack([motion.attitude(t + k * h) for k in (-1, 0, 1)], axis=1)
    rate = np.concatenate([rate_of(lab.continuous(q), h) for q in ends])
    np.testing.assert_allclose(rate, motion.rate(t), atol=1e-5)
    change = (motion.rate(t + h) - motion.rate(t - h)) / (2 * h)
    np.testing.assert_allclose(change, motion.angular_acceleration(t), atol=1e-4)
    second = (motion.position(t + h) - 2 * motion.position(t) + motion.position(t - h)) / h**2
    np.testing.assert_allclose(second, motion.acceleration(t), atol=1e-4)


def test_specific_force_points_up_at_rest_and_quaternion_turns_body_to_reference() -> None:
    """At rest the accelerometer reads 1 g upwards; a heading of 90 deg turns body x to east."""
    still = lab.Motion((lab.NOTHING, lab.NOTHING, lab.NOTHING))
    readings = lab.ideal_readings(still, np.zeros(1))
    np.testing.assert_allclose(readings["acc"][0], [0.0, 0.0, -9.80665])
    np.testing.assert_allclose(readings["mag"][0], lab.FIELD)
    heading = lab.from_vector(np.array([[0.0, 0.0, np.pi / 2]]))
    np.testing.assert_allclose(lab.to_reference(heading, np.array([1.0, 0.0, 0.0]))[0], [0, 1, 0], atol=1e-12)


def test_lever_arm_is_the_acceleration_of_the_moved_point(motion: lab.Motion) -> None:
    """The lever arm term equals the second difference of the moved point, seen in the body."""
    arm, t, h = np.array([-0.0358, 0.005, 0.012]), np.linspace(0.0, 20.0, 101), 3e-4
    place = [lab.to_reference(motion.attitude(t + k * h), arm) for k in (-1, 0, 1)]
    seen = lab.to_body(motion.attitude(t), (place[0] - 2 * place[1] + place[2]) / h**2)
    rate, change = motion.rate(t), motion.angular_acceleration(t)
    np.testing.assert_allclose(
        seen, np.cross(rate, np.cross(rate, arm)) + np.cross(change, arm), atol=1e-4 * np.abs(seen).max()
    )


def test_slerp_is_exact_at_nodes_and_for_a_steady_turn() -> None:
    """Interpolation of a steady turn gives the same steady turn, with either sign of the nodes."""
    nodes, t = np.arange(0.0, 3.0, 0.1), np.linspace(0.0, 2.9, 777)
    spin = np.array([0.7, -1.1, 2.0])
    q = lab.from_vector(nodes[:, None] * spin)
    q[::3] *= -1.0
    got, want = lab.slerp(t, nodes, q), lab.from_vector(t[:, None] * spin)
    np.testing.assert_allclose(np.abs(np.sum(got * want, axis=1)), 1.0, atol=1e-12)
    np.testing.assert_allclose(np.abs(np.sum(lab.slerp(nodes, nodes, q) * q, axis=1)), 1.0, atol=1e-12)


def test_smoothing_sign(motion: lab.Motion) -> None:
    """The true acceleration less the smoothed one is -c times its second derivative, with c = v/2."""
    t, deviation, h = np.linspace(0.0, 20.0, 501), 0.005, 1e-3
    excess = motion.acceleration(t) - lab.gaussian_mean(motion.acceleration, t, deviation)
    second = sum(w * motion.acceleration(t + k * h) for k, w in ((-1, 1), (0, -2), (1, 1))) / h**2
    c = -np.sum(excess * second) / np.sum(second**2)
    assert c == pytest.approx(deviation**2 / 2.0, rel=0.01)


def test_smoothed_reference_has_lost_rate() -> None:
    """The gyro excess over the smoothed reference fits -c x'' with the stated c to a few per cent."""
    q = poses_of("reference_smoothed")
    step = 0.01
    rate = rate_of(q, step)
    gyro = columns("reference_smoothed", "gyro_")[1:-1]
    band = lab.signal.firwin(61, 4.0, fs=100.0)
    low = [lab.signal.fftconvolve(x, band[:, None], mode="valid") for x in (gyro, rate)]
    second = np.gradient(np.gradient(low[0], step, axis=0), step, axis=0)
    # A central difference over two steps takes (step^2 / 6) x'' from the rate as well.
    c = -np.sum((low[0] - low[1]) * second) / np.sum(second**2) - step**2 / 6.0
    assert c == pytest.approx(made("reference_smoothed").effects["ref.lowpass"]["c"], rel=0.15)


def test_fast_reference_clock_makes_the_reference_late() -> None:
    """Near the end of the log the reference lags the gyro by k times the time."""
    rate = rate_of(poses_of("reference_clock_fast"), 0.01)
    gyro = columns("reference_clock_fast", "gyro_")[1:-1]
    band = lab.signal.firwin(31, 6.0, fs=100.0)[:, None]
    rate, gyro = (lab.signal.fftconvolve(x, band, mode="valid") for x in (rate, gyro))
    slope = np.gradient(gyro, 0.01, axis=0)
    for part, late in ((slice(200, 2200), 3e-4 * 12.0), (slice(-2200, -200), 3e-4 * 108.0)):
        lag = -np.sum((rate - gyro)[part] * slope[part]) / np.sum(slope[part] ** 2)
        assert lag == pytest.approx(late, abs=1.5e-3)


@pytest.mark.parametrize("name", sorted(set(lab.ROWS) - SLOW_ROWS))
def test_each_row_is_a_valid_log(name: str) -> None:
    """Times increase, quaternions are unit, readings are finite where expected, answers are known ids."""
    row = made(name)
    frame = row.frame
    t = frame["t"].to_numpy()
    assert row.name == name
    assert np.all(np.diff(t) > 0.0)
    assert t[-1] - t[0] == pytest.approx(row.seconds, abs=0.1)
    assert row.verdicts
    assert row.verdicts <= NAMED
    assert frozenset(row.effects) <= row.may_name
    assert all(np.isfinite(v) for parameters in row.effects.values() for v in parameters.values())
    if "ref_qw" in frame:
        norm = np.linalg.norm(poses_of(name), axis=1)
        np.testing.assert_allclose(norm[np.isfinite(norm)], 1.0, atol=1e-9)
        assert np.isfinite(norm).sum() > 1000
    if "own_rows" not in name and name != "reference_stamps_bunched":
        numbers = frame.drop(columns=[c for c in frame if c == "pose" or c.startswith("mag_")])
        assert np.isfinite(numbers.to_numpy()).all()


def test_rows_depend_on_the_seed_only() -> None:
    """The same seed gives the same log, another seed another log."""
    row = lab.ROWS["gyro_bias_with_scattered_zero"]
    assert row(3).frame.equals(row(3).frame)
    assert not row(3).frame.equals(row(4).frame)


def test_gyro_bias_is_the_stated_one() -> None:
    """The mean of gyro less reference rate is the bias; means over 2 s scatter by about 0.3 deg/s."""
    name = "gyro_bias_with_scattered_zero"
    excess = columns(name, "gyro_")[1:-1] - rate_of(poses_of(name), 0.01)
    np.testing.assert_allclose(excess.mean(axis=0), [-0.19, 0.08, 0.05], atol=1e-3)
    scatter = excess[199:-199].reshape(-1, 200, 3).mean(axis=1).std(axis=0)
    assert np.all(np.abs(scatter / lab.DEGREE - 0.3) < 0.12)


def test_hard_iron_and_current_can_be_read_off() -> None:
    """Least squares on the known attitudes returns hard iron, soft iron and current of the UAV row."""
    name = "uav_motor_current"
    frame, truth = made(name).frame, made(name).effects
    ideal = lab.to_body(poses_of(name), lab.FIELD)
    current = frame["motor_current"].to_numpy()
    assert current.min() >= 0.0
    assert current.max() <= 20.0
    assert current.std() > 2.0
    regressors = np.column_stack([np.ones(len(frame)), current, ideal])
    found = np.linalg.lstsq(regressors, columns(name, "mag_") - ideal, rcond=None)[0]
    np.testing.assert_allclose(found[0], list(truth["mag.hard_iron"].values()), atol=0.2)
    np.testing.assert_allclose(found[1], list(truth["mag.current"].values()), atol=0.01)
    np.testing.assert_allclose(found[2:].T.ravel(), list(truth["mag.soft_iron"].values()), atol=0.003)


def test_hard_iron_of_300_microtesla() -> None:
    """The offset has the stated size, and readings and poses lie in different rows."""
    row = made("hard_iron_reference_in_own_rows")
    assert np.linalg.norm(list(row.effects["mag.hard_iron"].values())) == pytest.approx(300.0)
    has_reading, has_pose = row.frame["acc_x"].notna(), row.frame["ref_qw"].notna()
    assert np.all(has_reading != has_pose)


def test_lever_arm_can_be_told_to_two_millimetres() -> None:
    """A plain local-polynomial estimate from the log alone finds x within 2 mm."""
    name = "lever_arm_beside_lively_reference"
    step, q, gyro = 1.0 / 120.0, poses_of(name), columns(name, "gyro_")
    window = {"window_length": 15, "polyorder": 5, "axis": 0, "delta": step}
    linear_part = lab.signal.savgol_filter(columns(name, "ref_p"), deriv=2, **window)
    force = lab.to_body(q, linear_part - np.array([0.0, 0.0, lab.GRAVITY]))
    rate = lab.signal.savgol_filter(gyro, **window)
    change = lab.signal.savgol_filter(gyro, deriv=1, **window)
    terms = [np.cross(rate, np.cross(rate, e)) + np.cross(change, e) for e in np.eye(3)]
    terms = np.stack([term[20:-20].ravel() for term in terms], axis=1)
    found = np.linalg.lstsq(terms, (columns(name, "acc_") - force)[20:-20].ravel(), rcond=None)[0]
    tolerance = lab.TOLERANCES[name]["acc.lever_arm"]["x"]
    assert found[0] == pytest.approx(-0.0358, abs=tolerance)


def test_stamps_come_in_bunches_without_mean_delay() -> None:
    """Five of six steps between reference stamps are 15 us; the bunches follow at 20 Hz."""
    frame = made("reference_stamps_bunched").frame
    steps = np.diff(frame.loc[frame["ref_qw"].notna(), "t"].to_numpy())
    assert np.mean(np.abs(steps - 15e-6) < 1e-9) == pytest.approx(5.0 / 6.0, abs=0.01)
    assert steps[steps > 1e-3].mean() == pytest.approx(0.05, abs=1e-3)


def test_shaken_row_has_the_stated_translation() -> None:
    """The accelerometer departs from 1 g by about 9 m/s^2 RMS and the log has no position."""
    name = "shaken_without_position_turned_mount"
    assert "ref_px" not in made(name).frame
    force = lab.to_reference(poses_of(name), columns(name, "acc_")) + np.array([0.0, 0.0, lab.GRAVITY])
    assert np.sqrt(np.mean(np.sum(force**2, axis=1))) == pytest.approx(9.0, rel=0.15)


def test_broken_gyro_rows_are_broken() -> None:
    """The motion leaves the range, the counts wrap, the bus dies, the axis stands still."""
    clipped = np.abs(columns("gyro_soft_clip", "gyro_"))
    assert clipped.max() < lab.FULL_SCALE + 1e-6
    assert np.mean(clipped > 0.95 * lab.FULL_SCALE) > 0.02
    wrapped = columns("gyro_wrapped_int16", "gyro_")
    assert np.abs(wrapped).max() <= lab.FULL_SCALE
    assert np.sum(np.abs(np.diff(wrapped, axis=0)) > 1.8 * lab.FULL_SCALE) > 20
    readings = np.hstack([columns("dead_bus_zeros", p) for p in ("acc_", "gyro_", "mag_")])
    assert 0.02 < np.mean(np.all(readings == 0.0, axis=1)) < 0.2
    assert np.ptp(columns("gyro_axis_pinned", "gyro_")[:, 1]) == 0.0


def test_play_operator_has_slack_and_memory() -> None:
    """The output stands still within the slack and follows at its edge."""
    x = np.array([[0.0], [3.0], [2.0], [1.5], [0.0], [-4.0]])
    np.testing.assert_allclose(lab.play(x, 1.0)[:, 0], [0.0, 2.0, 2.0, 2.0, 1.0, -3.0])


def test_hysteresis_is_far_above_noise_and_not_affine() -> None:
    """The residual of the best constant and matrix is several times the noise."""
    name = "magnetic_hysteresis"
    ideal = lab.to_body(poses_of(name), lab.FIELD)
    regressors = np.column_stack([np.ones(len(ideal)), ideal])
    residual = columns(name, "mag_") - ideal
    rest = residual - regressors @ np.linalg.lstsq(regressors, residual, rcond=None)[0]
    assert rest.std() > 4.0 * lab.MEMS.mag
    assert rest.std() == pytest.approx(residual.std(), rel=0.02)


def test_mount_follows_its_equation_and_rings() -> None:
    """The bend obeys the equation of motion, and most of its power lies near 12 Hz."""
    rng = np.random.default_rng(1)
    calm = lab.draw_motion(rng, rate=0.5, fastest=2.0)
    shaken = lab.Motion(tuple(a + lab.draw_sines(rng, 0.03, 6.0, 18.0, 24, order=1) for a in calm.angles))
    t, w = lab.uniform_times(4.0, 200.0), 2.0 * np.pi * 12.0
    angle, rate = lab.flexed(shaken, t, np.full(3, 12.0), 0.04)
    slope = np.gradient(angle, t, axis=0)
    np.testing.assert_allclose(slope[5:-5], rate[5:-5], atol=0.05 * np.abs(rate).max())
    bend = np.gradient(rate, t, axis=0) + 0.08 * w * rate + w**2 * angle
    drive = -shaken.angular_acceleration(t)
    error = (bend - drive)[5:-5].std() / (w**2 * angle).std()
    assert error < 0.06
    power = np.abs(np.fft.rfft(angle * np.hanning(t.size)[:, None], axis=0)) ** 2
    frequency = np.fft.rfftfreq(t.size, 0.005)
    near = (frequency > 10.0) & (frequency < 14.0)
    assert power[near].sum() > 0.6 * power[frequency > 4.0].sum()


def test_vibration_shifts_the_gyro() -> None:
    """Means over 0.5 s of the gyro excess follow the variance of the accelerometer in the same windows."""
    name = "drone_vibration_rectification"
    excess = (columns(name, "gyro_")[1:-1] - rate_of(poses_of(name), 0.005))[99:-99]
    acc = columns(name, "acc_")[100:-100]
    blocks = len(excess) // 100
    shift = excess[: blocks * 100].reshape(blocks, 100, 3).mean(axis=1)
    power = acc[: blocks * 100].reshape(blocks, 100, 3).var(axis=1).sum(axis=1)
    for axis, truth in enumerate((0.022, -0.016, 0.012)):
        assert np.polyfit(power, shift[:, axis], 1)[0] / lab.DEGREE == pytest.approx(truth, rel=0.25)


def test_six_poses_show_bias_and_scale() -> None:
    """The labelled axis points up in each pose; half sums and half differences give bias and scale."""
    row = made("six_labelled_poses")
    frame = row.frame
    assert set(frame["pose"]) == {"", "+x", "-x", "+y", "-y", "+z", "-z"}
    for axis in "xyz":
        up, down = (frame.loc[frame["pose"] == f"{sign}{axis}", f"acc_{axis}"].mean() for sign in "+-")
        assert (up + down) / 2 == pytest.approx(row.effects["acc.bias"][axis], abs=0.01)
        assert (up - down) / (2 * lab.GRAVITY) - 1 == pytest.approx(row.effects["acc.scale"][axis], abs=0.001)
        for other in set("xyz") - {axis}:
            level = frame.loc[frame["pose"] == f"+{axis}", f"acc_{other}"].mean()
            assert level == pytest.approx(row.effects["acc.bias"][other], abs=0.01)
    step = np.diff(frame["t"], append=np.nan)[:-1]
    turn = (frame[["gyro_x", "gyro_y", "gyro_z"]].to_numpy()[:-1] * step[:, None]).sum(axis=0)
    np.testing.assert_allclose(turn, [0.0, -1.5 * np.pi, 1.5 * np.pi], atol=0.02)


def test_error_sizes_outside_the_catalogue() -> None:
    """Line and tone have 3.5 times the RMS of the noise; the zero jumps 31 times by ten times the noise."""
    excess_of = {}
    for name in ("mains_line", "swept_tone", "zero_jumps"):
        excess = columns(name, "gyro_")[1:-1] - rate_of(poses_of(name), 0.005)
        excess_of[name] = excess
    noise = lab.MEMS.gyr
    for name in ("mains_line", "swept_tone"):
        assert excess_of[name].std() / noise == pytest.approx(np.sqrt(3.5**2 + 1.0), rel=0.1)
    zero = excess_of["zero_jumps"]
    assert np.all(np.abs(zero.mean(axis=0)) < 0.1 * noise)
    for axis in range(3):
        smooth = np.convolve(zero[:, axis], np.ones(40) / 40, mode="same")
        above = smooth > 0.5 * (np.percentile(smooth, 90) + np.percentile(smooth, 10))
        assert np.sum(above[1:] != above[:-1]) == 31


def test_noise_above_the_stated_one() -> None:
    """The gyro noise is 12 times the stated noise."""
    name = "stated_noise_too_small"
    excess = columns(name, "gyro_")[1:-1] - rate_of(poses_of(name), 0.01)
    assert excess.std() / made(name).metadata["noise"]["gyr"] == pytest.approx(12.0, rel=0.1)


def test_heading_of_the_reference_drifts() -> None:
    """The horizontal field, turned by the reference, turns by 4 deg over the log."""
    name = "irrelevant_columns_drifting_heading"
    field = lab.to_reference(poses_of(name), columns(name, "mag_"))
    start, end = field[:600].mean(axis=0), field[-600:].mean(axis=0)
    turn = np.arctan2(end[1], end[0]) - np.arctan2(start[1], start[0])
    assert turn / lab.DEGREE == pytest.approx(3.75, abs=0.4)
