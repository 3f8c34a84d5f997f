"""Calibration of real sensors, judged on poses, turns and stretches of time that the fit did not see."""

import numpy as np
import pytest
from imufit import SensorModel, read
from imufit.calibrating import calibrate, find_poses
from imufit.errors import InputError
from imufit.log import parse_mapping
from recording import recording

TRANSCRIPT = (
    "temp=temp_raw[333.87LSB/degC+21],acc_x=accel_x[16384LSB/g],acc_y=accel_y[16384LSB/g],acc_z=accel_z[16384LSB/g],"
    "gyr_x=gyro_x[131LSB/dps],gyr_y=gyro_y[131LSB/dps],gyr_z=gyro_z[131LSB/dps]"
)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def rest_errors(log, result=None):
    """|f| - g of every rest of a log, before or after a calibration."""
    readings = np.array([pose.mean for pose in find_poses(log, labelled_only=False).poses if pose.used])
    corrected = readings if result is None else result.sensors["acc"].correct(readings)
    return np.linalg.norm(corrected, axis=1) - log.metadata.gravity


@pytest.mark.parametrize(
    ("name", "poses", "cost", "least", "most"),
    [
        ("mpu9150_unit0", 20, "magnitude", 0.2, 0.004),
        ("mpu9150_unit1", 20, "magnitude", 0.2, 0.004),
        ("mpu9150_unit3", 20, "magnitude", 0.07, 0.004),
        ("xsens_mti_37_poses", 37, "magnitude", 1.0, 0.002),
        ("mpu6050_poses", 11, "magnitude", 0.6, 0.05),
    ],
)
def test_poses_left_out_come_to_gravity(name, poses, cost, least, most):
    result = calibrate(read(recording(f"many_positions/{name}.parquet")))
    acc = result.sensors["acc"]
    assert acc.cost == cost
    assert len(result.used) >= poses
    assert acc.before > least
    assert acc.held_out < most


@pytest.mark.parametrize("name", ["mpu9150_unit0", "mpu9150_unit1", "mpu9150_unit3", "xsens_mti_37_poses"])
def test_turns_left_out_end_where_gravity_says(name):
    gyr = calibrate(read(recording(f"many_positions/{name}.parquet"))).sensors["gyr"]
    assert gyr.cost == "turns"
    assert gyr.held_out < 0.8 * gyr.before
    assert np.degrees(gyr.held_out) < 0.6


def test_six_labelled_positions_calibrate_the_rests_that_have_no_label():
    log = read(recording("six_positions/ferraris_session_A.parquet"))
    result = calibrate(log)
    acc = result.sensors["acc"]
    assert acc.cost == "vector"
    assert len(result.used) == 6
    assert acc.held_out < 0.1 * acc.before
    assert rms(rest_errors(log)) > 0.5
    assert rms(rest_errors(log, result)) < 0.006
    assert result.sensors["gyr"].held_out < result.sensors["gyr"].before


def test_a_model_from_a_file_corrects_the_log_as_the_calibration_says(tmp_path):
    log = read(recording("many_positions/mpu9150_unit0.parquet"))
    result = calibrate(log)
    result.save(tmp_path / "sensor.toml")
    corrected = SensorModel.load(tmp_path / "sensor.toml").apply(log)
    assert rms(rest_errors(corrected)) < 1.2 * result.sensors["acc"].after + 1e-3
    again = calibrate(corrected).sensors["acc"]
    np.testing.assert_allclose(again.scale, 1.0, atol=2e-4)
    np.testing.assert_allclose(again.bias, 0.0, atol=2e-3)


def test_free_rotation_brings_the_rests_of_other_logs_nearer_to_gravity():
    folder = "mpu6050_hmc5883l/set-2_"
    result = calibrate(read(recording(f"{folder}full-sphere.parquet")))
    rests = [
        read(recording(f"{folder}unmoved-with-{name}.parquet"))
        for name in ("x-pointing-forward-10min", "z-pointing-front-and-x-up", "z-pointing-front-and-y-down")
    ]
    before = rms(np.concatenate([rest_errors(log) for log in rests]))
    after = rms(np.concatenate([rest_errors(log, result) for log in rests]))
    assert before > 0.2
    assert after < 0.4 * before
    mag = result.sensors["mag"]
    assert mag.before > 7.0
    assert mag.held_out < 0.4
    assert mag.extras["dip_error_deg"]["after"] < 0.5 * mag.extras["dip_error_deg"]["before"]


@pytest.mark.parametrize(("name", "least", "most"), [("qmc5883l_unit_a", 5.0, 0.7), ("ck_acc_mag", 15.0, 0.5)])
def test_the_field_has_one_length_in_stretches_left_out(name, least, most):
    mag = calibrate(read(recording(f"magnetometer_sphere/{name}.parquet")), sensors=["mag"]).sensors["mag"]
    assert mag.before > least
    assert mag.held_out < most


@pytest.mark.parametrize(
    ("name", "rate", "message"),
    [
        ("stationary-60s.log", 10, "bias and tilt can't be separated"),
        ("sixface.log", 1, r"pose 1 \(\+x\): not still"),
    ],
)
def test_a_transcript_that_cannot_calibrate_says_why(name, rate, message):
    mapping = parse_mapping(f"t=row[{rate}Hz],{TRANSCRIPT}")
    log = read(recording(f"serial_transcripts/{name}"), mapping=mapping)
    with pytest.raises(InputError, match=message):
        calibrate(log)


def test_a_transcript_at_rest_gives_the_bias_of_the_gyro():
    mapping = parse_mapping(f"t=row[10Hz],{TRANSCRIPT}")
    log = read(recording("serial_transcripts/stationary-60s.log"), mapping=mapping)
    gyr = calibrate(log, sensors=["gyr"]).sensors["gyr"]
    assert gyr.cost == "rest"
    np.testing.assert_allclose(-gyr.bias, np.mean(log.gyr, axis=0), atol=2e-4)
    half = [read(log.path, mapping=mapping).rows(*rows) for rows in ((0, log.n // 2), (log.n // 2, log.n))]
    first = calibrate(half[0], sensors=["gyr"]).sensors["gyr"]
    before, after = np.mean(half[1].gyr, axis=0), np.mean(half[1].gyr, axis=0) + first.bias
    assert np.linalg.norm(after) < 0.02 * np.linalg.norm(before)
