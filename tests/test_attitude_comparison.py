"""What a model does to a filter's attitude, and what the error that is left goes with."""

from dataclasses import replace

import numpy as np
import pytest
from imufit import Log, SensorModel
from imufit.comparing.attitude import attitude_comparison, corrected
from imufit.lab.simulate import simulate
from scipy.spatial.transform import Rotation

IRON = {"mag.hard_iron": {"x": 12.0, "y": -8.0, "z": 5.0}}


def iron(seed: int = 5) -> Log:
    return simulate("handheld", IRON, seed, 60.0).to_log()


def quantities(found, part: str) -> set[str]:
    return {d.quantity for d in found.dependences if d.part == part}


def test_iron_goes_with_the_field_and_goes_away_with_the_model():
    log = iron()
    as_it_is = attitude_comparison(SensorModel(), log)
    assert as_it_is.after is None
    assert as_it_is.before["heading"] > 3.0
    found = attitude_comparison(SensorModel(["mag.hard_iron"], IRON), log)
    assert found.before == as_it_is.before
    assert found.after["heading"] < 0.3 * found.before["heading"]
    assert "with the model applied" in found.sentence


def test_a_disturbed_field_is_the_environment():
    log = simulate("handheld", {}, 6, 160.0).to_log()
    mag = log.mag.copy()
    there = log.t % 40.0 > 28.0
    mag[there] += Rotation.from_quat(log.ref_q[there][:, [1, 2, 3, 0]]).inv().apply([5.0, 25.0, 0.0])
    found = attitude_comparison(SensorModel(), replace(log, mag=mag), "mahony")
    assert "field_disturbance" in quantities(found, "heading")
    assert found.limit == "environment"
    assert "The limit is the environment" in found.sentence


def test_a_bias_of_the_accelerometer_is_constant_in_the_body():
    log = simulate("tilt", {"acc.bias": {"x": 0.0, "y": 0.8, "z": 0.0}}, 7, 60.0).to_log()
    found = attitude_comparison(SensorModel(), log)
    assert next(d for d in found.dependences if d.part == "inclination").quantity == "constant"
    assert found.limit == "calibration"


def test_a_late_reference_is_set_right():
    tau = 0.04
    late = simulate("handheld", {"ref.delay": {"tau": tau}}, 8, 30.0).to_log()
    exact = simulate("handheld", {}, 8, 30.0).to_log()
    shifted = corrected(SensorModel(["ref.delay"], {"ref.delay": {"tau": tau}}), late).ref_q
    known = np.isfinite(shifted).all(axis=1)
    assert known.mean() > 0.9
    truth, found = (Rotation.from_quat(q[known][:, [1, 2, 3, 0]]) for q in (exact.ref_q, shifted))
    as_it_is = Rotation.from_quat(late.ref_q[known][:, [1, 2, 3, 0]])
    assert np.sqrt(np.mean((truth.inv() * found).magnitude() ** 2)) < 0.1 * np.sqrt(
        np.mean((truth.inv() * as_it_is).magnitude() ** 2)
    )


@pytest.mark.parametrize("what", ["reference", "gyr"])
def test_nothing_is_said_without_reference_or_sensor(what):
    log = iron()
    columns = {"acc": log.acc, "gyr": log.gyr, "mag": log.mag, "reference": log.ref_q}
    del columns[what]
    assert attitude_comparison(SensorModel(), Log.from_arrays(log.t, **columns, frame="NED")) is None


def test_json_has_numbers_for_both():
    value = attitude_comparison(SensorModel(["mag.hard_iron"], IRON), iron()).to_dict()
    assert value["filter"] == "mekf"
    assert value["before_deg"] > value["after_deg"] > 0.0


@pytest.mark.filterwarnings("error")
def test_readings_in_other_rows_than_the_reference_say_nothing_of_these():
    log = iron()
    even = (np.arange(log.n) % 2 == 0)[:, None]
    apart = replace(log, mag=np.where(even, log.mag, np.nan), ref_q=np.where(even, np.nan, log.ref_q))
    found = attitude_comparison(SensorModel(), apart)
    assert "field_disturbance" not in quantities(found, "heading")
