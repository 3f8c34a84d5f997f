"""Motion of a sensor in the middle of a machine tool's tilting table (paper B).

The A axis turns the table about `rig_axis`. The machine reports the commanded angle; that its frame rocks when it is
struck, it does not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from imufit.lab.simulate.environment import north_and_down
from imufit.lab.simulate.motion import Array, Cruise, Product, Ringing, Steps, Sum
from imufit.lab.simulate.noise import Noise
from imufit.lab.simulate.scenario import Plan, Scenario
from imufit.lab.simulate.truth import Joint, Trajectory

POSITIONING = (float(np.radians(20.0)), 0.25)
"""Largest speed (rad/s) of the axis on its way to an angle, and the time (s) in which it starts and stops."""

SWEEPING = (float(np.radians(5.0)), 0.6)
"""The same for the wide sweep, which is driven gently."""

REACH = (float(np.radians(-110.0)), float(np.radians(30.0)))
"""Ends of the wide sweep, rad."""

TABLE_HEIGHT = 0.5
"""Height (m) of the sensor over the axis about which the struck machine rocks on its feet."""

CONTACT = 0.004
"""Time (s) for which the hammer's soft tip pushes."""


def _axis(plan: Plan, start: list[float], targets: list[float], drive: tuple[float, float]) -> Trajectory:
    """Drive the axis from zero to each target (rad) in turn, beginning at `start` (s)."""
    fastest, ramp = drive
    begin: list[float] = []
    rates, angle = [0.0], 0.0
    for t, target in zip(start, targets, strict=True):
        way = target - angle
        speed = min(fastest, abs(way) / ramp)
        begin += [t, t + abs(way) / speed]
        rates += [np.sign(way) * speed, 0.0]
        angle = target
    path = Cruise(np.array(begin), np.full(len(begin), ramp), np.array(rates))
    return Trajectory([Joint(np.eye(3)[plan.rig_axis], path)], rig_axis=plan.rig_axis)


def _moved(degrees: float, share: float) -> Callable[[Plan], Trajectory]:
    """Stand at zero for `share` of the time, drive to an angle, stand there."""
    return lambda plan: _axis(plan, [share * plan.duration], [float(np.radians(degrees))], POSITIONING)


def _swept(plan: Plan) -> Trajectory:
    """Step to and fro between the ends of the reach, with a rest after each step."""
    rng = plan.rng
    start: list[float] = []
    targets: list[float] = []
    (speed, ramp), now, angle, way = SWEEPING, 2.0, 0.0, 1.0
    while not start or now < plan.duration:
        target = float(np.clip(angle + way * rng.uniform(0.15, 0.3), *REACH))
        start.append(now)
        targets.append(target)
        now += max(abs(target - angle) / speed, ramp) + ramp + rng.uniform(1.2, 2.0)
        angle = target
        if angle in REACH:
            way = -way
    return _axis(plan, start, targets, SWEEPING)


def _struck(plan: Plan) -> Trajectory:
    """Stand at zero; at two fifths of the time a hammer strikes, and the frame rocks on its feet and rings out."""
    rng, axis = plan.rng, np.eye(3)[plan.rig_axis]
    at = 0.4 * plan.duration
    rocking = Ringing(
        start=at,
        amplitude=float(np.radians(rng.uniform(0.015, 0.025))),
        frequency=rng.uniform(24.0, 32.0),
        damping=rng.uniform(0.03, 0.05),
    )
    blow = Product(Steps(np.array([at]), np.array([CONTACT]), np.array([0.0, 1.0])), rocking)
    up: Array = -north_and_down(plan.frame)[1]
    standing = Joint(axis, Sum(()))
    return Trajectory(
        [standing], rig_axis=plan.rig_axis, unreported=[Joint(axis, blow)], unreported_arms=[TABLE_HEIGHT * up]
    )


def _scenario(description: str, build: Callable[[Plan], Trajectory]) -> Scenario:
    return Scenario(description, build, rig=True, sensors=("acc", "gyr", "temp"), noise=Noise.mpu6050)


MACHINE_TOOL: Mapping[str, Scenario] = {
    # How long the machine stands at zero before is not published: these shares of the time let a constant bias of the
    # gyroscope make the published errors of its angle.
    "machine_at_1": _scenario(
        "A machine tool's table stands at zero for half of the time, drives to 1 degree and stands there.",
        _moved(1.0, 0.502),
    ),
    "machine_at_1.5": _scenario(
        "A machine tool's table stands at zero for four fifths of the time, drives to 1.5 degrees and stands there.",
        _moved(1.5, 0.787),
    ),
    "machine_at_5": _scenario(
        "A machine tool's table stands at zero for two fifths of the time, drives to 5 degrees and stands there.",
        _moved(5.0, 0.415),
    ),
    "machine_move": _scenario(
        "A machine tool's table stands at zero for half of the time, drives to -5 degrees and stands there.",
        _moved(-5.0, 0.5),
    ),
    "machine_struck": _scenario(
        "A machine tool stands; at two fifths of the time an impact hammer strikes it, and its frame rings.", _struck
    ),
    "machine_sweep": _scenario(
        "A machine tool's table steps to and fro between -110 and 30 degrees and rests after each step.", _swept
    ),
}
