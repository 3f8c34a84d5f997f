"""Scenarios: a kind of motion, and what a log of it has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from imufit.lab.simulate.environment import FIELD_DOWN, FIELD_NORTH
from imufit.lab.simulate.noise import Noise
from imufit.lab.simulate.truth import Trajectory


@dataclass(frozen=True)
class Plan:
    """The parts of a scenario: random stream, duration (s), reference frame, rig axis (index)."""

    rng: np.random.Generator
    duration: float
    frame: str
    rig_axis: int


@dataclass(frozen=True)
class Scenario:
    """A kind of motion.

    Attributes
    ----------
    description : one sentence.
    build : makes the trajectory.
    position : whether the reference records a position (otherwise the body does not translate).
    poses : whether static poses are labelled in the log.
    rig : whether the motion is that of a one-axis rig with a commanded angle.
    sensors : which of "acc", "gyr", "mag", "temp" the log has by default.
    noise : makes the random errors that the log has by default.
    field : horizontal (northward) and downward flux density, uT.
    """

    description: str
    build: Callable[[Plan], Trajectory]
    position: bool = False
    poses: bool = False
    rig: bool = False
    sensors: tuple[str, ...] = ("acc", "gyr", "mag", "temp")
    noise: Callable[[], Noise] = Noise
    field: tuple[float, float] = (FIELD_NORTH, FIELD_DOWN)
