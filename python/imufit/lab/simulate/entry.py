"""The parts of a physically simulated effect, and the common paths into a sensor's readings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from imufit.lab.simulate.motion import Array
from imufit.lab.simulate.sensor import Setup, Situation

Parameters = Mapping[str, float]
Stage = Literal["rig", "reference", "mounting", "place", "time", "gain", "disturbance", "range"]
Late = Literal["delay", "lag"]

THREE = ("x", "y", "z")
SIX = ("xy", "xz", "yx", "yz", "zx", "zy")
NINE = tuple(row + column for row in THREE for column in THREE)


@dataclass(frozen=True)
class Run:
    """The log for which an effect is set up: reference frame, first and last time (s)."""

    frame: str
    start: float
    stop: float


Apply = Callable[[Setup, Parameters, Run], None]


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
    late : how it comes late by its one parameter, a time in which it is not linear; None for all others.
    trials : values to try for the parameters inside it, by the length of the log (s).
    """

    id: str
    typical: Mapping[str, float]
    sensors: tuple[str, ...]
    stage: Stage
    apply: Apply
    inner: Callable[[np.random.Generator, Run], dict[str, float]] = lambda _rng, _run: {}
    positive: bool = False
    column: str | None = None
    vibration: bool = False
    late: Late | None = None
    trials: Callable[[float], list[dict[str, float]]] = lambda _length: [{}]

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


def gain_of(sensor: str, gain: Callable[[Parameters], Array]) -> Apply:
    """Return what adds `gain` of the parameters, a matrix (3, 3), to the gain of `sensor`."""

    def apply(setup: Setup, p: Parameters, _run: Run) -> None:
        setup.sensors[sensor].gain = setup.sensors[sensor].gain + gain(p)

    return apply


def disturbance_of(sensor: str, shape: Callable[[Situation, Parameters], Array]) -> Apply:
    """Return what adds `shape` of the situation and the parameters, (n, 3), to the output of `sensor`."""

    def apply(setup: Setup, p: Parameters, _run: Run) -> None:
        setup.sensors[sensor].disturbances.append(lambda situation: shape(situation, p))

    return apply


def times(course: Array, p: Parameters) -> Array:
    """Return a course (n,) times the parameters x, y, z: (n, 3)."""
    return np.multiply.outer(course, vector(p))


def three(size: float) -> dict[str, float]:
    """Return the same size for x, y and z."""
    return dict.fromkeys(THREE, size)
