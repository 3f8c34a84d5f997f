"""Checks of the independent simulator against itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import motion_and_reference as mr
import numpy as np
import pytest
from motion_and_reference import DEGREE, Array, Motion

MOTIONS: dict[str, Callable[[np.random.Generator], Motion]] = {
    "hand": lambda rng: mr.hand_held(rng, 20.0),
    "hand in place": lambda rng: mr.hand_held(rng, 20.0, acceleration=0.0),
    "arm": lambda rng: mr.robot_arm(rng, 20.0),
    "wrist": lambda rng: mr.robot_arm(rng, 20.0, translating=False),
    "table": lambda rng: mr.turntable(rng, 20.0),
    "table off centre": lambda rng: mr.turntable(rng, 20.0, radius=0.2),
    "one axis": lambda rng: mr.one_axis(rng, 20.0, mr.Y),
    "drive": lambda rng: mr.drive(rng, 20.0),
    "poses": lambda rng: mr.rest_poses(rng, 20.0, translating=True),
    "six positions": lambda rng: mr.six_positions(rng, 20.0)[0],
    "drone": lambda rng: mr.drone(rng, 20.0),
}
SEEDS = (1, 2)


def hand(seed: int = 5) -> Motion:
    """Return one motion by hand of 20 s."""
    return mr.hand_held(np.random.default_rng(seed), 20.0, fastest=2.0)


def turned(first: Array, second: Array) -> Array:
    """Return the angle between attitudes in degrees."""
    vector = mr.to_rotation_vector(mr.multiply(mr.conjugate(first), second))
    return np.asarray(np.linalg.norm(vector, axis=1) / DEGREE)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", MOTIONS)
def test_derivatives_agree(kind: str, seed: int) -> None:
    """Central differences of attitude, rate, position and velocity give the stated derivatives."""
    motion = MOTIONS[kind](np.random.default_rng(seed))
    t, h = np.linspace(-1.0, 21.0, 400), 1e-5
    now, before, after = motion.state(t), motion.state(t - h), motion.state(t + h)
    slope = (mr.to_matrix(after.attitude) - mr.to_matrix(before.attitude)) / (2 * h)
    skew = np.einsum("nji,njk->nik", mr.to_matrix(now.attitude), slope)
    omega = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    assert np.allclose(skew, -np.swapaxes(skew, 1, 2), atol=1e-5)
    assert np.allclose(omega, now.rate, atol=1e-5)
    assert np.allclose((after.rate - before.rate) / (2 * h), now.angular_acceleration, atol=1e-3)
    assert np.allclose((after.position - before.position) / (2 * h), now.velocity, atol=1e-5)
    assert np.allclose((after.velocity - before.velocity) / (2 * h), now.acceleration, atol=1e-3)


@pytest.mark.parametrize("kind", MOTIONS)
def test_pose_is_the_state(kind: str) -> None:
    """The pose without encoders equals the state, and attitudes are continuous unit quaternions."""
    motion = MOTIONS[kind](np.random.default_rng(4))
    t = np.arange(0.0, 20.0, 0.005)
    state = motion.state(t)
    attitude, position = motion.pose(t)
    assert np.allclose(attitude, state.attitude)
    assert np.allclose(position, state.position)
    assert np.allclose(np.linalg.norm(attitude, axis=1), 1.0)
    assert np.all(np.sum(attitude[1:] * attitude[:-1], axis=1) > 0.9)


@pytest.mark.parametrize("frame", ["NED", "ENU", "NWU"])
def test_specific_force(frame: str) -> None:
    """Specific force is R^T (a - g) with a from the position, and points up at rest."""
    gravity = mr.gravity_vector(frame)
    field = mr.field_vector(20.0, 2.0, 44.0, frame)
    t, h = np.linspace(0.0, 20.0, 500), 1e-3
    motion = hand()
    state = motion.state(t)
    readings = mr.ideal_readings(state, gravity, field)
    path = [motion.pose(t + shift)[1] for shift in (-h, 0.0, h)]
    acceleration = (path[0] - 2 * path[1] + path[2]) / h**2
    expected = np.einsum("nji,nj->ni", mr.to_matrix(state.attitude), acceleration - gravity)
    assert np.allclose(readings.acc, expected, atol=2e-3)
    assert np.allclose(np.linalg.norm(readings.mag, axis=1), np.linalg.norm(field))
    still = mr.ideal_readings(Motion((mr.Joint(mr.X, mr.Line(0.0)),)).state(t), gravity, field)
    up = -1.0 if frame == "NED" else 1.0
    assert np.allclose(still.acc, [0.0, 0.0, up * mr.GRAVITY])
    assert np.allclose(still.mag, field)


def test_quaternion_turns_body_into_reference() -> None:
    """A quarter turn about z takes the body's x axis to the reference's y axis."""
    quarter = mr.from_rotation_vector(np.array([[0.0, 0.0, np.pi / 2]]))
    assert np.allclose(mr.rotate(quarter, mr.X[None, :]), mr.Y)
    assert np.allclose(mr.to_matrix(quarter)[0] @ mr.X, mr.Y)
    assert np.allclose(mr.to_rotation_vector(-quarter), [[0.0, 0.0, np.pi / 2]])


def test_six_positions_put_each_axis_up() -> None:
    """Each body axis points up and down once, exactly, in the spans of rest."""
    motion, spans = mr.six_positions(np.random.default_rng(2), 30.0)
    middle = np.array([0.5 * (begin + end) for begin, end in spans])
    for t in (middle, np.array([begin for begin, _ in spans]), np.array([end for _, end in spans])):
        force = mr.ideal_readings(motion.state(t), mr.gravity_vector(), np.zeros(3)).acc / mr.GRAVITY
        assert np.allclose(np.sort(np.abs(force), axis=1), [0.0, 0.0, 1.0], atol=1e-9)
        assert len({tuple(row) for row in np.round(force).astype(int).tolist()}) == 6


def test_noise_has_the_stated_size() -> None:
    """White noise of a reference has the stated standard deviation about and along each axis."""
    track = mr.observe(hand(), np.arange(0.0, 20.0, 0.005))
    noisy = mr.add_noise(track, np.random.default_rng(1), 0.1 * DEGREE, 5e-4)
    error = mr.to_rotation_vector(mr.multiply(mr.conjugate(track.attitude), noisy.attitude))
    assert np.allclose(error.std(axis=0), 0.1 * DEGREE, rtol=0.06)
    assert np.allclose((noisy.position - track.position).std(axis=0), 5e-4, rtol=0.06)


@pytest.mark.parametrize("way", ["quaternion", "rotation_vector"])
def test_first_order_smoothing_loses_the_second_derivative(
    way: Literal["quaternion", "rotation_vector"],
) -> None:
    """A first-order filter run both ways adds c x'' with c = 1 / (2 pi cutoff)^2 to slow motion."""
    motion = Motion((mr.Joint(mr.X, mr.Sines(np.array([0.5]), np.array([0.8]), np.array([0.3]))),))
    times = np.arange(-2.0, 22.0, 0.005)
    smooth = mr.lowpass(mr.observe(motion, times), 200.0, 12.0, 1, way=way)
    inner = (times > 0) & (times < 20)
    angle = mr.to_rotation_vector(smooth.attitude)[inner, 0]
    bend = motion.joints[0].angle.at(times[inner], 2)
    lost = np.sum((angle - motion.joints[0].angle.at(times[inner])) * bend) / np.sum(bend**2)
    assert lost == pytest.approx(1 / (2 * np.pi * 12.0) ** 2, rel=0.1)


def test_causal_filter_is_late() -> None:
    """A causal filter of the second order is late by sqrt(2) / (2 pi cutoff)."""
    motion = hand()
    times = np.arange(-2.0, 22.0, 0.005)
    smooth = mr.lowpass(mr.observe(motion, times), 200.0, 12.0, 2, causal=True)
    inner = (times > 0) & (times < 20)
    late = np.sqrt(2) / (2 * np.pi * 12.0)
    shifted, _ = motion.pose(times[inner] - late)
    same, _ = motion.pose(times[inner])
    error = np.sqrt(np.mean(turned(shifted, smooth.attitude[inner]) ** 2))
    assert error < 0.15 * np.sqrt(np.mean(turned(same, smooth.attitude[inner]) ** 2))


def test_interpolation_and_hold() -> None:
    """Slerp is exact at samples and loses h^2/12 of x''; holding is late by half an interval."""
    motion = Motion(
        (mr.Joint(mr.Y, mr.Sines(np.array([0.4]), np.array([0.9]), np.array([0.0]))),),
        (mr.Sines(np.array([0.2]), np.array([0.7]), np.array([0.1])), mr.Line(1.0), mr.Line()),
    )
    interval = 0.05
    track = mr.observe(motion, np.arange(-2.0, 22.0, interval))
    assert np.allclose(turned(mr.interpolate(track, track.stamp).attitude, track.attitude), 0.0, atol=1e-6)
    rows = np.arange(0.0, 20.0, 0.00317)
    angle, path = motion.joints[0].angle, motion.base[0]
    found = mr.interpolate(track, rows)
    for value, truth in ((mr.to_rotation_vector(found.attitude)[:, 1], angle), (found.position[:, 0], path)):
        bend = truth.at(rows, 2)
        lost = np.sum((value - truth.at(rows)) * bend) / np.sum(bend**2)
        assert lost == pytest.approx(interval**2 / 12, rel=0.03)
    held = mr.to_rotation_vector(mr.hold(track, rows).attitude)[:, 1]
    speed = angle.at(rows, 1)
    late = -np.sum((held - angle.at(rows)) * speed) / np.sum(speed**2)
    assert late == pytest.approx(interval / 2, rel=0.05)


def test_gaps_stay_empty_or_are_bridged() -> None:
    """Rows in a gap are NaN if the gap is longer than allowed, and straight otherwise."""
    track = mr.drop_out(mr.observe(hand(), np.arange(0.0, 20.0, 0.01)), [(5.0, 6.0)])
    rows = np.arange(0.0025, 19.0, 0.005)
    empty = np.isnan(mr.interpolate(track, rows, longest_gap=0.1).attitude[:, 0])
    assert np.array_equal(empty, (rows > 4.99) & (rows < 6.0))
    assert not np.isnan(mr.interpolate(track, rows).attitude).any()


def test_packets_and_jitter_keep_the_order() -> None:
    """Stamps grow strictly, packets hold three to eight samples 15 us apart, and stamps are not early."""
    rng = np.random.default_rng(3)
    times = mr.clock(rng, 120.0, 20.0)
    stamps = mr.packet_stamps(rng, times)
    assert np.all(np.diff(stamps) > 0)
    assert np.all(stamps >= times)
    ends = np.flatnonzero(np.diff(stamps) > 1e-3)
    sizes = np.diff(ends)
    assert sizes.min() >= 3
    assert sizes.max() <= 8
    assert np.min(np.diff(stamps)) == pytest.approx(15e-6, rel=1e-6)
    jittered = mr.jittered_stamps(rng, times, 0.003)
    assert np.all(np.diff(jittered) > 0)
    assert abs(np.mean(jittered - times)) < 3e-4


def test_encoders_round() -> None:
    """An encoder is off by half a step at most."""
    rng = np.random.default_rng(7)
    motion = mr.one_axis(rng, 20.0, mr.Z)
    t = np.arange(0.0, 20.0, 0.01)
    step = 0.2 * DEGREE
    error = turned(mr.observe(motion, t).attitude, mr.observe(motion, t, angle_step=step).attitude) * DEGREE
    assert error.max() <= 0.5 * step * (1 + 1e-6)
    assert error.max() > 0.4 * step


def test_slips_and_heading_drift() -> None:
    """A slip changes only its span; a drift turns attitudes about the vertical alone."""
    rng = np.random.default_rng(8)
    track = mr.observe(hand(), np.arange(0.0, 20.0, 0.01))
    chosen = mr.spans(rng, 20.0, 3, 0.1, 0.5)
    slipped = turned(track.attitude, mr.slip(track, rng, chosen).attitude)
    inside = mr.within(track.stamp, chosen)
    assert slipped[inside].min() > 0.9
    assert slipped[~inside].max() < 1e-5
    drifting = mr.drift_heading(track, mr.Line(0.0, 0.001))
    turn = mr.to_rotation_vector(mr.multiply(drifting.attitude, mr.conjugate(track.attitude)))
    assert np.allclose(turn, 0.001 * track.stamp[:, None] * mr.Z, atol=1e-9)
