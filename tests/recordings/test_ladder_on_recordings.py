"""The ladder on real recordings: the error falls, and what one part says the other confirms."""

from __future__ import annotations

import itertools

import imufit
import numpy as np
import pytest
from imufit import Ladder, Log
from recording import recording

BROAD = (
    "broad/02_undisturbed_slow_rotation_B.parquet",
    "broad/07_undisturbed_fast_rotation_B.parquet",
    "broad/21_undisturbed_fast_combined.parquet",
)


def climbed(name: str) -> tuple[Log, Ladder]:
    log = imufit.read(recording(name))
    return log, imufit.ladder(log)


def values(result: Ladder, effect: str) -> np.ndarray:
    return np.array([p.value for p in result.fit.parameters if p.effect == effect])


@pytest.mark.parametrize("name", BROAD)
def test_delay_and_lever_arm_of_broad_are_confirmed_by_the_other_half(name: str) -> None:
    log, whole = climbed(name)
    assert whole.ratio_end < 0.9 * whole.ratio_start
    halves = [imufit.ladder(log.rows(0, log.n // 2)), imufit.ladder(log.rows(log.n // 2, log.n))]
    for result in (whole, *halves):
        assert set(result.model[:2]) == {"ref.delay", "acc.lever_arm"}
        # The same sensor in every trial: its clock runs ahead of the cameras by four milliseconds.
        assert values(result, "ref.delay")[0] == pytest.approx(-4.0e-3, rel=0.1)
        assert values(result, "acc.lever_arm")[2] == pytest.approx(8.0e-3, rel=0.15)


def test_iron_of_the_aircraft_is_the_same_in_both_parts_of_the_flight() -> None:
    log, whole = climbed("uav_motor_current/thor75_part1.parquet")
    assert whole.ratio_end < 0.5 * whole.ratio_start
    # On the ground the reference's heading drifts; the second half is flight.
    cuts = [log.n // 2, 3 * log.n // 4, log.n]
    first, second = (imufit.ladder(log.rows(a, b)) for a, b in itertools.pairwise(cuts))
    np.testing.assert_allclose(values(first, "mag.hard_iron"), values(second, "mag.hard_iron"), rtol=0.2)


@pytest.mark.parametrize(
    "name",
    [
        "robot_arm/MPU6050RM3100_path1_150mms.parquet",
        "robot_arm/MPU9150_path1_150mms.parquet",
        "robot_arm/MPU6050RM3100_path3_150mms.parquet",
    ],
)
def test_error_falls_on_the_robot_arm(name: str) -> None:
    _, whole = climbed(name)
    assert whole.ratio_end < 0.5 * whole.ratio_start
    assert "mag.hard_iron" in whole.model


def test_bias_and_mount_of_the_encoder_rig_are_confirmed_by_the_other_half() -> None:
    log = imufit.read(recording("encoder_rig/roll_slow.parquet"))
    halves = [imufit.ladder(log.rows(first, first + 30000)) for first in (0, log.n // 2)]
    for result in halves:
        assert result.ratio_end < 0.5 * result.ratio_start
        assert result.model[0] == "acc.bias"
    np.testing.assert_allclose(values(halves[0], "acc.bias")[0], values(halves[1], "acc.bias")[0], rtol=0.1)
