"""Calibrations of real sensors, each confirmed by poses, turns or stretches that had no part in it.

Imported by `benches/recordings.py`. The poses of a log are dealt out in turn to two halves. Each half is calibrated
alone; its correction is judged on the poses of the other. For a gyro the turns are dealt out, for a magnetometer the
log is cut in the middle.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from confirmed import Ratio, of, ratio
from imufit import InputError, Log, read
from imufit.calibrating import Calibration, calibrate, find_poses
from imufit.results import Parameter

ENOUGH = 9
"""Poses that the length of gravity needs for scale, misalignment and bias."""
WITH = {"acc": ("acc",), "gyr": ("acc", "gyr"), "mag": ("mag",)}
"""Sensors calibrated along: a gyro is held against gravity."""


@dataclass(frozen=True)
class Calibrated:
    """One sensor of one recording: what was found, the error it leaves, and what the other half says of it."""

    recording: str
    sensor: str
    effect: str
    parameters: tuple[Parameter, ...]
    before: float
    after: float
    held_out: float
    unit: str
    confirmed_by: str
    ratio: Ratio | None


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def rest_error(readings: np.ndarray, gravity: float, result: Calibration | None = None) -> float:
    corrected = readings if result is None else result.sensors["acc"].correct(readings)
    return rms(np.linalg.norm(corrected, axis=1) - gravity)


def around_poses(log: Log, turns: bool) -> list[Log]:
    """Cut a log into pieces around one pose each, or, for turns, from one pose to the next."""
    rows = [pose.rows for pose in find_poses(log, labelled_only=False).poses if pose.used]
    if turns:
        return [log.rows(a[0], b[1]) for a, b in itertools.pairwise(rows)]
    middles = [(a[1] + b[0]) // 2 for a, b in itertools.pairwise(rows)]
    return [log.rows(a, b) for a, b in zip([0, *middles], [*middles, log.n], strict=True)]


def of_half(log: Log, half: int, sensor: str, cost: str) -> Calibration | None:
    """Calibrate from every other pose or turn, a magnetometer from half of the time; None where that is too little."""
    if sensor == "mag":
        pieces = [log.rows(half * log.n // 2, (half + 1) * log.n // 2)]
    else:
        pieces = around_poses(log, turns=sensor == "gyr")[half::2]
        if len(pieces) < ENOUGH:
            return None
    try:
        result = calibrate(pieces, *(() if sensor == "mag" else (cost,)), sensors=WITH[sensor])
    except InputError:
        return None
    return result if sensor in result.sensors else None


def readings(log: Log) -> np.ndarray:
    return np.array([pose.mean for pose in find_poses(log, labelled_only=False).poses if pose.used])


def calibrated(folder: Path, file: str, title: str, rests: Sequence[str] = ()) -> list[Calibrated]:
    """Calibrate a recording; `rests` are further recordings of the sensor on whose rests the result is judged."""
    log = read(folder / file)
    whole = calibrate(log)
    every = whole.model.listed()
    others = np.concatenate([readings(read(folder / other)) for other in rests]) if rests else None
    labelled = log.pose is not None
    cost = whole.sensors["acc"].cost
    found = []
    for name, result in whole.sensors.items():
        halves = [None, None] if labelled else [of_half(log, half, name, cost) for half in (0, 1)]
        first, second = halves
        before, held_out, judge = result.before, result.held_out, "left out one by one"
        if name == "acc" and others is not None:
            before, held_out = (rest_error(others, whole.gravity, each) for each in (None, whole))
            judge = "rests of other recordings"
        elif name == "acc" and labelled:
            unlabelled = unlabelled_rests(log, whole)
            before, held_out = (rest_error(unlabelled, whole.gravity, each) for each in (None, whole))
            judge = "rests without a label"
        elif name == "acc" and first is not None and second is not None:
            sides = [np.array([pose.mean for pose in half.used]) for half in (first, second)]
            before = rms(np.array([rest_error(side, whole.gravity) for side in sides]))
            crossed = zip(sides, (second, first), strict=True)
            held_out = rms(np.array([rest_error(side, whole.gravity, other) for side, other in crossed]))
            judge = "the other half of the poses"
        for effect in result.effects:
            compared = None
            if first is not None and second is not None:
                a, b = (of(half.model.listed(), effect) for half in (first, second))
                compared = ratio(title, a, b) if a and b else None
            found.append(
                Calibrated(
                    title,
                    name,
                    effect,
                    of(every, effect),
                    before,
                    result.after,
                    held_out,
                    result.error_unit,
                    judge,
                    compared,
                )
            )
    return found


def unlabelled_rests(log: Log, whole: Calibration) -> np.ndarray:
    """Return the mean readings of the rests that had no part in a calibration from labelled poses."""
    rests = [pose for pose in find_poses(log, labelled_only=False).poses if pose.used]
    return np.array(
        [
            rest.mean
            for rest in rests
            if not any(rest.rows[0] < pose.rows[1] and pose.rows[0] < rest.rows[1] for pose in whole.used)
        ]
    )
