"""Motions known exactly, ideal sensor readings, and reference instruments as laboratories have them.

Every motion is a chain of joints whose angles are analytic functions of time, on a base whose position is one
too. Attitude, angular rate, angular acceleration, position, velocity and acceleration are exact at any time.
A reference instrument turns a motion into a `Track`: the stamps, attitudes and positions that it would write.

Quaternions are Hamilton, scalar first, and rotate body vectors into the reference frame.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import comb
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt
from numpy.polynomial import Polynomial
from scipy.interpolate import BSpline
from scipy.signal import butter, sosfilt, sosfilt_zi, sosfiltfilt

Array = npt.NDArray[np.float64]
Generator = np.random.Generator

GRAVITY = 9.80665
DEGREE = np.pi / 180.0
PACKET_SPACING = 15e-6

X = np.array([1.0, 0.0, 0.0])
Y = np.array([0.0, 1.0, 0.0])
Z = np.array([0.0, 0.0, 1.0])


# --------------------------------------------------------------------------------
# Quaternions
# --------------------------------------------------------------------------------


def multiply(a: Array, b: Array) -> Array:
    """Return the Hamilton product of two arrays of quaternions."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    return np.asarray(
        np.stack(
            [
                aw * bw - ax * bx - ay * by - az * bz,
                aw * bx + ax * bw + ay * bz - az * by,
                aw * by - ax * bz + ay * bw + az * bx,
                aw * bz + ax * by - ay * bx + az * bw,
            ],
            axis=-1,
        )
    )


def conjugate(q: Array) -> Array:
    """Return the inverse of unit quaternions."""
    return np.asarray(q * np.array([1.0, -1.0, -1.0, -1.0]))


def from_rotation_vector(v: Array) -> Array:
    """Return the quaternions of rotation vectors in rad."""
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), 0.5 * v * np.sinc(angle / (2 * np.pi))], axis=-1)


def to_rotation_vector(q: Array) -> Array:
    """Return the rotation vectors, of at most half a turn, of unit quaternions."""
    q = np.where(q[..., :1] < 0, -q, q)
    length = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(length, q[..., :1])
    factor = np.where(length > 1e-12, angle / np.maximum(length, 1e-12), 2.0)
    return np.asarray(q[..., 1:] * factor)


def to_matrix(q: Array) -> Array:
    """Return the rotation matrices, body to reference, of unit quaternions."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.asarray(np.stack([np.stack(row, axis=-1) for row in rows], axis=-2))


def rotate(q: Array, v: Array) -> Array:
    """Rotate body vectors into the reference frame."""
    t = 2 * np.cross(q[..., 1:], v)
    return np.asarray(v + q[..., :1] * t + np.cross(q[..., 1:], t))


def same_sign(q: Array) -> Array:
    """Choose the sign of each quaternion so that the sequence is continuous."""
    flips = np.sign(np.sum(q[1:] * q[:-1], axis=1))
    flips[flips == 0] = 1.0
    return np.asarray(q * np.concatenate([[1.0], np.cumprod(flips)])[:, None])


# --------------------------------------------------------------------------------
# Scalar functions of time with exact derivatives
# --------------------------------------------------------------------------------


class Scalar(Protocol):
    """A function of time with exact derivatives up to the third."""

    def at(self, t: Array, order: int = 0) -> Array:
        """Return the derivative of this order (0 is the value) at times t."""
        ...


@dataclass(frozen=True)
class Line:
    """A constant plus a constant speed."""

    offset: float = 0.0
    slope: float = 0.0

    def at(self, t: Array, order: int = 0) -> Array:
        """Return the derivative of this order at times t."""
        if order == 0:
            return self.offset + self.slope * t
        return np.full(t.shape, self.slope if order == 1 else 0.0)


@dataclass(frozen=True)
class Sines:
    """A sum of sinusoids."""

    amplitude: Array
    frequency: Array
    phase: Array

    def at(self, t: Array, order: int = 0) -> Array:
        """Return the derivative of this order at times t."""
        total = np.zeros(t.shape)
        for a, f, p in zip(self.amplitude, self.frequency, self.phase, strict=True):
            w = 2 * np.pi * f
            total += a * w**order * np.sin(w * t + p + order * np.pi / 2)
        return total


@dataclass(frozen=True)
class Spline:
    """A quintic spline."""

    spline: BSpline

    def at(self, t: Array, order: int = 0) -> Array:
        """Return the derivative of this order at times t."""
        return np.asarray(self.spline(t, nu=order), dtype=np.float64)


_STEP = Polynomial([0, 0, 0, 0, 35, -84, 70, -20])
_STEP_INTEGRAL = _STEP.integ()


@dataclass(frozen=True)
class Moves:
    """Moves from point to point with rests between: each is a step of the seventh degree."""

    start: float
    begin: Array
    duration: Array
    change: Array

    def at(self, t: Array, order: int = 0) -> Array:
        """Return the derivative of this order at times t."""
        total = np.full(t.shape, self.start if order == 0 else 0.0)
        polynomial = _STEP.deriv(order) if order else _STEP
        for begin, duration, change in zip(self.begin, self.duration, self.change, strict=True):
            u = (t - begin) / duration
            inside = (u > 0) & (u < 1)
            total[inside] += change / duration**order * polynomial(u[inside])
            if order == 0:
                total[u >= 1] += change
        return total


@dataclass(frozen=True)
class Speeds:
    """An angle whose speed moves smoothly from plateau to plateau, as that of a rate table."""

    start: float
    speed: Moves

    def at(self, t: Array, order: int = 0) -> Array:
        """Return the derivative of this order at times t."""
        if order:
            return self.speed.at(t, order - 1)
        moves = self.speed
        total = self.start + moves.start * t
        for begin, duration, change in zip(moves.begin, moves.duration, moves.change, strict=True):
            u = (t - begin) / duration
            inside = (u > 0) & (u < 1)
            total[inside] += change * duration * _STEP_INTEGRAL(u[inside])
            total[u >= 1] += change * duration * (u[u >= 1] - 0.5)
        return total


@dataclass(frozen=True)
class Sum:
    """A sum of functions."""

    parts: tuple[Scalar, ...]

    def at(self, t: Array, order: int = 0) -> Array:
        """Return the derivative of this order at times t."""
        return np.asarray(sum((part.at(t, order) for part in self.parts), np.zeros(t.shape)))


@dataclass(frozen=True)
class Product:
    """A product of two functions."""

    first: Scalar
    second: Scalar

    def at(self, t: Array, order: int = 0) -> Array:
        """Return the derivative of this order at times t."""
        total = np.zeros(t.shape)
        for k in range(order + 1):
            total += comb(order, k) * self.first.at(t, k) * self.second.at(t, order - k)
        return total


@dataclass(frozen=True)
class Course:
    """The heading of a vehicle that points along its path."""

    x: Scalar
    y: Scalar

    def at(self, t: Array, order: int = 0) -> Array:
        """Return the derivative of this order, up to the second, at times t."""
        vx, vy = self.x.at(t, 1), self.y.at(t, 1)
        if order == 0:
            return np.unwrap(np.arctan2(vy, vx))
        ax, ay = self.x.at(t, 2), self.y.at(t, 2)
        square = vx**2 + vy**2
        rate = (vx * ay - vy * ax) / square
        if order == 1:
            return np.asarray(rate)
        if order == 2:
            jerk = vx * self.y.at(t, 3) - vy * self.x.at(t, 3)
            return np.asarray(jerk / square - 2 * rate * (vx * ax + vy * ay) / square)
        raise ValueError("the third derivative of a course is not known")


def sines(rng: Generator, count: int, low: float, high: float, rms: float, order: int = 0) -> Sines:
    """Draw sinusoids whose derivative of this order has this RMS, shared about equally between them."""
    frequency = np.exp(rng.uniform(np.log(low), np.log(high), count))
    share = rng.uniform(0.5, 1.5, count)
    amplitude = share * rms * np.sqrt(2.0 / np.sum(share**2)) / (2 * np.pi * frequency) ** order
    return Sines(amplitude, frequency, rng.uniform(0, 2 * np.pi, count))


def random_spline(rng: Generator, seconds: float, spacing: float, spread: float) -> Spline:
    """Draw a spline over the log and a margin of three seconds at both ends."""
    degree = 5
    knots = np.arange(-3.0 - (degree + 1) * spacing, seconds + 3.0 + (degree + 2) * spacing, spacing)
    return Spline(BSpline(knots, spread * rng.standard_normal(knots.size - degree - 1), degree))


# --------------------------------------------------------------------------------
# Rigid motion
# --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Joint:
    """A turn about a fixed axis, followed by a link fixed in the turned frame."""

    axis: Array
    angle: Scalar
    link: Array | None = None


@dataclass(frozen=True)
class State:
    """The exact state of the body at a set of times.

    Rate and angular acceleration are body vectors; the others are vectors of the reference frame.
    """

    t: Array
    attitude: Array
    rate: Array
    angular_acceleration: Array
    position: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True)
class Motion:
    """A chain of joints on a base that may move."""

    joints: tuple[Joint, ...]
    base: tuple[Scalar, Scalar, Scalar] = (Line(), Line(), Line())

    def state(self, t: Array) -> State:
        """Return attitude and position with their derivatives at times t."""
        t = np.asarray(t, dtype=np.float64)
        q = np.tile([1.0, 0.0, 0.0, 0.0], (t.size, 1))
        rate, turn, p, v, a = (np.zeros((t.size, 3)) for _ in range(5))
        for joint in self.joints:
            angle, speed, rush = (joint.angle.at(t, order)[:, None] for order in range(3))
            axis = joint.axis
            q = multiply(q, from_rotation_vector(angle * axis))

            def into(vector: Array, axis: Array = axis, angle: Array = angle) -> Array:
                return _turned_back(vector, axis, angle)

            rate, turn, p, v, a = into(rate), into(turn), into(p), into(v), into(a)
            turn = turn + np.cross(rate, axis) * speed + axis * rush
            rate = rate + axis * speed
            if joint.link is not None:
                p = p + joint.link
                swing = np.cross(rate, joint.link)
                v = v + swing
                a = a + np.cross(turn, joint.link) + np.cross(rate, swing)
        base = [np.stack([part.at(t, order) for part in self.base], axis=1) for order in range(3)]
        return State(t, q, rate, turn, base[0] + rotate(q, p), base[1] + rotate(q, v), base[2] + rotate(q, a))

    def pose(self, t: Array, angle_step: float = 0.0) -> tuple[Array, Array]:
        """Return attitude and position; encoders, if any, round every joint angle to their step."""
        q = np.tile([1.0, 0.0, 0.0, 0.0], (t.size, 1))
        position = np.stack([part.at(t) for part in self.base], axis=1)
        for joint in self.joints:
            angle = joint.angle.at(t)
            if angle_step > 0:
                angle = np.round(angle / angle_step) * angle_step
            q = multiply(q, from_rotation_vector(angle[:, None] * joint.axis))
            if joint.link is not None:
                position = position + rotate(q, np.broadcast_to(joint.link, position.shape))
        return q, position


def _turned_back(vector: Array, axis: Array, angle: Array) -> Array:
    """Express vectors in a frame that is turned by the angle about the axis."""
    along = (vector @ axis)[:, None] * axis
    return np.asarray(along + (vector - along) * np.cos(angle) + np.cross(vector, axis) * np.sin(angle))


def gravity_vector(frame: str = "NED", gravity: float = GRAVITY) -> Array:
    """Return gravity in the reference frame: down is +z in NED and -z in ENU and NWU."""
    return np.array([0.0, 0.0, gravity if frame == "NED" else -gravity])


def field_vector(north: float, east: float, down: float, frame: str = "NED") -> Array:
    """Return a magnetic field, given by its north, east and down parts, in the reference frame."""
    if frame == "NED":
        return np.array([north, east, down])
    if frame == "ENU":
        return np.array([east, north, -down])
    if frame == "NWU":
        return np.array([north, -east, -down])
    raise ValueError(f"frame {frame} is not known")


@dataclass(frozen=True)
class Readings:
    """Ideal readings in the body frame: specific force, angular rate, magnetic flux density."""

    acc: Array
    gyr: Array
    mag: Array


def ideal_readings(state: State, gravity: Array, field: Array) -> Readings:
    """Return f = R^T (a - g), omega and m = R^T m_ref."""
    back = conjugate(state.attitude)
    force = rotate(back, state.acceleration - gravity)
    return Readings(force, state.rate.copy(), rotate(back, np.broadcast_to(field, force.shape)))


# --------------------------------------------------------------------------------
# Motions
# --------------------------------------------------------------------------------


def _roll_pitch_yaw(roll: Scalar, pitch: Scalar, yaw: Scalar) -> tuple[Joint, ...]:
    return (Joint(Z, yaw), Joint(Y, pitch), Joint(X, roll))


def _active(rng: Generator, seconds: float) -> Moves:
    """Return a factor that is zero at the start and end of the log and one between."""
    rest = rng.uniform(0.08, 0.2, 2) * seconds
    begin = np.array([rest[0], seconds - rest[1] - 1.0])
    return Moves(0.0, begin, np.array([1.0, 1.0]), np.array([1.0, -1.0]))


def hand_held(rng: Generator, seconds: float, fastest: float = 2.5, acceleration: float = 1.0) -> Motion:
    """Draw a motion by hand: all axes turn at 20 to 90 deg/s RMS; the acceleration is an RMS value too.

    Half of the longer motions start and end at rest; a third are splines instead of sinusoids.
    """
    irregular = rng.random() < 0.33
    at_rest = rng.random() < 0.5 and seconds >= 15
    envelope = _active(rng, seconds)
    spacing = 0.75 / fastest

    def turn() -> Scalar:
        speed = rng.uniform(20, 90) * DEGREE
        if irregular:
            part: Scalar = random_spline(rng, seconds, spacing, 0.7 * speed * spacing)
            slow = sines(rng, 2, 0.03, 0.15, rng.uniform(10, 40) * DEGREE)
            part = Sum((part, slow))
        else:
            part = sines(rng, 7, 0.08, fastest, speed, order=1)
        if at_rest:
            part = Product(envelope, part)
        return Sum((Line(rng.uniform(-np.pi / 3, np.pi / 3)), part))

    def shift() -> Scalar:
        if acceleration <= 0:
            return Line()
        part: Scalar = sines(rng, 6, min(0.35, 0.4 * fastest), fastest, acceleration / np.sqrt(3), order=2)
        return Product(envelope, part) if at_rest else part

    return Motion(_roll_pitch_yaw(turn(), turn(), turn()), (shift(), shift(), shift()))


def _schedule(
    rng: Generator, seconds: float, move: tuple[float, float], rest: tuple[float, float]
) -> list[tuple[float, float]]:
    """Draw the start and duration of moves with rests between, over the whole log."""
    moves = []
    t = rng.uniform(*rest)
    while t < seconds - move[0]:
        duration = rng.uniform(*move)
        moves.append((t, duration))
        t += duration + rng.uniform(*rest)
    return moves or [(0.2 * seconds, 0.6 * seconds)]


def _moves(
    schedule: Sequence[tuple[float, float]],
    targets: Array,
    start: float,
    fastest: float = np.inf,
) -> Moves:
    """Move to each target in turn, or as far towards it as the highest speed allows."""
    begin, duration = np.array(schedule).T
    # The speed of a step peaks at 35/16 of its mean.
    reach = fastest * duration * 16 / 35
    change = np.empty(duration.size)
    place = start
    for k, target in enumerate(targets):
        change[k] = np.clip(target - place, -reach[k], reach[k])
        place += change[k]
    return Moves(start, begin, duration, change)


def robot_arm(rng: Generator, seconds: float, shortest: float = 0.8, translating: bool = True) -> Motion:
    """Draw moves with stops of a six-axis arm, or of its wrist alone if the sensor does not translate."""
    schedule = _schedule(rng, seconds, (shortest, shortest + 1.6), (0.2, 1.5))
    chain = (
        (Z, 70, (0.0, 0.0, -0.35)),
        (Y, 30, (0.0, 0.0, -0.4)),
        (Y, 35, (0.35, 0.0, 0.0)),
        (X, 90, (0.1, 0.0, 0.0)),
        (Y, 60, (0.08, 0.0, 0.0)),
        (X, 110, (0.03, 0.02, -0.02)),
    )
    joints = [] if translating else [Joint(Z, Line(rng.uniform(-np.pi, np.pi)))]
    for axis, reach, link in chain if translating else chain[3:]:
        targets = rng.uniform(-reach, reach, len(schedule)) * DEGREE
        angle = _moves(schedule, targets, rng.uniform(-reach, reach) * DEGREE, 150 * DEGREE)
        joints.append(Joint(axis, angle, np.array(link) if translating else None))
    return Motion(tuple(joints))


def _table_angle(rng: Generator, seconds: float, shortest: float, most: float, speed: float) -> Scalar:
    """Draw stop-and-go moves within a range, speeds with plateaus, or a swing."""
    way = rng.integers(3)
    if way == 0:
        schedule = _schedule(rng, seconds, (shortest, shortest + 2.0), (0.3, 2.0))
        return _moves(schedule, rng.uniform(-most, most, len(schedule)), 0.0, 200 * DEGREE)
    if way == 1:
        schedule = _schedule(rng, seconds, (max(shortest, 0.6), max(shortest, 0.6) + 0.6), (1.0, 3.0))
        targets = rng.uniform(-speed, speed, len(schedule))
        targets[-1] = 0.0
        return Speeds(0.0, _moves(schedule, targets, 0.0))
    return sines(rng, 3, 0.1, min(0.8, 0.5 / shortest), 0.5 * speed, order=1)


def turntable(rng: Generator, seconds: float, shortest: float = 0.8, radius: float = 0.0) -> Motion:
    """Draw a rate table or pan-tilt unit; the sensor sits at this radius, tilted on its plate."""
    pan = _table_angle(rng, seconds, shortest, 150 * DEGREE, 120 * DEGREE)
    schedule = _schedule(rng, seconds, (shortest, shortest + 2.0), (0.5, 3.0))
    tilt = _moves(schedule, rng.uniform(-60, 60, len(schedule)) * DEGREE, 0.0, 120 * DEGREE)
    plate = Joint(X, Line(rng.uniform(-30, 30) * DEGREE))
    link = np.array([radius, 0.0, -0.3 * radius]) if radius > 0 else None
    return Motion((Joint(Z, pan), Joint(Y, tilt, link), plate))


def one_axis(rng: Generator, seconds: float, axis: Array, shortest: float = 0.8) -> Motion:
    """Draw the motion of a rig that turns about one axis only."""
    return Motion((Joint(axis, _table_angle(rng, seconds, shortest, 170 * DEGREE, 90 * DEGREE)),))


def drive(rng: Generator, seconds: float, acceleration: float = 0.8) -> Motion:
    """Draw a gentle drive: the vehicle points along its path and rolls and pitches on its springs."""
    slow = 0.04
    x = Sum((Line(0.0, rng.uniform(6, 10)), sines(rng, 4, slow, 0.15, rng.uniform(0.5, 1.2), order=1)))
    y = sines(rng, 5, slow, 0.25, acceleration, order=2)
    y = Sines(np.minimum(y.amplitude, 8.0 / (2 * np.pi * y.frequency)), y.frequency, y.phase)
    z = sines(rng, 4, 0.5, 1.6, rng.uniform(0.1, 0.3), order=2)
    roll = sines(rng, 4, 0.1, 1.6, rng.uniform(0.6, 2.0) * DEGREE)
    pitch = sines(rng, 4, 0.1, 1.6, rng.uniform(0.4, 1.5) * DEGREE)
    return Motion(_roll_pitch_yaw(roll, pitch, Course(x, y)), (x, y, z))


def rest_poses(rng: Generator, seconds: float, shortest: float = 0.8, translating: bool = False) -> Motion:
    """Draw poses all over the sphere with rests of one to four seconds."""
    schedule = _schedule(rng, seconds, (shortest, shortest + 1.0), (1.0, 4.0))
    count = len(schedule)
    widths = (np.pi, 0.48 * np.pi, np.pi)
    angles = [_moves(schedule, rng.uniform(-w, w, count), 0.0, 240 * DEGREE) for w in widths]
    base: tuple[Scalar, Scalar, Scalar] = (Line(), Line(), Line())
    if translating:
        places = [_moves(schedule, rng.uniform(-0.25, 0.25, count), 0.0) for _ in range(3)]
        base = (places[0], places[1], places[2])
    return Motion(_roll_pitch_yaw(angles[0], angles[1], angles[2]), base)


def six_positions(rng: Generator, seconds: float) -> tuple[Motion, tuple[tuple[float, float], ...]]:
    """Draw six poses, each body axis up and down, and return the motion with the spans of the rests."""
    poses = np.array([(0, 0), (0, 180), (0, 90), (0, -90), (90, 0), (-90, 0)], dtype=np.float64)
    poses = poses[rng.permutation(6)] * DEGREE
    slot = seconds / 6
    move = min(1.2, 0.4 * slot)
    schedule = [(k * slot - move / 2, move) for k in range(1, 6)]
    pitch = _moves(schedule, poses[1:, 0], float(poses[0, 0]))
    roll = _moves(schedule, poses[1:, 1], float(poses[0, 1]))
    spans = tuple(
        (k * slot + (move / 2 if k else 0.0), (k + 1) * slot - (move / 2 if k < 5 else 0.0)) for k in range(6)
    )
    return Motion(_roll_pitch_yaw(roll, pitch, Line(rng.uniform(-np.pi, np.pi)))), spans


def drone(rng: Generator, seconds: float, acceleration: float = 1.0, vibration: float = 1.5) -> Motion:
    """Draw a flight: small tilts, slow turns, and rotors that shake the body.

    Acceleration and vibration are RMS values. With zero acceleration the body shakes and turns on a stand.
    """
    rotor = rng.uniform(55, 90)
    throttle = Sum((Line(1.0), sines(rng, 3, 0.05, 0.4, 0.25)))

    def shake(rms: float, order: int) -> Scalar:
        frequency = rotor * np.array([1.0, 1.013, 2.0, 2.021])
        share = rng.uniform(0.5, 1.0, 4) * np.array([1.0, 0.8, 0.5, 0.3])
        amplitude = rms * share * np.sqrt(2 / np.sum(share**2)) / (2 * np.pi * frequency) ** order
        return Product(throttle, Sines(amplitude, frequency, rng.uniform(0, 2 * np.pi, 4)))

    def turn(spread: float, slow: float, fast: float) -> Scalar:
        return Sum((sines(rng, 5, slow, fast, spread * DEGREE), shake(rng.uniform(0.3, 2.0) * DEGREE, 1)))

    def shift() -> Scalar:
        shaking = shake(vibration / np.sqrt(3), 2)
        if acceleration <= 0:
            return shaking
        return Sum((sines(rng, 5, 0.12, 0.7, acceleration / np.sqrt(3), order=2), shaking))

    tilts = turn(rng.uniform(4, 10), 0.15, 1.2), turn(rng.uniform(4, 10), 0.15, 1.2), turn(40, 0.03, 0.2)
    return Motion(_roll_pitch_yaw(*tilts), (shift(), shift(), shift()))


# --------------------------------------------------------------------------------
# Reference instruments
# --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Track:
    """What a reference instrument writes: stamps, attitudes and positions, NaN where it knows none."""

    stamp: Array
    attitude: Array
    position: Array

    def kept(self, keep: npt.NDArray[np.bool_]) -> Track:
        """Return the rows to keep."""
        return Track(self.stamp[keep], self.attitude[keep], self.position[keep])


def clock(rng: Generator, rate: float, seconds: float, margin: float = 2.0) -> Array:
    """Return the sample times of an instrument with its own phase and a clock that is up to 400 ppm off."""
    true_rate = rate * (1 + rng.uniform(-4e-4, 4e-4))
    start = -margin + rng.uniform(0, 1 / rate)
    return np.asarray(start + np.arange(int((seconds + 2 * margin) * true_rate)) / true_rate)


def observe(motion: Motion, times: Array, stamps: Array | None = None, angle_step: float = 0.0) -> Track:
    """Return the true poses at these times; encoders, if any, round joint angles to their step."""
    attitude, position = motion.pose(times, angle_step)
    return Track(times if stamps is None else stamps, attitude, position)


def add_noise(track: Track, rng: Generator, attitude: float, position: float) -> Track:
    """Add independent noise to every attitude (rad about each axis) and position (m along each axis)."""
    small = from_rotation_vector(attitude * rng.standard_normal((track.stamp.size, 3)))
    moved = track.position + position * rng.standard_normal(track.position.shape)
    return replace(track, attitude=multiply(track.attitude, small), position=moved)


def lowpass(
    track: Track,
    rate: float,
    cutoff: float,
    order: int,
    causal: bool = False,
    way: Literal["quaternion", "rotation_vector"] = "quaternion",
) -> Track:
    """Filter attitudes and positions with a Butterworth filter, both ways in time or causally.

    Attitudes are filtered as quaternion components or as rotation vectors about the mean attitude.
    """
    sections = butter(order, cutoff, fs=rate, output="sos")

    def run(values: Array) -> Array:
        if not causal:
            return np.asarray(sosfiltfilt(sections, values, axis=0))
        start = sosfilt_zi(sections)[:, :, None] * values[0]
        return np.asarray(sosfilt(sections, values, axis=0, zi=start)[0])

    if way == "quaternion":
        q = run(same_sign(track.attitude))
        attitude = q / np.linalg.norm(q, axis=1, keepdims=True)
    else:
        attitude = _filter_rotation_vectors(track.attitude, run)
    return replace(track, attitude=attitude, position=run(track.position))


def _filter_rotation_vectors(attitude: Array, run: Callable[[Array], Array]) -> Array:
    """Filter the rotation vectors about the mean attitude, with whole turns taken out."""
    q = same_sign(attitude)
    mean = q.mean(axis=0)
    mean = mean / np.linalg.norm(mean) if np.linalg.norm(mean) > 0.1 else q[0]
    relative = multiply(conjugate(np.broadcast_to(mean, q.shape)), q)
    relative = same_sign(relative if relative[0, 0] >= 0 else -relative)
    length = np.linalg.norm(relative[:, 1:], axis=1, keepdims=True)
    angle = 2 * np.arctan2(length, relative[:, :1])
    vector = relative[:, 1:] * np.where(length > 1e-9, angle / np.maximum(length, 1e-9), 2.0)
    return multiply(np.broadcast_to(mean, q.shape), from_rotation_vector(run(vector)))


def interpolate(track: Track, rows: Array, longest_gap: float = np.inf) -> Track:
    """Slerp attitudes and interpolate positions linearly onto rows; a longer gap stays empty (NaN)."""
    after = np.clip(np.searchsorted(track.stamp, rows, side="right"), 1, track.stamp.size - 1)
    before = after - 1
    gap = track.stamp[after] - track.stamp[before]
    share = np.clip((rows - track.stamp[before]) / gap, 0.0, 1.0)[:, None]
    start = track.attitude[before]
    step = to_rotation_vector(multiply(conjugate(start), track.attitude[after]))
    attitude = multiply(start, from_rotation_vector(share * step))
    position = (1 - share) * track.position[before] + share * track.position[after]
    between = (share[:, 0] > 0) & (share[:, 0] < 1)
    empty = (between & (gap > longest_gap)) | (rows < track.stamp[0]) | (rows > track.stamp[-1])
    attitude[empty] = np.nan
    position[empty] = np.nan
    return Track(rows, attitude, position)


def hold(track: Track, rows: Array) -> Track:
    """Repeat the latest pose on every row."""
    latest = np.clip(np.searchsorted(track.stamp, rows, side="right") - 1, 0, None)
    return Track(rows, track.attitude[latest], track.position[latest])


def packet_stamps(rng: Generator, times: Array, smallest: int = 3, largest: int = 8) -> Array:
    """Return the stamps of samples that arrive in packets: 15 us apart, after the packet's last sample."""
    stamps = np.empty_like(times)
    begin = 0
    while begin < times.size:
        end = min(begin + int(rng.integers(smallest, largest + 1)), times.size)
        arrival = times[end - 1] + rng.uniform(0.0005, 0.003)
        stamps[begin:end] = arrival + PACKET_SPACING * np.arange(end - begin)
        begin = end
    return stamps


def jittered_stamps(rng: Generator, times: Array, spread: float) -> Array:
    """Return stamps with an independent error that never changes their order."""
    limit = 0.45 * float(np.median(np.diff(times)))
    return times + np.clip(spread * rng.standard_normal(times.size), -limit, limit)


def drift_heading(track: Track, error: Scalar) -> Track:
    """Turn attitudes about the vertical by an error that changes with time."""
    turn = from_rotation_vector(error.at(track.stamp)[:, None] * Z)
    return replace(track, attitude=multiply(turn, track.attitude))


def spans(
    rng: Generator,
    seconds: float,
    count: int,
    shortest: float,
    longest: float,
) -> list[tuple[float, float]]:
    """Draw spans of time within the log, one in each of `count` equal parts of it."""
    part = seconds / count
    chosen = []
    for k in range(count):
        length = min(rng.uniform(shortest, longest), 0.6 * part)
        begin = k * part + rng.uniform(0.1 * part, 0.9 * part - length)
        chosen.append((begin, begin + length))
    return chosen


def within(t: Array, chosen: Sequence[tuple[float, float]]) -> npt.NDArray[np.bool_]:
    """Tell which times lie in one of the spans."""
    inside = np.zeros(t.shape, dtype=bool)
    for begin, end in chosen:
        inside |= (t >= begin) & (t < end)
    return inside


def drop_out(track: Track, chosen: Sequence[tuple[float, float]]) -> Track:
    """Remove the rows in the spans."""
    return track.kept(~within(track.stamp, chosen))


def slip(track: Track, rng: Generator, chosen: Sequence[tuple[float, float]]) -> Track:
    """Let two markers swap in each span: the pose jumps by some degrees and millimetres and jumps back."""
    attitude, position = track.attitude.copy(), track.position.copy()
    for span in chosen:
        inside = within(track.stamp, [span])
        axis = rng.standard_normal(3)
        turn = from_rotation_vector(rng.uniform(1, 6) * DEGREE * axis / np.linalg.norm(axis))
        attitude[inside] = multiply(attitude[inside], np.broadcast_to(turn, (int(inside.sum()), 4)))
        position[inside] += rng.uniform(0.003, 0.02) * rng.choice([-1.0, 1.0], 3)
    return replace(track, attitude=attitude, position=position)
