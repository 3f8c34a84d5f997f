"""Sound logs to spoil: simulated by the command line, and stretches of real recordings."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from recording import DATA

from mistakes.catalogue import Need
from mistakes.shell import imufit
from mistakes.spoils import Log, columns_of

MOVING = ("handheld", "arm", "turntable")
"""Scenarios that turn about every axis."""
OTHERS = ("tilt", "still")
"""A rig with one axis, and a sensor at rest: a pose of the scenario `poses`."""
FRAMES = ("NED", "ENU", "NWU")
DURATION = 60
"""Length of a simulated log, s: the least in which every scenario turns through all of its directions."""
ROWS = 6000
"""Rows taken of a recording: 20 s to a minute, so that an answer takes seconds."""
TURNS, PULLS = 0.08, 1.0
"""Standard deviations of rate (rad/s) and specific force (m/s^2) from which on an axis counts as moved: a hundred times
the noise of a consumer sensor."""
RECORDINGS = (
    ("broad/02_undisturbed_slow_rotation_B.parquet", 20000),
    ("broad/21_undisturbed_fast_combined.parquet", 20000),
    ("robot_arm/MPU9150_path3_300mms.parquet", 700),
    ("robot_arm/MPU6050RM3100_path1_300mms.parquet", 700),
    ("encoder_rig/pitch_medium.parquet", 20000),
    ("uav_motor_current/thor75_part1.parquet", 8000),
)
"""Recordings, and the row from which on a stretch is taken: past the rest, and past the backlog of the robot arm."""
FROM_READINGS = ("dmp_q", "encoder_deg", "still_", "gap_before", "movement")
"""Beginnings of columns that are left out: another sensor's, or copies of the reference."""


@dataclass(frozen=True)
class Sound:
    """A sound log, what it is called, and what it has."""

    name: str
    log: Log
    has: frozenset[Need]
    real: bool = False


def load(path: Path) -> Log:
    """Columns and metadata of a Parquet log, read without the package."""
    table = pq.read_table(path)
    metadata = json.loads((table.schema.metadata or {}).get(b"imufit", b"{}"))
    columns = {name: table.column(name).to_numpy(zero_copy_only=False) for name in table.column_names if name != "pose"}
    return Log({name: np.asarray(column, float) for name, column in columns.items()}, metadata)


def has(log: Log) -> frozenset[Need]:
    """What a log has, by its columns and its motion."""
    table, found = log.table, set()
    for need, name in ((Need.ACC, "acc_x"), (Need.GYR, "gyr_x"), (Need.MAG, "mag_x"), (Need.TEMP, "temp")):
        if name in table:
            found.add(need)
    if "ref_qw" in table and np.isfinite(table["ref_qw"]).mean() > 0.9:
        found.add(Need.REFERENCE)
    if "ref_px" in table:
        found.add(Need.POSITION)
    if "ref_angle" in table and "rig_axis" in log.metadata:
        found.add(Need.ANGLE)
    found |= {need for need, key in ((Need.NOISE, "noise"), (Need.FIELD, "mag_reference")) if key in log.metadata}
    turns = [float(np.nanstd(table[name])) for name in columns_of("gyr")] if Need.GYR in found else [0.0]
    pulls = [float(np.nanstd(table[name])) for name in columns_of("acc")] if Need.ACC in found else [0.0]
    if max(turns) > TURNS:
        found.add(Need.TURNING)
    if min(turns) > TURNS and min(pulls) > PULLS:
        found.add(Need.MOVING)
    if max(turns) < TURNS / 10:
        found.add(Need.STILL)
    return frozenset(found)


def simulated(kind: str, seed: int, directory: Path) -> Sound:
    """Simulate a log without effects; `still` is the longest rest of static poses. The seed tells the frame too."""
    scenario = "poses" if kind == "still" else kind
    path = directory / f"{kind}_{seed}.parquet"
    frame = FRAMES[seed % len(FRAMES)]
    options = ["--seed", str(seed), "--duration", str(DURATION), "--frame", frame, "-o", str(path)]
    done = imufit("simulate", scenario, *options)
    if done.returncode:
        raise RuntimeError(done.stderr)
    log = load(path)
    if kind == "still":
        log = log.rows(longest_rest(log))
    return Sound(f"{kind} {seed}", log, has(log))


def longest_rest(log: Log) -> slice:
    """Rows of the longest time without turns, its ends left out."""
    moving = np.linalg.norm(log.vector("gyr"), axis=1) > TURNS / 10
    edges = np.flatnonzero(np.concatenate([[True], moving, [True]]))
    longest = int(np.argmax(np.diff(edges)))
    return slice(int(edges[longest]) + 5, int(edges[longest + 1]) - 6)


def recordings() -> Iterator[Sound]:
    """Stretches of the real recordings, as far as they are there."""
    for name, first in RECORDINGS:
        if (DATA / name).exists():
            whole = load(DATA / name)
            columns = [column for column in whole.table if column.startswith(FROM_READINGS)]
            log = whole.without(*columns).rows(slice(first, first + ROWS))
            yield Sound(name.removesuffix(".parquet"), log, has(log), real=True)
