"""Filter and smoother on hand-moved recordings with optical reference (BROAD)."""

from dataclasses import replace

import imufit
import pytest
from imufit.replaying import replay
from recording import recording


@pytest.mark.parametrize(
    ("trial", "filtered", "smoothed"),
    [("11_undisturbed_slow_translation_B", 1.3, 0.6), ("33_disturbed_attached_magnet_2cm", 2.2, 1.7)],
)
def test_the_field_is_north_and_nothing_else_is_known(trial: str, filtered: float, smoothed: float) -> None:
    log = imufit.read(recording(f"broad/{trial}.parquet"))
    log = replace(log, metadata=replace(log.metadata, mag_reference=(0.0, 20.0, -44.0)))
    errors = replay(log, ["mahony", "mekf", "smoother"]).errors
    assert errors["mekf"]["total_deg"] < min(filtered, errors["mahony"]["total_deg"])
    assert errors["smoother"]["total_deg"] < min(smoothed, errors["mekf"]["total_deg"])
    assert errors["mekf"]["inclination_deg"] < 0.8
