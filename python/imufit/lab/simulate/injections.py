"""Every effect, done physically: what it does to the setup of sensors, body, rig and reference.

An entry of `INJECTIONS` states which parameters an effect has, how large they typically are, which sensors see it, and
at which stage of the measurement it acts. A further effect is one more entry.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from imufit.lab.simulate.entry import (
    NINE,
    SIX,
    Injection,
    Parameters,
    Run,
    Stage,
    disturbance_of,
    gain_of,
    matrix,
    three,
    times,
    vector,
)
from imufit.lab.simulate.environment import north_and_down
from imufit.lab.simulate.motion import Array, Signal
from imufit.lab.simulate.outside import OUTSIDE
from imufit.lab.simulate.rig import Backlash, Flexure, Periodic
from imufit.lab.simulate.sensor import SENSORS, Setup, Situation
from imufit.lab.simulate.truth import rotation_from_vector


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
        return Injection(name, typical, (sensor,), "disturbance", disturbance_of(sensor, shape), vibration=vibration)

    unit = {"acc": 0.1, "gyr": 0.01, "mag": 2.0}
    full = {"acc": 10.0, "gyr": 2.0, "mag": 50.0}
    entries = [
        entry("mag.hard_iron", three(5.0), _constant),
        entry("gyr.g_sensitivity", dict.fromkeys(NINE, 2e-4), lambda s, p: s.force @ matrix(p).T),
        entry("gyr.scale_asymmetry", three(0.005), lambda s, p: vector(p) * np.abs(s.input)),
        replace(entry("mag.current", three(1.0), lambda s, p: times(s.current, p)), column="motor_current"),
    ]
    for sensor in SENSORS:
        u, x = unit[sensor], full[sensor]
        entries += [
            entry(f"{sensor}.bias_temperature", three(0.1 * u), lambda s, p: times(s.warmth, p)),
            entry(f"{sensor}.scale_temperature", three(5e-4), lambda s, p: times(s.warmth, p) * s.input),
        ]
        if sensor == "mag":
            continue
        entries += [
            entry(f"{sensor}.bias", three(u), _constant),
            entry(f"{sensor}.bias_drift", three(0.01 * u), lambda s, p: times(s.since, p)),
            entry(f"{sensor}.quadratic", three(0.01 / x), lambda s, p: vector(p) * s.input**2),
            entry(f"{sensor}.cubic", three(0.01 / x**2), lambda s, p: vector(p) * s.input**3),
        ]
    # The simulated shaking is a tenth of a drone's: the gyroscope's c makes up for that.
    entries += [
        entry(
            f"{sensor}.vibration_rectification", three(size), lambda s, p: times(s.vibration_power, p), vibration=True
        )
        for sensor, size in (("acc", 0.02), ("gyr", 1e-4))
    ]
    warmup = entry("gyr.warmup", three(0.01), lambda s, p: times(np.exp(-s.since / p["tau"]), p))
    entries.append(
        replace(
            warmup,
            inner=lambda rng, run: {"tau": float(rng.uniform(0.08, 0.25) * (run.stop - run.start))},
            trials=lambda length: [{"tau": length * part} for part in (0.08, 0.15, 0.3, 0.6, 1.5)],
        )
    )
    return entries


def _gains() -> list[Injection]:
    """List the effects that are a gain of one sensor."""
    entries = []
    for sensor in ("acc", "gyr"):
        scale = gain_of(sensor, lambda p: np.diag(vector(p)))
        entries.append(Injection(f"{sensor}.scale", three(0.02), (sensor,), "gain", scale))
        cross = gain_of(sensor, matrix)
        entries.append(Injection(f"{sensor}.misalignment", dict.fromkeys(SIX, 0.01), (sensor,), "gain", cross))
    iron = Injection("mag.soft_iron", dict.fromkeys(NINE, 0.03), ("mag",), "gain", gain_of("mag", matrix))
    return [*entries, iron]


def _place(setup: Setup, p: Parameters, _run: Run) -> None:
    setup.sensors["acc"].place = vector(p)


def _times_and_ranges() -> list[Injection]:
    """List the effects by which a sensor is displaced, late, slow or limited."""
    entries = [Injection("acc.lever_arm", three(0.03), ("acc",), "place", _place)]

    def attribute(sensor: str, name: str, parameter: str) -> Callable[[Setup, Parameters, Run], None]:
        return lambda setup, p, _run: setattr(setup.sensors[sensor], name, p[parameter])

    for sensor in SENSORS:
        late = attribute(sensor, "delay", "tau")
        entries.append(
            Injection(f"{sensor}.delay", {"tau": 0.01}, (sensor,), "time", late, positive=True, late="delay")
        )
    for sensor in ("acc", "gyr"):
        slow, limit = attribute(sensor, "lag", "tau"), attribute(sensor, "limit", "range")
        entries.append(
            Injection(f"{sensor}.lowpass", {"tau": 0.01}, (sensor,), "time", slow, positive=True, late="lag")
        )
        entries.append(Injection(f"{sensor}.saturation", {"range": 1.0}, (sensor,), "range", limit, positive=True))
    return entries


def _alignment(setup: Setup, p: Parameters, _run: Run) -> None:
    setup.mount = rotation_from_vector(vector(p))


def _tilt(setup: Setup, p: Parameters, _run: Run) -> None:
    setup.base = rotation_from_vector(np.array([p["x"], p["y"], 0.0]))


def _late_reference(setup: Setup, p: Parameters, _run: Run) -> None:
    setup.recorder = replace(setup.recorder, delay=p["tau"])


def _drifting_reference(setup: Setup, p: Parameters, run: Run) -> None:
    setup.recorder = replace(setup.recorder, skew=p["k"], start=run.start)


def _smoothed_reference(setup: Setup, p: Parameters, _run: Run) -> None:
    setup.recorder = replace(setup.recorder, smoothing=p["c"])


def _field(setup: Setup, p: Parameters, _run: Run) -> None:
    setup.environment = replace(setup.environment, field=setup.environment.field + vector(p))


def _earth_rate(setup: Setup, p: Parameters, run: Run) -> None:
    north, down = north_and_down(run.frame)
    rate = p["north"] * north - p["vertical"] * down
    setup.sensors["gyr"].disturbances.append(lambda s: np.swapaxes(s.rotation, 1, 2) @ rate)


def _references() -> list[Injection]:
    """List the effects of the reference and of the world around it."""
    return [
        Injection("ref.alignment", three(0.02), SENSORS, "mounting", _alignment),
        Injection("ref.tilt", {"x": 0.02, "y": 0.02}, ("acc", "mag"), "mounting", _tilt),
        Injection("ref.delay", {"tau": 0.01}, SENSORS, "reference", _late_reference, positive=True, late="delay"),
        Injection("ref.skew", {"k": 1e-4}, SENSORS, "reference", _drifting_reference),
        Injection("ref.lowpass", {"c": 1e-4}, SENSORS, "reference", _smoothed_reference, positive=True),
        Injection("mag.field_reference", three(2.0), ("mag",), "reference", _field),
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
        replace(
            periodic,
            inner=lambda rng, _run: {"N": float(rng.integers(8, 25))},
            trials=lambda _length: [{"N": float(order)} for order in range(4, 26)],
        ),
    ]


INJECTIONS: Mapping[str, Injection] = {
    entry.id: entry for entry in (*_gains(), *_disturbances(), *_times_and_ranges(), *_references(), *_rigs())
}
"""The catalogue's effects by name, except `SENSOR.column:NAME`, of which each column has one: see `injection`."""


def effect_of_column(sensor: str, column: str) -> str:
    """Return the id of what a column does to a sensor: a name of its own where it has one, else `SENSOR.column:NAME`.

    Parameters
    ----------
    sensor : str
        ``acc``, ``gyr`` or ``mag``.
    column : str
        Name of the covariate.
    """
    named = (entry.id for entry in INJECTIONS.values() if (entry.sensors, entry.column) == ((sensor,), column))
    return next(named, f"{sensor}.column:{column}")


def injection(effect: str) -> Injection:
    """Return the injection for an effect's name, among them `acc.column:NAME`, `gyr.column:NAME`, `mag.column:NAME`.

    Parameters
    ----------
    effect : str
        Its id.
    """
    if effect in INJECTIONS:
        return INJECTIONS[effect]
    if effect in OUTSIDE:
        return OUTSIDE[effect].injection
    prefix, _, column = effect.partition(":")
    sensor = prefix.removesuffix(".column")
    if column and sensor in SENSORS and sensor != prefix:
        if (named := effect_of_column(sensor, column)) != effect:
            raise ValueError(f"the effect of {column} on {sensor} has a separate name: {named}")
        typical = {"acc": 0.1, "gyr": 5e-3, "mag": 1.0}[sensor]
        apply = disturbance_of(sensor, lambda s, p: times(s.covariates[column], p))
        return Injection(effect, three(typical), (sensor,), "disturbance", apply, column=column)
    raise ValueError(f"unknown effect {effect!r}: use one of {', '.join(INJECTIONS)}, SENSOR.column:NAME")


def order(effect: str) -> int:
    """Return when an effect is applied among others: the stage of the measurement at which it acts."""
    stages: tuple[Stage, ...] = ("rig", "reference", "mounting", "place", "time", "gain", "disturbance", "range")
    return stages.index(injection(effect).stage)
