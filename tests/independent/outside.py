"""Logs with one disturbance that no effect of the catalogue describes.

The sensor is ideal but for its noise and one error of a kind that real sensors, mounts, supplies and rooms
have: a bias that jumps, a mount that rings, a clock that wanders, a magnet that passes. Its size is 0.7 to 4
times the white noise of the sensor (root mean square over all rows of the channels it touches). The right
answer is that something is missing and that the catalogue does not hold it.

`draw(seed)` makes one log of kind `KINDS[seed % len(KINDS)]`. A draw is thrown away where one effect of the
catalogue explains more than four fifths of the disturbance, where all of them together leave too little to be
seen, or where the noise of the reference hides it.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import count

import numpy as np
from case import Case
from whole_sensor import (
    GRAVITY,
    Array,
    Bench,
    Catalogue,
    Form,
    State,
    Steps,
    Whitener,
    clean,
    draw_bench,
    envelope,
    gimbal,
    hand_held,
    left,
    log,
    metadata,
    poses_and_swings,
    poses_and_turns,
    robot_arm,
    small_turns,
    windows,
)

Shape = Callable[[float], Form]

LEVELS = (0.7, 4.0)
"""Sizes in units of the white noise."""
EXPLAINED = 0.8
"""Largest part of the disturbance that one effect of the catalogue may explain."""
MAJORITY = 0.5
"""Part from which on an effect of the catalogue counts as a harmless name for a part of the disturbance."""
PATIENCE = 12
"""Draws that are made to find one in which no effect explains the larger part."""
SEEN = 300.0
"""Least chi-square of the disturbance in the noise of sensor and reference."""
LEFT = 100.0
"""Least chi-square that the whole catalogue together leaves."""

MILLI = 1e-3

PLACES = {
    "any": (hand_held, robot_arm, gimbal, poses_and_swings, poses_and_turns),
    "turns": (gimbal, poses_and_turns),
    "travels": (hand_held, robot_arm, poses_and_swings),
}


@dataclass
class World:
    """Holds what a disturbance can depend on: motion, readings, temperature, its own covariates."""

    rng: np.random.Generator
    bench: Bench
    state: State
    x: Form
    columns: dict[str, Array] = field(default_factory=dict)

    @property
    def t(self) -> Array:
        """Returns the times of the rows from the start of the log."""
        return self.bench.t

    @property
    def end(self) -> float:
        """Returns the time of the last row."""
        return float(self.bench.t[-1])

    def any_of(self, *sensors: str) -> str:
        """Returns one of the sensors."""
        return str(self.rng.choice(sensors))

    def axis(self) -> int:
        """Returns the number of an axis."""
        return int(self.rng.integers(3))

    def two_axes(self) -> tuple[int, int]:
        """Returns the numbers of two different axes."""
        i, j = self.rng.permutation(3)[:2]
        return int(i), int(j)

    def between(self, low: float, high: float) -> float:
        """Returns a number in a range."""
        return float(self.rng.uniform(low, high))

    def late(self, sensor: str, delay: Array) -> Array:
        """Returns a sensor's ideal readings at times earlier than the rows by `delay`."""
        state = self.bench.motion.at(self.t - delay)
        if sensor == "acc":
            return state.force()
        return state.rate if sensor == "gyr" else state.into_body(self.bench.earth_field)

    def slope(self, sensor: str) -> Array:
        """Returns the time derivative of a sensor's ideal readings."""
        h = np.full_like(self.t, 2e-3)
        return (self.late(sensor, -h) - self.late(sensor, h)) / 4e-3

    def spells(self, busy: tuple[float, float], rest: tuple[float, float]) -> Array:
        """Returns starts and ends of spells with rests between them, (2, k)."""
        return windows(self.rng, 0.0, self.end, busy, rest)

    def inside(self, spans: Array) -> Array:
        """Returns 1 within the spans and 0 outside."""
        t = self.t[:, None]
        return np.any((t >= spans[0]) & (t < spans[1]), axis=1).astype(float)

    def moments(self, gap: tuple[float, float]) -> Array:
        """Returns random moments with gaps between them."""
        times = np.cumsum(self.rng.uniform(*gap, int(self.end / gap[0]) + 2))
        return times[times < self.end]

    def levels(self, dwell: tuple[float, float]) -> Array:
        """Returns a random level for every row, held for random times."""
        index = np.searchsorted(self.moments(dwell), self.t)
        return self.rng.standard_normal(index.max() + 1)[index]

    def pulses(self, height: tuple[float, float], busy: tuple[float, float], rest: tuple[float, float]) -> Array:
        """Returns smooth pulses of random heights."""
        spans = self.spells(busy, rest)
        k = spans.shape[1]
        starts = np.column_stack([spans[0], spans[1] - 0.4]).ravel()
        tops = np.column_stack([np.zeros(k), self.rng.uniform(*height, k)]).ravel()
        return Steps(starts, starts + 0.4, np.append(tops, 0.0))(self.t)[0]

    def wandering(self, dwell: tuple[float, float]) -> Array:
        """Returns a smooth curve through random values of unit size."""
        spans = self.spells(dwell, (0.0, 0.2))
        return Steps(spans[0], spans[1], self.rng.standard_normal(spans.shape[1] + 1))(self.t)[0]

    def on(self, sensor: str, signal: Array, axis: int | None = None) -> Shape:
        """Returns a signal on one axis of a sensor, or along a random direction, times the amplitude."""
        if axis is None and self.rng.random() < 0.5:
            direction = self.rng.standard_normal(3)
            direction /= np.linalg.norm(direction)
        else:
            direction = np.eye(3)[self.axis() if axis is None else axis]
        return lambda a: {sensor: a * np.outer(signal, direction)}


def linear(sensor: str, error: Array) -> Shape:
    """Returns an error times the amplitude."""
    return lambda a: {sensor: a * error}


def axis_only(sensor: str, error: Array, axis: int) -> Form:
    """Returns an error on one axis alone."""
    return {sensor: error * np.eye(3)[axis]}


def centred(signal: Array) -> Array:
    """Returns a signal less its mean."""
    return signal - signal.mean(axis=0)


def beyond(signal: Array, known: Array) -> Array:
    """Returns what is left of a signal when its straight line over a known one is taken out."""
    signal, known = centred(signal), centred(known)
    return signal - known * (signal @ known) / (known @ known)


def play(x: Array, slack: float) -> Array:
    """Returns a follower that moves only when the leader has taken up the slack."""
    y, held = np.empty_like(x), float(x[0])
    for i, value in enumerate(x.tolist()):
        held = min(max(held, value - slack), value + slack)
        y[i] = held
    return y


def follower(x: Array, dt: float, tau: float) -> Array:
    """Returns the first-order lag of rows."""
    y, held, part = np.empty_like(x), x[0], 1.0 - np.exp(-dt / tau)
    for i, value in enumerate(x):
        held = held + part * (value - held)
        y[i] = held
    return y


def decays(t: Array, moments: Array, heights: Array, tau: float) -> Array:
    """Returns the sum of exponential decays that start at given moments."""
    y = np.zeros_like(t)
    for moment, height in zip(moments, heights, strict=True):
        since = t - moment
        y += np.where(since >= 0.0, height * np.exp(-np.clip(since, 0.0, None) / tau), 0.0)
    return y


# ---------------------------------------------------------------------------------------------------------
# The kinds


@dataclass(frozen=True)
class Kind:
    """Names a disturbance and the log that it needs."""

    name: str
    make: Callable[[World], Shape]
    place: str = "any"
    cycles: bool = False
    """Whether the temperature goes up and down instead of only up."""
    fixed: bool = False
    """Whether the size is part of the kind."""


KINDS: list[Kind] = []


def kind(place: str = "any", cycles: bool = False, fixed: bool = False) -> Callable:
    """Returns a decorator that puts a disturbance into `KINDS`."""

    def keep(make: Callable[[World], Shape]) -> Callable[[World], Shape]:
        KINDS.append(Kind(make.__name__, make, place, cycles, fixed))
        return make

    return keep


@kind()
def bias_level_shift(w: World) -> Shape:
    """A zero shifts to another level and comes back."""
    start = w.between(0.2, 0.5) * w.end
    shift = w.inside(np.array([[start], [start + w.between(0.15, 0.35) * w.end]]))
    return w.on(w.any_of("acc", "gyr", "mag"), shift)


@kind()
def bias_many_levels(w: World) -> Shape:
    """A zero takes a new random level every few seconds."""
    return w.on(w.any_of("acc", "gyr", "mag"), centred(w.levels((4.0, 12.0))))


@kind()
def random_telegraph(w: World) -> Shape:
    """A zero switches between two levels at random (popcorn noise)."""
    index = np.searchsorted(w.moments((0.5, 5.0)), w.t)
    return w.on(w.any_of("acc", "gyr"), np.where(index % 2 == 0, 1.0, -1.0), w.axis())


@kind(cycles=True)
def thermal_hysteresis(w: World) -> Shape:
    """A zero depends on whether the chip was last heated or cooled; the straight line is compensated."""
    slack = w.between(0.3, 0.45) * np.ptp(w.bench.temperature)
    return w.on(w.any_of("acc", "gyr"), beyond(play(w.bench.temperature, slack), w.bench.temperature))


@kind(cycles=True)
def v_over_temperature(w: World) -> Shape:
    """A zero falls to the middle of the temperature range and rises beyond it."""
    middle = np.median(w.bench.temperature)
    return w.on(w.any_of("acc", "gyr"), centred(np.abs(w.bench.temperature - middle)))


@kind(cycles=True)
def parabola_over_temperature(w: World) -> Shape:
    """A zero follows the square of the temperature."""
    return w.on(w.any_of("acc", "gyr", "mag"), centred(centred(w.bench.temperature) ** 2))


@kind(cycles=True)
def bias_of_heating_rate(w: World) -> Shape:
    """A zero follows how fast the temperature changes."""
    return w.on(w.any_of("acc", "gyr"), centred(np.gradient(w.bench.temperature, w.t)))


@kind(cycles=True)
def bias_of_heat_soak(w: World) -> Shape:
    """A zero follows the case, which lags far behind the chip; the chip's own part is compensated."""
    soaked = follower(w.bench.temperature, w.bench.step, w.between(15.0, 30.0))
    return w.on(w.any_of("acc", "gyr"), beyond(soaked, w.bench.temperature))


@kind()
def supply_gain(w: World) -> Shape:
    """A gain follows the supply voltage, which is logged."""
    sag = w.pulses((0.2, 0.6), (2.0, 6.0), (2.0, 6.0))
    w.columns["vbat"] = 4.1 - 0.3 * w.t / w.end - sag + 0.004 * w.rng.standard_normal(len(w.t))
    sensor = w.any_of("acc", "gyr")
    return linear(sensor, centred(-sag)[:, None] * w.x[sensor])


@kind()
def gain_breathes(w: World) -> Shape:
    """A gain swings slowly with time."""
    sensor, turns = w.any_of("acc", "gyr", "mag"), w.between(2.3, 6.0)
    swing = np.sin(2.0 * np.pi * turns * w.t / w.end + w.between(0.0, 6.0))
    return linear(sensor, swing[:, None] * w.x[sensor])


@kind()
def gain_switches(w: World) -> Shape:
    """A gain takes a new value every few seconds (automatic ranging)."""
    sensor = w.any_of("acc", "gyr", "mag")
    return linear(sensor, centred(w.levels((5.0, 12.0)))[:, None] * w.x[sensor])


@kind()
def range_step(w: World) -> Shape:
    """A second range takes over above a threshold of any axis, every time with another zero."""
    size = np.abs(w.x["gyr"]).max(axis=1)
    over = size > w.between(0.1, 0.3) * size.max()
    spell = np.cumsum(np.diff(over, prepend=False))
    return w.on("gyr", over * w.rng.standard_normal(spell.max() + 1)[spell])


@kind()
def dead_zone(w: World) -> Shape:
    """Small rates read zero."""
    x = w.x["gyr"]
    return lambda a: {"gyr": np.where(np.abs(x) < a, -x, 0.0)}


@kind()
def sticking_mass(w: World) -> Shape:
    """The proof mass moves only after the force has overcome a friction."""
    x, i = w.x["acc"], w.axis()
    return lambda a: axis_only("acc", (play(x[:, i], a) - x[:, i])[:, None], i)


@kind()
def slew_rate_limit(w: World) -> Shape:
    """Readings cannot change faster than a limit."""
    sensor, i = w.any_of("acc", "gyr"), w.axis()
    x = w.x[sensor][:, i]
    steepest = np.abs(np.diff(x)).max()

    def shape(a: float) -> Form:
        limit, held, y = steepest * np.exp(-a), float(x[0]), np.empty_like(x)
        for k, value in enumerate(x.tolist()):
            held += min(max(value - held, -limit), limit)
            y[k] = held
        return axis_only(sensor, (y - x)[:, None], i)

    return shape


@kind()
def creep_after_force(w: World) -> Shape:
    """A part of every change of force arrives only after seconds (creep of the spring)."""
    slow = follower(w.x["acc"], w.bench.step, w.between(3.0, 8.0))
    return linear("acc", slow - w.x["acc"])


@kind()
def one_axis_delay(w: World) -> Shape:
    """One axis is late, the other two are not."""
    sensor, i = w.any_of("acc", "gyr", "mag"), w.axis()
    x = w.x[sensor]
    return lambda a: axis_only(sensor, w.late(sensor, np.full_like(w.t, MILLI * a)) - x, i)


@kind()
def delay_swings(w: World) -> Shape:
    """A delay swings with time about nothing."""
    sensor, turns = w.any_of("acc", "gyr", "mag"), w.between(2.5, 8.0)
    swing = np.sin(2.0 * np.pi * turns * w.t / w.end + w.between(0.0, 6.0))
    return lambda a: {sensor: w.late(sensor, MILLI * a * swing) - w.x[sensor]}


@kind()
def delay_jumps(w: World) -> Shape:
    """A buffer slips: the delay jumps forth and back."""
    sensor, steps = w.any_of("acc", "gyr", "mag"), centred(w.levels((6.0, 14.0)))
    return lambda a: {sensor: w.late(sensor, MILLI * a * steps) - w.x[sensor]}


@kind()
def clock_resynchronised(w: World) -> Shape:
    """A sensor's clock runs away and is set right again and again."""
    sensor, period = w.any_of("acc", "gyr", "mag"), w.between(8.0, 20.0)
    saw = (w.t / period + w.between(0.0, 1.0)) % 1.0 - 0.5
    return lambda a: {sensor: w.late(sensor, MILLI * a * saw) - w.x[sensor]}


@kind(place="turns")
def sample_jitter(w: World) -> Shape:
    """Samples are taken a random time away from their time stamp."""
    sensor, jitter = w.any_of("acc", "mag"), w.rng.standard_normal(len(w.t))
    return lambda a: {sensor: w.late(sensor, MILLI * a * jitter) - w.x[sensor]}


@kind(fixed=True)
def jumps_31(w: World) -> Shape:
    """31 jumps of ten sigma."""
    sensor, n = w.any_of("acc", "gyr", "mag"), len(w.t)
    width = int(np.ceil(1.02 * LEVELS[0] ** 2 * n / (31 * 100.0)))
    signal = np.zeros(n)
    for row in w.rng.choice(n // (2 * width), 31, replace=False) * 2 * width:
        signal[row : row + width] = w.rng.choice([-1.0, 1.0])
    return w.on(sensor, 10.0 * w.bench.white[sensor] * signal, w.axis())


@kind()
def spikes_decay(w: World) -> Shape:
    """Charge pops at random and leaks away."""
    moments = w.moments((1.5, 6.0))
    heights = w.rng.standard_normal(len(moments))
    return w.on(w.any_of("acc", "gyr"), decays(w.t, moments, heights, w.between(0.4, 1.5)))


@kind()
def readings_freeze(w: World) -> Shape:
    """A reading is repeated for a while, again and again."""
    sensor, moments = w.any_of("acc", "gyr", "mag"), w.moments((3.0, 9.0))

    def shape(a: float) -> Form:
        since = w.t - moments[np.clip(np.searchsorted(moments, w.t, side="right") - 1, 0, None)]
        return {sensor: w.late(sensor, np.where((since >= 0.0) & (since < a), since, 0.0)) - w.x[sensor]}

    return shape


@kind()
def torn_bytes(w: World) -> Shape:
    """High and low byte of a reading come from different samples now and then."""
    sensor, n = w.any_of("acc", "mag"), len(w.t)
    hits = (w.rng.random(n) < 0.03) * w.rng.choice([-1.0, 1.0], n)
    return w.on(sensor, hits, w.axis())


@kind()
def fine_part_wraps(w: World) -> Shape:
    """The fine part of the converter wraps around before the coarse part counts on."""
    x, i = w.x["acc"], w.axis()
    period = w.between(1.5, 4.0)
    return linear("acc", ((x / period + 0.3) % 1.0 - 0.5) * np.eye(3)[i])


@kind()
def converter_ripple(w: World) -> Shape:
    """The converter's curve has a ripple over the reading."""
    sensor = w.any_of("acc", "mag")
    period = w.between(0.15, 0.3) * np.abs(w.x[sensor]).max()
    return linear(sensor, np.sin(2.0 * np.pi * w.x[sensor] / period + w.between(0.0, 6.0)))


@kind()
def missing_code(w: World) -> Shape:
    """The converter's curve has a step inside the range."""
    x, i = w.x["acc"], w.axis()
    level = w.between(-0.4, 0.4) * GRAVITY
    band = np.where((x > level) & (x < level + 2.0), 1.0, 0.0)
    return linear("acc", band * np.eye(3)[i])


@kind(place="turns")
def mains_aliased(w: World) -> Shape:
    """The mains line gets in and is folded by the sampling."""
    line = w.rng.choice([50.0, 60.0]) + w.between(-0.05, 0.05)
    tone = np.sin(2.0 * np.pi * line * w.t + w.between(0.0, 6.0))
    return w.on(w.any_of("acc", "mag"), tone)


@kind(place="turns")
def swept_tone(w: World) -> Shape:
    """A machine that runs up shakes the sensor at a rising frequency."""
    low, high = w.between(0.5, 2.0), w.between(8.0, 20.0)
    phase = 2.0 * np.pi * (low * w.t + 0.5 * (high - low) * w.t**2 / w.end)
    return w.on(w.any_of("acc", "mag"), np.sin(phase))


@kind(place="turns")
def modulated_tone(w: World) -> Shape:
    """Two fans beat: a tone that comes and goes."""
    tone = np.sin(2.0 * np.pi * w.between(6.0, 15.0) * w.t)
    return w.on("acc", tone * np.sin(2.0 * np.pi * w.between(0.08, 0.2) * w.t))


@kind(place="turns")
def mount_rings(w: World) -> Shape:
    """A flexing mount rings at 8 to 20 Hz after every knock."""
    omega, damping = 2.0 * np.pi * w.between(8.0, 20.0), w.between(0.01, 0.04)
    signal = np.zeros_like(w.t)
    for moment in w.moments((1.0, 4.0)):
        since = np.clip(w.t - moment, 0.0, None)
        signal += w.between(0.5, 1.5) * np.exp(-damping * omega * since) * np.sin(omega * since)
    return w.on("acc", signal)


@kind(place="turns")
def footfalls(w: World) -> Shape:
    """Steps of a walker shake the floor."""
    signal = np.zeros_like(w.t)
    for moment in w.moments((0.45, 0.65)):
        signal += w.between(0.7, 1.3) * np.exp(-0.5 * ((w.t - moment) / 0.06) ** 2)
    return w.on("acc", centred(signal))


@kind()
def mount_slips(w: World) -> Shape:
    """The mount slips by a small angle and is put back; every sensor sees it."""
    start = w.between(0.2, 0.5) * w.end
    slipped = w.inside(np.array([[start], [start + w.between(0.15, 0.35) * w.end]]))
    axis = w.rng.standard_normal(3)
    turn = np.outer(slipped, axis / np.linalg.norm(axis))

    def shape(a: float) -> Form:
        back = np.swapaxes(small_turns(MILLI * a * turn), 1, 2)
        return {s: np.einsum("nij,nj->ni", back, x) - x for s, x in w.x.items()}

    return shape


@kind()
def mount_bends(w: World) -> Shape:
    """The mount bends under the force across it; every sensor sees the angle."""
    i, j = w.two_axes()
    turn = np.outer(w.x["acc"][:, i], np.eye(3)[j])

    def shape(a: float) -> Form:
        back = np.swapaxes(small_turns(MILLI * a * turn), 1, 2)
        return {s: np.einsum("nij,nj->ni", back, x) - x for s, x in w.x.items()}

    return shape


@kind()
def gyro_force_squared(w: World) -> Shape:
    """The gyroscope's zero follows the square of the force."""
    return w.on("gyr", centred(w.x["acc"][:, w.axis()] ** 2), w.axis())


@kind()
def gyro_force_product(w: World) -> Shape:
    """The gyroscope's zero follows the product of two forces."""
    i, j = w.two_axes()
    return w.on("gyr", w.x["acc"][:, i] * w.x["acc"][:, j], w.axis())


@kind()
def force_of_other_rate(w: World) -> Shape:
    """The accelerometer follows the rate about another axis."""
    i, j = w.two_axes()
    return w.on("acc", w.x["gyr"][:, j], i)


@kind()
def rate_of_other_rate_size(w: World) -> Shape:
    """The gyroscope follows the size of the rate about another axis."""
    i, j = w.two_axes()
    return w.on("gyr", centred(np.abs(w.x["gyr"][:, j])), i)


@kind()
def rate_times_rate(w: World) -> Shape:
    """The gyroscope follows the product of the rates about the two other axes."""
    i, j = w.two_axes()
    return w.on("gyr", w.x["gyr"][:, i] * w.x["gyr"][:, j], 3 - i - j)


@kind()
def rate_times_force(w: World) -> Shape:
    """The gyroscope's gain follows the force across."""
    i, j = w.two_axes()
    return w.on("gyr", w.x["gyr"][:, i] * w.x["acc"][:, j], i)


@kind()
def force_times_force(w: World) -> Shape:
    """The accelerometer follows the product of the forces along the two other axes."""
    i, j = w.two_axes()
    return w.on("acc", w.x["acc"][:, i] * w.x["acc"][:, j], 3 - i - j)


@kind()
def jerk_across(w: World) -> Shape:
    """The accelerometer follows the change of force along another axis."""
    i, j = w.two_axes()
    return w.on("acc", w.slope("acc")[:, j], i)


@kind()
def angular_acceleration_across(w: World) -> Shape:
    """The gyroscope follows the angular acceleration about another axis."""
    i, j = w.two_axes()
    return w.on("gyr", w.state.turn[:, j], i)


@kind()
def heading_ripple(w: World) -> Shape:
    """A zero depends on the heading (a cogging turntable)."""
    heading = np.arctan2(w.state.rotation[:, 1, 0], w.state.rotation[:, 0, 0])
    return w.on(w.any_of("acc", "gyr"), np.sin(w.rng.integers(2, 7) * heading + w.between(0.0, 6.0)))


@kind(place="travels")
def rail_ripple(w: World) -> Shape:
    """A zero depends on the place (a machine's rails)."""
    along = w.state.position @ w.rng.standard_normal(3)
    return w.on("acc", np.sin(2.0 * np.pi * along / (w.between(0.15, 0.3) * np.ptp(along))))


@kind(place="travels")
def air_flow(w: World) -> Shape:
    """The stream of air past the case pushes on the mass: an error along the velocity."""
    return linear("acc", w.state.into_body(w.state.velocity))


@kind(place="travels")
def field_varies_in_space(w: World) -> Shape:
    """The magnetic field has a gradient in the room, free of sources and currents."""
    gradient = w.rng.standard_normal((3, 3))
    gradient = gradient + gradient.T
    gradient -= np.eye(3) * np.trace(gradient) / 3.0
    return linear("mag", w.state.into_body(centred(w.state.position) @ gradient))


@kind()
def magnet_passes(w: World) -> Shape:
    """A magnet is carried past a few times."""
    moment = w.rng.standard_normal(3)
    total = np.zeros((len(w.t), 3))
    for time in w.moments((15.0, 30.0)):
        along, aside = np.linalg.qr(w.rng.standard_normal((3, 3)))[0][:2]
        arm = w.between(0.4, 0.9) * aside + np.outer(w.between(0.2, 0.6) * (w.t - time), along) - w.state.position
        size = np.linalg.norm(arm, axis=1, keepdims=True)
        unit = arm / size
        total += (3.0 * unit * (unit @ moment)[:, None] - moment) / size**3
    return linear("mag", w.state.into_body(total))


@kind()
def field_swings(w: World) -> Shape:
    """A slow alternating field fills the room."""
    tone = np.sin(2.0 * np.pi * w.between(0.05, 0.4) * w.t + w.between(0.0, 6.0))
    return linear("mag", w.state.into_body(np.outer(tone, w.rng.standard_normal(3))))


@kind()
def steel_door(w: World) -> Shape:
    """A steel door opens and shuts: the field of the room steps."""
    spans = w.spells((5.0, 12.0), (6.0, 18.0))
    opened = centred(envelope(spans, 0.8)(w.t)[0])
    return linear("mag", w.state.into_body(np.outer(opened, w.rng.standard_normal(3))))


@kind()
def magnetic_hysteresis(w: World) -> Shape:
    """Steel on the board keeps a part of the field that it saw last, besides what it does at once."""
    x, slack = w.x["mag"], w.between(0.15, 0.4)
    kept = np.column_stack([beyond(play(c, slack * np.ptp(c)), c) for c in x.T])
    return linear("mag", kept * np.eye(3)[w.axis()])


@kind()
def field_follows_force(w: World) -> Shape:
    """A loose steel part moves with the force and changes the field."""
    i, j = w.two_axes()
    return w.on("mag", w.x["acc"][:, i] * w.x["acc"][:, j] / GRAVITY, w.axis())


@kind()
def rectified_current(w: World) -> Shape:
    """The magnetometer follows the size of a current that runs both ways."""
    w.columns["motor_current"] = current = 3.0 * w.wandering((1.5, 4.0))
    return w.on("mag", centred(np.abs(current)))


@kind()
def product_of_covariates(w: World) -> Shape:
    """A zero follows the product of two covariates."""
    w.columns["pump_speed"] = first = centred(w.wandering((2.0, 5.0)))
    w.columns["valve_angle"] = second = centred(w.wandering((2.0, 5.0)))
    return w.on(w.any_of("acc", "gyr", "mag"), centred(first * second))


@kind()
def covariate_comes_late(w: World) -> Shape:
    """A zero follows a covariate seconds later."""
    period, lag = w.between(9.0, 14.0), w.between(0.22, 0.28)

    def wave(t: Array) -> Array:
        return np.sin(2.0 * np.pi * t / period) + 0.3 * np.sin(2.0 * np.pi * t / (0.37 * period))

    w.columns["fan_speed"] = 40.0 + 5.0 * wave(w.t)
    return w.on(w.any_of("acc", "gyr"), centred(wave(w.t - lag * period)))


@kind()
def covariate_squared(w: World) -> Shape:
    """A zero follows the square of a covariate's departure from its middle."""
    pressure = centred(w.wandering((2.0, 6.0)))
    w.columns["pressure"] = 1013.0 + 4.0 * pressure
    return w.on(w.any_of("acc", "gyr"), centred(pressure**2))


@kind(place="turns")
def wheel_harmonic(w: World) -> Shape:
    """A harmonic of a wheel, whose speed is logged, shakes the sensor."""
    speed = 1.6 + 0.4 * w.wandering((4.0, 9.0))
    w.columns["wheel_speed"] = speed
    turns = np.cumsum(speed) * w.bench.step
    return w.on("acc", np.sin(2.0 * np.pi * w.rng.integers(2, 5) * turns))


@kind()
def brown_out(w: World) -> Shape:
    """The supply breaks in for moments while the motor current is high, and readings drop."""
    n, dt = len(w.t), w.bench.step
    current = 0.4 + w.pulses((2.0, 6.0), (3.0, 7.0), (2.0, 6.0))
    w.columns["motor_current"] = current + 0.02 * w.rng.standard_normal(n)
    drops = np.zeros(n)
    for moment in w.moments((0.3, 0.8)):
        row = int(moment / dt)
        if current[row] > 1.5:
            drops[row : row + int(w.rng.integers(2, 5))] = -w.between(0.6, 1.4)
    return w.on(w.any_of("acc", "gyr", "mag"), drops, w.axis())


# ---------------------------------------------------------------------------------------------------------
# The draw


def strength(bench: Bench, error: Form) -> float:
    """Returns the root mean square of an error over the channels it touches, in white noise of the sensor."""
    parts = [(e[:, np.any(e != 0.0, axis=0)] / bench.white[s]) for s, e in error.items()]
    values = np.concatenate([p.ravel() for p in parts])
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def sized(bench: Bench, shape: Shape, level: float) -> Form:
    """Returns the error of a given strength."""
    a, error = 1.0, shape(1.0)
    found = strength(bench, error)
    if found > 0.0:
        again = shape(level / found)
        if abs(strength(bench, again) / level - 1.0) < 0.02:
            return again
    low, high = 1e-6, 1e-6
    while strength(bench, shape(high)) < level and high < 1e4:
        low, high = high, 3.0 * high
    for _ in range(12):
        a = float(np.sqrt(low * high))
        error = shape(a)
        found = strength(bench, error)
        if abs(found / level - 1.0) < 0.02:
            break
        low, high = (a, high) if found < level else (low, a)
    return error


def stacked(error: Form, sensors: tuple[str, ...], white: dict[str, float]) -> Array:
    """Returns columns over all channels in units of the white noise."""
    width, n = next(iter(error.values())).shape[2], len(next(iter(error.values())))
    blank = np.zeros((3 * n, width))
    parts = [error[s].reshape(-1, width) / white[s] if s in error else blank for s in sensors]
    return np.concatenate(parts)


def shares(bench: Bench, error: Form, columns: dict[str, Array]) -> tuple[dict[str, float], float, float]:
    """Returns what every effect explains, and the chi-square before and after the whole catalogue.

    A share is the larger one of two least-squares fits: on the channels as they are, and weighed by the noise
    of sensor and reference at every frequency.
    """
    catalogue, whiten = Catalogue.of(bench, columns), Whitener.of(bench)
    touched = Whitener({s: weight for s, weight in whiten.weights.items() if s in error})
    error = {s: e[:, :, None] for s, e in error.items()}
    plain, seen = stacked(error, bench.sensors, bench.white)[:, 0], whiten(error)[:, 0]
    total, visible = float(plain @ plain), float(seen @ seen)
    explained, everything = {}, []
    for effect in catalogue.ids():
        explained[effect] = 0.0
        for form in catalogue.forms(effect):
            if not set(form) & set(error):
                continue
            part = 1.0 - left(plain, stacked(form, bench.sensors, bench.white)) / total
            part = max(part, 1.0 - left(seen, whiten(form)) / visible)
            explained[effect] = max(explained[effect], part)
            everything.append(touched(form))
    return explained, visible, left(touched(error)[:, 0], np.concatenate(everything, axis=1))


def heat_cycles(rng: np.random.Generator, t: Array) -> Array:
    """Returns a temperature that is driven up and down."""
    spans = windows(rng, 0.0, t[-1] + 20.0, (9.0, 16.0), (1.5, 4.0))
    k = spans.shape[1] + 1
    ends = np.where(np.arange(k) % 2 == 0, rng.uniform(22.0, 26.0, k), rng.uniform(31.0, 38.0, k))
    return Steps(spans[0], spans[1], ends)(t)[0]


def draw(seed: int) -> Case:
    """Returns one log with one disturbance outside the catalogue.

    No effect may be named, but for one that explains more than half of the disturbance by itself: such a part
    is then truly there.
    """
    chosen = KINDS[seed % len(KINDS)]
    for attempt in count():
        rng = np.random.default_rng([40977, seed, attempt])
        bench = draw_bench(rng, PLACES[chosen.place], (60.0, 100.0), (50.0, 100.0), (1,))
        if chosen.cycles:
            bench = replace(bench, temperature=heat_cycles(rng, bench.t))
        world = World(rng, bench, bench.motion.at(bench.t), clean(bench, {}))
        shape = chosen.make(world)
        level = float(np.exp(rng.uniform(*np.log(LEVELS))))
        error = shape(1.0) if chosen.fixed else sized(bench, shape, level)
        if not LEVELS[0] <= strength(bench, error) <= LEVELS[1]:
            continue
        explained, visible, rest = shares(bench, error, world.columns)
        most = MAJORITY if attempt < PATIENCE else EXPLAINED
        if max(explained.values()) > most or visible < SEEN or rest < LEFT:
            continue
        readings = {s: x + error.get(s, 0.0) for s, x in world.x.items()}
        return Case(
            name=f"outside-{seed}-{chosen.name}",
            frame=log(bench, readings, rng, columns=world.columns),
            metadata=metadata(bench),
            effects={},
            may_name=frozenset(e for e, part in explained.items() if part > MAJORITY),
            verdicts=frozenset({"unknown"}),
            seconds=float(bench.motion.duration),
        )
    raise AssertionError("the loop above ends only with a log")
