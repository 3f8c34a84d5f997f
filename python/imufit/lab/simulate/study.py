"""The setting of a simulated log before anything is injected: motion, environment, rows, and a measure for effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from imufit.lab.simulate.courses import Course
from imufit.lab.simulate.entry import Run
from imufit.lab.simulate.environment import (
    Environment,
    Temperature,
    Vibration,
    covariate,
    field_vector,
    gravity_vector,
    stream,
)
from imufit.lab.simulate.injections import injection
from imufit.lab.simulate.noise import Noise, magnetometer_rows, sampling_times
from imufit.lab.simulate.scenarios import SCENARIOS, build
from imufit.lab.simulate.sensor import SENSORS, Rows
from imufit.lab.simulate.size import SIZES, Scale

AXES = ("x", "y", "z")

COARSE_LAG_STEP = 4e-3
"""Step (s) on which a lag is solved where effects are only held against each other."""


class Study:
    """The data that effects are tried out on, or injected into; arguments as in `simulate`, effects by name.

    Attributes
    ----------
    scenario, seed, rate : as given.
    trajectory, environment, noise : what the log is made from.
    rows, run : its rows.
    names : what the log has: of "acc", "gyr", "mag", "temp".
    scale : measures effects in this log.
    """

    def __init__(
        self,
        scenario: str,
        effects: Sequence[str],
        seed: int = 0,
        duration: float = 120.0,
        rate: float = 100.0,
        *,
        frame: str = "NED",
        sensors: Sequence[str] | None = None,
        covariates: Sequence[str] = (),
        courses: Mapping[str, Course] | None = None,
        noise: Noise | None = None,
        realistic: bool = False,
        rig_axis: str = "x",
    ) -> None:
        if not (duration * rate >= 2.0 and np.isfinite(duration * rate) and rate > 0.0):
            raise ValueError(f"duration {duration} s at {rate} Hz does not make two rows")
        if rig_axis not in AXES:
            raise ValueError(f"rig_axis is {rig_axis!r}: use x, y or z")
        self.scenario, self.seed, self.rate = scenario, seed, rate
        self.trajectory = build(scenario, stream(seed, f"motion {scenario}"), duration, frame, AXES.index(rig_axis))
        kind = SCENARIOS[scenario]
        self.names = kind.sensors if sensors is None else _known_sensors(sensors)
        self.noise = noise or (Noise.realistic() if realistic else kind.noise())
        self.environment = _environment(
            effects, seed, duration, rate, frame=frame, covariates=covariates, courses=courses or {}, field=kind.field
        )
        t = sampling_times(self.noise, seed, duration, rate)
        self.rows, self.run = Rows(t), Run(frame, float(t[0]), float(t[-1]))
        every = np.ones(t.size, dtype=np.bool_)
        sampled = {"acc": every, "gyr": every, "mag": magnetometer_rows(self.noise, t)}
        sampled = {name: rows for name, rows in sampled.items() if name in self.names}
        white = self.noise.white()
        if self.environment.vibration is not None:
            # A reference does not show shaking: it is noise to any reader that looks at the log.
            white["acc"] = float(np.hypot(white["acc"], self.environment.vibration.rms(t)))
        self.scale = Scale(self.trajectory, self.environment, self.run, self.rows, sampled=sampled, white=white)

    def coarse(self, rate: float = 10.0) -> tuple[Scale, float]:
        """Return a measure that looks at about `rate` rows a second, and how many rows stand behind each of these."""
        step = max(1, round(self.rate / rate)) | 1
        whole = self.scale
        sampled = {name: rows[::step] for name, rows in whole.sampled.items()}
        part = Scale(
            self.trajectory,
            self.environment,
            self.run,
            Rows(self.rows.t[::step], COARSE_LAG_STEP),
            sampled=sampled,
            white=whole.white,
        )
        return part, float(step)

    def draw(self, effect: str, size: str | float, attempt: int = 0) -> dict[str, float]:
        """Return random parameters with which `effect` has this size; each attempt draws others."""
        self._check_seen(effect)
        if isinstance(size, str) and size not in SIZES:
            raise ValueError(f"unknown size {size!r}: use {', '.join(SIZES)} or a number")
        wanted = SIZES[size] if isinstance(size, str) else float(size)
        if not (wanted > 0.0 and np.isfinite(wanted)):
            raise ValueError(f"size is {size}: it must be positive")
        return self.scale.draw(effect, wanted, stream(self.seed, f"effect {effect} {attempt}"))

    def complete(self, effect: str, given: Mapping[str, float]) -> dict[str, float]:
        """Return `given` in order, with zero for parameters not named; ValueError for what is not a parameter."""
        self._check_seen(effect)
        entry = injection(effect)
        if unknown := [name for name in given if name not in entry.parameters]:
            raise ValueError(f"{effect} has no parameter {unknown[0]!r}: it has {', '.join(entry.parameters)}")
        if missing := [name for name in entry.required if name not in given]:
            raise ValueError(f"{effect} needs the parameter {missing[0]!r}")
        if bad := [name for name, value in given.items() if not np.isfinite(value)]:
            raise ValueError(f"{effect}: the parameter {bad[0]!r} is not finite")
        if low := [name for name, value in given.items() if entry.positive and value < 0.0]:
            raise ValueError(f"{effect}: the parameter {low[0]!r} must not be negative")
        return {name: float(given.get(name, 0.0)) for name in entry.parameters}

    def _check_seen(self, effect: str) -> None:
        seen_by = injection(effect).sensors
        if not any(name in self.names for name in seen_by):
            raise ValueError(f"{effect} needs {' or '.join(seen_by)}, which this log does not have")


def _known_sensors(sensors: Sequence[str]) -> tuple[str, ...]:
    for name in sensors:
        if name not in (*SENSORS, "temp"):
            raise ValueError(f"unknown sensor {name!r}: use acc, gyr, mag, temp")
    return tuple(sensors)


def _environment(
    effects: Sequence[str],
    seed: int,
    duration: float,
    rate: float,
    *,
    frame: str,
    covariates: Sequence[str],
    courses: Mapping[str, Course],
    field: tuple[float, float],
) -> Environment:
    needed = [injection(name) for name in effects]
    columns = [*covariates, *(entry.column for entry in needed if entry.column is not None)]
    columns += [name for name in courses if name != "temp"]
    vibrating = any(entry.vibration for entry in needed)
    return Environment(
        gravity=gravity_vector(frame),
        field=field_vector(frame, field),
        temperature=courses.get("temp") or Temperature.random(stream(seed, "temperature"), duration),
        covariates={name: courses.get(name) or covariate(name, seed, duration) for name in dict.fromkeys(columns)},
        vibration=Vibration.random(stream(seed, "vibration"), duration, rate) if vibrating else None,
    )
