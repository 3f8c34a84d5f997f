"""Real logs without a reference attitude: what their rests name agrees with what calibration finds."""

import pytest
from imufit import SensorModel, open_log, read
from imufit.calibrating import calibrate
from imufit.errors import InputError
from recording import recording


@pytest.mark.parametrize("name", ["mpu9150_unit0", "mpu9150_unit1", "mpu9150_unit3"])
def test_biases_of_a_sensor_are_named_and_agree_with_its_calibration(name):
    path = recording(f"many_positions/{name}.parquet")
    calibrated = calibrate(read(path), sensors=("gyr",)).sensors["gyr"].effects["gyr.bias"]
    fit = SensorModel().fit(open_log(path))
    first = fit.diagnose()
    assert first.evidence == "rests"
    assert first.verdict in ("missing", "ambiguous")
    assert {"acc.bias", "gyr.bias"} & {first.best, *first.ambiguous_with}
    passed = next(c for c in first.candidates if c.effect == "gyr.bias")
    assert passed.status == "significant"
    for parameter in passed.parameters:
        # On top of what else is there, and of a zero that wanders: its own error says how well it is known.
        assert abs(parameter.value - calibrated[parameter.name]) < 2.0 * parameter.standard_error < 0.05
    for parameter in SensorModel(["gyr.bias"]).fit(open_log(path)).parameters:
        assert parameter.value == pytest.approx(calibrated[parameter.name], abs=5e-4)


def test_one_long_rest_is_refused_in_words():
    with pytest.raises(InputError, match=r"too few rests.*at least 8 attitudes"):
        SensorModel().fit(open_log(recording("many_positions/mpu6050_still_7min.parquet")))


def test_field_of_a_board_that_lies_still_names_no_iron():
    path = recording("mpu6050_hmc5883l/set-2_unmoved-with-x-pointing-forward-10min.parquet")
    with pytest.raises(InputError, match="no reference attitude"):
        SensorModel().fit(open_log(path))


def test_iron_of_a_board_turned_about_the_vertical_is_named_with_what_looks_like_it():
    path = recording("mpu6050_hmc5883l/set-2_rotate-ccw-around-z-pointing-up.parquet")
    diagnosis = SensorModel().fit(open_log(path)).diagnose()
    assert diagnosis.verdict in ("missing", "ambiguous")
    assert {c.effect for c in diagnosis.candidates if c.status == "significant"} == {"mag.soft_iron", "mag.hard_iron"}
    assert "rest" in " ".join(diagnosis.notes)
