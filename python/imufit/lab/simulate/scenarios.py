"""The motions a log can be simulated with."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from imufit.errors import InputError
from imufit.lab.simulate.environment import north_and_down
from imufit.lab.simulate.machine_tool import MACHINE_TOOL
from imufit.lab.simulate.motion import Array, Cruise, Product, Signal, Sinusoids, Steps, Sum
from imufit.lab.simulate.robot_arm import ROBOT_ARM
from imufit.lab.simulate.scenario import Plan, Scenario
from imufit.lab.simulate.six_sides import SIX_SIDES
from imufit.lab.simulate.truth import Fixed, Joint, Legs, Trajectory, rotation_from_vector
from imufit.log.words import one_of

X, Y, Z = np.eye(3)
LABELS = ("+x", "-x", "+y", "-y", "+z", "-z")


def _random_rotation(rng: np.random.Generator) -> Array:
    return np.asarray(Rotation.from_quat(rng.normal(size=4)).as_matrix(), dtype=np.float64)


def _mostly_on(rng: np.random.Generator, duration: float, rest: float, active: float, change: float) -> Steps:
    """Draw an envelope: 0 for about `rest` s, then 1 for about `active` s, and so on; each change takes `change` s."""
    start: list[float] = []
    level, now = [0.0], 0.7 * rest
    while not start or now < duration:
        start.append(now)
        level.append(1.0 - level[-1])
        now += change + rng.uniform(0.7, 1.3) * (active if level[-1] else rest)
    return Steps(np.array(start), np.full(len(start), change), np.array(level))


def _offsets(rng: np.random.Generator, envelope: Steps, reach: float, count: int) -> Steps:
    """Draw levels within +-`reach`, changed `count` times in each active part: so each rest has a level of its own."""
    start, length = [], []
    ends = np.append(envelope.start[1::2], envelope.start[-1] + 12.0)
    for begin, end in zip(envelope.start[0::2], ends, strict=False):
        part = (end - begin) / count
        start += [begin + i * part for i in range(count)]
        length += [0.95 * part] * count
    levels = np.concatenate([[0.0], rng.uniform(0.35, 1.0, len(start)) * reach * rng.choice([-1.0, 1.0], len(start))])
    return Steps(np.array(start), np.array(length), levels)


def _handheld(plan: Plan) -> Trajectory:
    """Hand motion: turning about 1.5 rad/s and 1.5 m/s^2 while it moves, with rests at changing attitudes."""
    rng = plan.rng
    envelope = _mostly_on(rng, plan.duration, 2.5, 13.0, 1.2)

    def angle(reach: float, rate: float) -> Signal:
        swing = Sinusoids.random(rng, 0.15, 1.8, 7).with_rate(rate)
        return Sum([_offsets(rng, envelope, reach, 3), Product(envelope, swing)])

    turning = [Joint(Z, angle(2.5, 0.9)), Joint(Y, angle(1.3, 0.9)), Joint(X, angle(2.2, 0.9))]
    shift = [Product(envelope, Sinusoids.random(rng, 0.4, 1.8, 5).with_acceleration(1.0)) for _ in range(3)]
    return Trajectory(turning, shift=shift)


def _arm(plan: Plan) -> Trajectory:
    """Five hinges; in each episode of about 8 s three of them swing, all of them move on to another position."""
    rng = plan.rng
    envelope = _mostly_on(rng, plan.duration, 1.5, 7.0, 1.0)
    reach = [2.5, 1.0, 1.2, 2.0, 1.2]
    parts: list[list[Signal]] = [[_offsets(rng, envelope, r, 1)] for r in reach]
    for begin, end in zip(envelope.start[0::2], np.append(envelope.start[1::2], np.inf), strict=False):
        window = Steps(np.array([begin, min(end, begin + 60.0)]), np.array([1.0, 1.0]), np.array([0.0, 1.0, 0.0]))
        for i in rng.choice(5, 3, replace=False):
            swing = Sinusoids.random(rng, 0.25, 1.0, 2).with_rate(rng.uniform(0.6, 1.1))
            parts[i].append(Product(window, swing))
    axes = [Z, Y, Y, X, Y]
    up = -north_and_down(plan.frame)[1]
    arms = [0.25 * up, 0.30 * X, 0.25 * X, 0.10 * X, 0.05 * X]
    return Trajectory([Joint(a, Sum(p)) for a, p in zip(axes, parts, strict=True)], arms=arms)


def _turntable(plan: Plan) -> Trajectory:
    """Incline a table: the body is mounted with x, y and z along its axis in turn, and spun both ways each time."""
    rng = plan.rng
    inclination = rotation_from_vector(
        np.radians(rng.uniform(35.0, 55.0)) * (np.cos(az := rng.uniform(-3, 3)) * X + np.sin(az) * Y)
    )
    part = plan.duration / 3.0
    remount = min(3.0, 0.1 * part)
    spin = (part - remount) / 3.0
    start, rates, ramp = [], [0.0], min(1.0, 0.2 * spin)
    for m in range(3):
        sign = rng.choice([-1.0, 1.0])
        for s in range(3):
            begin = m * part + (remount if m else 0.0) + s * spin
            rate = sign * (-1.0) ** s * rng.uniform(*((1.0, 1.6), (2.0, 2.8), (0.5, 0.9))[s])
            start += [begin + 0.15 * spin, begin + spin - 1.05 * ramp]
            rates += [rate, 0.0]
    table = Joint(Z, Cruise(np.array(start), np.full(len(start), ramp), np.array(rates)))
    columns = [
        (Y, Z, X),
        (Z, X, Y),
        (X, Y, Z),
    ]  # where the body's x, y, z point on the table: x, then y, then z along its axis
    mounts = [_about_z(rng) @ np.stack(c, axis=1) for c in columns]
    order = rng.permutation(3)
    turns = part * np.array([1.0, 2.0])
    legs = Legs(turns, np.full(2, remount), np.stack([mounts[i] for i in order]))
    return Trajectory([Fixed(inclination), table, legs])


def _one_way(plan: Plan) -> Trajectory:
    """Spin about an axis that is none of the body's, always the same way, at several rates, with stops between."""
    rng = plan.rng
    inclination = rotation_from_vector(np.radians(rng.uniform(35.0, 55.0)) * (X if rng.random() < 0.5 else Y))
    along = rng.uniform(0.45, 1.0, 3) * rng.choice([-1.0, 1.0], 3)
    away, _ = Rotation.align_vectors([Z], [along])
    start, rates = [], [0.0]
    spell = plan.duration / 8.0
    for k in range(8):
        start += [(k + 0.1) * spell, (k + 0.85) * spell]
        rates += [rng.uniform(0.6, 2.8), 0.0]
    table = Joint(Z, Cruise(np.array(start), np.full(len(start), 0.1 * spell), np.array(rates)))
    return Trajectory([Fixed(inclination), table, Fixed(np.asarray(away.as_matrix()))])


def _about_z(rng: np.random.Generator) -> Array:
    return rotation_from_vector(rng.uniform(-np.pi, np.pi) * Z)


def _poses(plan: Plan) -> Trajectory:
    """Lay each face up in random order, within 3.5 degrees, among attitudes of any kind, until time is up."""
    rng = plan.rng
    up = -north_and_down(plan.frame)[1]
    start: list[float] = []
    length: list[float] = []
    attitudes: list[Array] = []
    now = rng.uniform(2.0, 3.0)
    while True:
        for k in rng.permutation(12):
            attitudes.append(_face_up(rng, up, k) if k < 6 else _random_rotation(rng))
            if now >= plan.duration:
                return Trajectory([Legs(np.array(start), np.array(length), np.stack(attitudes))])
            start.append(now)
            length.append(rng.uniform(1.4, 2.2))
            now += length[-1] + rng.uniform(2.0, 3.2)


def _face_up(rng: np.random.Generator, up: Array, face: int) -> Array:
    """Draw an attitude with the body axis of number `face` in LABELS within 3.5 degrees of up, any heading."""
    target = up * (1.0 if face % 2 == 0 else -1.0)
    axis = face // 2
    upright = np.empty((3, 3))
    upright[:, axis], upright[:, (axis + 1) % 3], upright[:, (axis + 2) % 3] = target, X, np.cross(target, X)
    slope = rotation_from_vector(np.radians(rng.uniform(-2.0, 2.0, 3)))
    return np.asarray(slope @ _about_z(rng) @ upright, dtype=np.float64)


def pose_labels(frame: str, rotation: Array, omega: Array) -> npt.NDArray[np.intp]:
    """Return for each row the number in LABELS of the body axis that points up at rest within 5 degrees, else -1."""
    up_in_body = np.swapaxes(rotation, 1, 2) @ -north_and_down(frame)[1]
    axis = np.argmax(np.abs(up_in_body), axis=1)
    along = np.take_along_axis(up_in_body, axis[:, None], axis=1)[:, 0]
    still = np.linalg.norm(omega, axis=1) < 1e-6
    number = 2 * axis + (along < 0.0)
    return np.where(still & (np.abs(along) > np.cos(np.radians(5.0))), number, -1)


def _tilt(plan: Plan) -> Trajectory:
    """Drive a one-axis rig: steps, ramps and small reversals between -60 and 60 degrees, with rests between."""
    rng = plan.rng
    start: list[float] = []
    length: list[float] = []
    rates, now, angle = [0.0], rng.uniform(1.5, 2.5), 0.0
    while not start or now < plan.duration:
        kind = rng.choice(["step", "ramp", "reversal"], p=[0.35, 0.45, 0.2]) if start else "step"
        target = rng.uniform(-1.05, 1.05) if kind != "reversal" else angle - np.sign(angle) * rng.uniform(0.05, 0.15)
        way = target - angle
        ramp = 0.8 if kind == "ramp" else 0.6
        rate = way / ramp if kind != "ramp" else np.sign(way) * rng.uniform(0.1, 0.35)
        rate = np.sign(way) * min(abs(rate), 0.8, abs(way) / ramp)
        cruise = abs(way) / abs(rate) - ramp
        start += [now, now + ramp + cruise]
        length += [ramp, ramp]
        rates += [rate, 0.0]
        now += 2 * ramp + cruise + rng.uniform(0.8, 2.0)
        angle = target
    joint = Joint(np.eye(3)[plan.rig_axis], Cruise(np.array(start), np.array(length), np.array(rates)))
    return Trajectory([joint], rig_axis=plan.rig_axis)


SCENARIOS: Mapping[str, Scenario] = {
    "turntable": Scenario(
        "An inclined rate table spins the sensor both ways about its x, y and z axis in turn, with stops between.",
        _turntable,
    ),
    "one_way": Scenario(
        "An inclined rate table always spins the same way, about an axis that is none of the sensor's, at eight rates.",
        _one_way,
    ),
    "arm": Scenario(
        "A robot arm swings the sensor back and forth about changing axes; attitude and position are recorded.",
        _arm,
        position=True,
    ),
    "poses": Scenario(
        "The sensor rests in many poses, each face up among them and labelled, with smooth turns between.",
        _poses,
        poses=True,
    ),
    "tilt": Scenario(
        "A one-axis tilt rig, as on a machine tool, makes steps, ramps and small reversals; its angle is recorded.",
        _tilt,
        rig=True,
    ),
    "handheld": Scenario(
        "The sensor is turned and moved by hand in all directions, up to 2 Hz, with short rests.",
        _handheld,
        position=True,
    ),
    **MACHINE_TOOL,
    **ROBOT_ARM,
    **SIX_SIDES,
}


def build(name: str, rng: np.random.Generator, duration: float, frame: str = "NED", rig_axis: int = 0) -> Trajectory:
    """Return the motion of scenario `name` for about `duration` (s); it can be evaluated before and after that too."""
    if name not in SCENARIOS:
        raise InputError(f"unknown scenario {name!r}", remedy=one_of(name, SCENARIOS))
    return SCENARIOS[name].build(Plan(rng, duration, frame, rig_axis))
