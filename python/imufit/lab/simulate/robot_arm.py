"""Motion of a sensor at the end of a robot arm that swings back and forth (paper C).

Three hinges meet in one point that stands still: the base turns about the vertical, the shoulder lifts, the wrist
rolls. So the sensor, `ARM` from that point, feels `omega x (omega x r) + domega/dt x r` besides gravity. One hinge
after the other goes from end to end, as a drive does: quickly up to a constant rate, quickly to a stop, a short rest.
The paper states neither rates nor lengths; these are those of a small arm with hobby or stepper drives.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from imufit.lab.simulate.motion import Array, Cruise
from imufit.lab.simulate.noise import Noise
from imufit.lab.simulate.scenario import Plan, Scenario
from imufit.lab.simulate.truth import Joint, Trajectory

ARM = (0.3, 0.0, 0.0)
"""The sensor seen from the point in which the hinges meet, along the body's axes, m."""

BANGKOK = (41.0, 10.0)
"""Horizontal and downward flux density where the paper was written, uT: a dip of 14 degrees."""

REACH = tuple(float(np.radians(angle)) for angle in (60.0, 35.0, 45.0))
"""How far base, shoulder and wrist swing to either side, rad."""

STANDING = 3.0
"""Time (s) at rest before the first swing and after the last swing of each hinge."""


def _swung(plan: Plan) -> Trajectory:
    """Swing base, shoulder and wrist in turn about an attitude that is not the identity, until time is up."""
    rng = plan.rng
    pose = np.radians(rng.uniform([25.0, -25.0, 10.0], [65.0, -10.0, 25.0]))
    start: list[list[float]] = [[], [], []]
    length: list[list[float]] = [[], [], []]
    rates: list[list[float]] = [[0.0], [0.0], [0.0]]
    now, hinge = STANDING, 0
    while not start[2] or now < plan.duration:
        reach, ramp = REACH[hinge], rng.uniform(0.25, 0.35)
        speed = float(np.radians(rng.uniform(50.0, 80.0)))
        for way in (reach, -2.0 * reach, 2.0 * reach, -2.0 * reach, reach):
            travel = abs(way) / speed
            start[hinge] += [now, now + travel]
            length[hinge] += [ramp, ramp]
            rates[hinge] += [float(np.sign(way)) * speed, 0.0]
            now += travel + ramp + rng.uniform(0.8, 1.2)
        now += STANDING
        hinge = (hinge + 1) % 3
    paths = [
        Cruise(np.array(s), np.array(d), np.array(r), float(angle))
        for s, d, r, angle in zip(start, length, rates, pose, strict=True)
    ]
    still: Array = np.zeros(3)
    axes = np.eye(3)[::-1]
    return Trajectory([Joint(a, p) for a, p in zip(axes, paths, strict=True)], arms=[still, still, np.array(ARM)])


ROBOT_ARM: Mapping[str, Scenario] = {
    "arm_swing": Scenario(
        "A robot arm swings a GY-86 at its end back and forth, one axis after the other, with stops; field of Bangkok.",
        _swung,
        position=True,
        noise=Noise.gy86,
        field=BANGKOK,
    ),
}
