"""Three-axis sensors on a moving body, from the true motion to the digits.

Order of things: the sensor sits at its place on the body and feels the motion as it was one delay ago; a lag smooths
that; gains and disturbances act on it; noise comes on top; the output is rounded and cannot leave its range.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from imufit.lab.simulate.environment import Environment
from imufit.lab.simulate.motion import Array
from imufit.lab.simulate.noise import SensorNoise
from imufit.lab.simulate.recorder import Recorder
from imufit.lab.simulate.truth import Kinematics, Trajectory

SENSORS = ("acc", "gyr", "mag")
LAG_STEP = 1e-3
"""Step (s) on which the differential equation of a lag is solved."""

LAG_HISTORY = 60.0
"""Time (s) before the log from which a lag is solved at most: sensors are not slower, and the grid stays small."""


KEPT = 6
"""How many motions are kept while effects are tried out."""


@dataclass(frozen=True)
class Situation:
    """Quantities that act on one sensor at the n rows of a log.

    Attributes
    ----------
    input : (n, 3), the true quantity at the sensor, body frame, its unit.
    force : (n, 3), true specific force at the body's origin, body frame, m/s^2.
    rotation : (n, 3, 3), true attitude of the sensor's axes, to the reference frame.
    omega : (n, 3), true angular rate, body frame, rad/s.
    position : (n, 3), true position of the body's origin, reference frame, m.
    since : (n,), time since the start of the log, s.
    warmth : (n,), temperature less its mean over the log, K.
    covariates : (n,) each, less their means over the log.
    current : (n,), motor current, A; NaN without a motor.
    vibration_power : (n,), local mean square of the vibration, (m/s^2)^2.
    """

    input: Array
    force: Array
    rotation: Array
    omega: Array
    position: Array
    since: Array
    warmth: Array
    covariates: Mapping[str, Array]
    current: Array
    vibration_power: Array


@dataclass
class Sensor:
    """One sensor: where it sits (body frame, m), how late (s) and slow (s) it is, its gains, disturbances and range."""

    place: Array = field(default_factory=lambda: np.zeros(3))
    delay: float = 0.0
    lag: float = 0.0
    gain: Array = field(default_factory=lambda: np.eye(3))
    disturbances: list[Callable[[Situation], Array]] = field(default_factory=list)
    limit: float = np.inf

    def output(self, situation: Situation) -> Array:
        """Return what the sensor would show (n, 3) without noise, rounding and limit."""
        total = situation.input @ self.gain.T
        for disturbance in self.disturbances:
            total = total + disturbance(situation)
        return total

    def digits(self, output: Array, noise: SensorNoise, rng: np.random.Generator, t: Array, rates: Array) -> Array:
        """Return the recorded reading (n, 3): noise added, rounded, held within the range."""
        return self.limited(noise.rounded(output + noise.draw(rng, t, rates)))

    def limited(self, output: Array) -> Array:
        """Return `output` held within the range."""
        return np.clip(output, -self.limit, self.limit)


@dataclass
class Rows:
    """The rows of a log: times (n,), s; the first and the last few motions worked out for them are kept.

    ``lag_step`` (s) is that of the grid on which a lag is solved.
    """

    t: Array
    lag_step: float = LAG_STEP
    _known: dict[tuple[int, float], tuple[Trajectory, Kinematics]] = field(default_factory=dict, repr=False)
    _fine: dict[float, Rows] = field(default_factory=dict, repr=False)

    def kinematics(self, trajectory: Trajectory, delay: float) -> Kinematics:
        """Return the motion as it was `delay` (s) before each row."""
        key = (id(trajectory), delay)
        if key not in self._known:
            if len(self._known) >= KEPT:
                del self._known[list(self._known)[1]]
            self._known[key] = (trajectory, trajectory.at(self.t - delay))
        return self._known[key][1]

    def recorded(self, trajectory: Trajectory, recorder: Recorder) -> Kinematics:
        """Return the motion as a recorder of the reference has it in each row."""
        if recorder == Recorder(delay=recorder.delay):
            return self.kinematics(trajectory, recorder.delay)
        return recorder.poses(trajectory, self.t)

    def fine(self, before: float) -> Rows:
        """Return a grid with `lag_step` from `before` (s) ahead of the first row to the last one."""
        if before not in self._fine:
            grid = np.arange(self.t[0] - before, self.t[-1] + 2 * self.lag_step, self.lag_step)
            self._fine[before] = Rows(grid)
        return self._fine[before]


@dataclass
class Setup:
    """Sensors mounted on a body that follows a trajectory, in an environment, watched by a reference.

    Attributes
    ----------
    commanded : the motion that the reference reports.
    expected : the environment that the log's metadata report.
    environment : the environment that really is.
    trajectory : the motion that really happens.
    mount : (3, 3), sensor axes to the axes of the reference's body.
    base : (3, 3), by which the reference's frame is turned against the world: x_world = base x_reference.
    recorder : what records the reference, stamps and poses.
    """

    commanded: Trajectory
    expected: Environment
    environment: Environment
    trajectory: Trajectory
    mount: Array = field(default_factory=lambda: np.eye(3))
    base: Array = field(default_factory=lambda: np.eye(3))
    recorder: Recorder = field(default_factory=Recorder)
    sensors: dict[str, Sensor] = field(default_factory=lambda: {name: Sensor() for name in SENSORS})

    @classmethod
    def ideal(cls, trajectory: Trajectory, environment: Environment) -> Setup:
        """Return perfect sensors and a reference that reports `trajectory`."""
        return cls(trajectory, environment, environment, trajectory.actual)

    def felt(self, kinematics: Kinematics) -> Kinematics:
        """Return the motion of the sensors' axes in the world, from that of the body in the reference's frame."""
        return kinematics.carried(self.base).mounted(self.mount)

    def input(self, name: str, felt: Kinematics, t: Array) -> Array:
        """Return the true quantity (n, 3) at sensor `name` for its motion at times `t` (s), body frame."""
        if name == "gyr":
            return felt.omega
        if name == "mag":
            return felt.flux_density(self.environment.field)
        force = felt.displaced(self.sensors[name].place).specific_force(self.environment.gravity)
        shaking = self.environment.vibration
        return force if shaking is None else force + shaking.at(t)

    def situation(self, name: str, rows: Rows) -> Situation:
        """Return what acts on sensor `name` at the rows."""
        sensor, surroundings = self.sensors[name], self.environment
        then = rows.t - sensor.delay
        felt = self.felt(rows.kinematics(self.trajectory, sensor.delay))
        vibration = surroundings.vibration
        warmth = surroundings.temperature.at(rows.t)
        columns = {key: course.at(rows.t) for key, course in surroundings.covariates.items()}
        return Situation(
            input=self.input(name, felt, then) if sensor.lag == 0.0 else self._lagged(name, rows),
            force=felt.specific_force(surroundings.gravity),
            rotation=felt.rotation,
            omega=felt.omega,
            position=felt.position,
            since=rows.t - rows.t[0],
            warmth=warmth - np.mean(warmth),
            current=columns.get("motor_current", np.full(rows.t.size, np.nan)),
            covariates={key: column - np.mean(column) for key, column in columns.items()},
            vibration_power=np.zeros(rows.t.size) if vibration is None else vibration.power(then),
        )

    def _lagged(self, name: str, rows: Rows) -> Array:
        """Solve lag dy/dt = x - y on a fine grid, from a steady start, for an input that is linear within a step."""
        lag, delay = self.sensors[name].lag, self.sensors[name].delay
        grid = rows.fine(float(np.ceil(min(12.0 * lag, LAG_HISTORY) + delay)))
        x = self.input(name, self.felt(grid.kinematics(self.trajectory, 0.0)), grid.t)
        keep = float(np.exp(-rows.lag_step / lag))
        slope = 1.0 - lag / rows.lag_step * (1.0 - keep)
        y, _ = lfilter([slope, 1.0 - keep - slope], [1.0, -keep], x, axis=0, zi=(1.0 - slope) * x[:1])
        return np.asarray(CubicSpline(grid.t, y)(rows.t - delay), dtype=np.float64)


def outputs(setup: Setup, rows: Rows, names: tuple[str, ...] = SENSORS) -> dict[str, Array]:
    """Return what the named sensors would show (n, 3) without noise, rounding and limit."""
    return {name: setup.sensors[name].output(setup.situation(name, rows)) for name in names}


def readings(setup: Setup, rows: Rows, names: tuple[str, ...] = SENSORS) -> dict[str, Array]:
    """Return the noise-free readings (n, 3) of the named sensors, held within their ranges."""
    return {name: setup.sensors[name].limited(output) for name, output in outputs(setup, rows, names).items()}


def discrepancy(setup: Setup, rows: Rows, names: tuple[str, ...] = SENSORS) -> dict[str, Array]:
    """Return the noise-free readings less the ideal ones for the motion that the reference reports, (n, 3) each."""
    reported = Setup.ideal(setup.commanded, setup.expected)
    kinematics = rows.recorded(setup.commanded, setup.recorder)
    real = readings(setup, rows, names)
    return {name: real[name] - reported.input(name, kinematics, rows.t) for name in names}
