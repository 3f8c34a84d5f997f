"""Motion of a sensor in a box during a calibration on a level table (paper A)."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from imufit.lab.simulate.environment import north_and_down
from imufit.lab.simulate.motion import Array
from imufit.lab.simulate.scenario import Plan, Scenario
from imufit.lab.simulate.truth import Legs, Trajectory, rotation_from_vector

ROUNDS = ("+z", "+x", "-z", "-x", "+z", "+y", "-z", "-y", "+z", "+x", "+y", "-x", "-y", "+x")
"""Sides that are laid up: three rounds of quarter turns, about y, about x, about z."""

FREELY = 24
"""Attitudes through which the box is turned in the hand after the rounds: enough for a magnetometer."""


def _side(label: str) -> Array:
    """Return the body axis (3,) of a label."""
    axis: Array = np.eye(3)["xyz".index(label[1])]
    return axis if label[0] == "+" else -axis


def _six_sides(plan: Plan) -> Trajectory:
    """Lay side after side up, exactly, with quarter turns between; then turn freely; again until time is up."""
    rng = plan.rng
    up = -north_and_down(plan.frame)[1]
    first, _ = Rotation.align_vectors([up], [_side(ROUNDS[0])])
    attitude = rotation_from_vector(rng.uniform(-np.pi, np.pi) * up) @ np.asarray(first.as_matrix())
    upright, attitudes = attitude, [attitude]
    start: list[float] = []
    length: list[float] = []
    now = rng.uniform(3.0, 3.6)

    def turn(to: Array, seconds: float, rest: float) -> None:
        nonlocal now
        attitudes.append(to)
        start.append(now)
        length.append(seconds)
        now += seconds + rest

    while now < plan.duration:
        attitude = upright
        for before, after in pairwise(ROUNDS):
            # Turned about b x a, a is where b was.
            quarter = rotation_from_vector(0.5 * np.pi * np.cross(_side(after), _side(before)))
            attitude = attitude @ quarter
            turn(attitude, rng.uniform(1.0, 1.4), rng.uniform(3.0, 3.6))
        for _ in range(FREELY):
            free = np.asarray(Rotation.from_quat(rng.normal(size=4)).as_matrix(), dtype=np.float64)
            turn(free, rng.uniform(1.4, 2.0), 0.0)
        turn(upright, 1.5, rng.uniform(3.0, 3.6))
    return Trajectory([Legs(np.array(start), np.array(length), np.stack(attitudes))])


SIX_SIDES: Mapping[str, Scenario] = {
    "six_sides": Scenario(
        "The sensor is laid on the six sides of its box on a level table, first with its z axis up, quarter turn by "
        "quarter turn, then turned freely: a calibration.",
        _six_sides,
        poses=True,
    ),
}
