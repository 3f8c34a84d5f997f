"""``imufit convert``: what people bring as text becomes a log, and what was read is told."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from imufit.cli.app import main
from imufit.log import Log, contents, read
from recording import recording

COUNTS = ",".join(f"acc_{a}=accel_{a}[16384LSB/g],gyr_{a}=gyro_{a}[131LSB/dps]" for a in "xyz")
RAW = ",".join(f"acc_{a}=a{a}[16384LSB/g],gyr_{a}=g{a}[131LSB/dps]" for a in "xyz")
FILES = {
    "many_positions/mpu9150_unit0.log": ["t=row[100Hz],acc_x=c1,acc_y=c2,acc_z=c3,gyr_x=c4,gyr_y=c5,gyr_z=c6"],
    "many_positions/mpu6050_poses_raw_counts.csv": ["t=row[100Hz]", RAW],
    "six_positions/ferraris_session_A.csv": [
        "t=n_samples[102.4Hz]",
        "gyr_x=gyr_x[dps],gyr_y=gyr_y[dps],gyr_z=gyr_z[dps]",
    ],
    "serial_transcripts/sixface.log": ["t=row[1Hz]", COUNTS, "temp=temp_raw[333.87LSB/degC+21]"],
    "serial_transcripts/stationary-60s.log": ["t=row[10Hz]", COUNTS, "temp=temp_raw[333.87LSB/degC+21]"],
}


def run(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str, str]:
    code = main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("suffix", [".parquet", ".csv", ".npz"])
def test_real_files_become_logs(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, suffix: str) -> None:
    path, out = recording(name), tmp_path / f"log{suffix}"
    mapping = [word for text in FILES[name] for word in ("--map", text)]
    code, printed, err = run(capsys, "convert", path, *mapping, "-o", out, "--json", "-")
    assert (code, err) == (0, "")
    told, log = json.loads(printed), read(out)
    assert told["n"] == log.n
    assert told["rate_hz"] == pytest.approx((log.n - 1) / log.duration, rel=1e-6)
    assert {column["name"] for column in told["columns"]} == set(log.table())
    assert log.acc is not None
    assert log.gyr is not None
    assert 8.0 < np.median(np.linalg.norm(log.acc, axis=1)) < 11.0
    # turned by hand: in degrees per second it would be hundreds
    assert np.abs(log.gyr).max() < 20.0


def test_what_was_read_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = [f"acc=(0, 0.0{k}, 9.8) t={0.1 * k:.1f} vbat=3.7" for k in range(9)]
    (tmp_path / "a.log").write_text("\n".join(["boot", "# face_begin +z", *lines, ""]))
    mapping = "t=t,acc_x=acc_x,acc_y=acc_y,acc_z=acc_z"
    code, out, err = run(capsys, "convert", tmp_path / "a.log", "--map", mapping, "-o", tmp_path / "b.csv")
    assert (code, err) == (0, "")
    words = [line.split() for line in out.splitlines()]
    assert "9 rows over 0.8 s, 10 Hz." in out
    assert "a.log: 9 records (acc, t, vbat); 1 other line ignored." in out
    assert ["acc_y", "m/s^2", "9", "0", "0.04", "0.08"] in words
    assert ["vbat", "9", "3.7", "3.7", "3.7"] in words
    assert ["pose", "+z", "9"] in words
    assert "Missing: gyroscope, magnetometer, temperature, reference attitude." in out


def test_unusable_text_leaves_no_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.log").write_text("ax=0 ay=0 az=9.8\n" * 5)
    code, out, err = run(capsys, "convert", tmp_path / "a.log", "-o", tmp_path / "b.csv")
    assert (code, out) == (2, "")
    assert err == (
        "imufit: a.log: column t is missing. If this is right, use --map "
        "'t=row[100Hz],acc_x=ax[m/s^2],acc_y=ay[m/s^2],acc_z=az[m/s^2]'\n"
    )
    assert not (tmp_path / "b.csv").exists()


def test_every_command_takes_the_text_itself(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = recording("serial_transcripts/stationary-60s.log")
    mapping = [word for text in FILES["serial_transcripts/stationary-60s.log"] for word in ("--map", text)]
    code, out, err = run(capsys, "replay", path, *mapping, "--filter", "mahony", "--json", "-")
    assert (code, err) == (0, "")
    assert json.loads(out)["n"] == 580


def test_contents_of_a_log_with_gaps() -> None:
    mag = [[1.0, 2.0, np.nan], [np.nan] * 3, [3.0, np.nan, np.nan]]
    log = Log.from_arrays([0.0, 0.1, 0.2], mag=mag, pose=["+x", None, "+x"], covariates={"empty": [np.nan] * 3})
    found = contents(log)
    told = {column["name"]: column for column in found.to_dict()["columns"]}
    assert told["mag_x"] == {"name": "mag_x", "unit": "uT", "samples": 2, "low": 1.0, "median": 2.0, "high": 3.0}
    assert told["empty"]["median"] is None
    assert told["pose"] == {"name": "pose", "unit": "", "samples": 2, "labels": ["+x"]}
    assert found.missing == ("acc", "gyr", "temp", "ref_q")
    assert found.rate == pytest.approx(10.0)


def test_contents_of_a_single_row() -> None:
    assert contents(Log.from_arrays([1.0], acc=[[0.0, 0.0, 9.8]])).to_dict()["rate_hz"] is None
