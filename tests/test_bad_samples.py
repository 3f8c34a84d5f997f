"""Filters that hold on to a vector are back near their undisturbed selves 20 s after bad samples of any size."""

from __future__ import annotations

from functools import cache

import imufit
import numpy as np
import pytest
from imufit import Log
from imufit.replaying import replay
from recording import recording
from scipy.spatial.transform import Rotation
from test_mekf import moving

FILTERS = ("complementary", "kalman", "mahony", "madgwick", "hybrid", "mekf", "smoother", "triad", "quest", "accel")
WITHOUT_HEADING = ("complementary", "kalman")
SIZES = {"gyr": (5.0, 35.0, 1000.0, 1e100), "acc": (30.0, 157.0, 1e5, 1e100), "mag": (100.0, 1e5, 1e100)}
"""rad/s, m/s^2 and uT: from what hands do over the end of a range to bytes that are none."""
KINDS = ("one", "two", "const", "noise", "zero")
"""What is bad: one sample, two, or those of a second (all the same, noise, zeros)."""
LEFT = 2.0
"""Most that is left of the attitude, deg."""
AT = 16.7
"""Where the bad samples begin, s."""


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


@cache
def undisturbed(which: str) -> dict[str, np.ndarray]:
    return replay(logs(which), list(FILTERS)).attitude


def logs(which: str) -> Log:
    return walked() if which == "recorded" else hand(int(which))


def with_bad(log: Log, sensor: str, kind: str, size: float, seed: int) -> Log:
    rng = np.random.default_rng(seed)
    column = np.array(getattr(log, sensor))
    first = int(np.searchsorted(log.t, log.t[0] + AT))
    rows = {"one": 1, "two": 2}.get(kind, round(1.0 / float(np.median(np.diff(log.t)))))
    bad = size * rng.normal(size=(rows, 3))
    if kind != "noise":
        direction = rng.normal(size=3)
        bad[:] = size * direction / np.linalg.norm(direction)
    column[first : first + rows] = bad
    return log.with_fields(**{sensor: column})


def apart(log: Log, name: str, found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Angle between attitudes, deg; of the vertical where nothing shows the heading."""
    a, b = (Rotation.from_quat(q[:, [1, 2, 3, 0]]) for q in (found, expected))
    if name not in WITHOUT_HEADING:
        return np.degrees((a * b.inv()).magnitude())
    up = [q.inv().apply([0.0, 0.0, 1.0]) for q in (a, b)]
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(*up), axis=1), (up[0] * up[1]).sum(axis=1)))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("sensor", ["gyr", "acc", "mag"])
@pytest.mark.parametrize("which", ["3", "4", "recorded"])
def test_every_filter_is_itself_again_twenty_seconds_after_bad_samples(which: str, sensor: str, kind: str):
    log = logs(which)
    after = log.t - log.t[0] >= AT + 21.0
    for size in SIZES[sensor] if kind != "zero" else (0.0,):
        found = replay(with_bad(log, sensor, kind, size, seed=len(which)), list(FILTERS)).attitude
        for name in FILTERS:
            left = apart(log, name, found[name][after], undisturbed(which)[name][after])
            assert left.max() < LEFT, f"{name}, {sensor} {kind} {size:g}: {left.max():.2f} deg"


@pytest.mark.parametrize("seed", [105, 106, 108])
def test_zeros_for_a_second_are_known_not_to_be_the_motion(seed: int):
    """Between two rates that zeros do not go with, the turn is uncertain: filters with a covariance are back soon."""
    log = hand(seed)
    bad = with_bad(log, "gyr", "zero", 0.0, seed)
    names = ("kalman", "mekf")
    found, expected = replay(bad, list(names)).attitude, replay(log, list(names)).attitude
    for name in names:
        off = apart(log, name, found[name], expected[name])
        assert off.max() > 5.0
        assert off[log.t - log.t[0] >= AT + 6.0].max() < LEFT, (
            f"{name}: {off[log.t - log.t[0] >= AT + 6.0].max():.2f} deg"
        )


def test_a_magnet_on_the_sensor_is_not_taken_for_a_lost_heading():
    log = imufit.read(recording("broad/33_disturbed_attached_magnet_2cm.parquet"))
    watched, alone = (
        np.sqrt(np.nanmean(replay(log, ["madgwick"], {"replay": rules}).row_errors("madgwick")[:, 0] ** 2))
        for rules in ({}, {"recovery": 0.0})
    )
    assert watched < 1.1 * alone, f"{np.degrees(watched):.1f} deg, {np.degrees(alone):.1f} deg by the equations alone"


@pytest.mark.parametrize("which", ["3", "4", "recorded"])
@pytest.mark.parametrize("size", [5.0, 35.0, 200.0, 1000.0, 1e100])
def test_a_single_bad_rate_is_bridged_and_counted(which: str, size: float):
    log = logs(which)
    expected = replay(log, ["gyro"])
    found = replay(with_bad(log, "gyr", "one", size, seed=7), ["gyro"])
    assert apart(log, "gyro", found.attitude["gyro"], expected.attitude["gyro"]).max() < 0.5
    assert found.skipped["gyr_bridged"] == expected.skipped.get("gyr_bridged", 0) + 1
