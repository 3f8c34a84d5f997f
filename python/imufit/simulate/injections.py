"""Every effect, done physically: what it does to the setup of sensors, body, rig and reference.

An entry of `INJECTIONS` says which parameters an effect has, how large they typically are, which sensors see it, and at
which stage of the measurement it acts. A further effect is one more entry.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from imufit.simulate.environment import north_and_down
from imufit.simulate.motion import Array, Signal
from imufit.simulate.rig import Backlash, Flexure, Periodic
from imufit.simulate.sensor import SENSORS, Setup, Situation
from imufit.simulate.truth import rotation_from_vector

Parameters = Mapping[str, float]
Stage = Literal["rig", "reference", "mounting", "place", "time", "gain", "disturbance", "range"]

THREE = ("x", "y", "z")
SIX = ("xy", "xz", "yx", "yz", "zx", "zy")
NINE = tuple(row + column for row in THREE for column in THREE)


@dataclass(frozen=True)
class Run:
    """The log for which an effect is set up: reference frame, first and last time (s)."""

    frame: str
    start: float
    stop: float


@dataclass(frozen=True)
class Injection:
    """How one effect gets into the readings.

    Attributes
    ----------
    id : name of the effect.
    typical : parameter names and their typical sizes, SI units.
    sensors : the sensors that see it.
    stage : where in the measurement it acts.
    apply : changes the setup; gets the setup, the parameters and the run.
    inner : draws the parameters that do not scale the effect, such as a time constant.
    positive : whether the scaled parameters are positive by their meaning.
    column : the covariate that it needs, if any.
    vibration : whether it needs a vibrating environment.
    """

    id: str
    typical: Mapping[str, float]
    sensors: tuple[str, ...]
    stage: Stage
    apply: Callable[[Setup, Parameters, Run], None]
    inner: Callable[[np.random.Generator, Run], dict[str, float]] = lambda _rng, _run: {}
    positive: bool = False
    column: str | None = None
    vibration: bool = False

    def direction(self, rng: np.random.Generator, run: Run) -> dict[str, float]:
        """Draw parameters of about typical size and either sign, none of them negligible.

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of randomness.
        run : Run
            The log for which the effect is set up.
        """
        signs = np.ones(len(self.typical)) if self.positive else rng.choice([-1.0, 1.0], len(self.typical))
        drawn = rng.uniform(0.4, 1.0, len(self.typical)) * signs * list(self.typical.values())
        return dict(zip(self.typical, drawn.tolist(), strict=True)) | self.inner(rng, run)

    def scaled(self, direction: Parameters, factor: float, peak: float) -> dict[str, float]:
        """Return parameters with an effect about `factor` times as strong; `peak` is the largest ideal reading.

        Parameters
        ----------
        direction : mapping of str to float
            Parameters as `direction` drew them, SI units.
        factor : float
            Times as strong.
        peak : float
            Largest ideal reading, in the sensor's unit.
        """
        if self.stage == "range":
            return {"range": peak / (1.0 + 0.01 * factor)}
        return {name: value * factor if name in self.typical else value for name, value in direction.items()}

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of all parameters, in order."""
        return tuple(self.direction(np.random.default_rng(0), Run("NED", 0.0, 1.0)))

    @property
    def required(self) -> tuple[str, ...]:
        """Names of the parameters that have no default of zero: those that are single, or not scaled."""
        return tuple(n for n in self.parameters if n not in self.typical or len(self.typical) == 1)


def vector(p: Parameters) -> Array:
    """Return the parameters x, y, z as an array (3,)."""
    return np.array([p[name] for name in THREE])


def matrix(p: Parameters) -> Array:
    """Return the parameters xx ... zz, those of them that there are, as a matrix (3, 3)."""
    return np.array([[p.get(row + column, 0.0) for column in THREE] for row in THREE])


def _gain(sensor: str, gain: Callable[[Parameters], Array]) -> Callable[[Setup, Parameters, Run], None]:
    def apply(setup: Setup, p: Parameters, _run: Run) -> None:
        setup.sensors[sensor].gain = setup.sensors[sensor].gain + gain(p)

    return apply


def _disturbance(
    sensor: str, shape: Callable[[Situation, Parameters], Array]
) -> Callable[[Setup, Parameters, Run], None]:
    def apply(setup: Setup, p: Parameters, _run: Run) -> None:
        setup.sensors[sensor].disturbances.append(lambda situation: shape(situation, p))

    return apply


def _times(course: Array, p: Parameters) -> Array:
    return np.multiply.outer(course, vector(p))


def _three(size: float) -> dict[str, float]:
    return dict.fromkeys(THREE, size)


def _constant(situation: Situation, p: Parameters) -> Array:
    return np.broadcast_to(vector(p), situation.input.shape)


def _disturbances() -> list[Injection]:
    """List the effects that add to the output of one sensor."""

    def entry(
        name: str,
        typical: Mapping[str, float],
        shape: Callable[[Situation, Parameters], Array],
        vibration: bool = False,
    ) -> Injection:
        sensor = name.partition(".")[0]
        return Injection(name, typical, (sensor,), "disturbance", _disturbance(sensor, shape), vibration=vibration)

    unit = {"acc": 0.1, "gyr": 0.01, "mag": 2.0}
    full = {"acc": 10.0, "gyr": 2.0, "mag": 50.0}
    entries = [
        entry("mag.hard_iron", _three(5.0), _constant),
        entry("gyr.g_sensitivity", dict.fromkeys(NINE, 2e-4), lambda s, p: s.force @ matrix(p).T),
        entry("gyr.scale_asymmetry", _three(0.005), lambda s, p: vector(p) * np.abs(s.input)),
        entry("mag.current", _three(1.0), lambda s, p: _times(s.current, p)),
    ]
    for sensor in SENSORS:
        u, x = unit[sensor], full[sensor]
        entries += [
            entry(f"{sensor}.bias_temperature", _three(0.1 * u), lambda s, p: _times(s.warmth, p)),
            entry(f"{sensor}.scale_temperature", _three(5e-4), lambda s, p: _times(s.warmth, p) * s.input),
        ]
        if sensor == "mag":
            continue
        entries += [
            entry(f"{sensor}.bias", _three(u), _constant),
            entry(f"{sensor}.bias_drift", _three(0.01 * u), lambda s, p: _times(s.since, p)),
            entry(f"{sensor}.quadratic", _three(0.01 / x), lambda s, p: vector(p) * s.input**2),
            entry(f"{sensor}.cubic", _three(0.01 / x**2), lambda s, p: vector(p) * s.input**3),
        ]
    entries.append(
        entry("acc.vibration_rectification", _three(0.02), lambda s, p: _times(s.vibration_power, p), vibration=True)
    )
    warmup = entry("gyr.warmup", _three(0.01), lambda s, p: _times(np.exp(-s.since / p["tau"]), p))
    entries.append(
        replace(warmup, inner=lambda rng, run: {"tau": float(rng.uniform(0.08, 0.25) * (run.stop - run.start))})
    )
    return [replace(e, column="motor_current") if e.id == "mag.current" else e for e in entries]


def _gains() -> list[Injection]:
    """List the effects that are a gain of one sensor."""
    entries = []
    for sensor in ("acc", "gyr"):
        scale = _gain(sensor, lambda p: np.diag(vector(p)))
        entries.append(Injection(f"{sensor}.scale", _three(0.02), (sensor,), "gain", scale))
        cross = _gain(sensor, matrix)
        entries.append(Injection(f"{sensor}.misalignment", dict.fromkeys(SIX, 0.01), (sensor,), "gain", cross))
    iron = Injection("mag.soft_iron", dict.fromkeys(NINE, 0.03), ("mag",), "gain", _gain("mag", matrix))
    return [*entries, iron]


def _place(setup: Setup, p: Parameters, _run: Run) -> None:
    setup.sensors["acc"].place = vector(p)


def _times_and_ranges() -> list[Injection]:
    """List the effects by which a sensor is displaced, late, slow or limited."""
    entries = [Injection("acc.lever_arm", _three(0.03), ("acc",), "place", _place)]

    def attribute(sensor: str, name: str, parameter: str) -> Callable[[Setup, Parameters, Run], None]:
        return lambda setup, p, _run: setattr(setup.sensors[sensor], name, p[parameter])

    for sensor in SENSORS:
        late = attribute(sensor, "delay", "tau")
        entries.append(Injection(f"{sensor}.delay", {"tau": 0.01}, (sensor,), "time", late, positive=True))
    for sensor in ("acc", "gyr"):
        slow, limit = attribute(sensor, "lag", "tau"), attribute(sensor, "limit", "range")
        entries.append(Injection(f"{sensor}.lowpass", {"tau": 0.01}, (sensor,), "time", slow, positive=True))
        entries.append(Injection(f"{sensor}.saturation", {"range": 1.0}, (sensor,), "range", limit, positive=True))
    return entries


def _alignment(setup: Setup, p: Parameters, _run: Run) -> None:
    setup.mount = rotation_from_vector(vector(p))


def _tilt(setup: Setup, p: Parameters, _run: Run) -> None:
    setup.base = rotation_from_vector(np.array([p["x"], p["y"], 0.0]))


def _late_reference(setup: Setup, p: Parameters, _run: Run) -> None:
    setup.reference_delay = p["tau"]


def _field(setup: Setup, p: Parameters, _run: Run) -> None:
    setup.environment = replace(setup.environment, field=setup.environment.field + vector(p))


def _earth_rate(setup: Setup, p: Parameters, run: Run) -> None:
    north, down = north_and_down(run.frame)
    rate = p["north"] * north - p["vertical"] * down
    setup.sensors["gyr"].disturbances.append(lambda s: np.swapaxes(s.rotation, 1, 2) @ rate)


def _references() -> list[Injection]:
    """List the effects of the reference and of the world around it."""
    return [
        Injection("ref.alignment", _three(0.02), SENSORS, "mounting", _alignment),
        Injection("ref.tilt", {"x": 0.02, "y": 0.02}, ("acc", "mag"), "mounting", _tilt),
        Injection("ref.delay", {"tau": 0.01}, SENSORS, "reference", _late_reference, positive=True),
        Injection("mag.field_reference", _three(2.0), ("mag",), "reference", _field),
        Injection("gyr.earth_rate", {"north": 5e-5, "vertical": 5e-5}, ("gyr",), "disturbance", _earth_rate),
    ]


def _commanded(setup: Setup) -> Signal:
    joint = setup.trajectory.rig_joint
    if joint is None:
        raise ValueError("rig effects need a one-axis rig: use the scenario 'tilt'")
    return joint.angle


def _backlash(setup: Setup, p: Parameters, run: Run) -> None:
    axis = Backlash(_commanded(setup), p["width"], run.start - 1.0, run.stop + 1.0)
    setup.trajectory = setup.trajectory.with_rig_angle(axis)


def _flexure(setup: Setup, p: Parameters, _run: Run) -> None:
    setup.trajectory = setup.trajectory.with_rig_angle(Flexure(_commanded(setup), p["k"]))


def _periodic(setup: Setup, p: Parameters, _run: Run) -> None:
    axis = Periodic(_commanded(setup), p["a"], p["b"], round(p["N"]))
    setup.trajectory = setup.trajectory.with_rig_angle(axis)


def _rigs() -> list[Injection]:
    """List the effects of the rig that moves the sensor."""
    periodic = Injection("rig.periodic", {"a": 2e-3, "b": 2e-3}, SENSORS, "rig", _periodic)
    return [
        Injection("rig.backlash", {"width": 5e-3}, SENSORS, "rig", _backlash, positive=True),
        Injection("rig.flexure", {"k": 5e-3}, SENSORS, "rig", _flexure),
        replace(periodic, inner=lambda rng, _run: {"N": float(rng.integers(8, 25))}),
    ]


INJECTIONS: Mapping[str, Injection] = {
    entry.id: entry for entry in (*_gains(), *_disturbances(), *_times_and_ranges(), *_references(), *_rigs())
}
"""Every effect by its name, except `SENSOR.column:NAME`, of which there is one for each column: see `injection`."""


def injection(effect: str) -> Injection:
    """Return the injection for an effect's name, among them `acc.column:NAME`, `gyr.column:NAME`, `mag.column:NAME`.

    Parameters
    ----------
    effect : str
        Its id.
    """
    if effect in INJECTIONS:
        return INJECTIONS[effect]
    prefix, _, column = effect.partition(":")
    sensor = prefix.removesuffix(".column")
    if column and sensor in SENSORS and sensor != prefix:
        if (sensor, column) == ("mag", "motor_current"):
            raise ValueError("the effect of motor_current on the magnetometer has a name of its own: mag.current")
        typical = {"acc": 0.1, "gyr": 5e-3, "mag": 1.0}[sensor]
        apply = _disturbance(sensor, lambda s, p: _times(s.covariates[column], p))
        return Injection(effect, _three(typical), (sensor,), "disturbance", apply, column=column)
    raise ValueError(f"unknown effect {effect!r}: use one of {', '.join(INJECTIONS)}, SENSOR.column:NAME")


def order(effect: str) -> int:
    """Return when an effect is applied among others: the stage of the measurement at which it acts."""
    stages: tuple[Stage, ...] = ("rig", "reference", "mounting", "place", "time", "gain", "disturbance", "range")
    return stages.index(injection(effect).stage)
