"""Made-up pairs of recordings, one of a sensor and one of a reference on another clock, with the truth about both.

A pair is one motion seen twice: by a sensor (angular rate and specific force) and by a reference (attitude and, mostly,
position), each with its own clock, rate, gaps, noise and axes. Everything about a pair follows from its seed.

Conventions
-----------
- The reference frame has z up; `GRAVITY` is the gravity vector in it, so a sensor at rest reads +9.80665 m/s^2 upwards.
- `ref_q` is a scalar-first Hamilton quaternion that turns vectors in marker-body axes into the reference frame.
- A reference sample stamped `ref_t` was taken at sensor time `ref_t - lag - skew * (ref_t - ref_t[0])`: with a positive
  lag the reference's stamps are late. The first row of the reference is always there, so `ref_t[0]` is well defined.
- `mount` turns a vector in marker-body axes into sensor axes: the sensor's rate is `mount.apply(rate in marker axes)`.

The motion is a quintic spline through three rotation angles and a path. Its rate and acceleration are the exact
derivatives of that spline, so that the readings and the attitude agree to rounding before errors are put on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy.fft import irfft, next_fast_len, rfftfreq
from scipy.interpolate import BSpline, CubicSpline, make_interp_spline
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
Kind = Literal["free", "repetitive", "unrelated"]

GRAVITY: FloatArray = np.array([0.0, 0.0, -9.80665])
MOTIONS: tuple[str, ...] = ("hand", "walk", "robot", "drone", "tilt")

SHORTEST_OVERLAP = 15.0  # s that both recordings see of the motion
EDGE = 15.0  # s by which a recording may start or end before or after the motion does
GRID_STEP = 0.005  # s between the knots of a motion's spline
STREAMS = {"free": 1, "repetitive": 2, "unrelated": 3}


@dataclass(frozen=True, eq=False)
class Pair:
    """Two recordings and the truth about their clocks and axes."""

    name: str
    kind: str
    t: FloatArray
    gyr: FloatArray
    acc: FloatArray
    ref_t: FloatArray
    ref_q: FloatArray
    ref_p: FloatArray | None
    lag: float
    """Seconds by which the reference's first stamp is late; NaN where the recordings are unrelated."""
    skew: float
    """How much faster the reference's clock runs; NaN where the recordings are unrelated."""
    mount: Rotation
    """Marker-body axes to sensor axes; without meaning where the recordings are unrelated."""
    period: float = 0.0
    """Seconds after which a repetitive motion is the same again, 0 for the other kinds."""
    motion: str = ""
    """What moved: one of `MOTIONS`, "periodic", or "SENSOR/REFERENCE" where the recordings are unrelated."""
    cutoff: float = 0.0
    """Where the reference was smoothed, its bandwidth in Hz; 0 where it was not."""


@dataclass(frozen=True, eq=False)
class Vibration:
    """Shaking of the sensor alone, from rotors: it is not in the attitude."""

    frequency: float
    rate: FloatArray
    """Amplitude per axis, rad/s."""
    force: FloatArray
    """Amplitude per axis, m/s^2."""
    phase: FloatArray
    wander: FloatArray
    """Seconds of slow timing change, for each of three slow sines."""

    def at(self, t: FloatArray, sample_rate: float) -> tuple[FloatArray, FloatArray]:
        """Rate and specific force to add at these times; above the sensor's own bandwidth it is damped."""
        damping = 1.0 if self.frequency < 0.4 * sample_rate else 0.3
        slow = sum((w * np.sin(t / (2.3 + 3.1 * i) + i) for i, w in enumerate(self.wander)), np.zeros_like(t))
        turns = 2 * np.pi * self.frequency * (t + slow)
        waves = np.sin(turns[:, None] + self.phase) + 0.4 * np.sin(2 * turns[:, None] + 1.7 * self.phase)
        return damping * self.rate * waves, damping * self.force * waves


@dataclass(frozen=True, eq=False)
class Motion:
    """A smooth attitude and path over time."""

    name: str
    angles: Any
    """Spline of yaw, pitch and roll, rad."""
    path: Any
    """Spline of the sensor's place in the reference frame, m."""
    world: Rotation
    """Turns the frame in which the angles are meant into the reference frame."""
    body: Rotation
    """Turns marker-body axes into the axes in which the angles are meant."""
    vibration: Vibration | None = None

    def attitude(self, t: FloatArray) -> Rotation:
        """Marker body to reference frame."""
        return self.world * Rotation.from_euler("ZYX", self.angles(t)) * self.body

    def rate(self, t: FloatArray) -> FloatArray:
        """Angular rate in marker-body axes, rad/s."""
        _, pitch, roll = self.angles(t).T
        d_yaw, d_pitch, d_roll = self.angles.derivative()(t).T
        rate = np.column_stack(
            (
                d_roll - d_yaw * np.sin(pitch),
                d_pitch * np.cos(roll) + d_yaw * np.cos(pitch) * np.sin(roll),
                -d_pitch * np.sin(roll) + d_yaw * np.cos(pitch) * np.cos(roll),
            )
        )
        return np.asarray(self.body.inv().apply(rate), dtype=np.float64)

    def specific_force(self, t: FloatArray) -> FloatArray:
        """Acceleration less gravity in marker-body axes, m/s^2."""
        acceleration = self.path.derivative(2)(t)
        return np.asarray(self.attitude(t).apply(acceleration - GRAVITY, inverse=True), dtype=np.float64)


@dataclass(frozen=True)
class Span:
    """When things happen, in seconds from the start of the motion."""

    length: float
    """The motion lasts from 0 to here, or beyond where it has no rest around it."""
    sensor: tuple[float, float]
    reference: tuple[float, float]
    rest_around: bool

    @property
    def overlap(self) -> float:
        """Seconds of the motion that both recordings see."""
        return min(self.sensor[1], self.reference[1], self.length) - max(self.sensor[0], self.reference[0], 0.0)

    @property
    def grid(self) -> FloatArray:
        """Knots for a spline that covers both recordings."""
        return np.arange(-EDGE - 1.0, self.length + EDGE + 1.0, GRID_STEP)


def pair(seed: int) -> Pair:
    """Draw one motion that never quite repeats itself, seen by both recordings."""
    streams = _streams("free", seed)
    span = _span(streams[0], 20.0, SHORTEST_OVERLAP)
    motion = _free_motion(streams[1], span, str(streams[0].choice(MOTIONS)))
    return _recorded("free", seed, streams, span, motion, motion)


def repetitive(seed: int) -> Pair:
    """Draw a motion that repeats itself exactly through the whole of both recordings."""
    streams = _streams("repetitive", seed)
    period = _log_uniform(streams[0], 0.5, 5.0)
    needed = max(SHORTEST_OVERLAP, 10.5 * period)
    span = _span(streams[0], max(20.0, 1.2 * needed), needed)
    motion = _periodic_motion(streams[1], period)
    return _recorded("repetitive", seed, streams, span, motion, motion, period)


def unrelated(seed: int) -> Pair:
    """Draw two recordings that have nothing to do with each other, or a sensor that lies still."""
    streams = _streams("unrelated", seed)
    span = _span(streams[0], 20.0, SHORTEST_OVERLAP)
    kinds = [str(kind) for kind in streams[0].choice(MOTIONS, 2)]
    case = streams[0].random()
    if case < 0.3:
        kinds[0] = kinds[1]
    reference = _free_motion(streams[1], span, kinds[1])
    own = streams[1].spawn(1)[0]
    sensor = _still(own, span) if case > 0.6 else _free_motion(own, span, kinds[0])
    return _recorded("unrelated", seed, streams, span, sensor, reference)


def _streams(kind: Kind, seed: int) -> list[np.random.Generator]:
    """Independent random streams: span and kind, motion, clocks, mount, sensor, reference."""
    return np.random.default_rng([STREAMS[kind], seed]).spawn(6)


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _random_rotation(rng: np.random.Generator) -> Rotation:
    return Rotation.from_quat(rng.normal(size=4))


def _small_rotation(rng: np.random.Generator, largest: float) -> Rotation:
    axis = rng.normal(size=3)
    return Rotation.from_rotvec(axis / np.linalg.norm(axis) * rng.uniform(0.0, largest))


def _span(rng: np.random.Generator, shortest: float, needed: float) -> Span:
    """When the motion and the recordings start and end; both recordings see at least `needed` seconds of it."""
    length = _log_uniform(rng, shortest, 600.0)
    inside = min(EDGE, (length - needed) / 2)
    starts = rng.uniform(-EDGE, inside, 2)
    ends = length + rng.uniform(-inside, EDGE, 2)
    rest_around = bool(rng.random() < 0.5)
    return Span(length, (float(starts[0]), float(ends[0])), (float(starts[1]), float(ends[1])), rest_around)


# Motions


def _free_motion(rng: np.random.Generator, span: Span, name: str) -> Motion:
    """Draw a motion of the named kind over a span."""
    angles, path = {"hand": _hand, "walk": _walk, "robot": _robot, "drone": _drone, "tilt": _tilt}[name](rng, span)
    return Motion(
        name=name,
        angles=make_interp_spline(span.grid, angles, k=5),
        path=make_interp_spline(span.grid, path, k=5),
        world=Rotation.from_euler("z", rng.uniform(-np.pi, np.pi)),
        body=_random_rotation(rng) if rng.random() < 0.5 else Rotation.identity(),
        vibration=_vibration(rng) if name == "drone" else None,
    )


def _vibration(rng: np.random.Generator) -> Vibration:
    """Shake from rotors at 60 to 180 Hz."""
    return Vibration(
        frequency=rng.uniform(60.0, 180.0),
        rate=_log_uniform(rng, 0.02, 0.3) * rng.uniform(0.3, 1.4, 3),
        force=_log_uniform(rng, 0.2, 3.0) * rng.uniform(0.3, 1.4, 3),
        phase=rng.uniform(-np.pi, np.pi, 3),
        wander=rng.uniform(0.01, 0.05, 3),
    )


def _still(rng: np.random.Generator, span: Span) -> Motion:
    """Stay where it is, in any attitude."""
    grid = span.grid[:: max(1, span.grid.size // 50)]
    grid = np.append(grid, span.grid[-1] + 1.0)
    nothing = make_interp_spline(grid, np.zeros((grid.size, 3)), k=5)
    return Motion("still", nothing, nothing, Rotation.identity(), _random_rotation(rng))


def _periodic_motion(rng: np.random.Generator, period: float) -> Motion:
    """Draw three harmonics on every axis: the even one is strong, so that half a period is never a mirror image."""
    phase = np.linspace(0.0, 2 * np.pi, max(96, round(period / GRID_STEP)) + 1)
    first = 2 * np.pi / period
    curves = []
    for order, rms in (
        (1, _log_uniform(rng, 0.3, min(3.0, 1.0 * first))),
        (2, _log_uniform(rng, 0.2, min(3.0, 0.3 * first**2))),
    ):
        size = np.array([1.0, rng.uniform(0.5, 0.9), rng.uniform(0.1, 0.4)])
        size = size[:, None] * rng.uniform(0.3, 1.0, (3, 3))
        size *= rms / np.sqrt(0.5 * np.sum(size**2))
        turn = rng.uniform(-np.pi, np.pi, (3, 3))
        curve = np.zeros((phase.size, 3))
        for k in range(3):
            curve += size[k] / ((k + 1) * first) ** order * np.cos((k + 1) * phase[:, None] + turn[k])
        curve[-1] = curve[0]
        spline = make_interp_spline(phase / first, curve, k=5, bc_type="periodic")
        curves.append(BSpline(spline.t, spline.c, spline.k, extrapolate="periodic"))
    world = Rotation.from_euler("z", rng.uniform(-np.pi, np.pi))
    body = _random_rotation(rng) if rng.random() < 0.5 else Rotation.identity()
    return Motion("periodic", curves[0], curves[1], world, body)


def _band(rng: np.random.Generator, size: int, step: float, band: tuple[float, float], order: int) -> FloatArray:
    """Three smooth random curves whose derivative of this order is noise in that band (Hz), with unit RMS in all."""
    padded = next_fast_len(int(1.2 * size) + 16, real=True)
    frequency = rfftfreq(padded, step)
    shape = np.exp(-((frequency / band[1]) ** 4)) * -np.expm1(-((frequency / band[0]) ** 4))
    white = rng.normal(size=(frequency.size, 3)) + 1j * rng.normal(size=(frequency.size, 3))
    spectrum = white * shape[:, None] * rng.uniform(0.3, 1.0, 3)
    rms = np.sqrt(np.mean(np.sum(irfft(spectrum, padded, axis=0) ** 2, axis=1)))
    frequency[0] = 1.0
    curve = irfft(spectrum / (2j * np.pi * frequency[:, None]) ** order, padded, axis=0)
    return np.asarray(curve[:size] / rms, dtype=np.float64)


def _activity(rng: np.random.Generator, span: Span, pauses: list[tuple[float, float]]) -> FloatArray:
    """Make a curve that is 1 while there is motion and 0 during rest, with smooth flanks."""
    grid = span.grid
    activity = np.ones_like(grid)
    if span.rest_around:
        activity[(grid < 0.0) | (grid > span.length)] = 0.0
    for start, end in pauses:
        activity[(grid > start) & (grid < end)] = 0.0
    flank = np.hanning(2 * round(rng.uniform(0.2, 0.5) / GRID_STEP) + 1)
    half = flank.size // 2
    return np.convolve(np.pad(activity, half, mode="edge"), flank / flank.sum(), mode="valid")


def _integral(rate: FloatArray) -> FloatArray:
    """Running integral over the grid, from zero."""
    total = np.zeros_like(rate)
    np.cumsum(0.5 * GRID_STEP * (rate[1:] + rate[:-1]), axis=0, out=total[1:])
    return total


def _along(curve: FloatArray, own_time: FloatArray) -> FloatArray:
    """Values of a curve, given at every grid step, along a time that stands still during rest.

    A motion made this way comes to a stop and goes on from there.
    """
    return np.asarray(CubicSpline(GRID_STEP * np.arange(len(curve)), curve)(own_time), dtype=np.float64)


def _hand(rng: np.random.Generator, span: Span) -> tuple[FloatArray, FloatArray]:
    """Move by hand: random rates of 0.3 to 4 rad/s RMS, often with pauses in which only the hand trembles."""
    pauses: list[tuple[float, float]] = []
    if rng.random() < 0.6:
        at = -EDGE + rng.uniform(3.0, 12.0)
        while at < span.length + EDGE:
            pauses.append((at, at + rng.uniform(0.5, 5.0)))
            at = pauses[-1][1] + rng.uniform(3.0, 12.0)
    size = span.grid.size
    own_time = _integral(_activity(rng, span, pauses))
    highest = rng.uniform(1.0, 4.0)
    angles = _log_uniform(rng, 0.3, 4.0) * _along(_band(rng, size, GRID_STEP, (0.2, highest), 1), own_time)
    held = _integral(_activity(rng, span, []))
    angles += _log_uniform(rng, 0.003, 0.03) * _along(_band(rng, size, GRID_STEP, (1.0, 7.0), 1), held)
    path = _log_uniform(rng, 0.3, 4.0) * _along(_band(rng, size, GRID_STEP, (0.3, min(highest, 2.5)), 2), own_time)
    return angles, path


def _walk(rng: np.random.Generator, span: Span) -> tuple[FloatArray, FloatArray]:
    """Walk: steps of slowly varying pace and size, with turns."""
    size = span.grid.size
    activity = _activity(rng, span, [])
    own_time = _integral(activity)
    pace = rng.uniform(0.7, 2.0)
    slow = _along(_band(rng, size, GRID_STEP, (0.03, 0.3), 0), own_time)
    varying = 1.0 + rng.uniform(0.04, 0.08) * np.clip(slow, -3.0, 3.0)
    step = 2 * np.pi * pace * _integral(activity * varying[:, 0])
    rms = _log_uniform(rng, 0.4, 2.5)
    angles = np.zeros((size, 3))
    for k, weight in enumerate((1.0, rng.uniform(0.4, 1.0), rng.uniform(0.1, 0.4))):
        scale = weight * rng.uniform(0.3, 1.0, 3) / ((k + 1) * 2 * np.pi * pace)
        angles += scale * np.cos((k + 1) * step[:, None] + rng.uniform(-np.pi, np.pi, 3))
    swing = rms / np.sqrt(np.mean(np.sum(np.gradient(angles[activity > 0.5], GRID_STEP, axis=0) ** 2, axis=1)))
    angles *= swing * (1.0 + rng.uniform(0.05, 0.15) * np.clip(slow[:, [1, 2, 0]], -3.0, 3.0))
    turns = _moves(rng, span, 1, (1.0, 3.0), (2.0, 15.0), np.array([2.0]), 2.0)[:, 0]
    heading = turns + 0.2 * _along(_band(rng, size, GRID_STEP, (0.03, 0.2), 0), own_time)[:, 0]
    angles[:, 0] += heading
    speed = activity * rng.uniform(0.5, 1.6)
    forward = np.column_stack((speed * np.cos(heading), speed * np.sin(heading), np.zeros(size)))
    path = _integral(forward)
    bounce = rng.uniform(0.5, 3.0) / (2 * 2 * np.pi * pace) ** 2
    path[:, 2] += bounce * np.cos(2 * step + rng.uniform(-np.pi, np.pi))
    return angles, path


def _moves(
    rng: np.random.Generator,
    span: Span,
    axes: int,
    move: tuple[float, float],
    rest: tuple[float, float],
    reach: FloatArray,
    fastest: float,
) -> FloatArray:
    """Go from target to target along smooth fifth-order curves, with a rest after each; targets lie within `reach`."""
    at, stop = (0.0, span.length) if span.rest_around else (-EDGE - 1.0, span.length + EDGE + 1.0)
    place = rng.uniform(-reach, reach, axes)
    places, starts, lengths = [place], [], []
    while True:
        target = rng.uniform(-reach, reach, axes)
        length = max(rng.uniform(*move), 1.875 * float(np.linalg.norm(target - place)) / fastest)
        if at + length > stop:
            break
        starts.append(at)
        lengths.append(length)
        places.append(target)
        place = target
        at += length + rng.uniform(*rest)
    if not starts:
        return np.tile(place, (span.grid.size, 1))
    begun = np.clip(np.searchsorted(starts, span.grid, side="right") - 1, 0, None)
    part = np.clip((span.grid - np.array(starts)[begun]) / np.array(lengths)[begun], 0.0, 1.0)[:, None]
    share = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
    stations = np.array(places)
    return np.asarray(stations[begun] + share * (stations[begun + 1] - stations[begun]), dtype=np.float64)


def _robot(rng: np.random.Generator, span: Span) -> tuple[FloatArray, FloatArray]:
    """Move as a robot does: point to point, all axes together, with full rests."""
    reach = np.concatenate((np.array([1.5, 0.8, 0.8]) * rng.uniform(0.4, 1.0), [0.4, 0.4, 0.3]))
    moves = _moves(rng, span, 6, (0.4, 2.5), (0.2, 3.0), reach, rng.uniform(1.0, 4.0))
    return moves[:, :3], moves[:, 3:]


def _drone(rng: np.random.Generator, span: Span) -> tuple[FloatArray, FloatArray]:
    """Fly slowly: weak rotation of 0.1 to 0.3 rad/s RMS below 1 Hz and a wide, slow path."""
    size = span.grid.size
    own_time = _integral(_activity(rng, span, []))
    angles = rng.uniform(0.1, 0.3) * _along(_band(rng, size, GRID_STEP, (0.1, rng.uniform(0.5, 1.0)), 1), own_time)
    path = _log_uniform(rng, 0.1, 1.0) * _along(_band(rng, size, GRID_STEP, (0.1, 0.4), 2), own_time)
    return angles, path


def _tilt(rng: np.random.Generator, span: Span) -> tuple[FloatArray, FloatArray]:
    """Tilt about one level axis, to irregular angles with holds between, with a little play in the hinge."""
    angle = _moves(rng, span, 1, (0.5, 3.0), (0.2, 3.0), np.array([rng.uniform(0.5, 1.5)]), 3.0)[:, 0]
    play = rng.uniform(0.002, 0.02) * np.sin(np.outer(angle, [2.3, 0.0, 3.1]) + rng.uniform(-np.pi, np.pi, 3))
    angles = play + np.column_stack((np.zeros_like(angle), angle, np.zeros_like(angle)))
    arm = rng.uniform(0.0, 0.3)
    return angles, arm * np.column_stack((np.cos(angle), np.zeros_like(angle), -np.sin(angle)))


# Recordings


@dataclass(frozen=True)
class Clocks:
    """How the two clocks relate to the time of the motion."""

    sensor_zero: float
    """Sensor time at the start of the motion."""
    reference_first: float
    """First stamp of the reference."""
    lag: float
    skew: float


def _recorded(
    kind: Kind,
    seed: int,
    streams: list[np.random.Generator],
    span: Span,
    sensor_motion: Motion,
    reference_motion: Motion,
    period: float = 0.0,
) -> Pair:
    """Let both recordings see their motion."""
    clocks = _clocks(streams[2], span)
    mount = _mount(streams[3])
    arm = streams[3].uniform(-0.06, 0.06, 3) if streams[3].random() < 0.5 else np.zeros(3)
    t, gyr, acc = _sensor(streams[4], span, sensor_motion, clocks, mount)
    ref_t, ref_q, ref_p, cutoff = _reference(streams[5], span, reference_motion, clocks, arm)
    same = sensor_motion is reference_motion
    motion = reference_motion.name if same else f"{sensor_motion.name}/{reference_motion.name}"
    return Pair(
        name=f"{kind}-{seed:03d}-{motion.replace('/', '-')}",
        kind=kind,
        t=t,
        gyr=gyr,
        acc=acc,
        ref_t=ref_t,
        ref_q=ref_q,
        ref_p=ref_p,
        lag=clocks.lag if same else float("nan"),
        skew=clocks.skew if same else float("nan"),
        mount=mount,
        period=period,
        motion=motion,
        cutoff=cutoff,
    )


def _clocks(rng: np.random.Generator, span: Span) -> Clocks:
    """Draw clocks: both from zero, or near each other, or with nothing in common."""
    skew = float(rng.uniform(-1e-4, 1e-4))
    sensor_start, reference_start = span.sensor[0], span.reference[0]
    case = rng.random()
    if case < 0.2:
        return Clocks(-sensor_start, 0.0, sensor_start - reference_start, skew)
    if case < 0.5:
        lag = float(rng.uniform(-60.0, 60.0))
        zero = -min(sensor_start, reference_start + lag)
        return Clocks(zero, reference_start + zero + lag, lag, skew)
    zero = float(rng.uniform(0.0, 1e5)) - sensor_start
    first = 0.0 if rng.random() < 0.6 else float(rng.uniform(0.0, 1e5))
    return Clocks(zero, first, first - (reference_start + zero), skew)


def _mount(rng: np.random.Generator) -> Rotation:
    """Draw one of the 24 ways to swap axes, a few degrees off, or in one pair of five any rotation."""
    if rng.random() < 0.2:
        return _random_rotation(rng)
    return _small_rotation(rng, np.radians(5.0)) * Rotation.create_group("O")[int(rng.integers(24))]


def _elapsed(rng: np.random.Generator, length: float, rate: float, jitter: float) -> FloatArray:
    """Stamps from zero, evenly spaced or with each one off by up to `jitter` of the spacing."""
    count = np.arange(int(length * rate) + 1, dtype=np.float64)
    count[1:] += jitter * rng.uniform(-1.0, 1.0, count.size - 1)
    return count / rate


def _outages(
    rng: np.random.Generator, elapsed: FloatArray, count: int, longest: tuple[float, float], at_most: float
) -> BoolArray:
    """Mark the rows that fall into gaps; the first and last half second stay, and all gaps last `at_most` together."""
    lengths = np.array([_log_uniform(rng, *longest) for _ in range(count)])
    lengths *= min(1.0, at_most / lengths.sum())
    lost = np.zeros(elapsed.size, dtype=np.bool_)
    for length in lengths:
        start = rng.uniform(0.5, elapsed[-1] - 0.5 - length)
        lost |= (elapsed > start) & (elapsed < start + length)
    return lost


def _sensor(
    rng: np.random.Generator, span: Span, motion: Motion, clocks: Clocks, mount: Rotation
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Read the sensor: point samples with scale error, bias, noise, sometimes coarse steps and lost rows."""
    rate = _log_uniform(rng, 25.0, 1000.0)
    jitter = rng.uniform(0.01, 0.3) if rng.random() < 0.5 else 0.0
    elapsed = _elapsed(rng, span.sensor[1] - span.sensor[0], rate, jitter)
    case = rng.random()
    if case < 0.2:
        lost = _outages(rng, elapsed, int(rng.integers(1, 3)), (0.1, 3.0), 0.2 * span.overlap)
        elapsed = elapsed[~lost]
    elif case < 0.4:
        lost = rng.random(elapsed.size) < _log_uniform(rng, 0.001, 0.02)
        lost[0] = False
        elapsed = elapsed[~lost]
    t = clocks.sensor_zero + span.sensor[0] + elapsed
    when = span.sensor[0] + elapsed
    gyr = np.asarray(mount.apply(motion.rate(when)), dtype=np.float64)
    acc = np.asarray(mount.apply(motion.specific_force(when)), dtype=np.float64)
    if motion.vibration is not None:
        rate_shake, force_shake = motion.vibration.at(when, rate)
        gyr += rate_shake
        acc += force_shake
    gyr = gyr * (1.0 + rng.uniform(-0.03, 0.03, 3)) + rng.uniform(-0.1, 0.1, 3) * rng.uniform(0.0, 1.0)
    gyr += _log_uniform(rng, 0.001, 0.02) * rng.normal(size=gyr.shape)
    acc = acc * (1.0 + rng.uniform(-0.01, 0.01, 3)) + rng.uniform(-0.2, 0.2, 3)
    acc += _log_uniform(rng, 0.01, 0.1) * rng.normal(size=acc.shape)
    if rng.random() < 0.3:
        step = float(rng.choice([0.001065, 0.004, 0.01]))
        gyr = step * np.round(gyr / step)
        acc = 0.005 * np.round(acc / 0.005)
    return t, gyr, acc


def _reference(
    rng: np.random.Generator, span: Span, motion: Motion, clocks: Clocks, arm: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray | None, float]:
    """Read the reference: noisy, sometimes smoothed, with gaps and now and then a wild pose."""
    rate = _log_uniform(rng, 10.0, 1000.0)
    cutoff = rng.uniform(6.0, 15.0)
    smoothed = bool(rng.random() < 0.4) and rate > 2.5 * cutoff
    jitter = 0.0 if smoothed or rng.random() < 0.6 else rng.uniform(0.01, 0.3)
    length = (span.reference[1] - span.reference[0]) / (1.0 - clocks.skew)
    elapsed = _elapsed(rng, length, rate, jitter)
    when = span.reference[0] + (1.0 - clocks.skew) * elapsed
    noise = np.radians(_log_uniform(rng, 0.02, 0.5))
    attitude = motion.attitude(when)
    p = motion.path(when) - attitude.apply(arm)
    p += _log_uniform(rng, 1e-4, 2e-3) * rng.normal(size=p.shape) + rng.uniform(-2.0, 2.0, 3)
    q = (attitude * Rotation.from_rotvec(noise * rng.normal(size=(elapsed.size, 3)))).as_quat()[:, [3, 0, 1, 2]]
    q[1:] *= np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))[:, None]
    if smoothed:
        sections = butter(2, cutoff, fs=rate, output="sos")
        q = sosfiltfilt(sections, q, axis=0)
        p = sosfiltfilt(sections, p, axis=0)
        q /= np.linalg.norm(q, axis=1, keepdims=True)
    if rng.random() < 0.15:
        wild = int(rng.integers(1, elapsed.size - 1))
        q[wild] = _random_rotation(rng).as_quat()
        p[wild] += rng.normal(size=3)
    if rng.random() < 0.4:
        q[q[:, 0] < 0.0] *= -1.0
    ref_t = clocks.reference_first + elapsed
    if rng.random() < 0.4:
        lost = _outages(rng, elapsed, int(rng.integers(1, 4)), (0.2, 5.0), 0.25 * span.overlap)
        if rng.random() < 0.5:
            q[lost] = np.nan
            p[lost] = np.nan
        else:
            ref_t, q, p = ref_t[~lost], q[~lost], p[~lost]
    return ref_t, q, (p if rng.random() < 0.7 else None), (cutoff if smoothed else 0.0)
