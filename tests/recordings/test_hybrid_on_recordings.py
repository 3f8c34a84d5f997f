"""Paper C's claim on an MPU6050 that an industrial robot carried, by the benchmark's own judgement."""

from __future__ import annotations

import runpy
from pathlib import Path

import imufit
import pytest
from imufit.comparing.attitude import corrected
from recording import recording

BENCH = Path(__file__).resolve().parents[2] / "benches" / "robot_arm.py"
HEADING, INCLINATION, TOTAL = 0, 1, 2


def test_the_calibrated_hybrid_beats_triad_and_mahony_with_the_whole_field_loses() -> None:
    bench = runpy.run_path(str(BENCH))
    known = bench["read"](recording("robot_arm/MPU6050RM3100_path1_150mms.parquet"))
    ladder = imufit.ladder(known)
    # Hard iron of the size of the field, and a reference that is late; what is found beyond is small.
    assert ladder.model[:2] == ("mag.hard_iron", "ref.delay")
    model = imufit.SensorModel(ladder.model[:2]).fit(known).model
    log = bench["read"](recording("robot_arm/MPU6050RM3100_path4_300mms.parquet"))
    before, after = (bench["judged"](each) for each in (log, corrected(model, log)))
    assert after["TRIAD"][TOTAL] < 0.35 * before["TRIAD"][TOTAL]
    triad, first, second = (after[name] for name in ("TRIAD", "hybrid driven, figure 3", "hybrid driven, figure 4"))
    assert first[TOTAL] < 0.97 * triad[TOTAL]
    assert second[TOTAL] < 0.85 * triad[TOTAL]
    for each in (first, second):
        assert each[INCLINATION] < 0.9 * triad[INCLINATION]
    assert after["Mahony, figure 3"][TOTAL] == pytest.approx(first[TOTAL], rel=0.05)
    # The field dips by 46 degrees here, and with k_1 = k_2 half of that is the error of the inclination.
    assert after["Mahony, whole field, figure 3"][INCLINATION] == pytest.approx(23.0, abs=4.0)
    assert after["Mahony, whole field, figure 4"][TOTAL] < triad[TOTAL]
    assert after["mekf"][INCLINATION] < 0.6 * triad[INCLINATION]
