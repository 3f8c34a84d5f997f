"""Logs of failures that real labs meet, each with the answer that is right.

The file uses its own physics only. A motion is a sum of sines, so its attitude, rate, angular acceleration,
position and acceleration are exact at any time. The body readings follow the contract: ``f = R^T (a - g)``
with ``g = (0, 0, +9.80665)`` in NED, ``omega`` right-handed in the body frame, ``m = R^T m_ref``, and a
Hamilton quaternion, scalar first, from the body to the reference frame.

How a row is to be judged:

* ``effects`` holds the ids that the ladder must add, with true parameters. An empty dict behind an id means
  that only the name counts.
* ``may_name`` holds every id that may be named. Any other name is wrong.
* ``verdicts`` holds the allowed verdicts of ``diagnose`` where ``effects`` is empty, and of the end of the
  ladder where it is not. ``"refused"`` stands for exit status 2 with one line that says what is wrong.
* ``TOLERANCES`` holds the largest error of a parameter where the row fixes one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from case import Case
from motion_and_reference import multiply
from numpy.typing import NDArray
from scipy import signal

Array = NDArray[np.float64]
Columns = dict[str, Array]

GRAVITY = 9.80665
DEGREE = np.pi / 180.0
FIELD = np.array([21.5, 1.1, 42.8])  # uT, north, east, down
REF_IDS = frozenset({"ref.alignment", "ref.tilt", "ref.delay", "ref.skew", "ref.lowpass"})
ANY_VERDICT = frozenset({"adequate", "missing", "ambiguous", "unknown"})
FULL_SCALE = 250.0 * DEGREE  # rad/s, the gyro range of the rows that leave it

TOLERANCES: dict[str, dict[str, dict[str, float]]] = {
    "lever_arm_beside_lively_reference": {"acc.lever_arm": {"x": 0.002}},
}


# ------------------------------------------------------------------------------------------------ quaternions


def from_vector(v: Array) -> Array:
    """Return the quaternions of rotation vectors in rad."""
    angle = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2.0), 0.5 * np.sinc(angle / (2.0 * np.pi)) * v], axis=-1)


def to_body(q: Array, v: Array) -> Array:
    """Turn reference-frame vectors into the body frame: ``R(q)^T v``."""
    w, u = q[..., :1], -q[..., 1:]
    v = np.broadcast_to(v, u.shape)
    twice = 2.0 * np.cross(u, v)
    turned: Array = v + w * twice + np.cross(u, twice)
    return turned


def to_reference(q: Array, v: Array) -> Array:
    """Turn body vectors into the reference frame: ``R(q) v``."""
    return to_body(q * np.array([1.0, -1.0, -1.0, -1.0]), v)


def continuous(q: Array) -> Array:
    """Choose signs so that neighbouring quaternions lie in the same half space."""
    flips = np.sum(q[1:] * q[:-1], axis=1) < 0.0
    sign = np.concatenate([[1.0], np.where(np.cumsum(flips) % 2 == 1, -1.0, 1.0)])
    signed: Array = q * sign[:, None]
    return signed


def slerp(t: Array, nodes: Array, q: Array) -> Array:
    """Interpolate quaternions on the great arc between the two nodes around each time."""
    q = continuous(q)
    i = np.clip(np.searchsorted(nodes, t, side="right") - 1, 0, nodes.size - 2)
    part = ((t - nodes[i]) / (nodes[i + 1] - nodes[i]))[:, None]
    a, b = q[i], q[i + 1]
    half = 2.0 * np.arctan2(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))[:, None]
    weight_a = np.sinc((1.0 - part) * half / np.pi) * (1.0 - part)
    weight_b = np.sinc(part * half / np.pi) * part
    mixed = weight_a * a + weight_b * b
    unit: Array = mixed / np.linalg.norm(mixed, axis=1, keepdims=True)
    return unit


def linear(t: Array, nodes: Array, values: Array) -> Array:
    """Interpolate each column of an array on a straight line."""
    return np.stack([np.interp(t, nodes, column) for column in values.T], axis=1)


# ----------------------------------------------------------------------------------------------------- motion


@dataclass(frozen=True)
class Sines:
    """A sum of sines in time, with exact derivatives of any order."""

    amplitude: Array
    frequency: Array
    phase: Array

    def at(self, t: Array, order: int = 0) -> Array:
        """Return the derivative of that order at times ``t``."""
        total = np.zeros_like(t)
        for amplitude, frequency, phase in zip(self.amplitude, self.frequency, self.phase, strict=True):
            w = 2.0 * np.pi * frequency
            total += amplitude * w**order * np.sin(w * t + phase + order * np.pi / 2.0)
        return total

    def __add__(self, other: Sines) -> Sines:
        """Return the sum of both."""
        return Sines(
            np.concatenate([self.amplitude, other.amplitude]),
            np.concatenate([self.frequency, other.frequency]),
            np.concatenate([self.phase, other.phase]),
        )


NOTHING = Sines(np.zeros(0), np.zeros(0), np.zeros(0))


@dataclass(frozen=True)
class Motion:
    """Roll, pitch and yaw (rad) and three positions (m) as sums of sines."""

    angles: tuple[Sines, ...]
    positions: tuple[Sines, ...] = (NOTHING, NOTHING, NOTHING)

    def attitude(self, t: Array) -> Array:
        """Return the quaternion from body to reference, for R = Rz(yaw) Ry(pitch) Rx(roll)."""
        roll, pitch, yaw = (angle.at(t) for angle in self.angles)
        zero = np.zeros_like(t)
        q_yaw = np.stack([np.cos(yaw / 2), zero, zero, np.sin(yaw / 2)], axis=1)
        q_pitch = np.stack([np.cos(pitch / 2), zero, np.sin(pitch / 2), zero], axis=1)
        q_roll = np.stack([np.cos(roll / 2), np.sin(roll / 2), zero, zero], axis=1)
        return multiply(multiply(q_yaw, q_pitch), q_roll)

    def rate(self, t: Array) -> Array:
        """Return the body rate, rad/s."""
        roll, pitch = self.angles[0].at(t), self.angles[1].at(t)
        d_roll, d_pitch, d_yaw = (angle.at(t, 1) for angle in self.angles)
        sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
        about_y = d_pitch * cr + d_yaw * sr * cp
        about_z = -d_pitch * sr + d_yaw * cr * cp
        return np.stack([d_roll - d_yaw * sp, about_y, about_z], axis=1)

    def angular_acceleration(self, t: Array) -> Array:
        """Return the derivative of the body rate, rad/s^2."""
        roll, pitch = self.angles[0].at(t), self.angles[1].at(t)
        d_roll, d_pitch, d_yaw = (angle.at(t, 1) for angle in self.angles)
        dd_roll, dd_pitch, dd_yaw = (angle.at(t, 2) for angle in self.angles)
        sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
        return np.stack(
            [
                dd_roll - dd_yaw * sp - d_yaw * d_pitch * cp,
                dd_pitch * cr
                - d_pitch * d_roll * sr
                + dd_yaw * sr * cp
                + d_yaw * d_roll * cr * cp
                - d_yaw * d_pitch * sr * sp,
                -dd_pitch * sr
                - d_pitch * d_roll * cr
                + dd_yaw * cr * cp
                - d_yaw * d_roll * sr * cp
                - d_yaw * d_pitch * cr * sp,
            ],
            axis=1,
        )

    def position(self, t: Array) -> Array:
        """Return the position in the reference frame, m."""
        return np.stack([axis.at(t) for axis in self.positions], axis=1)

    def acceleration(self, t: Array) -> Array:
        """Return the acceleration in the reference frame, m/s^2."""
        return np.stack([axis.at(t, 2) for axis in self.positions], axis=1)


def draw_sines(
    rng: np.random.Generator,
    rms: float,
    low: float,
    high: float,
    count: int = 9,
    order: int = 0,
) -> Sines:
    """Draw sines between two frequencies; the derivative of the given order has the given RMS.

    Each sine has the same part in that derivative, within a factor of two.
    """
    edges = np.geomspace(low, high, count + 1)
    frequency = edges[:-1] + (edges[1:] - edges[:-1]) * rng.uniform(0.1, 0.9, count)
    share = rng.uniform(0.7, 1.4, count)
    share *= rms * np.sqrt(2.0) / np.linalg.norm(share)
    phase = rng.uniform(0.0, 2.0 * np.pi, count)
    return Sines(share / (2.0 * np.pi * frequency) ** order, frequency, phase)


def draw_motion(
    rng: np.random.Generator,
    rate: float = 1.0,
    fastest: float = 2.5,
    acceleration: float = 0.0,
    slowest_shake: float = 0.4,
) -> Motion:
    """Draw a motion that turns through many attitudes, and shakes.

    ``rate`` is the RMS of each Euler rate of the shake in rad/s; ``fastest`` its highest frequency in Hz;
    ``acceleration`` the RMS of the acceleration on each axis in m/s^2.
    """
    swings = (55.0, 32.0, 80.0)  # degrees RMS of the slow turn in roll, pitch and yaw
    angles = tuple(
        draw_sines(rng, swing * DEGREE, 0.025, 0.11, 4) + draw_sines(rng, rate, 0.3, fastest, 8, order=1)
        for swing in swings
    )
    if acceleration == 0.0:
        return Motion(angles)
    positions = tuple(draw_sines(rng, acceleration, slowest_shake, fastest, 8, order=2) for _ in range(3))
    return Motion(angles, positions)


# ------------------------------------------------------------------------------------------ readings and logs


@dataclass(frozen=True)
class Noise:
    """White noise of each reading: m/s^2, rad/s, uT."""

    acc: float = 0.05
    gyr: float = 0.1 * DEGREE
    mag: float = 0.5


MEMS = Noise()


def uniform_times(seconds: float, rate: float) -> Array:
    """Return sample times from zero at a fixed rate."""
    return np.arange(round(seconds * rate)) / rate


def ideal_readings(motion: Motion, t: Array) -> Columns:
    """Return noise-free ``acc``, ``gyr`` and ``mag`` readings as arrays of three columns."""
    q = motion.attitude(t)
    down = np.array([0.0, 0.0, GRAVITY])
    return {
        "acc": to_body(q, motion.acceleration(t) - down),
        "gyr": motion.rate(t),
        "mag": to_body(q, FIELD),
    }


def add_noise(rng: np.random.Generator, readings: Columns, noise: Noise = MEMS) -> Columns:
    """Return the readings with white noise."""
    size = {"acc": noise.acc, "gyr": noise.gyr, "mag": noise.mag}
    return {key: value + size[key] * rng.standard_normal(value.shape) for key, value in readings.items()}


def reference(
    rng: np.random.Generator,
    motion: Motion,
    t: Array,
    degrees: float,
    millimetres: float = 0.0,
) -> Columns:
    """Return the attitude ``q`` and the position ``p`` that a reference with white noise gives at ``t``."""
    turn = degrees * DEGREE * rng.standard_normal((t.size, 3))
    shift = 1e-3 * millimetres * rng.standard_normal((t.size, 3))
    return {"q": continuous(multiply(motion.attitude(t), from_vector(turn))), "p": motion.position(t) + shift}


def resample(t: Array, nodes: Array, poses: Columns) -> Columns:
    """Interpolate poses onto other times: the attitude on the great arc, the position on a line."""
    return {"q": slerp(t, nodes, poses["q"]), "p": linear(t, nodes, poses["p"])}


def table(t: Array, readings: Columns, poses: Columns | None, position: bool = True) -> pd.DataFrame:
    """Put times, readings and poses into the columns of the contract."""
    columns: Columns = {"t": t}
    for sensor in ("acc", "gyr", "mag"):
        if sensor in readings:
            columns |= {f"{sensor}_{axis}": readings[sensor][:, i] for i, axis in enumerate("xyz")}
    if poses is not None:
        columns |= {f"ref_q{axis}": poses["q"][:, i] for i, axis in enumerate("wxyz")}
        if position:
            columns |= {f"ref_p{axis}": poses["p"][:, i] for i, axis in enumerate("xyz")}
    return pd.DataFrame(columns)


def own_rows(
    t: Array,
    readings: Columns,
    t_reference: Array,
    poses: Columns,
    position: bool = True,
) -> pd.DataFrame:
    """Put the reference into rows of its own: a row holds readings or a pose, and NaN elsewhere."""
    both = pd.concat([table(t, readings, None), table(t_reference, {}, poses, position)], ignore_index=True)
    both = both.sort_values("t", kind="stable", ignore_index=True)
    if not np.all(np.diff(both["t"].to_numpy()) > 0.0):
        raise ValueError("two rows have the same time")
    return both


def metadata(**more: object) -> dict[str, object]:
    """Return the metadata of a log in NED with a known field."""
    return {"frame": "NED", "gravity": GRAVITY, "mag_reference": FIELD.tolist(), **more}


def xyz(values: Array) -> dict[str, float]:
    """Name three parameters."""
    return {axis: float(value) for axis, value in zip("xyz", values, strict=True)}


def case(
    name: str,
    frame: pd.DataFrame,
    seconds: float,
    verdicts: set[str] | frozenset[str],
    effects: dict[str, dict[str, float]] | None = None,
    may_name: set[str] | frozenset[str] = frozenset(),
    meta: dict[str, object] | None = None,
) -> Case:
    """Build a Case; every id that must be named may be named."""
    effects = effects or {}
    return Case(
        name=name,
        frame=frame,
        metadata=metadata() if meta is None else meta,
        effects=effects,
        may_name=frozenset(may_name) | frozenset(effects),
        verdicts=frozenset(verdicts),
        seconds=seconds,
    )


# ----------------------------------------------------------------------------- references that were processed


def mocap_lowpassed(seed: int) -> Case:
    """Row 1. Nothing is hidden; the motion capture was low-passed at 6 Hz with zero phase.

    A second-order Butterworth filter ran forwards and backwards over quaternions and positions. Only
    ``ref.*`` may be named.
    """
    rng = np.random.default_rng([1, seed])
    seconds, rate, margin = 60.0, 100.0, 300
    motion = draw_motion(rng, rate=1.5, fastest=4.5, acceleration=2.0)
    t = uniform_times(seconds, rate)
    wide = (np.arange(-margin, t.size + margin)) / rate
    poses = reference(rng, motion, wide, degrees=0.03, millimetres=0.2)
    b, a = signal.butter(2, 6.0, fs=rate)
    q = signal.filtfilt(b, a, poses["q"], axis=0)[margin:-margin]
    p = signal.filtfilt(b, a, poses["p"], axis=0)[margin:-margin]
    poses = {"q": q / np.linalg.norm(q, axis=1, keepdims=True), "p": p}
    frame = table(t, add_noise(rng, ideal_readings(motion, t)), poses)
    return case("mocap_lowpassed", frame, seconds, ANY_VERDICT, may_name=REF_IDS)


def robot_poses_interpolated(seed: int) -> Case:
    """Row 2. Nothing is hidden; 10 Hz poses of a robot were interpolated onto 100 Hz rows.

    Only ``ref.*`` may be named.
    """
    rng = np.random.default_rng([2, seed])
    seconds = 80.0
    motion = draw_motion(rng, rate=0.6, fastest=1.3, acceleration=0.8, slowest_shake=0.2)
    t = uniform_times(seconds, 100.0)
    nodes = np.arange(-2, round(seconds * 10.0) + 3) / 10.0 + 0.0031
    poses = resample(t, nodes, reference(rng, motion, nodes, degrees=0.01, millimetres=0.05))
    frame = table(t, add_noise(rng, ideal_readings(motion, t)), poses)
    return case("robot_poses_interpolated", frame, seconds, ANY_VERDICT, may_name=REF_IDS)


def mocap_slerped_from_other_clock(seed: int) -> Case:
    """Row 3. Nothing is hidden; 100 Hz motion capture was interpolated onto 100 Hz rows of another clock.

    The two clocks beat slowly, so the interpolation smooths the reference by an amount that changes in time.
    Only ``ref.*`` may be named.
    """
    rng = np.random.default_rng([3, seed])
    seconds = 60.0
    motion = draw_motion(rng, rate=1.5, fastest=3.0, acceleration=2.0)
    t = uniform_times(seconds, 100.0)
    nodes = np.arange(-3, round(seconds * 100.03) + 5) / 100.03 + 0.0037
    poses = resample(t, nodes, reference(rng, motion, nodes, degrees=0.03, millimetres=0.15))
    frame = table(t, add_noise(rng, ideal_readings(motion, t)), poses)
    return case("mocap_slerped_from_other_clock", frame, seconds, ANY_VERDICT, may_name=REF_IDS)


def gyro_bias_with_scattered_zero(seed: int) -> Case:
    """Row 4. A large gyro bias, and a zero whose means over 2 s scatter by 0.3 deg/s without memory.

    The scatter has a mean of exactly zero over the log, so the bias is the stated one.
    ``gyr.bias`` must be named.
    """
    rng = np.random.default_rng([4, seed])
    seconds, rate = 80.0, 100.0
    bias = np.array([-0.19, 0.08, 0.05])
    motion = draw_motion(rng, rate=1.2, fastest=2.5, acceleration=1.5)
    t = uniform_times(seconds, rate)
    blocks = 0.3 * DEGREE * rng.standard_normal((round(seconds / 2.0), 3))
    blocks -= blocks.mean(axis=0)
    readings = ideal_readings(motion, t)
    readings["gyr"] = readings["gyr"] + bias + np.repeat(blocks, round(2.0 * rate), axis=0)
    poses = reference(rng, motion, t, degrees=0.03, millimetres=0.15)
    frame = table(t, add_noise(rng, readings), poses)
    return case(
        "gyro_bias_with_scattered_zero",
        frame,
        seconds,
        {"adequate", "unknown"},
        effects={"gyr.bias": xyz(bias)},
    )


def hard_iron_reference_in_own_rows(seed: int) -> Case:
    """Row 5. The reference has rows of its own; the magnetometer has a hard iron offset of 300 uT.

    ``mag.hard_iron`` must be named.
    """
    rng = np.random.default_rng([5, seed])
    seconds = 60.0
    offset = np.array([210.0, -180.0, 112.0])
    offset *= 300.0 / np.linalg.norm(offset)
    motion = draw_motion(rng, rate=1.0, fastest=2.5, acceleration=1.0)
    t = uniform_times(seconds, 100.0)
    readings = ideal_readings(motion, t)
    readings["mag"] = readings["mag"] + offset
    t_reference = uniform_times(seconds, 120.0) + 0.00037
    poses = reference(rng, motion, t_reference, degrees=0.03, millimetres=0.15)
    frame = own_rows(t, add_noise(rng, readings), t_reference, poses)
    return case(
        "hard_iron_reference_in_own_rows",
        frame,
        seconds,
        {"adequate"},
        effects={"mag.hard_iron": xyz(offset)},
        may_name=REF_IDS,
    )


def reference_stamps_bunched(seed: int) -> Case:
    """Row 6. The reference is true and uniform at 120 Hz; its stamps lie 15 us apart in bunches of six.

    Each packet is stamped near the mean time of its samples, so the reference is not late on average. No
    effect of a sensor may be named. An ``adequate`` with residuals far above the noise is wrong too.
    """
    rng = np.random.default_rng([6, seed])
    seconds, bunch = 60.0, 6
    motion = draw_motion(rng, rate=1.0, fastest=2.5, acceleration=1.0)
    t = uniform_times(seconds, 100.0)
    true_times = uniform_times(seconds, 120.0) + 0.0011
    packets = true_times.reshape(-1, bunch).mean(axis=1)
    packets = packets + 0.0002 * rng.standard_normal(packets.size)
    stamps = (packets[:, None] + 15e-6 * (np.arange(bunch) - 2.5)).ravel()
    poses = reference(rng, motion, true_times, degrees=0.03, millimetres=0.15)
    frame = own_rows(t, add_noise(rng, ideal_readings(motion, t)), stamps, poses)
    return case("reference_stamps_bunched", frame, seconds, {"adequate", "unknown"}, may_name=REF_IDS)


# ------------------------------------------------------------------------------------- translation and mounts


def shaken_without_position_turned_mount(seed: int) -> Case:
    """Row 7. A hand shakes the body at 9 m/s^2 RMS, the log has no position, the mount is turned by 3 deg.

    Gyro and magnetometer see the mount. The accelerometer cannot be judged, so no effect of it may be named.
    """
    rng = np.random.default_rng([7, seed])
    seconds = 60.0
    motion = draw_motion(rng, rate=1.2, fastest=3.0, acceleration=9.0 / np.sqrt(3.0), slowest_shake=1.2)
    axis = np.array([0.6, -0.5, 0.62])
    mount = from_vector(3.0 * DEGREE * axis / np.linalg.norm(axis))
    t = uniform_times(seconds, 100.0)
    turned = {key: to_body(np.tile(mount, (t.size, 1)), v) for key, v in ideal_readings(motion, t).items()}
    poses = reference(rng, motion, t, degrees=0.03)
    frame = table(t, add_noise(rng, turned), poses, position=False)
    return case(
        "shaken_without_position_turned_mount",
        frame,
        seconds,
        {"missing", "ambiguous", "unknown"},
        may_name={"ref.alignment"},
    )


def fast_translation_with_position(seed: int) -> Case:
    """Row 8. A hand moves the body fast; the 100 Hz positions have 0.3 mm noise; nothing is hidden.

    No effect may be named: no ``gyr.scale``, no ``mag.soft_iron``, no ``gyr.g_sensitivity``.
    """
    rng = np.random.default_rng([8, seed])
    seconds = 60.0
    motion = draw_motion(rng, rate=1.0, fastest=3.0, acceleration=5.0, slowest_shake=0.7)
    t = uniform_times(seconds, 100.0)
    poses = reference(rng, motion, t, degrees=0.03, millimetres=0.3)
    frame = table(t, add_noise(rng, ideal_readings(motion, t)), poses)
    return case("fast_translation_with_position", frame, seconds, {"adequate"})


def lever_arm_beside_lively_reference(seed: int) -> Case:
    """Row 9. The accelerometer sits (-35.8, 5, 12) mm from the tracked point of a lively 120 Hz reference.

    ``acc.lever_arm`` must be named, and its x must lie within 2 mm of the truth.
    """
    rng = np.random.default_rng([9, seed])
    seconds = 60.0
    arm = np.array([-0.0358, 0.005, 0.012])
    motion = draw_motion(rng, rate=2.5, fastest=2.5, acceleration=2.0)
    t = uniform_times(seconds, 120.0)
    readings = ideal_readings(motion, t)
    rate, change = motion.rate(t), motion.angular_acceleration(t)
    readings["acc"] = readings["acc"] + np.cross(rate, np.cross(rate, arm)) + np.cross(change, arm)
    poses = reference(rng, motion, t, degrees=0.03, millimetres=0.1)
    frame = table(t, add_noise(rng, readings), poses)
    return case(
        "lever_arm_beside_lively_reference",
        frame,
        seconds,
        {"adequate"},
        effects={"acc.lever_arm": xyz(arm)},
    )


# ----------------------------------------------------------------------------------------------- fast sensors


def _fast_sensor(seed: int, name: str, rate: float, seconds: float, separate: bool) -> Case:
    """Row 10. A fast log beside a 200 Hz reference; nothing is hidden; only ``ref.*`` may be named.

    The magnetometer gives 100 readings per second and NaN in the rows between.
    """
    rng = np.random.default_rng([10, round(rate), int(separate), seed])
    motion = draw_motion(rng, rate=1.2, fastest=3.0, acceleration=1.5)
    t = uniform_times(seconds, rate)
    readings = add_noise(rng, ideal_readings(motion, t), Noise(acc=0.08, gyr=0.2 * DEGREE, mag=0.5))
    readings["mag"][np.arange(t.size) % round(rate / 100.0) != 0] = np.nan
    if separate:
        t_reference = uniform_times(seconds, 200.0) + 0.000041
        poses = reference(rng, motion, t_reference, degrees=0.02, millimetres=0.1)
        frame = own_rows(t, readings, t_reference, poses)
    else:
        nodes = np.arange(-2, round(seconds * 200.0) + 3) / 200.0 + 0.000041
        poses = resample(t, nodes, reference(rng, motion, nodes, degrees=0.02, millimetres=0.1))
        frame = table(t, readings, poses)
    return case(name, frame, seconds, {"adequate", "missing", "ambiguous"}, may_name=REF_IDS)


def sensor_1khz_reference_interpolated(seed: int) -> Case:
    """Row 10. A 1 kHz sensor; the 200 Hz reference is interpolated onto its rows."""
    return _fast_sensor(seed, "sensor_1khz_reference_interpolated", 1000.0, 40.0, separate=False)


def sensor_1khz_reference_in_own_rows(seed: int) -> Case:
    """Row 10. A 1 kHz sensor; the 200 Hz reference has rows of its own."""
    return _fast_sensor(seed, "sensor_1khz_reference_in_own_rows", 1000.0, 40.0, separate=True)


def sensor_4khz_reference_interpolated(seed: int) -> Case:
    """Row 10. A 4 kHz sensor; the 200 Hz reference is interpolated onto its rows."""
    return _fast_sensor(seed, "sensor_4khz_reference_interpolated", 4000.0, 30.0, separate=False)


def sensor_4khz_reference_in_own_rows(seed: int) -> Case:
    """Row 10. A 4 kHz sensor; the 200 Hz reference has rows of its own."""
    return _fast_sensor(seed, "sensor_4khz_reference_in_own_rows", 4000.0, 30.0, separate=True)


def sensor_8khz_reference_interpolated(seed: int) -> Case:
    """Row 10. An 8 kHz sensor; the 200 Hz reference is interpolated onto its rows."""
    return _fast_sensor(seed, "sensor_8khz_reference_interpolated", 8000.0, 20.0, separate=False)


def sensor_8khz_reference_in_own_rows(seed: int) -> Case:
    """Row 10. An 8 kHz sensor; the 200 Hz reference has rows of its own."""
    return _fast_sensor(seed, "sensor_8khz_reference_in_own_rows", 8000.0, 20.0, separate=True)


# --------------------------------------------------------------------------------------- broken gyro readings


def stated_noise_too_small(seed: int) -> Case:
    """Row 11. The true gyro noise is 12 times the stated noise; the reference is very quiet.

    The answer is not ``adequate``, and no effect may be named.
    """
    rng = np.random.default_rng([11, seed])
    seconds = 60.0
    stated = Noise(acc=0.05, gyr=0.08 * DEGREE, mag=0.5)
    motion = draw_motion(rng, rate=1.0, fastest=2.0)
    t = uniform_times(seconds, 100.0)
    true_noise = Noise(acc=stated.acc, gyr=12.0 * stated.gyr, mag=stated.mag)
    poses = reference(rng, motion, t, degrees=0.0004)
    frame = table(t, add_noise(rng, ideal_readings(motion, t), true_noise), poses, position=False)
    meta = metadata(noise={"acc": stated.acc, "gyr": stated.gyr, "mag": stated.mag})
    return case("stated_noise_too_small", frame, seconds, {"unknown"}, meta=meta)


def _violent_log(rng: np.random.Generator) -> tuple[Array, Columns, Columns]:
    """Return times, noisy readings and poses of a motion that often turns faster than the gyro range."""
    motion = draw_motion(rng, rate=2.4, fastest=2.5, acceleration=1.5)
    t = uniform_times(60.0, 100.0)
    readings = add_noise(rng, ideal_readings(motion, t))
    return t, readings, reference(rng, motion, t, degrees=0.03, millimetres=0.15)


def soft_clip(x: Array, limit: float, smear: float) -> Array:
    """Clip at both ends of the range with a smooth corner of width ``smear``."""
    size = np.abs(x)
    return np.sign(x) * (size - smear * np.logaddexp(0.0, (size - limit) / smear))


def gyro_soft_clip(seed: int) -> Case:
    """Row 12. The gyro clips at a smeared end of range; only ``gyr.saturation`` may be named."""
    t, readings, poses = _violent_log(np.random.default_rng([12, 1, seed]))
    readings["gyr"] = soft_clip(readings["gyr"], FULL_SCALE, 0.15)
    return case(
        "gyro_soft_clip",
        table(t, readings, poses),
        60.0,
        {"unknown", "missing", "refused"},
        may_name={"gyr.saturation"},
    )


def gyro_wrapped_int16(seed: int) -> Case:
    """Row 12. The gyro counts wrap around at 16 bits; no effect may be named."""
    t, readings, poses = _violent_log(np.random.default_rng([12, 2, seed]))
    unit = FULL_SCALE / 32768.0
    counts = np.round(readings["gyr"] / unit)
    readings["gyr"] = unit * (np.mod(counts + 32768.0, 65536.0) - 32768.0)
    return case("gyro_wrapped_int16", table(t, readings, poses), 60.0, {"unknown", "refused"})


def dead_bus_zeros(seed: int) -> Case:
    """Row 12. The bus dies six times, and every axis then reads exactly zero; no effect may be named."""
    rng = np.random.default_rng([12, 3, seed])
    motion = draw_motion(rng, rate=1.2, fastest=2.5, acceleration=1.5)
    t = uniform_times(60.0, 100.0)
    readings = add_noise(rng, ideal_readings(motion, t))
    for start in 4.0 + 9.5 * np.arange(6) + rng.uniform(0.0, 6.0, 6):
        dead = (t >= start) & (t < start + rng.uniform(0.3, 1.6))
        for values in readings.values():
            values[dead] = 0.0
    poses = reference(rng, motion, t, degrees=0.03, millimetres=0.15)
    return case("dead_bus_zeros", table(t, readings, poses), 60.0, {"unknown", "refused"})


def gyro_axis_pinned(seed: int) -> Case:
    """Row 12. The y axis of the gyro reads one value for the whole log; no effect may be named.

    A scale of -1 with a bias has the same form, and is a wrong answer.
    """
    rng = np.random.default_rng([12, 4, seed])
    motion = draw_motion(rng, rate=1.2, fastest=2.5, acceleration=1.5)
    t = uniform_times(60.0, 100.0)
    readings = add_noise(rng, ideal_readings(motion, t))
    readings["gyr"][:, 1] = 0.0427
    poses = reference(rng, motion, t, degrees=0.03, millimetres=0.15)
    return case("gyro_axis_pinned", table(t, readings, poses), 60.0, {"unknown", "refused"})


# ------------------------------------------------------------------------------- errors outside the catalogue


def _quiet_rig(rng: np.random.Generator, seconds: float) -> tuple[Array, Motion, Columns]:
    """Return times at 200 Hz, a motion that only turns, and the poses of a very quiet reference."""
    motion = draw_motion(rng, rate=1.0, fastest=2.0)
    t = uniform_times(seconds, 200.0)
    return t, motion, reference(rng, motion, t, degrees=0.0002)


def mains_line(seed: int) -> Case:
    """Row 13. A 50 Hz line lies on the gyro; its RMS is 3.5 times the noise; no effect may be named."""
    rng = np.random.default_rng([13, 1, seed])
    t, motion, poses = _quiet_rig(rng, 60.0)
    readings = add_noise(rng, ideal_readings(motion, t))
    phase = 2.0 * np.pi * 50.013 * t[:, None] + rng.uniform(0.0, 2.0 * np.pi, 3)
    readings["gyr"] += 3.5 * MEMS.gyr * np.sqrt(2.0) * np.sin(phase)
    return case("mains_line", table(t, readings, poses, position=False), 60.0, {"unknown"})


def swept_tone(seed: int) -> Case:
    """Row 13. A tone of 3.5 times the noise sweeps from 5 to 60 Hz on the gyro; no effect may be named."""
    rng = np.random.default_rng([13, 2, seed])
    t, motion, poses = _quiet_rig(rng, 60.0)
    readings = add_noise(rng, ideal_readings(motion, t))
    turns = 5.0 * t + 0.5 * (60.0 - 5.0) / 60.0 * t**2
    phase = 2.0 * np.pi * turns[:, None] + rng.uniform(0.0, 2.0 * np.pi, 3)
    readings["gyr"] += 3.5 * MEMS.gyr * np.sqrt(2.0) * np.sin(phase)
    return case("swept_tone", table(t, readings, poses, position=False), 60.0, {"unknown"})


def zero_jumps(seed: int) -> Case:
    """Row 13. The gyro zero jumps 31 times by 10 times the noise, up and down; no effect may be named.

    The zero has a mean of exactly zero over the log.
    """
    rng = np.random.default_rng([13, 3, seed])
    seconds, jumps = 64.0, 31
    t, motion, poses = _quiet_rig(rng, seconds)
    readings = add_noise(rng, ideal_readings(motion, t))
    for axis in range(3):
        times = seconds / (jumps + 1) * (1.0 + np.arange(jumps) + rng.uniform(-0.4, 0.4, jumps))
        level = 5.0 * MEMS.gyr * (-1.0) ** (np.searchsorted(times, t, side="right") + axis)
        readings["gyr"][:, axis] += level - level.mean()
    return case("zero_jumps", table(t, readings, poses, position=False), seconds, {"unknown"})


def swinging_delay(seed: int) -> Case:
    """Row 13. The delay of the reference swings by +-12 ms in four whole periods; no effect may be named.

    The delay has no mean and no trend.
    """
    rng = np.random.default_rng([13, 4, seed])
    seconds = 80.0
    t, motion, _ = _quiet_rig(rng, seconds)
    delay = 0.012 * np.cos(2.0 * np.pi * 4.0 * t / seconds)
    poses = reference(rng, motion, t - delay, degrees=0.0002)
    readings = add_noise(rng, ideal_readings(motion, t))
    return case("swinging_delay", table(t, readings, poses, position=False), seconds, {"unknown"})


def irrelevant_columns_drifting_heading(seed: int) -> Case:
    """Row 14. The sensors are ideal; the heading of the reference drifts by 4 deg over the log.

    ``temp`` and ``vbat`` change slowly in time like the heading, and have no part in any reading. The
    magnetometer has two lines. No effect may be named: no ``mag.field_reference``, no ``mag.column:*``, no
    ``mag.bias_temperature``.
    """
    rng = np.random.default_rng([14, seed])
    seconds = 120.0
    motion = draw_motion(rng, rate=1.0, fastest=2.5, acceleration=1.0)
    t = uniform_times(seconds, 100.0)
    readings = add_noise(rng, ideal_readings(motion, t))
    for frequency, size in ((16.67, 1.5), (33.31, 1.0)):
        phase = 2.0 * np.pi * frequency * t[:, None] + rng.uniform(0.0, 2.0 * np.pi, 3)
        readings["mag"] += size * np.sin(phase)
    part = t / seconds
    heading = 4.0 * DEGREE * (part + 0.02 * np.sin(2.0 * np.pi * 3.0 * part))
    zero = np.zeros_like(t)
    poses = reference(rng, motion, t, degrees=0.03, millimetres=0.15)
    poses["q"] = multiply(from_vector(np.stack([zero, zero, heading], axis=1)), poses["q"])
    frame = table(t, readings, poses)
    frame["temp"] = np.round(24.0 + 17.0 * (1.0 - np.exp(-t / 45.0)) + 0.05 * rng.standard_normal(t.size), 2)
    sag = 0.05 * np.sin(2.0 * np.pi * 0.13 * t)
    frame["vbat"] = np.round(12.4 - 0.8 * part + sag + 0.01 * rng.standard_normal(t.size), 3)
    return case("irrelevant_columns_drifting_heading", frame, seconds, {"adequate", "unknown"})


def play(x: Array, width: float) -> Array:
    """Return the play operator with half width ``width`` on each column: the output follows with slack."""
    out = np.empty_like(x)
    state = np.zeros(x.shape[1])
    for i, value in enumerate(x):
        state = np.minimum(np.maximum(state, value - width), value + width)
        out[i] = state
    return out


def magnetic_hysteresis(seed: int) -> Case:
    """Row 15. Iron near the magnetometer keeps a memory of the field on each axis; no effect may be named.

    The reading adds the play operator of the ideal reading, less the best constant and 3x3 matrix. Thus
    neither hard iron nor soft iron is true.
    """
    rng = np.random.default_rng([15, 1, seed])
    seconds = 80.0
    motion = draw_motion(rng, rate=0.8, fastest=1.5, acceleration=1.0)
    t = uniform_times(seconds, 100.0)
    readings = ideal_readings(motion, t)
    memory = play(readings["mag"], 9.0)
    regressors = np.column_stack([np.ones(t.size), readings["mag"]])
    memory -= regressors @ np.linalg.lstsq(regressors, memory, rcond=None)[0]
    readings["mag"] = readings["mag"] + memory
    poses = reference(rng, motion, t, degrees=0.03, millimetres=0.15)
    frame = table(t, add_noise(rng, readings), poses)
    return case("magnetic_hysteresis", frame, seconds, {"unknown"})


def flexed(motion: Motion, t: Array, frequency: Array, damping: float) -> tuple[Array, Array]:
    """Return the angle (rad) and the rate (rad/s) of a sensor on a flexing mount, relative to the body.

    Each axis follows ``x'' + 2 z w x' + w^2 x = -(angular acceleration of the body)``. ``t`` must be uniform;
    five steps per sample are integrated, after three seconds that let the start die out.
    """
    step = (t[1] - t[0]) / 5.0
    before = round(3.0 / step)
    fine = t[0] + step * np.arange(-before, 5 * (t.size - 1) + 1)
    drive = motion.angular_acceleration(fine)
    angle, rate = np.empty((t.size, 3)), np.empty((t.size, 3))
    for axis in range(3):
        w = 2.0 * np.pi * frequency[axis]
        denominator = [1.0, 2.0 * damping * w, w**2]
        for numerator, out in (([-1.0], angle), ([-1.0, 0.0], rate)):
            b, a = signal.bilinear(numerator, denominator, fs=1.0 / step)
            out[:, axis] = signal.lfilter(b, a, drive[:, axis])[before::5]
    return angle, rate


def mount_rings(seed: int) -> Case:
    """Row 15. The mount between reference body and sensor flexes and rings near 12 Hz; no name is right.

    The body trembles between 6 and 18 Hz, which drives the resonance.
    """
    rng = np.random.default_rng([15, 2, seed])
    seconds = 60.0
    calm = draw_motion(rng, rate=0.8, fastest=2.0, acceleration=1.0)
    tremble = tuple(angle + draw_sines(rng, 0.03, 6.0, 18.0, 24, order=1) for angle in calm.angles)
    motion = Motion(tremble, calm.positions)
    t = uniform_times(seconds, 200.0)
    angle, rate = flexed(motion, t, np.array([11.6, 12.0, 12.5]), damping=0.04)
    bend = from_vector(angle)
    readings = {key: to_body(bend, value) for key, value in ideal_readings(motion, t).items()}
    readings["gyr"] = readings["gyr"] + rate - 0.5 * np.cross(angle, rate)
    poses = reference(rng, motion, t, degrees=0.005, millimetres=0.05)
    return case("mount_rings", table(t, add_noise(rng, readings), poses), seconds, {"unknown"})


# ----------------------------------------------------------------------------------------------- true effects


def throttle_curve(rng: np.random.Generator, t: Array) -> Array:
    """Return a throttle between 0 and 1: slow changes and bursts of one to four seconds."""
    slow = draw_sines(rng, 0.08, 0.02, 0.12, 4).at(t) + 0.35
    for _ in range(max(4, round(t[-1] / 9.0))):
        middle, length = rng.uniform(t[0], t[-1]), rng.uniform(1.0, 4.0)
        slow = slow + rng.uniform(0.15, 0.5) * 0.5 * (
            np.tanh((t - middle + length / 2.0) / 0.15) - np.tanh((t - middle - length / 2.0) / 0.15)
        )
    return np.clip(slow, 0.0, 1.0)


def moving_mean(x: Array, count: int) -> Array:
    """Return the mean over a centred window, which is shorter at both ends."""
    total = np.concatenate([[0.0], np.cumsum(x)])
    i = np.arange(x.size)
    low, high = np.maximum(i - count // 2, 0), np.minimum(i + count // 2 + 1, x.size)
    mean: Array = (total[high] - total[low]) / (high - low)
    return mean


def drone_vibration_rectification(seed: int) -> Case:
    """Row 16. The vibration of a drone shifts the gyro in proportion to its power in 0.5 s windows.

    The power follows the throttle. ``gyr.vibration_rectification`` must be named, not
    ``gyr.g_sensitivity``. The contract does not fix how the power is counted, so no value is compared.
    """
    rng = np.random.default_rng([16, seed])
    seconds, rate = 90.0, 200.0
    motion = draw_motion(rng, rate=0.7, fastest=1.5, acceleration=1.0, slowest_shake=0.15)
    t = uniform_times(seconds, rate)
    throttle = throttle_curve(rng, t)
    turns = 2.0 * np.pi * np.cumsum(55.0 + 38.0 * throttle) / rate  # phase of the motors, rad
    tone = np.sin(turns[:, None] + rng.uniform(0.0, 2.0 * np.pi, 3)) * np.array([1.0, 0.8, 1.3])
    b, a = signal.butter(2, 35.0, btype="highpass", fs=rate)
    rough = signal.lfilter(b, a, rng.standard_normal((t.size, 3)), axis=0)
    vibration = 7.0 * throttle[:, None] * (tone + 0.6 * rough)
    count = round(0.5 * rate)
    variances = [moving_mean(v**2, count) - moving_mean(v, count) ** 2 for v in vibration.T]
    power = np.sum(variances, axis=0)
    shift = np.array([0.022, -0.016, 0.012]) * DEGREE  # rad/s per (m/s^2)^2
    readings = ideal_readings(motion, t)
    readings["acc"] = readings["acc"] + vibration
    readings["gyr"] = readings["gyr"] + power[:, None] * shift
    poses = reference(rng, motion, t, degrees=0.01, millimetres=0.1)
    return case(
        "drone_vibration_rectification",
        table(t, add_noise(rng, readings), poses),
        seconds,
        {"adequate", "unknown"},
        effects={"gyr.vibration_rectification": {}},
    )


def uav_motor_current(seed: int) -> Case:
    """Row 17. The motor current of a UAV moves the magnetometer, beside hard iron and 5 % of soft iron.

    The ladder must add ``mag.current``, ``mag.hard_iron`` and ``mag.soft_iron``.
    """
    rng = np.random.default_rng([17, seed])
    seconds = 120.0
    per_ampere = np.array([-0.05, 0.08, 0.15])
    offset = np.array([14.0, -9.0, 22.0])
    soft = np.array([[0.05, 0.02, -0.015], [-0.02, -0.04, 0.03], [0.01, 0.025, 0.045]])
    motion = draw_motion(rng, rate=0.8, fastest=1.5, acceleration=1.5, slowest_shake=0.15)
    t = uniform_times(seconds, 100.0)
    current = np.round(20.0 * throttle_curve(rng, t), 2)
    readings = ideal_readings(motion, t)
    readings["mag"] = readings["mag"] @ (np.eye(3) + soft).T + offset + current[:, None] * per_ampere
    poses = reference(rng, motion, t, degrees=0.03, millimetres=0.3)
    frame = table(t, add_noise(rng, readings), poses)
    frame["motor_current"] = current
    matrix = {f"{a}{b}": float(soft[i, j]) for i, a in enumerate("xyz") for j, b in enumerate("xyz")}
    effects = {"mag.current": xyz(per_ampere), "mag.hard_iron": xyz(offset), "mag.soft_iron": matrix}
    return case("uav_motor_current", frame, seconds, {"adequate"}, effects=effects)


def six_labelled_poses(seed: int) -> Case:
    """Row 18. Six labelled poses on a level plate, no attitude reference, accelerometer bias and scale.

    ``fit``, ``diagnose`` and ``ladder`` must work; the ladder must add ``acc.bias`` and ``acc.scale``. At
    readings of 0 and +-g a cubic term has the form of a scale error, so ``acc.cubic`` may be named beside it.
    """
    rng = np.random.default_rng([18, seed])
    hold, turn, rate = 10.0, 2.5, 100.0
    bias, scale = np.array([0.31, -0.22, 0.42]), np.array([0.018, -0.014, 0.025])
    labels = ["+z", "+x", "-z", "-x", "+y", "-y"]
    quarter = np.pi / 2.0
    # Each turn is a rotation about a body axis; the body axis named by the label then points up.
    turns = [np.array([0.0, -quarter, 0.0])] * 3 + [
        np.array([0.0, 0.0, quarter]),
        np.array([0.0, 0.0, 2 * quarter]),
    ]
    q = np.array([0.0, 1.0, 0.0, 0.0])  # roll of 180 deg: the body z axis points up in NED
    times, forces, rates, marks = [], [], [], []
    start = 0.0
    up = np.array([0.0, 0.0, -GRAVITY])
    for i, label in enumerate(labels):
        count = round(hold * rate)
        times.append(start + np.arange(count) / rate)
        forces.append(np.tile(to_body(q[None], up), (count, 1)))
        rates.append(np.zeros((count, 3)))
        marks += [label] * count
        start += hold
        if i == len(turns):
            break
        count = round(turn * rate)
        part = np.arange(count) / count
        angle = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
        speed = 30.0 * part**2 * (1.0 - part) ** 2 / turn
        path = multiply(np.tile(q, (count, 1)), from_vector(angle[:, None] * turns[i]))
        times.append(start + part * turn)
        forces.append(to_body(path, up))
        rates.append(speed[:, None] * turns[i])
        marks += [""] * count
        start += turn
        q = multiply(q, from_vector(turns[i]))
    t, force = np.concatenate(times), np.concatenate(forces)
    readings = {"acc": force * (1.0 + scale) + bias, "gyr": np.concatenate(rates)}
    frame = table(t, add_noise(rng, readings), None)
    frame["pose"] = marks
    return case(
        "six_labelled_poses",
        frame,
        start,
        {"adequate"},
        effects={"acc.bias": xyz(bias), "acc.scale": xyz(scale)},
        may_name={"acc.cubic"},
        meta={"frame": "NED", "gravity": GRAVITY},
    )


def _scaled_gyro(rng: np.random.Generator, name: str, early: Array, late: Array) -> Case:
    """Return a log whose gyro has one scale error in the first half and another in the second half."""
    seconds = 60.0
    motion = draw_motion(rng, rate=1.2, fastest=2.5, acceleration=1.5)
    t = uniform_times(seconds, 100.0)
    readings = ideal_readings(motion, t)
    scale = np.where((t < seconds / 2.0)[:, None], early, late)
    readings["gyr"] = readings["gyr"] * (1.0 + scale)
    poses = reference(rng, motion, t, degrees=0.03, millimetres=0.15)
    frame = table(t, add_noise(rng, readings), poses)
    return case(name, frame, seconds, {"unknown", "missing"}, may_name={"gyr.scale"})


def gyro_scale_doubles_midway(seed: int) -> Case:
    """Row 19. The gyro scale error doubles midway; only ``gyr.scale`` may be named."""
    early = np.array([0.03, -0.025, 0.02])
    return _scaled_gyro(np.random.default_rng([19, 1, seed]), "gyro_scale_doubles_midway", early, 2.0 * early)


def gyro_scale_60_percent(seed: int) -> Case:
    """Row 19. A wrong full scale makes every gyro reading 60 % too large; only ``gyr.scale`` may be named."""
    scale = np.full(3, 0.6)
    return _scaled_gyro(np.random.default_rng([19, 2, seed]), "gyro_scale_60_percent", scale, scale)


def reference_clock_fast(seed: int) -> Case:
    """Row 20. The clock of the reference runs 300 ppm fast over 120 s; ``ref.skew`` must be named.

    The pose stamped ``t`` was taken at ``t - 3e-4 t``, so the reference is late by ``k (t - t0)``, k = 3e-4.
    """
    rng = np.random.default_rng([20, 1, seed])
    seconds, skew = 120.0, 3e-4
    motion = draw_motion(rng, rate=1.0, fastest=2.5, acceleration=1.5)
    t = uniform_times(seconds, 100.0)
    poses = reference(rng, motion, t * (1.0 - skew), degrees=0.03, millimetres=0.15)
    frame = table(t, add_noise(rng, ideal_readings(motion, t)), poses)
    return case("reference_clock_fast", frame, seconds, {"adequate"}, effects={"ref.skew": {"k": skew}})


def gaussian_mean(values: Callable[[Array], Array], t: Array, deviation: float) -> Array:
    """Return the mean of a function of time under a Gaussian kernel, by Gauss-Hermite quadrature."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(11)
    weights = weights / weights.sum()
    parts = [weight * values(t + deviation * node) for node, weight in zip(nodes, weights, strict=True)]
    return np.asarray(np.sum(parts, axis=0), dtype=np.float64)


def reference_smoothed(seed: int) -> Case:
    """Row 20. A Gaussian kernel with a deviation of 15 ms smoothed the reference: name ``ref.lowpass``.

    A symmetric kernel of variance v turns x into ``x + (v/2) x''``. The reading less the ideal reading from
    that reference is ``-(v/2) x''``, so the contract's c is ``v/2``.
    """
    rng = np.random.default_rng([20, 2, seed])
    seconds, deviation = 60.0, 0.015
    motion = draw_motion(rng, rate=1.2, fastest=3.0, acceleration=2.0)
    t = uniform_times(seconds, 100.0)
    smooth = gaussian_mean(motion.attitude, t, deviation)
    smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
    turn = 0.02 * DEGREE * rng.standard_normal((t.size, 3))
    place = gaussian_mean(motion.position, t, deviation) + 1e-4 * rng.standard_normal((t.size, 3))
    poses = {"q": continuous(multiply(smooth, from_vector(turn))), "p": place}
    frame = table(t, add_noise(rng, ideal_readings(motion, t)), poses)
    return case(
        "reference_smoothed",
        frame,
        seconds,
        {"adequate", "unknown"},
        effects={"ref.lowpass": {"c": deviation**2 / 2.0}},
    )


ROWS: dict[str, Callable[[int], Case]] = {
    row.__name__: row
    for row in (
        mocap_lowpassed,
        robot_poses_interpolated,
        mocap_slerped_from_other_clock,
        gyro_bias_with_scattered_zero,
        hard_iron_reference_in_own_rows,
        reference_stamps_bunched,
        shaken_without_position_turned_mount,
        fast_translation_with_position,
        lever_arm_beside_lively_reference,
        sensor_1khz_reference_interpolated,
        sensor_1khz_reference_in_own_rows,
        sensor_4khz_reference_interpolated,
        sensor_4khz_reference_in_own_rows,
        sensor_8khz_reference_interpolated,
        sensor_8khz_reference_in_own_rows,
        stated_noise_too_small,
        gyro_soft_clip,
        gyro_wrapped_int16,
        dead_bus_zeros,
        gyro_axis_pinned,
        mains_line,
        swept_tone,
        zero_jumps,
        swinging_delay,
        irrelevant_columns_drifting_heading,
        magnetic_hysteresis,
        mount_rings,
        drone_vibration_rectification,
        uav_motor_current,
        six_labelled_poses,
        gyro_scale_doubles_midway,
        gyro_scale_60_percent,
        reference_clock_fast,
        reference_smoothed,
    )
}
