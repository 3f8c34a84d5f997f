"""Whole cheap sensors in simulated logs: five to seven known errors at once, injected as physics would.

The motions are smooth chains of joints whose rates and accelerations are exact. A reading is the force, rate
or field at the sensor's own point and own time, put through its lag, its gain, its offsets, its noise and its
rounding, in that order. Everything follows the public contract and nothing else: the formulas here share no
code with the tool they judge.

`draw(seed)` makes one log. A draw is kept only if every hidden effect can be seen in it: what the other
hidden effects cannot imitate must stand far above the noise of the sensor and of the reference. Where another
effect of the catalogue could take the place of a hidden one without a visible loss, that effect may be named
too.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import count, pairwise

import numpy as np
import pandas as pd
from case import Case
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

Array = NDArray[np.float64]
Jet = tuple[Array, Array, Array]
Channel = Callable[[Array], Jet]
Form = dict[str, Array]
Effects = dict[str, dict[str, float]]

GRAVITY = 9.80665
DOWN = np.array([0.0, 0.0, GRAVITY])
DEGREE = np.pi / 180.0
SENSORS = ("acc", "gyr", "mag")
AXES = "xyz"
SEEN = 400.0
"""Least chi-square by which a hidden effect stands out of what all others can imitate."""
ALIKE = 36.0
"""Largest chi-square at which two effects count as the same here."""


# ---------------------------------------------------------------------------------------------------------
# Smooth motions


@dataclass(frozen=True)
class Steps:
    """Holds a value and goes to the next one between `starts[i]` and `ends[i]`, smooth to third order."""

    starts: Array
    ends: Array
    values: Array

    def __call__(self, t: Array) -> Jet:
        """Returns the value and its first two derivatives."""
        i = np.clip(np.searchsorted(self.starts, t, side="right") - 1, 0, len(self.starts) - 1)
        length = (self.ends - self.starts)[i]
        u = np.clip((t - self.starts[i]) / length, 0.0, 1.0)
        rise = (self.values[1:] - self.values[:-1])[i]
        v = 1.0 - u
        return (
            self.values[i] + rise * u**4 * (35.0 - 84.0 * u + 70.0 * u**2 - 20.0 * u**3),
            rise / length * 140.0 * u**3 * v**3,
            rise / length**2 * 420.0 * u**2 * v**2 * (v - u),
        )


@dataclass(frozen=True)
class Tones:
    """Sums sines under a smooth envelope."""

    amplitudes: Array
    frequencies: Array
    phases: Array
    envelope: Channel

    def __call__(self, t: Array) -> Jet:
        """Returns the value and its first two derivatives."""
        w = 2.0 * np.pi * self.frequencies
        angle = np.outer(t, w) + self.phases
        sine, cosine = np.sin(angle), np.cos(angle)
        s, ds, dds = sine @ self.amplitudes, cosine @ (w * self.amplitudes), -sine @ (w**2 * self.amplitudes)
        e, de, dde = self.envelope(t)
        return e * s, de * s + e * ds, dde * s + 2.0 * de * ds + e * dds


@dataclass(frozen=True)
class Total:
    """Adds channels."""

    parts: tuple[Channel, ...]

    def __call__(self, t: Array) -> Jet:
        """Returns the sums of the parts' values and derivatives."""
        jets = [part(t) for part in self.parts]
        zero = np.zeros_like(t)
        return (
            sum((j[0] for j in jets), zero),
            sum((j[1] for j in jets), zero),
            sum((j[2] for j in jets), zero),
        )


@dataclass(frozen=True)
class Joint:
    """Turns by a channel about an axis of the frame before it, then follows a link of the frame after it."""

    axis: str
    angle: Channel
    link: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class State:
    """Holds where a body is and how it moves, in the reference frame; `rate` and `turn` in the body's."""

    position: Array
    velocity: Array
    acceleration: Array
    rotation: Array
    rate: Array
    turn: Array
    """Angular acceleration."""

    def into_body(self, vector: Array) -> Array:
        """Returns reference-frame vectors in the body frame."""
        return np.einsum("nji,nj->ni", self.rotation, np.broadcast_to(vector, self.position.shape))

    def force(self, lever: Array | None = None) -> Array:
        """Returns the specific force at a point of the body, in the body frame."""
        f = self.into_body(self.acceleration - DOWN)
        if lever is None:
            return f
        return f + np.cross(self.turn, lever) + np.cross(self.rate, np.cross(self.rate, lever))


def turned(axis: str, angle: Array) -> Array:
    """Returns rotations by `angle` about a coordinate axis, as matrices (n, 3, 3)."""
    i = AXES.index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    matrix = np.zeros((len(angle), 3, 3))
    matrix[:, i, i] = 1.0
    matrix[:, j, j] = matrix[:, k, k] = np.cos(angle)
    matrix[:, j, k] = -np.sin(angle)
    matrix[:, k, j] = np.sin(angle)
    return matrix


@dataclass(frozen=True)
class Motion:
    """Chains joints on a base that translates."""

    kind: str
    duration: float
    joints: tuple[Joint, ...]
    base: tuple[Channel, Channel, Channel] | None = None

    @property
    def travels(self) -> bool:
        """Tells whether the body's own point leaves its place."""
        return self.base is not None or any(any(joint.link) for joint in self.joints)

    def at(self, t: Array) -> State:
        """Returns the exact state at any times."""
        n = len(t)
        p, v, a = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
        if self.base is not None:
            for i, channel in enumerate(self.base):
                p[:, i], v[:, i], a[:, i] = channel(t)
        rotation = np.broadcast_to(np.eye(3), (n, 3, 3))
        omega, alpha = np.zeros((n, 3)), np.zeros((n, 3))
        for joint in self.joints:
            angle, speed, gain = (q[:, None] for q in joint.angle(t))
            axis = rotation[:, :, AXES.index(joint.axis)]
            alpha = alpha + gain * axis + speed * np.cross(omega, axis)
            omega = omega + speed * axis
            rotation = rotation @ turned(joint.axis, angle[:, 0])
            if any(joint.link):
                link = rotation @ np.array(joint.link)
                swing = np.cross(omega, link)
                p, v, a = p + link, v + swing, a + np.cross(alpha, link) + np.cross(omega, swing)
        return State(
            p,
            v,
            a,
            rotation,
            np.einsum("nji,nj->ni", rotation, omega),
            np.einsum("nji,nj->ni", rotation, alpha),
        )


def windows(rng: np.random.Generator, start: float, stop: float, busy: tuple, rest: tuple) -> Array:
    """Returns starts and ends of busy spells with rests between them, (2, k)."""
    spans, t = [], start
    while True:
        t += rng.uniform(*rest)
        end = t + rng.uniform(*busy)
        if end > stop:
            break
        spans.append((t, end))
        t = end
    return np.array(spans).T


def envelope(spans: Array, ramp: float) -> Steps:
    """Returns a channel that is 1 within the spans and 0 between them, with ramps inside the spans."""
    starts = np.column_stack([spans[0], spans[1] - ramp]).ravel()
    return Steps(starts, starts + ramp, np.tile([0.0, 1.0], len(spans[0]) + 1)[: 2 * len(spans[0]) + 1])


def tones(rng: np.random.Generator, around: Channel, size: float, low: float, high: float, k: int = 3) -> Tones:
    """Returns `k` sines of together about `size` between two frequencies."""
    share = rng.uniform(0.5, 1.0, k)
    frequencies = np.exp(rng.uniform(np.log(low), np.log(high), k))
    amplitudes = size * share / share.sum() * np.minimum(1.0, 1.2 / frequencies)
    return Tones(amplitudes, frequencies, rng.uniform(0, 2 * np.pi, k), around)


def signs(rng: np.random.Generator, size: int) -> Array:
    """Returns random signs."""
    return rng.choice([-1.0, 1.0], size)


def waypoints(rng: np.random.Generator, reach: float, stride: float, size: int) -> Array:
    """Returns random angles within +-`reach` degrees, in rad, none more than `stride` from the last."""
    angles = [rng.uniform(-reach, reach)]
    while len(angles) < size:
        low, high = max(-reach, angles[-1] - stride), min(reach, angles[-1] + stride)
        angles.append(rng.uniform(low, high))
    return np.array(angles) * DEGREE


def hand_held(rng: np.random.Generator, duration: float) -> Motion:
    """Returns a sensor waved about by hand, turned to a new pose in every spell, with rests."""
    spans = windows(rng, 0.5, duration - 1.0, (3.0, 7.0), (1.0, 2.6))
    around, k = envelope(spans, 0.8), spans.shape[1] + 1
    joints = []
    for axis, reach, wave in (("z", 150.0, 28.0), ("y", 70.0, 28.0), ("x", 150.0, 34.0)):
        poses = Steps(spans[0], spans[1], rng.uniform(-reach, reach, k) * DEGREE)
        joints.append(Joint(axis, Total((poses, tones(rng, around, wave * DEGREE, 0.4, 1.7)))))
    base = tuple(
        Total((Steps(spans[0], spans[1], rng.uniform(-0.4, 0.4, k)), tones(rng, around, 0.11, 0.3, 1.3))) for _ in AXES
    )
    return Motion("hand_held", duration, tuple(joints), (base[0], base[1], base[2]))


def robot_arm(rng: np.random.Generator, duration: float) -> Motion:
    """Returns a sensor on the flange of a six-axis arm that goes from waypoint to waypoint."""
    spans = windows(rng, 0.5, duration - 1.0, (1.0, 2.2), (0.3, 1.6))
    k = spans.shape[1] + 1
    joints = []
    for axis, reach, stride, link in (
        ("z", 70.0, 45.0, (0.05, 0.0, -0.33)),
        ("y", 35.0, 25.0, (0.0, 0.0, -0.35)),
        ("y", 45.0, 30.0, (0.30, 0.0, -0.04)),
        ("x", 120.0, 80.0, (0.05, 0.0, 0.0)),
        ("y", 100.0, 70.0, (0.08, 0.0, 0.0)),
        ("x", 160.0, 90.0, (0.04, 0.01, 0.0)),
    ):
        joints.append(Joint(axis, Steps(spans[0], spans[1], waypoints(rng, reach, stride, k)), link))
    return Motion("robot_arm", duration, tuple(joints))


def gimbal(rng: np.random.Generator, duration: float) -> Motion:
    """Returns a three-axis gimbal about the sensor's reference point: turns, oscillations and rests."""
    spans = windows(rng, 0.5, duration - 1.0, (5.0, 11.0), (1.2, 2.8))
    around, k = envelope(spans, 1.0), spans.shape[1] + 1
    joints = []
    for axis, reach, wave in (("z", 180.0, 35.0), ("y", 85.0, 30.0), ("x", 180.0, 40.0)):
        poses = Steps(spans[0], spans[1], rng.uniform(-reach, reach, k) * DEGREE)
        joints.append(Joint(axis, Total((poses, tones(rng, around, wave * DEGREE, 0.3, 1.5)))))
    return Motion("gimbal", duration, tuple(joints))


def poses_and_swings(rng: np.random.Generator, duration: float, arm: float | None = None) -> Motion:
    """Returns static poses all around, then swings about every axis in turn at the end of an arm."""
    arm = rng.uniform(0.1, 0.35) if arm is None else arm
    half = rng.uniform(0.45, 0.55) * duration
    moves = windows(rng, 0.5, half, (1.0, 1.6), (1.4, 2.2))
    spans = windows(rng, half, duration - 1.0, (5.0, 8.0), (1.0, 2.0))
    joined = np.concatenate([moves, spans], axis=1)
    k, m = moves.shape[1] + 1, spans.shape[1]
    joints = []
    for i, (axis, reach) in enumerate((("z", 160.0), ("y", 80.0), ("x", 170.0))):
        poses = Steps(joined[0], joined[1], waypoints(rng, reach, 95.0, k + m))
        mine = spans[:, i::3] if m >= 3 else spans
        others = np.delete(spans, np.s_[i::3], axis=1) if m >= 3 else spans
        big = tones(rng, envelope(mine, 1.0), 55.0 * DEGREE, 0.5, 1.0, 2)
        small = tones(rng, envelope(others, 1.0), 12.0 * DEGREE, 0.4, 1.3, 2)
        joints.append(Joint(axis, Total((poses, big, small)), (0.0, 0.0, arm if axis == "x" else 0.0)))
    return Motion("poses_and_swings" if arm else "poses_and_turns", duration, tuple(joints))


def poses_and_turns(rng: np.random.Generator, duration: float) -> Motion:
    """Returns static poses and swings about the sensor's own point."""
    return poses_and_swings(rng, duration, 0.0)


MOTIONS = (hand_held, robot_arm, gimbal, poses_and_swings, poses_and_turns)


# ---------------------------------------------------------------------------------------------------------
# The bench: a motion, its reference, the surroundings and the sensor's noise


@dataclass(frozen=True)
class Bench:
    """Holds all that a log comes from, apart from the sensor's systematic errors."""

    motion: Motion
    t: Array
    start: float
    earth_field: Array
    temperature: Array
    sensor: str
    white: dict[str, float]
    walk: float
    """Random walk of a zero over the whole log, as a part of the white noise."""
    attitude_noise: float
    position_noise: float
    magnetometer_every: int
    """Rows between two magnetometer readings; 0 = there is none."""
    tell_noise: bool

    @property
    def sensors(self) -> tuple[str, ...]:
        """Lists the sensors in the log."""
        return SENSORS if self.magnetometer_every else SENSORS[:2]

    @property
    def step(self) -> float:
        """Returns the mean time between rows."""
        return float(self.t[-1] - self.t[0]) / (len(self.t) - 1)

    @property
    def warmth(self) -> Array:
        """Returns the temperature less its mean over the log."""
        return self.temperature - self.temperature.mean()


def warm_up(rng: np.random.Generator, t: Array) -> Array:
    """Returns a chip that warms up fast, then slowly, while a fan comes on and goes off."""
    fast, slow = rng.uniform(4.0, 9.0), rng.uniform(1.5, 4.0)
    spans = windows(rng, 0.1 * t[-1], t[-1], (14.0, 24.0), (8.0, 18.0))
    start, end = spans[:, :2] if spans.size else np.array([[0.4 * t[-1]], [0.7 * t[-1]]])
    fan = np.zeros_like(t)
    for on, off in zip(start, end, strict=True):
        held = 1.0 - np.exp(-np.clip(t - on, 0.0, off - on) / 6.0)
        fan += held * np.exp(-np.clip(t - off, 0.0, None) / 9.0)
    return (
        rng.uniform(18.0, 27.0)
        + fast * (1.0 - np.exp(-t / rng.uniform(12.0, 25.0)))
        + slow * (1.0 - np.exp(-t / rng.uniform(50.0, 90.0)))
        - rng.uniform(1.2, 2.4) * fan
    )


def draw_bench(
    rng: np.random.Generator,
    motions: Iterable[Callable[[np.random.Generator, float], Motion]] = MOTIONS,
    seconds: tuple[float, float] = (60.0, 180.0),
    rates: tuple[float, ...] = (50.0, 100.0, 100.0, 200.0),
    magnetometer: tuple[int, ...] = (0, 1, 1, 2, 4),
) -> Bench:
    """Returns a random bench with the noise of a cheap sensor and of a good reference."""
    rate = float(rng.choice(rates))
    duration = float(np.round(rng.uniform(seconds[0], min(seconds[1], max(seconds[0], 18000.0 / rate)))))
    choices = list(motions)
    motion = choices[rng.integers(len(choices))](rng, duration)
    t = np.arange(int(duration * rate)) / rate
    if rng.random() < 0.25:
        t = t + rng.uniform(-0.02, 0.02, len(t)) / rate
        t -= t[0]
    heading, horizontal, vertical = rng.uniform(-0.3, 0.3), rng.uniform(17.0, 30.0), rng.uniform(25.0, 46.0)
    field_vector = [horizontal * np.cos(heading), horizontal * np.sin(heading), vertical]
    inertial = str(rng.choice(["MPU6050", "MPU9250"]))
    compass = str(rng.choice(["HMC5883L", "AK8963"])) if inertial == "MPU6050" else "AK8963"
    return Bench(
        motion=motion,
        t=t,
        start=float(np.round(rng.choice([0.0, rng.uniform(1.0, 4000.0)]), 3)),
        earth_field=np.round(field_vector, 3),
        temperature=warm_up(rng, t),
        sensor=f"{inertial} + {compass}",
        white={
            "acc": rng.uniform(0.022, 0.045),
            "gyr": rng.uniform(0.035, 0.075) * DEGREE,
            "mag": rng.uniform(0.2, 0.35) if compass == "HMC5883L" else rng.uniform(0.35, 0.6),
        },
        walk=rng.uniform(0.01, 0.04),
        attitude_noise=rng.uniform(0.02, 0.05) * DEGREE,
        position_noise=float(rng.choice([0.0, 1.0, 1.0, 1.0])) * rng.uniform(1e-4, 3e-4),
        magnetometer_every=int(rng.choice(magnetometer)),
        tell_noise=bool(rng.random() < 0.5),
    )


def parameter_names(effect: str) -> tuple[str, ...]:
    """Returns the contract's names of an effect's parameters."""
    if effect in ("gyr.g_sensitivity", "mag.soft_iron"):
        return tuple(row + column for row in AXES for column in AXES)
    if effect.endswith(".misalignment"):
        return "xy", "xz", "yx", "yz", "zx", "zy"
    if effect.endswith((".delay", ".lowpass")) and effect != "ref.lowpass":
        return ("tau",)
    singles = {
        "ref.skew": ("k",),
        "ref.lowpass": ("c",),
        "gyr.earth_rate": ("north", "vertical"),
        "ref.tilt": ("x", "y"),
        "gyr.warmup": ("x", "y", "z", "tau"),
    }
    if effect in singles:
        return singles[effect]
    return ("range",) if effect.endswith(".saturation") else ("x", "y", "z")


def vector(effects: Effects, effect: str) -> Array:
    """Returns an effect's parameters in the contract's order, zeros where it is not there."""
    values = effects.get(effect, {})
    return np.array([values.get(name, 0.0) for name in parameter_names(effect)])


def gain(effects: Effects, sensor: str) -> Array:
    """Returns I + diag(s) + M of a sensor."""
    matrix = np.eye(3)
    if sensor == "mag":
        return matrix + vector(effects, "mag.soft_iron").reshape(3, 3)
    matrix += np.diag(vector(effects, f"{sensor}.scale"))
    off = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)]
    for (i, j), value in zip(off, vector(effects, f"{sensor}.misalignment"), strict=True):
        matrix[i, j] += value
    return matrix


def lagged(signal: Callable[[Array], Array], t: Array, tau: float, grid: float = 1e-3) -> Array:
    """Returns a signal after a first-order lag, integrated on a fine grid from a second before the log."""
    fine = np.arange(t[0] - 1.0, t[-1] + 2.0 * grid, grid)
    x = signal(fine)
    decay = np.exp(-grid / tau)
    hold = tau / grid * (1.0 - decay)
    # exact for an input that goes straight from grid point to grid point
    driven = lfilter([1.0 - hold, hold - decay], [1.0, -decay], x - x[0], axis=0) + x[0]
    return CubicSpline(fine, driven)(t)


def clean(bench: Bench, effects: Effects) -> Form:
    """Returns the readings of every sensor with all effects and without noise and rounding."""
    lever = vector(effects, "acc.lever_arm")

    def force(t: Array) -> Array:
        return bench.motion.at(t).force(lever)

    def rate(t: Array) -> Array:
        return bench.motion.at(t).rate

    def field_there(t: Array) -> Array:
        return bench.motion.at(t).into_body(bench.earth_field)

    readings: Form = {}
    for sensor, signal in zip(SENSORS, (force, rate, field_there), strict=True):
        if sensor not in bench.sensors:
            continue
        times = bench.t - vector(effects, f"{sensor}.delay")[0]
        lag = effects.get(f"{sensor}.lowpass", {}).get("tau", 0.0)
        x = lagged(signal, times, lag) if lag else signal(times)
        y = x @ gain(effects, sensor).T
        y = y + vector(effects, "mag.hard_iron" if sensor == "mag" else f"{sensor}.bias")
        y = y + np.outer(bench.warmth, vector(effects, f"{sensor}.bias_temperature"))
        if sensor == "gyr" and "gyr.g_sensitivity" in effects:
            y = y + force(times) @ vector(effects, "gyr.g_sensitivity").reshape(3, 3).T
        readings[sensor] = y
    return readings


def rounded(sensor: str, name: str, y: Array) -> Array:
    """Returns readings in whole counts of the smallest range that holds them."""
    top = float(np.nanmax(np.abs(y)))
    if sensor == "acc":
        full = next(r for r in (2.0, 4.0, 8.0, 16.0) if top < 0.95 * r * GRAVITY or r == 16.0)
        count_size = full * GRAVITY / 32768.0
    elif sensor == "gyr":
        full = next(r for r in (250.0, 500.0, 1000.0, 2000.0) if top < 0.95 * r * DEGREE or r == 2000.0)
        count_size = full * DEGREE / 32768.0
    else:
        return np.round(y / (count_size := 100.0 / 1090.0 if "HMC" in name else 0.15)) * count_size
    return np.clip(np.round(y / count_size), -32768, 32767) * count_size


def quaternions(rotation: Array) -> Array:
    """Returns unit quaternions, scalar first, body into reference frame, without jumps of sign."""
    trace = np.trace(rotation, axis1=1, axis2=2)
    diagonal = np.stack([trace, rotation[:, 0, 0], rotation[:, 1, 1], rotation[:, 2, 2]], axis=1)
    case = np.argmax(diagonal, axis=1)
    q = np.empty((len(rotation), 4))
    for k in range(4):
        rows = case == k
        r = rotation[rows]
        if k == 0:
            q[rows, 0] = 1.0 + trace[rows]
            q[rows, 1] = r[:, 2, 1] - r[:, 1, 2]
            q[rows, 2] = r[:, 0, 2] - r[:, 2, 0]
            q[rows, 3] = r[:, 1, 0] - r[:, 0, 1]
            continue
        i, j, m = k - 1, k % 3, (k + 1) % 3
        q[rows, 0] = r[:, m, j] - r[:, j, m]
        q[rows, 1 + i] = 1.0 + r[:, i, i] - r[:, j, j] - r[:, m, m]
        q[rows, 1 + j] = r[:, j, i] + r[:, i, j]
        q[rows, 1 + m] = r[:, m, i] + r[:, i, m]
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    flips = np.sign(np.sum(q[1:] * q[:-1], axis=1))
    q[1:] *= np.cumprod(np.where(flips == 0.0, 1.0, flips))[:, None]
    return q


def small_turns(angles: Array) -> Array:
    """Returns rotation matrices of rotation vectors."""
    size = np.linalg.norm(angles, axis=1)
    a, b = np.sinc(size / np.pi), 0.5 * np.sinc(size / (2.0 * np.pi)) ** 2
    x, y, z = angles.T
    zero = np.zeros_like(x)
    hat = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    return np.eye(3) + a[:, None, None] * hat + b[:, None, None] * (hat @ hat)


def log(
    bench: Bench,
    readings: Mapping[str, Array],
    rng: np.random.Generator,
    late: float = 0.0,
    columns: Mapping[str, Array] | None = None,
) -> pd.DataFrame:
    """Returns the table that a logger would write: noise, rounding, a `late` reference, covariates."""
    n = len(bench.t)
    table: dict[str, Array] = {"t": bench.start + bench.t}
    for sensor, x in readings.items():
        white = bench.white[sensor]
        y = x + white * rng.standard_normal((n, 3))
        y += bench.walk * white / np.sqrt(n) * np.cumsum(rng.standard_normal((n, 3)), axis=0)
        y = rounded(sensor, bench.sensor, y)
        if sensor == "mag":
            y[np.arange(n) % bench.magnetometer_every != 0] = np.nan
        table.update({f"{sensor}_{axis}": y[:, i] for i, axis in enumerate(AXES)})
    table["temp"] = np.round((bench.temperature + 0.03 * rng.standard_normal(n)) * 340.0) / 340.0
    truth = bench.motion.at(bench.t - late)
    q = quaternions(truth.rotation @ small_turns(bench.attitude_noise * rng.standard_normal((n, 3))))
    table.update({f"ref_q{name}": q[:, i] for i, name in enumerate("wxyz")})
    if bench.motion.travels:
        p = truth.position + bench.position_noise * rng.standard_normal((n, 3))
        table.update({f"ref_p{axis}": p[:, i] for i, axis in enumerate(AXES)})
    return pd.DataFrame(table | dict(columns or {}))


def metadata(bench: Bench) -> dict:
    """Returns what the log says about itself."""
    chips = bench.sensor if bench.magnetometer_every else bench.sensor.split(" + ")[0]
    facts: dict = {"frame": "NED", "gravity": GRAVITY, "sensor": chips}
    if bench.magnetometer_every:
        facts["mag_reference"] = [float(x) for x in bench.earth_field]
    if bench.tell_noise:
        facts["noise"] = {sensor: float(bench.white[sensor]) for sensor in bench.sensors}
    return facts


# ---------------------------------------------------------------------------------------------------------
# The catalogue as columns, and what stands out of the noise


COMMON = (
    "bias",
    "scale",
    "misalignment",
    "bias_temperature",
    "scale_temperature",
    "bias_drift",
    "quadratic",
    "cubic",
    "vibration_rectification",
    "delay",
    "lowpass",
    "saturation",
)
GYROSCOPE = ("warmup", "scale_asymmetry", "g_sensitivity", "earth_rate")
COMPASS = ("hard_iron", "soft_iron", "field_reference", "delay", "bias_temperature", "scale_temperature")
REFERENCE = ("alignment", "tilt", "delay", "skew", "lowpass")


def times_matrix(x: Array) -> Array:
    """Returns the columns of A x for the nine elements of A, row by row, (n, 3, 9)."""
    columns = np.zeros((len(x), 3, 9))
    for i in range(3):
        columns[:, i, 3 * i : 3 * i + 3] = x
    return columns


def diagonal(x: Array) -> Array:
    """Returns the columns of diag(c) x, (n, 3, 3)."""
    return x[:, :, None] * np.eye(3)


def crossed(x: Array) -> Array:
    """Returns the columns of d x x for the three elements of d, (n, 3, 3)."""
    return np.stack([np.cross(e, x) for e in np.eye(3)], axis=2)


@dataclass
class Catalogue:
    """Holds the ideal readings of a log and writes every effect of the contract as columns over them.

    A form maps a sensor to an array (n, 3, k) with one column per linear parameter. An effect that is not
    linear in a parameter has one form for each value of that parameter on a grid.
    """

    t: Array
    x: Form
    slope: Form
    bend: Form
    state: State
    earth_field: Array
    warmth: Array
    columns: Mapping[str, Array] = field(default_factory=dict)

    @classmethod
    def of(cls, bench: Bench, columns: Mapping[str, Array] | None = None, h: float = 2e-3) -> "Catalogue":
        """Returns the catalogue of a bench's log."""

        def ideal(t: Array) -> tuple[Form, State]:
            state = bench.motion.at(t)
            all_three = {"acc": state.force(), "gyr": state.rate, "mag": state.into_body(bench.earth_field)}
            return {sensor: all_three[sensor] for sensor in bench.sensors}, state

        (x, state), (after, _), (before, _) = ideal(bench.t), ideal(bench.t + h), ideal(bench.t - h)
        slope = {s: (after[s] - before[s]) / (2.0 * h) for s in x}
        bend = {s: (after[s] - 2.0 * x[s] + before[s]) / h**2 for s in x}
        return cls(bench.t, x, slope, bend, state, bench.earth_field, bench.warmth, columns or {})

    def ids(self) -> list[str]:
        """Lists the effects that this log could be given."""
        names = [f"acc.{e}" for e in [*COMMON, "lever_arm"]] + [f"gyr.{e}" for e in [*COMMON, *GYROSCOPE]]
        if "mag" in self.x:
            names += [f"mag.{e}" for e in COMPASS]
            names += ["mag.current"] if "motor_current" in self.columns else []
        names += [f"ref.{e}" for e in REFERENCE]
        for column in self.columns:
            names += [f"{s}.column:{column}" for s in self.x if (s, column) != ("mag", "motor_current")]
        return names

    def forms(self, effect: str, taus: Iterable[float] = (4e-3, 8e-3, 14e-3, 20e-3)) -> Iterator[Form]:
        """Yields an effect's columns."""
        sensor, name = effect.split(".", 1)
        if sensor == "ref":
            yield from self._reference(name)
            return
        x, time = self.x[sensor], (self.t - self.t[0])[:, None]
        if name == "delay":
            yield {sensor: -self.slope[sensor][:, :, None]}
        elif name == "lowpass":
            # a lag is a delay by tau, whose own second order stays out, and half of tau^2 of bend
            for tau in taus:
                yield {sensor: (-self.slope[sensor] + 0.5 * tau * self.bend[sensor])[:, :, None]}
        elif name == "saturation":
            for part in (0.5, 0.7, 0.9):
                limit = part * np.abs(x).max()
                yield {sensor: (np.clip(x, -limit, limit) - x)[:, :, None]}
        elif name == "warmup":
            for tau in np.geomspace(3.0, 2.0 * time[-1, 0], 9):
                yield {sensor: diagonal(np.exp(-time / tau) * np.ones_like(x))}
        elif name in (by_axis := self._by_axis(x, time)):
            yield {sensor: diagonal(by_axis[name]())}
        elif name == "current" or name.startswith("column:"):
            values = self.columns["motor_current" if name == "current" else name.split(":", 1)[1]]
            shift = 0.0 if name == "current" else values.mean()
            yield {sensor: diagonal((values - shift)[:, None] * np.ones_like(x))}
        else:
            yield {sensor: self._across(x)[name]()}

    def _by_axis(self, x: Array, time: Array) -> dict[str, Callable[[], Array]]:
        """Returns what an effect with one parameter per axis multiplies, by the effect's name."""
        one, warmth = np.ones_like(x), self.warmth[:, None]
        return {
            "bias": lambda: one,
            "hard_iron": lambda: one,
            "scale": lambda: x,
            "bias_temperature": lambda: warmth * one,
            "scale_temperature": lambda: warmth * x,
            "bias_drift": lambda: time * one,
            "quadratic": lambda: x**2,
            "cubic": lambda: x**3,
            "scale_asymmetry": lambda: np.abs(x),
            "vibration_rectification": lambda: self._shaking()[:, None] * one,
        }

    def _across(self, x: Array) -> dict[str, Callable[[], Array]]:
        """Returns the columns of an effect that mixes axes, by the effect's name."""
        state = self.state

        def lever(e: Array) -> Array:
            return np.cross(state.rate, np.cross(state.rate, e)) + np.cross(state.turn, e)

        return {
            "misalignment": lambda: times_matrix(x)[:, :, [1, 2, 3, 5, 6, 7]],
            "soft_iron": lambda: times_matrix(x),
            "g_sensitivity": lambda: times_matrix(self.x["acc"]),
            "earth_rate": lambda: np.stack([state.into_body(np.eye(3)[i]) for i in (0, 2)], axis=2),
            "field_reference": lambda: np.swapaxes(state.rotation, 1, 2),
            "lever_arm": lambda: np.stack([lever(e) for e in np.eye(3)], axis=2),
        }

    def _shaking(self) -> Array:
        """Returns the accelerometer's power within half a second."""
        width = max(3, int(0.5 / (self.t[1] - self.t[0])))
        mean, power = np.ones(width) / width, np.zeros_like(self.t)
        for a in self.x["acc"].T:
            power += np.convolve((a - np.convolve(a, mean, "same")) ** 2, mean, "same")
        return power

    def _reference(self, name: str) -> Iterator[Form]:
        """Yields the columns of an effect of the reference."""
        time = (self.t - self.t[0])[:, None]
        if name == "alignment":
            yield {s: crossed(x) for s, x in self.x.items()}
        elif name == "delay":
            yield {s: d[:, :, None] for s, d in self.slope.items()}
        elif name == "skew":
            yield {s: (time * d)[:, :, None] for s, d in self.slope.items()}
        elif name == "lowpass":
            yield {s: d[:, :, None] for s, d in self.bend.items()}
        else:
            down = {"acc": -DOWN, "mag": self.earth_field}
            tilts = {
                s: np.stack([self.state.into_body(np.cross(np.eye(3)[i], down[s])) for i in (0, 1)], axis=2)
                for s in self.x
                if s != "gyr"
            }
            yield tilts
            yield {"acc": tilts["acc"]}


@dataclass(frozen=True)
class Whitener:
    """Weighs readings, frequency by frequency, by the noise of the sensor and of the reference together."""

    weights: dict[str, Array]

    @classmethod
    def of(cls, bench: Bench, top: float | None = None) -> "Whitener":
        """Returns the weights of a bench up to a frequency."""
        n, dt = len(bench.t), bench.step
        k = np.arange(n)
        f = k / (2.0 * n * dt)
        w = 2.0 * np.pi * f
        keep = f <= (np.inf if top is None else top)
        walk = bench.walk**2 / n / (2.0 * np.sin(0.5 * np.pi * np.maximum(k, 0.5) / n)) ** 2
        turn, place = bench.attitude_noise**2, bench.position_noise**2 * bench.motion.travels
        scatter = {
            "acc": turn * GRAVITY**2 + place * w**4,
            "gyr": turn * w**2,
            "mag": turn * float(bench.earth_field @ bench.earth_field) + 0.0 * w,
        }
        weights = {}
        for sensor in bench.sensors:
            rows = bench.magnetometer_every if sensor == "mag" else 1
            floor = bench.white[sensor] ** 2 * (rows + walk) + scatter[sensor]
            weights[sensor] = 1.0 / np.sqrt(floor[keep])
        return cls(weights)

    def __call__(self, form: Form) -> Array:
        """Returns a form as a matrix whose rows have unit noise."""
        columns = next(iter(form.values())).shape[2]
        blocks = []
        for sensor, weight in self.weights.items():
            if sensor in form:
                spectrum = dct(form[sensor], axis=0, norm="ortho")[: len(weight)]
                blocks.append((spectrum * weight[:, None, None]).reshape(-1, columns))
            else:
                blocks.append(np.zeros((3 * len(weight), columns)))
        return np.concatenate(blocks)


def basis(columns: Array) -> Array:
    """Returns an orthonormal basis of columns."""
    norms = np.linalg.norm(columns, axis=0)
    columns = columns[:, norms > 0.0] / norms[norms > 0.0]
    squares, turn = np.linalg.eigh(columns.T @ columns)
    keep = squares > 1e-10 * squares.max()
    return columns @ (turn[:, keep] / np.sqrt(squares[keep]))


def left(target: Array, columns: Array) -> float:
    """Returns the sum of squares of a target that columns cannot explain."""
    total = float(target @ target)
    if columns.shape[1] > 12:
        part = basis(columns).T @ target
        return total - float(part @ part)
    # few columns: without the threads that a matrix product would wake for so little
    norms = np.sqrt(np.einsum("ri,ri->i", columns, columns))
    columns = columns[:, norms > 0.0] / norms[norms > 0.0]
    if columns.shape[1] == 0:
        return total
    squares, turn = np.linalg.eigh(np.einsum("ri,rj->ij", columns, columns))
    keep = squares > 1e-9 * squares.max()
    part = turn[:, keep].T @ np.einsum("ri,r->i", columns, target) / np.sqrt(squares[keep])
    return total - float(part @ part)


def examine(bench: Bench, effects: Effects) -> tuple[dict[str, float], dict[str, set[str]]]:
    """Returns how far each effect stands out of the others, and which absent effects could replace it."""
    catalogue = Catalogue.of(bench)
    whiten = Whitener.of(bench, 6.0)

    def tau(effect: str) -> tuple[float, ...]:
        return (abs(effects[effect]["tau"]),) if "tau" in effects[effect] else (8e-3,)

    own = {e: whiten(next(catalogue.forms(e, tau(e)))) for e in effects}
    names, blocks = [], []
    for rival in catalogue.ids():
        for form in catalogue.forms(rival) if rival not in effects else ():
            columns = whiten(form)
            names.append(rival)
            blocks.append(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))
    squares = [np.einsum("ri,rj->ij", block, block) for block in blocks]
    rivals = np.concatenate(blocks, axis=1)
    edges = np.cumsum([0] + [block.shape[1] for block in blocks])
    stands: dict[str, float] = {}
    alike: dict[str, set[str]] = {}
    for effect in effects:
        target = own[effect] @ vector(effects, effect)
        others = basis(np.concatenate([own[e] for e in effects if e != effect], axis=1))
        for _ in range(2):
            target = target - others @ (others.T @ target)
        total = float(target @ target)
        stands[effect], alike[effect] = total, set()
        along, shared = rivals.T @ target, rivals.T @ others
        for name, square, i, j in zip(names, squares, edges[:-1], edges[1:], strict=True):
            # what a rival explains of the target when the other hidden effects are fitted with it
            size, turn = np.linalg.eigh(square - shared[i:j] @ shared[i:j].T)
            keep = size > 1e-9
            part = turn[:, keep].T @ along[i:j] / np.sqrt(size[keep])
            if total - float(part @ part) < ALIKE:
                alike[effect].add(name)
    return stands, alike


# ---------------------------------------------------------------------------------------------------------
# The draw


def amounts(rng: np.random.Generator, effect: str) -> dict[str, float]:
    """Returns random parameters of an effect at the size that data sheets give."""
    low, high = {
        "acc.bias": (0.1, 0.8),
        "gyr.bias": (0.5 * DEGREE, 5.0 * DEGREE),
        "acc.scale": (0.005, 0.03),
        "gyr.scale": (0.005, 0.03),
        "acc.misalignment": (0.003, 0.02),
        "gyr.misalignment": (0.003, 0.02),
        "gyr.g_sensitivity": (0.05 * DEGREE / GRAVITY, 0.3 * DEGREE / GRAVITY),
        "acc.lever_arm": (0.01, 0.1),
        "mag.hard_iron": (5.0, 60.0),
        "mag.soft_iron": (0.02, 0.12),
        "acc.bias_temperature": (0.01, 0.1),
        "gyr.bias_temperature": (0.02 * DEGREE, 0.2 * DEGREE),
        "acc.lowpass": (0.004, 0.02),
        "gyr.lowpass": (0.004, 0.02),
    }.get(effect, (0.002, 0.02))
    names = parameter_names(effect)
    values = np.exp(rng.uniform(np.log(low), np.log(high), len(names)))
    if names != ("tau",):
        values *= signs(rng, len(names))
    if effect == "mag.soft_iron":
        matrix = values.reshape(3, 3)
        values = np.where(np.eye(3, dtype=bool), matrix, 0.5 * (matrix + matrix.T)).ravel()
    return {name: float(value) for name, value in zip(names, values, strict=True)}


POOL = {
    "acc.bias": 1.6,
    "gyr.bias": 1.6,
    "acc.scale": 1.0,
    "gyr.scale": 1.0,
    "acc.misalignment": 1.0,
    "gyr.misalignment": 1.0,
    "gyr.g_sensitivity": 0.7,
    "acc.lever_arm": 1.0,
    "mag.hard_iron": 1.6,
    "mag.soft_iron": 1.2,
    "acc.bias_temperature": 0.8,
    "gyr.bias_temperature": 0.8,
    "acc.lowpass": 0.4,
    "gyr.lowpass": 0.4,
    "acc.delay": 0.4,
    "gyr.delay": 0.5,
    "mag.delay": 0.5,
    "ref.delay": 0.7,
}
"""How readily each effect is drawn."""


def choose(rng: np.random.Generator, bench: Bench) -> tuple[Effects, set[str]]:
    """Returns five to seven effects that can be told apart in principle, and other names for them."""
    wanted = int(rng.integers(5, 8))
    weight = np.array(list(POOL.values()))
    chosen: list[str] = []
    for effect in rng.choice(list(POOL), len(POOL), replace=False, p=weight / weight.sum()):
        sensor, name = str(effect).split(".")
        if sensor == "mag" and not bench.magnetometer_every:
            continue
        shifted = {"delay", "lowpass"}
        timing = [c for c in chosen if c.split(".")[1] in shifted]
        if name in shifted and (len(timing) == 2 or any(c.split(".")[0] == sensor for c in timing)):
            continue
        chosen.append(str(effect))
        if len(chosen) == wanted:
            break
    effects = {effect: amounts(rng, effect) for effect in POOL if effect in chosen}
    if "ref.delay" in effects and rng.random() < 0.35:
        # all sensors late by the same time are a reference that is early by it
        effects["ref.delay"]["tau"] *= -1.0
        return effects, {f"{sensor}.delay" for sensor in bench.sensors}
    return effects, set()


def too_near(effects: Effects, least: float = 1e-3) -> bool:
    """Tells whether two lags differ so little that a third one could stand for both."""
    taus = sorted(abs(values["tau"]) for values in effects.values() if "tau" in values)
    return any(b - a < least for a, b in pairwise(taus))


def draw(seed: int) -> Case:
    """Returns one log of a whole sensor with five to seven hidden effects, each of which can be seen.

    `effects` holds the true parameters. Where all sensors are late by the same time, that is written as a
    negative `ref.delay`, and the delays of the sensors may be named as well.
    """
    for attempt in count():
        rng = np.random.default_rng([20240, seed, attempt])
        bench = draw_bench(rng)
        effects, also = choose(rng, bench)
        stands, alike = examine(bench, effects)
        if min(stands.values()) < SEEN or too_near(effects):
            continue
        late = vector(effects, "ref.delay")[0]
        frame = log(bench, clean(bench, effects), rng, late)
        return Case(
            name=f"whole-{seed}-{bench.motion.kind}",
            frame=frame,
            metadata=metadata(bench),
            effects=effects,
            may_name=frozenset(effects) | frozenset(also).union(*alike.values()),
            verdicts=frozenset({"adequate"}),
            seconds=float(bench.motion.duration),
        )
    raise AssertionError("the loop above ends only with a log")
