"""The ladder on real recordings: the error falls, and what one part says the other confirms."""

from __future__ import annotations

import itertools
from dataclasses import replace

import imufit
import numpy as np
import pytest
from imufit import Ladder, Log
from imufit.replaying import replay
from recording import recording

BROAD = (
    "broad/07_undisturbed_fast_rotation_B.parquet",
    "broad/21_undisturbed_fast_combined.parquet",
)


def tilt_rmse(log: Log) -> dict[str, float]:
    """Return the root mean square error of each method's angle, deg."""
    comparison = replay(log, ["accel", "complementary"]).comparison()
    assert comparison is not None
    return {name: figures.rmse_deg for name, figures in comparison.methods.items() if figures is not None}


def without_other_columns(name: str) -> Log:
    """Read a recording; the encoder's own column and another sensor's are no causes of an error."""
    return replace(imufit.read(recording(name)), covariates={})


def values(result: Ladder, effect: str) -> np.ndarray:
    return np.array([p.value for p in result.fit.parameters if p.effect == effect])


def lag(result: Ladder, sensor: str) -> float:
    """Return by how much a sensor's readings come after the reference, s, with what all sensors have in common."""
    parts = {f"{sensor}.delay": 1.0, f"{sensor}.lowpass": 1.0, "ref.delay": -1.0}
    return sum(sign * values(result, effect)[0] for effect, sign in parts.items() if effect in result.model)


@pytest.mark.parametrize("name", BROAD)
def test_delays_and_lever_arm_of_broad_are_the_same_in_both_trials(name: str) -> None:
    log = imufit.read(recording(name))
    result = imufit.ladder(log.rows(log.n // 2, log.n // 2 + log.n // 4))
    assert result.ratio_end < 0.9 * result.ratio_start
    assert {"acc.lever_arm", "mag.delay"} <= set(result.model)
    # The effect that lowers the error most comes first, whatever fits have put in the place of another.
    assert result.steps[0].after < 0.8 * result.ratio_start
    # The same sensor in every trial: its rates come four milliseconds after the cameras, its field fifteen.
    assert lag(result, "gyr") == pytest.approx(4.1e-3, rel=0.1)
    assert lag(result, "mag") == pytest.approx(15.0e-3, rel=0.1)
    assert values(result, "acc.lever_arm")[2] == pytest.approx(8.0e-3, rel=0.15)


def test_iron_of_the_aircraft_is_the_same_in_both_parts_of_the_flight() -> None:
    log = imufit.read(recording("uav_motor_current/thor75_part1.parquet"))
    # On the ground the reference's heading drifts; the second half is flight.
    cuts = [log.n // 2, 3 * log.n // 4, log.n]
    first, second = (imufit.ladder(log.rows(a, b)) for a, b in itertools.pairwise(cuts))
    for part in (first, second):
        assert part.ratio_end < 0.5 * part.ratio_start
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
    log = imufit.read(recording(name))
    first = imufit.ladder(log[: log.n // 2])
    assert first.ratio_end < 0.5 * first.ratio_start
    assert "mag.hard_iron" in first.model


def test_iron_of_the_robot_arm_is_named_beside_errors_that_nothing_explains() -> None:
    # Poses come 14 times a second, so that the rest stands far above the noise: a fiftieth of the square of the error.
    paths = [f"robot_arm/MPU6050RM3100_path{path}_150mms.parquet" for path in (1, 2, 3)]
    answer = imufit.diagnose([imufit.read(recording(path)) for path in paths])
    assert (answer.verdict, answer.best) == ("missing", "mag.hard_iron")


@pytest.mark.parametrize("effects", [["mag.soft_iron"], ["mag.hard_iron", "mag.soft_iron"]])
def test_iron_that_few_attitudes_do_not_determine_stays_of_the_size_that_iron_has(effects: list[str]) -> None:
    # Ellipsoid and length of the field can run away together: plain least squares gave a hard iron of 250,000 µT.
    log = imufit.read(recording("nine_axis_no_reference/xio_sensor_data.parquet"))
    fit = imufit.fit(log, effects)
    assert fit.training_ratio < imufit.fit(log, []).training_ratio
    sizes = {"uT": 200.0, "1": 1.0}
    assert all(abs(p.value) < sizes[p.unit] for p in fit.parameters)


def test_bias_and_mount_of_the_encoder_rig_are_confirmed_by_the_other_half() -> None:
    log = without_other_columns("encoder_rig/roll_slow.parquet")
    halves = [imufit.ladder(log.rows(first, first + 10000)) for first in (0, log.n // 2)]
    for result in halves:
        assert result.ratio_end < 0.5 * result.ratio_start
        assert result.model[0] == "acc.bias"
        # One sample, be it the encoder's delay, the gyro's or its filter's.
        assert lag(result, "gyr") == pytest.approx(0.010, abs=0.002)
    np.testing.assert_allclose(values(halves[0], "acc.bias")[0], values(halves[1], "acc.bias")[0], rtol=0.1)
    # What one half says is worth as much in the other: the filters no longer hold on to a wrong zero and a wrong mount.
    unseen = log.rows(log.n // 2, log.n)
    assert halves[0].fit.model.compare(unseen).sensors["acc"] < 1.1
    before, after = (tilt_rmse(each) for each in (unseen, halves[0].fit.model.apply(unseen)))
    assert after["accel"] < 0.5 * before["accel"]
    assert after["complementary"] < 0.5 * before["complementary"]


def test_the_sensor_lags_the_encoder_as_much_in_another_trial() -> None:
    result = imufit.ladder(without_other_columns("encoder_rig/pitch_medium.parquet").rows(0, 10000))
    # One late encoder for both sensors, or a delay of each: without a magnetometer these are the same. Least squares of
    # the accelerometer over sine and cosine of the encoder's angle, shifted in steps of 1 ms, is best at 10 ms.
    assert lag(result, "acc") == pytest.approx(0.010, abs=0.002)
    assert lag(result, "gyr") == pytest.approx(lag(result, "acc"), abs=0.005)
