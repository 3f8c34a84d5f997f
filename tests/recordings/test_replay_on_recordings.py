"""Four methods of tilt measurement on a real MPU6050, against the encoder of its shaft and at rest beside it."""

import imufit
import numpy as np
import pytest
from imufit import Log
from imufit.replaying import replay
from imufit.results import TiltComparison
from recording import recording
from scipy.spatial.transform import Rotation

METHODS = ("accel", "gyro", "complementary", "kalman")
TWO_MINUTES = 12000


def compared(log: Log) -> TiltComparison:
    comparison = replay(log, METHODS).comparison()
    assert comparison is not None
    return comparison


@pytest.mark.parametrize(
    ("trial", "axis", "least", "gain"),
    [("roll_slow", "x", 1.0, 0.9), ("roll_fast", "x", 10.0, 0.5), ("pitch_medium", "y", 3.0, 0.7)],
)
def test_both_filters_follow_a_turning_shaft_better_than_the_accelerometer(trial, axis, least, gain):
    """The faster it turns, the more of the accelerometer's reading is not gravity."""
    log = imufit.read(recording(f"encoder_rig/{trial}.parquet")).rows(0, TWO_MINUTES)
    found = compared(log)
    assert (found.kind, found.axis, found.rests) == ("rig", axis, 0)
    figures = found.methods
    assert all(each is not None and each.sd_deg is None for each in figures.values())
    assert figures["accel"].sd_moving_deg > least
    for name in ("complementary", "kalman"):
        assert figures[name].sd_moving_deg < gain * figures["accel"].sd_moving_deg
        # The accelerometer's bias and mounting stay: no filter takes them away.
        assert figures[name].offset_deg == pytest.approx(figures["accel"].offset_deg, abs=1.5)
        assert figures[name].drift_deg_per_min < 0.25 * figures["gyro"].drift_deg_per_min


def test_no_method_without_a_rate_shows_the_heading_of_a_shaft_that_stands_upright():
    found = compared(imufit.read(recording("encoder_rig/yaw_medium.parquet")).rows(0, TWO_MINUTES))
    assert found.kind == "heading"
    assert found.methods["accel"] is None
    assert any("gravity does not show this angle" in note for note in found.notes)
    for name in ("gyro", "complementary", "kalman"):
        assert 1.0 < found.methods[name].drift_deg_per_min < 10.0


@pytest.mark.parametrize(("trial", "axis"), [("pitch_medium", "y"), ("yaw_medium", "x")])
def test_the_sensor_at_rest_ranks_as_the_paper_says(trial, axis):
    """Paper B, Table 5: noise and offset of the second sensor, which stands still beside the shaft."""
    log = imufit.read(recording(f"encoder_rig/{trial}.parquet")).rows(0, TWO_MINUTES)
    acc, gyr = (np.stack([log.covariates[f"still_{s}_{a}"] for a in "xyz"], axis=1) for s in ("acc", "gyr"))
    level, _ = Rotation.align_vectors([[0.0, 0.0, 1.0]], [acc.mean(axis=0)])
    q = Rotation.concatenate([level] * log.n)
    found = compared(Log.from_arrays(log.t, acc=acc, gyr=gyr, reference=q, rig_axis=axis, frame="NWU"))
    assert (found.rests, found.moves, found.vibrations) == (1, 0, 0)
    figures = found.methods
    assert figures["accel"].sd_deg > 3.0 * figures["complementary"].sd_deg
    assert abs(figures["gyro"].drift_deg_per_min) > 1.0
    assert all(abs(figures[name].drift_deg_per_min) < 0.1 for name in ("accel", "complementary", "kalman"))
    ranks = found.ranks()
    assert {name: mark.word for name, mark in ranks["noise"].items()} == {
        "accel": "high",
        "gyro": "low",
        "complementary": "second highest",
        "kalman": "low",
    }
    assert {name: mark.word for name, mark in ranks["offset"].items()} == {
        "accel": "low",
        "gyro": "high",
        "complementary": "low",
        "kalman": "low",
    }
