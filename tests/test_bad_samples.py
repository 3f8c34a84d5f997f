"""A single bad angular rate of any size is bridged."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import imufit
import numpy as np
import pytest
from imufit import Log
from imufit.replay import replay
from recording import recording
from scipy.spatial.transform import Rotation
from test_mekf import moving

AT = 16.7
"""Where the bad rate is, s."""


@cache
def hand(seed: int) -> Log:
    return moving(50.0, still=3.0, seed=seed)[0]


@cache
def walked() -> Log:
    """Sixty seconds of a recording by hand, with breaks."""
    log = imufit.read(recording("broad/05_undisturbed_slow_rotation_with_breaks_B.parquet"))
    start = np.searchsorted(log.t, log.t[0] + 30.0)
    rows = slice(start, np.searchsorted(log.t, log.t[0] + 90.0))
    columns = {name: getattr(log, name)[rows] for name in ("t", "acc", "gyr", "mag")}
    return Log.from_arrays(**columns, frame=log.metadata.frame)


def logs(which: str) -> Log:
    return walked() if which == "recorded" else hand(int(which))


def with_bad_rate(log: Log, size: float) -> Log:
    axis = np.random.default_rng(7).normal(size=3)
    gyr = np.array(log.gyr)
    gyr[np.searchsorted(log.t, log.t[0] + AT)] = size * axis / np.linalg.norm(axis)
    return replace(log, gyr=gyr)


def apart(found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Angle between attitudes, deg."""
    a, b = (Rotation.from_quat(q[:, [1, 2, 3, 0]]) for q in (found, expected))
    return np.degrees((a * b.inv()).magnitude())


@pytest.mark.parametrize("which", ["3", "4", "recorded"])
@pytest.mark.parametrize("size", [5.0, 35.0, 200.0, 1000.0, 1e100])
def test_a_single_bad_rate_is_bridged_and_counted(which: str, size: float):
    log = logs(which)
    expected = replay(log, ["gyro"])
    found = replay(with_bad_rate(log, size), ["gyro"])
    assert apart(found.attitude["gyro"], expected.attitude["gyro"]).max() < 0.5
    assert found.skipped["gyr_bridged"] == expected.skipped.get("gyr_bridged", 0) + 1
