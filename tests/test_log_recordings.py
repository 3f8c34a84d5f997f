"""Every real recording is read without complaint, and the originals agree with what was made of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from imufit.errors import InputError
from imufit.log import Log, open_log, parse_mapping, read
from pasted import shell_mappings
from recording import DATA, recording

FILES = sorted(DATA.rglob("*.parquet")) if DATA.is_dir() else []

TRUE_NOTES = {"phone_qualisys": ("the norm of mag is",)}
"""Rightly said of a folder's recordings: the phone's magnetometer is raw, hundreds of uT off."""


def test_the_recordings_are_there() -> None:
    recording("README.md")
    assert len(FILES) > 40


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_recording_is_read(path: Path) -> None:
    log = read(path)
    assert np.all(np.diff(log.t) > 0.0)
    assert log.metadata.extra["license"]
    for note in log.notes:
        assert any(true in note for true in TRUE_NOTES.get(path.parent.name, ())) or "repeated time stamps" in note
    stream = open_log(path, stream=True)
    assert (stream.n, stream.columns, stream.notes) == (log.n, log.columns, log.notes)
    np.testing.assert_array_equal(np.concatenate([chunk.core.t for chunk in stream.chunks(9999, 10)]), log.t)


def test_encoder_rig_has_a_coarse_clock() -> None:
    assert read(recording("encoder_rig/roll_fast.parquet")).notes == (
        "roll_fast.parquet: 240 repeated time stamps: clock coarser than the sampling; "
        "the second row of each pair was moved halfway to the next stamp",
    )


def close(log: Log, name: str, *, since: int = 0) -> None:
    other = read(recording(name))
    for sensor in ("acc", "gyr", "mag"):
        if getattr(other, sensor) is not None:
            np.testing.assert_allclose(
                getattr(log, sensor)[since:], getattr(other, sensor)[since:], rtol=1e-5, atol=1e-6
            )


def test_original_of_a_nine_axis_log() -> None:
    path = recording("nine_axis_no_reference/xio_sensor_data.csv")
    log = read(path)
    close(log, "nine_axis_no_reference/xio_sensor_data.parquet")
    assert log.notes[0].startswith("xio_sensor_data.csv: taken for x-io: t from 'Time (s)' in s, acc from")


COUNTS = [f"acc_{a}=a{a}[16384 LSB/g],gyr_{a}=g{a}[131 LSB/(deg/s)]" for a in "xyz"]


def test_original_without_header() -> None:
    path = recording("many_positions/mpu9150_unit0.log")
    with pytest.raises(InputError, match="the columns c1 to c6 have no names") as caught:
        read(path)
    # the mapping that the error names is all it takes
    log = read(path, parse_mapping(shell_mappings(str(caught.value.shell_remedy))[0]))
    close(log, "many_positions/mpu9150_unit0.parquet")
    assert log.notes == ("mpu9150_unit0.log: no header: the columns are called c1 to c6",)


def test_original_in_raw_counts() -> None:
    path = recording("many_positions/mpu6050_poses_raw_counts.csv")
    close(read(path, parse_mapping("t=row[100 Hz]", *COUNTS)), "many_positions/mpu6050_poses.parquet")
    with pytest.raises(InputError, match="raw counts of 16384 LSB/g"):
        read(path, parse_mapping("t=row[100 Hz]", *(text.replace("[16384 LSB/g]", "") for text in COUNTS)))


def test_original_in_degrees_per_second() -> None:
    path = recording("six_positions/ferraris_session_A.csv")
    with pytest.raises(InputError, match="looks like deg/s, not rad/s"):
        read(path, parse_mapping("t=n_samples[102.4 Hz]"))
    mapping = parse_mapping("t=n_samples[102.4 Hz]", *(f"gyr_{a}=gyr_{a}[deg/s]" for a in "xyz"))
    close(read(path, mapping), "six_positions/ferraris_session_A.parquet")


def test_flight_log_with_disordered_time() -> None:
    path = recording("rocket_messy_csv/government_work_2_airbrakes.csv")
    acc = [f"acc_{a}=raw_acceleration_{a}_gs[g]" for a in "xyz"]
    with pytest.raises(InputError, match=r"row \d+ \(line \d+\), column t: t = .* (repeats|is before)"):
        read(path, parse_mapping("t=timestamp_seconds", *acc))


def test_magnetometers_of_unlike_scale_are_not_refused() -> None:
    for name in ("robot_arm/MPU9150_path2_150mms", "robot_arm/MPU6050RM3100_path1_150mms"):
        assert read(recording(f"{name}.parquet")).mag is not None


@pytest.mark.parametrize("name", ["robot_arm/MPU9150_path1_150mms", "six_positions/ferraris_session_A"])
@pytest.mark.parametrize("factor", [180 / np.pi, 131 * 180 / np.pi])
def test_real_rates_in_another_unit_are_refused(tmp_path: Path, name: str, factor: float) -> None:
    df = read(recording(f"{name}.parquet")).to_dataframe()
    for axis in "xyz":
        df[f"gyr_{axis}"] *= factor
    df.to_parquet(tmp_path / "a.parquet")
    with pytest.raises(InputError, match=r"column gyr_x: .* not rad/s"):
        read(tmp_path / "a.parquet")
