"""Logs whose metadata do not state the field of the place, as those of most users.

The reading of a magnetometer is `(I + S) R^T h + b + noise`. The field `h` of the place is in no log here, so
whoever reads the log has to find it beside the errors. What then cannot be told apart, whatever the method:

* a gain common to all axes and a field of another strength: only the differences of the diagonal of `S` and
  its other elements count;
* hard iron along the only axis that the body turns about and the field along that axis;
* while the body turns about one axis only, a column of `S` along that axis and hard iron;
* while the body stays level, a mount that is turned about the vertical and a field of another heading;
* a reference frame that is not level and a turned field: only the accelerometer shows `ref.tilt`.

`draw(seed)` makes one log of kind `KINDS[seed % len(KINDS)]`. A draw is kept only if every hidden effect stands far
above the noise after the field and all other hidden effects have been fitted to it. An effect that could take the
place of a hidden one without a visible loss, the field fitted again, may be named too. `mag.field_reference` is
never right: no field was stated that could be off.

Motions, noise and formulas of the effects are those of `whole_sensor.py`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count

import numpy as np
import pandas as pd
from case import Case
from motion_and_reference import multiply
from whole_sensor import (
    AXES,
    DEGREE,
    DOWN,
    SEEN,
    Bench,
    Effects,
    Form,
    Joint,
    Motion,
    Steps,
    Total,
    envelope,
    examine,
    gain,
    gimbal,
    hand_held,
    log,
    metadata,
    parameter_names,
    poses_and_swings,
    poses_and_turns,
    robot_arm,
    signs,
    small_turns,
    tones,
    vector,
    warm_up,
    windows,
)

Generator = np.random.Generator
Make = Callable[[Generator, float], Motion]
Hide = Callable[[Generator], Effects]

FIELD = "mag.field_reference"
"""Stands for the unknown field where effects are compared."""
MOST_ROWS = 12_000.0
INTO_ENU = np.array([0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0])
"""Turns the north-east-down frame into the east-north-up frame, and back."""


# ---------------------------------------------------------------------------------------------------------
# Motions with few attitudes


def still(angle: float) -> Steps:
    """Returns a joint that keeps its angle in rad."""
    return Steps(np.array([0.0]), np.array([1.0]), np.array([angle, angle]))


def turning(rng: Generator, duration: float, reach: float, wave: float, slowness: float = 1.0) -> Total:
    """Returns a joint that goes to new angles within +-`reach` degrees, waves about them, and rests between."""
    spans = windows(rng, 0.5, duration - 1.0, (3.0 * slowness, 7.0 * slowness), (0.8, 2.2))
    goals = rng.uniform(0.3 * reach, reach, spans.shape[1] + 1) * (-1.0) ** np.arange(spans.shape[1] + 1)
    waves = tones(rng, envelope(spans, 0.8), wave * DEGREE, 0.3, 1.2)
    return Total((Steps(spans[0], spans[1], goals * DEGREE), waves))


def path(rng: Generator, duration: float, size: float, low: float, high: float) -> Total:
    """Returns one coordinate of a path in m, which starts and ends at rest."""
    whole = np.array([[0.2], [duration - 0.2]])
    return Total((tones(rng, envelope(whole, 2.0), size, low, high),))


def phone(rng: Generator, duration: float) -> Motion:
    """Returns a phone in the hand: all headings, tilts of 10 to 30 degrees."""
    tilt = rng.uniform(10.0, 30.0)
    joints = tuple(
        Joint(axis, turning(rng, duration, reach, wave))
        for axis, reach, wave in (("z", 170.0, 20.0), ("y", tilt, 6.0), ("x", tilt, 6.0))
    )
    base = tuple(path(rng, duration, 0.1, 0.2, 1.0) for _ in AXES)
    return Motion("phone", duration, joints, (base[0], base[1], base[2]))


def boat(rng: Generator, duration: float) -> Motion:
    """Returns a boat that circles, rolls by 8 to 20 degrees and pitches by half of that."""
    roll = rng.uniform(8.0, 20.0)
    joints = (
        Joint("z", turning(rng, duration, 170.0, 8.0, 2.0)),
        Joint("y", path(rng, duration, 0.5 * roll * DEGREE, 0.12, 0.5)),
        Joint("x", path(rng, duration, roll * DEGREE, 0.12, 0.5)),
    )
    x, y = (path(rng, duration, 6.0, 0.02, 0.06) for _ in "xy")
    return Motion("boat", duration, joints, (x, y, path(rng, duration, 0.4, 0.1, 0.3)))


def vehicle(rng: Generator, duration: float) -> Motion:
    """Returns a vehicle on a yard: all headings, and 2 to 5 degrees of roll and pitch on its springs and ramps."""
    tilt = rng.uniform(2.0, 5.0) * DEGREE
    joints = (
        Joint("z", turning(rng, duration, 170.0, 5.0, 2.0)),
        Joint("y", path(rng, duration, tilt, 0.1, 1.0)),
        Joint("x", path(rng, duration, tilt, 0.1, 1.0)),
    )
    x, y = (path(rng, duration, 15.0, 0.02, 0.06) for _ in "xy")
    return Motion("vehicle", duration, joints, (x, y, path(rng, duration, 0.02, 0.5, 1.2)))


def level_table(rng: Generator, duration: float) -> Motion:
    """Returns a sensor that lies level on a turntable: only its heading changes."""
    return Motion("level_table", duration, (Joint("z", turning(rng, duration, 175.0, 25.0)),))


def tilted_table(rng: Generator, duration: float) -> Motion:
    """Returns a sensor that lies on a turntable at a fixed tilt: only its heading changes."""
    pitch, roll = rng.uniform(10.0, 40.0, 2) * signs(rng, 2) * DEGREE
    turn = Joint("z", turning(rng, duration, 175.0, 25.0))
    return Motion("tilted_table", duration, (turn, Joint("y", still(pitch)), Joint("x", still(roll))))


def rig(rng: Generator, duration: float) -> Motion:
    """Returns a rig that turns its sensor about one level axis."""
    heading = Joint("z", still(rng.uniform(-np.pi, np.pi)))
    return Motion("rig", duration, (heading, Joint(str(rng.choice(["x", "y"])), turning(rng, duration, 170.0, 25.0))))


TUMBLING = (hand_held, robot_arm, gimbal, poses_and_swings, poses_and_turns)
TRAVELLING = (hand_held, robot_arm, poses_and_swings)
LIMITED = (phone, boat, vehicle)
TILTING = (phone, boat)
ONE_AXIS = (level_table, tilted_table, rig)


# ---------------------------------------------------------------------------------------------------------
# What is hidden


def along(rng: Generator, low: float, high: float) -> dict[str, float]:
    """Returns a vector of random direction whose length lies in a range."""
    v = rng.standard_normal(3)
    v *= rng.uniform(low, high) / np.linalg.norm(v)
    return dict(zip(AXES, v.tolist(), strict=True))


def each(rng: Generator, effect: str, low: float, high: float) -> dict[str, float]:
    """Returns parameters whose sizes all lie in a range, with random signs."""
    names = parameter_names(effect)
    values = rng.uniform(low, high, len(names)) * signs(rng, len(names))
    return dict(zip(names, values.tolist(), strict=True))


def iron(rng: Generator, size: float = 0.0) -> Effects:
    """Returns hard iron of about a size in uT; without one, of 30 to 500 uT."""
    size = size or float(np.exp(rng.uniform(np.log(40.0), np.log(400.0))))
    return {"mag.hard_iron": along(rng, 0.75 * size, 1.25 * size)}


def soft_iron(rng: Generator) -> Effects:
    """Returns a symmetric matrix: unequal gains, mixing of axes, and a common gain, which cannot be seen."""
    upper = np.triu(rng.uniform(0.03, 0.1, (3, 3)) * signs(rng, 9).reshape(3, 3), 1)
    gains = rng.permutation([-1.0, rng.uniform(-0.5, 0.5), 1.0]) * rng.uniform(0.03, 0.12)
    matrix = upper + upper.T + np.diag(gains + rng.uniform(-0.1, 0.1))
    return {"mag.soft_iron": dict(zip(parameter_names("mag.soft_iron"), matrix.ravel().tolist(), strict=True))}


def late(rng: Generator, effect: str) -> Effects:
    """Returns a delay of 8 to 40 ms."""
    return {effect: {"tau": float(rng.uniform(0.008, 0.04))}}


def biases(rng: Generator) -> Effects:
    """Returns zeros of gyroscope and accelerometer that are off."""
    return {
        "gyr.bias": each(rng, "gyr.bias", 0.5 * DEGREE, 4.0 * DEGREE),
        "acc.bias": each(rng, "acc.bias", 0.1, 0.6),
    }


def gyroscope_gains(rng: Generator) -> Effects:
    """Returns scale errors of the gyroscope and axes that are not square."""
    return {
        "gyr.scale": each(rng, "gyr.scale", 0.01, 0.04),
        "gyr.misalignment": each(rng, "gyr.misalignment", 0.005, 0.02),
    }


def common_gain(rng: Generator) -> Effects:
    """Returns a matrix that only makes every reading larger or smaller."""
    size = float(rng.uniform(0.05, 0.3) * rng.choice([-1.0, 1.0]))
    return {"mag.soft_iron": {"xx": size, "yy": size, "zz": size}}


# ---------------------------------------------------------------------------------------------------------
# Kinds


@dataclass(frozen=True)
class Kind:
    """Names what is hidden, and how the body moves.

    Attributes
    ----------
    name, motions, hide
        Name, motions to choose from, and what draws the hidden effects.
    seen
        Whether the effects can be seen at all. Where they cannot, the log is that of a perfect sensor in another
        field, and nothing may be named.
    reference_every
        Rows between two poses of the reference.
    """

    name: str
    motions: tuple[Make, ...]
    hide: Hide
    seen: bool = True
    reference_every: int = 1


def nothing(_rng: Generator) -> Effects:
    """Returns no effect."""
    return {}


KINDS = (
    Kind("nothing_tumbling", TUMBLING, nothing),
    Kind("nothing_limited", LIMITED, nothing),
    Kind("nothing_one_axis", ONE_AXIS, nothing),
    Kind("nothing_slow_reference", (*TUMBLING, *LIMITED), nothing, reference_every=2),
    Kind("iron_5", (*TUMBLING, *LIMITED), lambda rng: iron(rng, 5.0)),
    Kind("iron_50", (*TUMBLING, *LIMITED), lambda rng: iron(rng, 50.0)),
    Kind("iron_400", (*TUMBLING, *LIMITED), lambda rng: iron(rng, 400.0)),
    Kind("iron_soft_iron", TUMBLING, lambda rng: iron(rng) | soft_iron(rng)),
    Kind("iron_soft_iron_limited", TILTING, lambda rng: iron(rng, 30.0) | soft_iron(rng)),
    Kind("iron_mag_delay", TUMBLING, lambda rng: iron(rng) | late(rng, "mag.delay")),
    Kind("iron_ref_delay", (*TUMBLING, phone), lambda rng: iron(rng) | late(rng, "ref.delay")),
    Kind("iron_biases", (*TUMBLING, *TILTING), lambda rng: iron(rng) | biases(rng)),
    Kind("iron_lever_arm", TRAVELLING, lambda rng: iron(rng) | {"acc.lever_arm": along(rng, 0.05, 0.2)}),
    Kind("iron_mount", TUMBLING, lambda rng: iron(rng) | {"ref.alignment": along(rng, 1.0 * DEGREE, 4.0 * DEGREE)}),
    Kind(
        "iron_tilt",
        (*TUMBLING, *TILTING),
        lambda rng: iron(rng) | {"ref.tilt": each(rng, "ref.tilt", 0.4 * DEGREE, 2.0 * DEGREE)},
    ),
    Kind("iron_gyroscope_gains", TUMBLING, lambda rng: iron(rng) | gyroscope_gains(rng)),
    Kind("soft_iron", TUMBLING, soft_iron),
    Kind("soft_iron_limited", TILTING, soft_iron),
    Kind(
        "iron_temperature",
        (*TUMBLING, *LIMITED),
        lambda rng: iron(rng) | {"mag.bias_temperature": each(rng, "mag.bias_temperature", 0.2, 1.0)},
    ),
    Kind("iron_heading_only", (level_table, tilted_table), iron),
    Kind("iron_one_axis", (rig,), iron),
    Kind(
        "iron_gyr_bias_heading_only",
        (level_table,),
        lambda rng: iron(rng) | {"gyr.bias": each(rng, "gyr.bias", 0.5 * DEGREE, 4.0 * DEGREE)},
    ),
    Kind(
        "unseen_iron_along_axis",
        (level_table,),
        lambda rng: {"mag.hard_iron": {"z": float(rng.uniform(5.0, 400.0) * rng.choice([-1.0, 1.0]))}},
        seen=False,
    ),
    Kind("unseen_common_gain", (*TUMBLING, *LIMITED), common_gain, seen=False),
    Kind(
        "unseen_turned_mount",
        (level_table,),
        lambda rng: {"ref.alignment": {"z": float(rng.uniform(2.0, 15.0) * rng.choice([-1.0, 1.0])) * DEGREE}},
        seen=False,
    ),
)


# ---------------------------------------------------------------------------------------------------------
# From a kind to a log


def draw_bench(rng: Generator, kind: Kind) -> Bench:
    """Returns a motion, a field that points anywhere, and the noise of a cheap sensor and of its reference."""
    rate = float(rng.choice([50.0, 100.0, 200.0]))
    duration = float(np.round(rng.uniform(40.0, min(120.0, MOST_ROWS / rate))))
    motion = kind.motions[rng.integers(len(kind.motions))](rng, duration)
    t = np.arange(int(duration * rate)) / rate
    heading, level, down = rng.uniform(-np.pi, np.pi), rng.uniform(14.0, 36.0), rng.uniform(20.0, 55.0)
    earth_field = [level * np.cos(heading), level * np.sin(heading), down * rng.choice([-1.0, 1.0, 1.0])]
    return Bench(
        motion=motion,
        t=t,
        start=float(np.round(rng.choice([0.0, rng.uniform(1.0, 4000.0)]), 3)),
        earth_field=np.array(earth_field),
        temperature=warm_up(rng, t),
        sensor="MPU9250 + AK8963",
        white={
            "acc": rng.uniform(0.02, 0.05),
            "gyr": rng.uniform(0.03, 0.08) * DEGREE,
            "mag": rng.uniform(0.2, 1.0),
        },
        walk=rng.uniform(0.01, 0.03),
        attitude_noise=float(np.exp(rng.uniform(np.log(0.02), np.log(0.2)))) * DEGREE,
        position_noise=rng.uniform(1e-4, 4e-4),
        magnetometer_every=int(rng.choice([1, 2])),
        tell_noise=bool(rng.random() < 0.3),
    )


def readings(bench: Bench, hidden: Effects) -> Form:
    """Returns the readings of every sensor with all that is hidden, without noise.

    The reference says `R`. With a frame that is not level (`T`) and a turned mount (`A`) the true attitude is
    `T R A`, thus gravity and field are turned by `T^T` before `R^T` and all readings by `A^T` after it.
    """
    level = small_turns(np.append(vector(hidden, "ref.tilt"), 0.0)[None])[0]
    mount = small_turns(vector(hidden, "ref.alignment")[None])[0]
    here = bench.motion.at(bench.t)
    force = here.force(vector(hidden, "acc.lever_arm")) + here.into_body(DOWN - level.T @ DOWN)
    then = bench.motion.at(bench.t - vector(hidden, "mag.delay")[0])
    x = {"acc": force, "gyr": here.rate, "mag": then.into_body(level.T @ bench.earth_field)}
    zero = {"acc": "acc.bias", "gyr": "gyr.bias", "mag": "mag.hard_iron"}
    y = {s: x[s] @ mount @ gain(hidden, s).T + vector(hidden, zero[s]) for s in x}
    y["mag"] = y["mag"] + np.outer(bench.warmth, vector(hidden, "mag.bias_temperature"))
    return y


def into_enu(frame: pd.DataFrame) -> pd.DataFrame:
    """Returns a log whose reference frame has x east, y north and z up instead of north, east and down."""
    frame = frame.copy()
    q = [f"ref_q{name}" for name in "wxyz"]
    frame[q] = multiply(np.broadcast_to(INTO_ENU, (len(frame), 4)), frame[q].to_numpy())
    if "ref_px" in frame:
        frame[["ref_px", "ref_py"]] = frame[["ref_py", "ref_px"]].to_numpy()
        frame["ref_pz"] = -frame["ref_pz"]
    return frame


def determined(hidden: Effects, motion: str) -> Effects:
    """Returns the hidden effects with the parameters that the log determines and the contract fixes in sign.

    Soft iron is known but for its common gain, the sense of a small turn of mount or frame is not in the contract,
    and of hard iron the part along the only axis of turning is not known.
    """
    kept = {effect: dict(values) for effect, values in hidden.items()}
    for effect in {"mag.soft_iron", "ref.alignment", "ref.tilt"} & kept.keys():
        kept[effect] = {}
    if "mag.hard_iron" in kept and motion in ("level_table", "tilted_table", "rig"):
        level = {axis: kept["mag.hard_iron"][axis] for axis in "xy"}
        kept["mag.hard_iron"] = level if motion == "level_table" else {}
    return kept


def rivals(bench: Bench, hidden: Effects) -> tuple[float, frozenset[str]]:
    """Returns the least chi-square of a hidden effect beside the unknown field, and the effects that equal one."""
    stands, alike = examine(bench, hidden | {FIELD: {}})
    return min(stands[effect] for effect in hidden), frozenset().union(*(alike[effect] for effect in hidden))


def hidden_in(rng: Generator, kind: Kind) -> tuple[Bench, Effects, frozenset[str]]:
    """Returns a bench, what is hidden, and the rivals; draws again until every effect can be seen, where it can be."""
    for _ in count():
        bench, hidden = draw_bench(rng, kind), kind.hide(rng)
        if not hidden or not kind.seen:
            return bench, hidden, frozenset()
        least, others = rivals(bench, hidden)
        if least >= SEEN:
            return bench, hidden, others
    raise AssertionError("the loop above ends only with a log")


def draw(seed: int) -> Case:
    """Returns one log of an unknown field; the seed picks the kind and all numbers."""
    kind = KINDS[seed % len(KINDS)]
    rng = np.random.default_rng([20250, seed])
    bench, hidden, others = hidden_in(rng, kind)
    frame = log(bench, readings(bench, hidden), rng, vector(hidden, "ref.delay")[0])
    facts = metadata(bench)
    del facts["mag_reference"]
    if rng.random() < 1 / 3:
        frame, facts["frame"] = into_enu(frame), "ENU"
    skipped = np.arange(len(frame)) % kind.reference_every != 0
    frame.loc[skipped, [name for name in frame if name.startswith("ref_")]] = np.nan
    effects = determined(hidden, bench.motion.kind) if kind.seen else {}
    return Case(
        name=f"unknown_field-{seed}-{kind.name}-{bench.motion.kind}",
        frame=frame,
        metadata=facts,
        effects=effects,
        may_name=frozenset(effects) | others,
        verdicts=frozenset({"adequate", "ambiguous"} if others else {"adequate"}),
        seconds=bench.motion.duration,
    )
