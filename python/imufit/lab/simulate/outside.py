"""Effects that no catalogue holds, done physically: what is to be answered with "something, but nothing I know".

Each adds an error to one sensor, is drawn with random parameters like an effect of `INJECTIONS`, with its cause stated.
Errors that would come with an offset are taken about their mean: the sensor was zeroed before.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from imufit.lab.simulate.entry import Injection, Parameters, Run, disturbance_of, three, times, vector
from imufit.lab.simulate.motion import Array
from imufit.lab.simulate.sensor import Situation

AXES = ("x", "y", "z")
EVERYWHERE = ("turntable", "poses", "arm", "handheld")
LIVELY = ("arm", "handheld")


@dataclass(frozen=True)
class Outside:
    """An effect outside the catalogue.

    Attributes
    ----------
    kind : what it is, in words.
    injection : how it gets into the readings.
    causes : for each axis of the sensor the log's quantities that cause it there; empty where none does.
    scenarios : motions that show it.
    """

    kind: str
    injection: Injection
    causes: tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]
    scenarios: tuple[str, ...]


def centred(course: Array) -> Array:
    """Return a course (n,) or (n, 3) less its mean."""
    return np.asarray(course - np.mean(course, axis=0), dtype=np.float64)


def vee(course: Array) -> Array:
    """Return the distance of a course from the middle of its range, less the mean of that: a V."""
    middle = 0.5 * (np.min(course) + np.max(course))
    return centred(np.abs(course - middle))


def beyond(course: Array, share: float) -> Array:
    """Return by how much a course exceeds the value under which `share` of it lies; zero below; less its mean."""
    return centred(np.maximum(course - np.quantile(course, share), 0.0))


def play(course: Array, width: float) -> Array:
    """Return what a mechanism with play of this width makes of a course: it follows only after the play is used up."""
    half, now = 0.5 * width, float(course[0])
    low, high = (course - half).tolist(), (course + half).tolist()
    followed = np.empty(course.size)
    for i in range(course.size):
        now = min(max(now, low[i]), high[i])
        followed[i] = now
    return followed


def past(course: Array, since: Array, forgotten: float) -> Array:
    """Return what something that forgets in `forgotten` seconds remembers of a course (n, k) at times `since`."""
    new = -np.expm1(-np.diff(since) / forgotten)
    remembered = np.empty_like(course)
    remembered[0] = course[0]
    for i, share in enumerate(new.tolist(), start=1):
        remembered[i] = remembered[i - 1] + share * (course[i] - remembered[i - 1])
    return remembered


def _creep(s: Situation, p: Parameters) -> Array:
    """Follow a part x, y, z of every change only little by little."""
    return vector(p) * (past(s.input, s.since, p["forgotten"]) - s.input)


def _knocked(s: Situation, p: Parameters) -> Array:
    """Turn the sensor by x, y, z (rad) in its mounting at one instant, half of it the other way before."""
    side = np.where(s.since > p["at"] * s.since[-1], 0.5, -0.5)
    return np.cross(s.input, side[:, None] * vector(p))


def _tone(s: Situation, p: Parameters) -> Array:
    return times(np.sin(2.0 * np.pi * p["frequency"] * s.since + p["phase"]), p)


def _loose(s: Situation, p: Parameters) -> Array:
    """Jump to another level and back, each stay as long as chance (`pattern`) makes it."""
    rng = np.random.default_rng(int(p["pattern"]))
    stays = rng.exponential(np.tile([p["stay"], 4.0 * p["stay"]], 1000)) + 0.5 * p["stay"]
    away = np.searchsorted(np.cumsum(stays), s.since) % 2 == 1
    return times(centred(away.astype(np.float64)), p)


def _twice_round(s: Situation, p: Parameters) -> Array:
    """Go up and down twice in a whole turn of the heading."""
    x, y = s.rotation[:, 0, 0], s.rotation[:, 1, 0]
    return times(centred(np.cos(2.0 * np.arctan2(y, x))), p)


def _speed(s: Situation, p: Parameters) -> Array:
    velocity = np.gradient(s.position, s.since, axis=0)
    return times(centred(np.sum(velocity**2, axis=1)), p)


def _hysteresis(s: Situation, p: Parameters) -> Array:
    """Add c while it cools, subtract it while it warms, and turn over within a quarter of the temperature's range."""
    width = p["width"] * float(np.ptp(s.warmth))
    return times(2.0 * (play(s.warmth, width) - s.warmth) / width, p)


def _dead_zone(s: Situation, p: Parameters) -> Array:
    """Show nothing of a rate (or force) that is smaller than x, y, z on its axis."""
    return np.where(np.abs(s.input) < vector(p), -s.input, 0.0)


def _step(s: Situation, p: Parameters) -> Array:
    return times(centred((s.since > p["at"] * s.since[-1]).astype(np.float64)), p)


def _while(s: Situation, p: Parameters) -> Array:
    """Add another level for a while."""
    begin, length = p["at"] * s.since[-1], p["length"] * s.since[-1]
    return times(centred(((s.since > begin) & (s.since < begin + length)).astype(np.float64)), p)


def _passing_by(s: Situation, p: Parameters) -> Array:
    """Add the field of a magnet that passes at constant speed: it falls with the cube of the distance."""
    away = (s.since - p["at"] * s.since[-1]) / (p["width"] * s.since[-1])
    return times(centred((1.0 + away**2) ** -1.5), p)


def _gradient(s: Situation, p: Parameters) -> Array:
    """Let the field vary in space as a field without sources may: its gradient is symmetric and has no trace."""
    g = np.array([[p["x"], p["xy"], p["xz"]], [p["xy"], p["y"], p["yz"]], [p["xz"], p["yz"], -p["x"] - p["y"]]])
    field = centred(s.position) @ g
    return np.asarray(np.einsum("nji,nj->ni", s.rotation, field), dtype=np.float64)


def _next(course: Array) -> Array:
    """Return for x, y, z of a course (n, 3) that of y, z, x."""
    return course[:, [1, 2, 0]]


Shape = Callable[[Situation, Parameters], Array]
Inner = Callable[[np.random.Generator, Run], dict[str, float]]


def _nothing_inside(_rng: np.random.Generator, _run: Run) -> dict[str, float]:
    return {}


def _outside(
    name: str,
    kind: str,
    size: float | Mapping[str, float],
    shape: Shape,
    causes: Sequence[str] = (),
    *,
    own: str = "",
    of_next: str = "",
    scenarios: tuple[str, ...] = EVERYWHERE,
    inner: Inner = _nothing_inside,
    positive: bool = False,
) -> Outside:
    """Make an entry; `own` and `of_next` are vectors of which the axis itself, or the next one, is the cause."""
    sensor = name.partition(".")[0]
    typical = three(size) if isinstance(size, float) else dict(size)
    each = [
        (*causes, *([f"{own}_{AXES[k]}"] if own else []), *([f"{of_next}_{AXES[(k + 1) % 3]}"] if of_next else []))
        for k in range(3)
    ]
    entry = Injection(
        name, typical, (sensor,), "disturbance", disturbance_of(sensor, shape), inner=inner, positive=positive
    )
    return Outside(kind, entry, (each[0], each[1], each[2]), scenarios)


def _beat(rng: np.random.Generator, run: Run) -> dict[str, float]:
    """Draw a second harmonic of the mains that, sampled at 100 Hz, beats two to seven times during the log."""
    beats = rng.uniform(2.0, 7.0) * rng.choice([-1.0, 1.0])
    return {"frequency": 100.0 + float(beats) / (run.stop - run.start), "phase": float(rng.uniform(-np.pi, np.pi))}


def _pitch(rng: np.random.Generator, _run: Run) -> dict[str, float]:
    """Draw a frequency between a fifth of a hertz and eight."""
    return {"frequency": float(0.2 * 40.0 ** rng.uniform()), "phase": float(rng.uniform(-np.pi, np.pi))}


def _pattern(rng: np.random.Generator, _run: Run) -> dict[str, float]:
    """Draw how long a contact is lost in the middle, s, and what its stays are drawn from."""
    return {"stay": float(rng.uniform(0.8, 2.0)), "pattern": float(rng.integers(1 << 30))}


def _somewhere(low: float, high: float, name: str) -> Inner:
    return lambda rng, _run: {name: float(rng.uniform(low, high))}


def _some_time(length: str) -> Inner:
    """Draw when something happens and, under the name `length`, how long it lasts, in parts of the log."""
    return lambda rng, _run: {"at": float(rng.uniform(0.2, 0.7)), length: float(rng.uniform(0.03, 0.15))}


_GRADIENT = {"x": 3.0, "y": 3.0, "xy": 3.0, "xz": 3.0, "yz": 3.0}

OUTSIDE: Mapping[str, Outside] = {
    entry.injection.id: entry
    for entry in (
        _outside(
            "gyr.current_vee",
            "V over the current",
            5e-3,
            lambda s, p: times(vee(s.covariates["motor_current"]), p),
            ["motor_current"],
        ),
        _outside(
            "mag.current_vee",
            "V over the current",
            1.0,
            lambda s, p: times(vee(s.covariates["motor_current"]), p),
            ["motor_current"],
        ),
        _outside(
            "acc.voltage_threshold",
            "beyond a voltage",
            1.0,
            lambda s, p: times(beyond(-s.covariates["vbat"], p["share"]), p),
            ["vbat"],
            inner=_somewhere(0.75, 0.9, "share"),
        ),
        _outside(
            "gyr.current_threshold",
            "beyond a current",
            5e-3,
            lambda s, p: times(beyond(s.covariates["motor_current"], p["share"]), p),
            ["motor_current"],
            inner=_somewhere(0.75, 0.9, "share"),
        ),
        _outside(
            "gyr.temperature_vee",
            "V over the temperature",
            2e-3,
            lambda s, p: times(vee(s.warmth), p),
            ["temp"],
        ),
        _outside(
            "acc.temperature_quadratic",
            "parabola over the temperature",
            5e-3,
            lambda s, p: times(centred((s.warmth - p["at"] * np.ptp(s.warmth)) ** 2), p),
            ["temp"],
            inner=_somewhere(-0.1, 0.1, "at"),
        ),
        _outside(
            "acc.thermal_hysteresis",
            "thermal hysteresis",
            0.05,
            _hysteresis,
            ["temp", "t"],
            inner=_somewhere(0.15, 0.3, "width"),
        ),
        _outside(
            "gyr.thermal_hysteresis",
            "thermal hysteresis",
            5e-3,
            _hysteresis,
            ["temp", "t"],
            inner=_somewhere(0.15, 0.3, "width"),
        ),
        _outside(
            "gyr.scale_current",
            "gain follows the current",
            5e-3,
            lambda s, p: vector(p) * s.covariates["motor_current"][:, None] * s.input,
            ["motor_current"],
            own="omega",
            scenarios=("turntable", *LIVELY),
        ),
        _outside(
            "acc.scale_voltage",
            "gain follows the voltage",
            0.05,
            lambda s, p: vector(p) * s.covariates["vbat"][:, None] * s.input,
            ["vbat"],
            own="f",
        ),
        _outside(
            "gyr.dead_zone",
            "dead zone about zero rate",
            0.05,
            _dead_zone,
            own="omega",
            positive=True,
            scenarios=("turntable", *LIVELY),
        ),
        _outside(
            "acc.dead_zone",
            "dead zone about zero force",
            0.3,
            _dead_zone,
            own="f",
            positive=True,
            scenarios=("turntable", *LIVELY),
        ),
        _outside("gyr.bias_step", "step of the bias", 5e-3, _step, ["t"], inner=_somewhere(0.2, 0.8, "at")),
        _outside("acc.bias_step", "step of the bias", 0.05, _step, ["t"], inner=_somewhere(0.2, 0.8, "at")),
        _outside("acc.mains_hum", "hum that beats with the sampling", 0.05, _tone, inner=_beat),
        _outside("mag.mains_hum", "hum that beats with the sampling", 1.0, _tone, inner=_beat),
        _outside(
            "gyr.cross_rate",
            "follows the size of another axis' rate",
            0.01,
            lambda s, p: vector(p) * centred(np.abs(_next(s.omega))),
            of_next="omega",
            scenarios=("turntable", *LIVELY),
        ),
        _outside(
            "gyr.force_squared",
            "follows the square of the force",
            1e-4,
            lambda s, p: vector(p) * centred(s.force**2),
            own="f",
        ),
        _outside(
            "acc.current_voltage",
            "product of two covariates",
            0.1,
            lambda s, p: times(s.covariates["motor_current"] * s.covariates["vbat"], p),
            ["motor_current", "vbat"],
        ),
        _outside(
            "gyr.warmth_current",
            "product of two covariates",
            1e-3,
            lambda s, p: times(s.covariates["motor_current"] * s.warmth, p),
            ["motor_current", "temp"],
        ),
        _outside(
            "mag.field_gradient",
            "field that varies in space",
            _GRADIENT,
            _gradient,
            ["ref_px", "ref_py", "ref_pz"],
            scenarios=("arm",),
        ),
        _outside("mag.passing_magnet", "a magnet passes by", 3.0, _passing_by, ["t"], inner=_some_time("width")),
        _outside("acc.other_level", "another level for a while", 0.05, _while, ["t"], inner=_some_time("length")),
        _outside("gyr.other_level", "another level for a while", 5e-3, _while, ["t"], inner=_some_time("length")),
        _outside("gyr.tone", "oscillation of one frequency", 5e-3, _tone, ["t"], inner=_pitch),
        _outside("acc.tone", "oscillation of one frequency", 0.05, _tone, ["t"], inner=_pitch),
        _outside("gyr.loose_contact", "jumps between two levels", 5e-3, _loose, ["t"], inner=_pattern),
        _outside(
            "acc.creep", "creeps after every change", 0.01, _creep, own="f", inner=_somewhere(2.0, 8.0, "forgotten")
        ),
        _outside(
            "gyr.current_memory",
            "remembers the current",
            5e-3,
            lambda s, p: times(centred(past(s.covariates["motor_current"], s.since, p["forgotten"])), p),
            ["motor_current"],
            inner=_somewhere(4.0, 12.0, "forgotten"),
        ),
        _outside(
            "acc.warm_misalignment",
            "misalignment follows the temperature",
            1e-3,
            lambda s, p: vector(p) * s.warmth[:, None] * _next(s.input),
            ["temp"],
            of_next="f",
        ),
        _outside(
            "acc.knock",
            "mounting knocked askew",
            0.01,
            _knocked,
            ["t"],
            inner=_somewhere(0.3, 0.7, "at"),
            scenarios=("turntable", "poses", "handheld"),
        ),
        _outside(
            "acc.scale_rate",
            "gain follows the square of the rate",
            1e-3,
            lambda s, p: vector(p) * np.sum(s.omega**2, axis=1)[:, None] * s.input,
            ["omega_norm"],
            own="f",
            scenarios=LIVELY,
        ),
        _outside("acc.heading", "twice round with the heading", 0.05, _twice_round, ["heading"], scenarios=LIVELY),
        _outside("gyr.speed", "follows the square of the speed", 0.02, _speed, ["speed"], scenarios=("arm",)),
        _outside(
            "mag.squared",
            "follows the square of the field",
            1e-3,
            lambda s, p: vector(p) * centred(s.input**2),
            own="m",
        ),
    )
}
"""Every effect outside the catalogue by its name."""
