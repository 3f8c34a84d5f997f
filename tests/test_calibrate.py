"""Calibration: what was put into the sensor comes out, and what cannot be calibrated from is told."""

import json

import numpy as np
import pytest
from calibration_logs import FIELD, GRAVITY, SIDES, UP, Sensor, course, exp, joined, spread, tumbling, typical
from cli_stand_in import strict_json
from imufit import Log, SensorModel
from imufit.calibrating import calibrate, find_poses
from imufit.errors import InputError
from imufit.lab.simulate import simulate

OFF = {"xy": (0, 1), "xz": (0, 2), "yx": (1, 0), "yz": (1, 2), "zx": (2, 0), "zy": (2, 1)}
TURNED = [side for side in SIDES for _ in range(3)]
HEADINGS = [0.0, 2.1, 4.2] * 6


def log_of(sensor, where, seed=0, *, names="acc gyr pose", shake=0.0, **changed):
    return Log.from_arrays(**{**sensor.read(where, seed, names=names, shake=shake), **changed})


def six(sensor=None, seed=0, **changed):
    """Return a log of the six sides, labelled."""
    return log_of(sensor or typical(), course(SIDES), seed, **changed)


def truth_of(sensor):
    """Parameters of the sensor model that the sensor was made from."""
    truth = {}
    for name, gain, bias in (
        ("acc", sensor.acc_gain, sensor.acc_bias),
        ("gyr", sensor.gyr_gain, sensor.gyr_bias),
    ):
        truth[f"{name}.bias"] = dict(zip("xyz", bias, strict=True))
        truth[f"{name}.scale"] = dict(zip("xyz", np.diag(gain) - 1.0, strict=True))
        truth[f"{name}.misalignment"] = {key: gain[place] for key, place in OFF.items()}
    truth["acc.bias_temperature"] = dict(zip("xyz", sensor.bias_slope, strict=True))
    truth["acc.scale_temperature"] = dict(zip("xyz", sensor.scale_slope, strict=True))
    return truth


def pulls(result, sensor, *effects):
    """Errors over their standard errors."""
    truth, found = truth_of(sensor), {}
    for one in result.sensors.values():
        found.update({name: (one.effects[name], one.standard_errors[name]) for name in one.effects})
    return np.array(
        [
            (found[effect][0][key] - truth[effect][key]) / found[effect][1][key]
            for effect in effects
            for key in truth[effect]
        ]
    )


def refused(log, words, cost=None, **keywords):
    with pytest.raises(InputError) as told:
        calibrate(log, cost, **keywords)
    assert words in str(told.value)
    assert "\n" not in str(told.value)
    return str(told.value)


ACC = ("acc.bias", "acc.scale", "acc.misalignment")
GYR = ("gyr.bias", "gyr.scale", "gyr.misalignment")


# What was put in comes out.


@pytest.mark.parametrize("names", ["acc gyr pose", "acc gyr", "acc pose", "acc"])
def test_six_poses_give_bias_scale_and_misalignment_labelled_or_not(names):
    sensor = typical(1)
    result = calibrate(log_of(sensor, course(SIDES), names=names))
    assert result.sensors["acc"].cost == "vector"
    assert np.all(np.abs(pulls(result, sensor, *ACC)) < 4.0)
    errors = result.sensors["acc"].standard_errors
    assert max(errors["acc.bias"].values()) < 0.003
    assert max(max(errors[name].values()) for name in ACC[1:]) < 5e-4
    assert [pose.side for pose in result.poses] == list(SIDES)


def test_labels_add_nothing_to_what_the_readings_say():
    where, sensor = course(SIDES), typical(2)
    labelled, plain = (
        calibrate(log_of(sensor, where, names=names), sensors=["acc"]).sensors["acc"] for names in ("acc pose", "acc")
    )
    # The rests are cut a little differently: that is worth less than the noise.
    assert np.all(np.abs(labelled.matrix - plain.matrix) < 3e-4)
    assert np.all(np.abs(labelled.bias - plain.bias) < 3e-3)


def test_paper_form_undoes_the_sensor():
    sensor = typical(3)
    acc = calibrate(six(sensor)).sensors["acc"]
    assert np.all(np.diag(acc.misalignment) == 1.0)
    for up in UP.values():
        reading = sensor.acc_gain @ up * GRAVITY + sensor.acc_bias
        corrected = acc.misalignment @ np.diag(acc.scale) @ reading + acc.bias
        assert np.linalg.norm(corrected - up * GRAVITY) < 0.01
    assert acc.before > 0.1
    assert acc.after < 0.005


@pytest.mark.parametrize("count", [12, 16, 24])
def test_lengths_alone_give_scale_bias_and_non_orthogonality(count):
    sensor = typical(4)
    # Lengths leave a rotation open: the sensor's own axes are those in which the correction is symmetric.
    sensor.acc_gain = 0.5 * (sensor.acc_gain + sensor.acc_gain.T)
    result = calibrate(log_of(sensor, course(spread(count, seed=4)), names="acc"))
    assert result.sensors["acc"].cost == "magnitude"
    assert np.all(np.abs(pulls(result, sensor, *ACC)) < 4.0)
    matrix = result.sensors["acc"].matrix
    assert np.allclose(matrix, matrix.T, atol=1e-12)
    assert max(result.sensors["acc"].standard_errors["acc.bias"].values()) < 0.005


def test_lengths_correct_a_sensor_whose_axes_are_turned_up_to_a_rotation():
    sensor = typical(5)
    acc = calibrate(log_of(sensor, course(spread(16)), names="acc"), "magnitude").sensors["acc"]
    product = acc.matrix @ sensor.acc_gain
    assert np.allclose(product @ product.T, np.eye(3), atol=2e-3)
    assert acc.after < 0.005


def test_turns_between_rests_give_the_gyro():
    sensor = typical(6)
    result = calibrate(log_of(sensor, course([*SIDES, *spread(6)]), names="acc gyr pose"))
    gyr = result.sensors["gyr"]
    assert gyr.cost == "turns"
    assert np.all(np.abs(pulls(result, sensor, *GYR)) < 4.0)
    assert max(gyr.standard_errors["gyr.scale"].values()) < 3e-3
    assert max(gyr.standard_errors["gyr.bias"].values()) < 3e-4
    assert gyr.after < 0.2 * gyr.before


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_flipped_gyro_axis_is_found_and_told(axis):
    sensor = typical(7)
    sensor.gyr_gain[axis] *= -1.0
    sensor.gyr_bias[axis] *= -1.0
    result = calibrate(log_of(sensor, course([*SIDES, *spread(4)])))
    assert f"Negative scale: gyro axis {'xyz'[axis]} is flipped." in result.verdict
    assert np.all(np.abs(pulls(result, sensor, *GYR)) < 4.0)


def test_flipped_accelerometer_axis_is_calibrated_as_a_negative_scale():
    sensor = typical(8)
    sensor.acc_gain[1] *= -1.0
    result = calibrate(six(sensor))
    assert "Negative scale: axis y is flipped" in result.verdict
    assert result.sensors["acc"].scale[1] < -0.9
    assert np.all(np.abs(pulls(result, sensor, *ACC)) < 4.0)


def test_gyro_bias_alone_is_left_where_nothing_turns_enough():
    sensor = typical(9)
    result = calibrate(log_of(sensor, course(["+z"], hold=6.0), names="acc gyr"), sensors=["gyr"])
    assert result.sensors["gyr"].cost == "rest"
    assert set(result.sensors["gyr"].effects) == {"gyr.bias"}
    assert np.all(np.abs(pulls(result, sensor, "gyr.bias")) < 4.0)


@pytest.fixture(scope="module")
def tumbled():
    return tumbling(40.0)


def test_field_of_constant_length_gives_hard_iron_and_soft_iron_up_to_a_rotation(tumbled):
    sensor = typical(10)
    log = log_of(sensor, tumbled, names="mag", mag_reference=FIELD)
    mag = calibrate(log).sensors["mag"]
    assert "dip" not in mag.extras
    assert np.allclose(list(mag.effects["mag.hard_iron"].values()), sensor.hard_iron, atol=0.1)
    product = mag.matrix @ sensor.soft_iron
    assert np.allclose(product @ product.T, np.eye(3), atol=4e-3)
    assert mag.after < 0.4
    assert mag.before > 5.0


def test_constant_dip_gives_the_magnetometers_rotation_too(tumbled):
    sensor = typical(11)
    sensor.soft_iron = exp([0.05, -0.08, 0.06]) @ sensor.soft_iron
    where = joined(course(SIDES), tumbled)
    mag = calibrate(log_of(sensor, where, names="acc mag pose", mag_reference=FIELD)).sensors["mag"]
    assert np.degrees(mag.extras["dip"]) == pytest.approx(np.degrees(np.arctan2(44.0, 18.0)), abs=0.1)
    assert np.allclose(np.array(list(mag.effects["mag.hard_iron"].values())), sensor.hard_iron, atol=0.15)
    product = mag.matrix @ sensor.soft_iron
    # What is left: no rotation, and no scale.
    assert np.allclose(product, np.eye(3), atol=5e-3)


def test_field_of_unknown_strength_is_brought_to_its_mean_and_that_is_said(tumbled):
    sensor = typical(12)
    result = calibrate(log_of(sensor, tumbled, names="mag"))
    mag = result.sensors["mag"]
    assert "the scale common to the three axes is not calibrated" in result.verdict
    product = mag.matrix @ sensor.soft_iron
    assert np.allclose(product @ product.T / np.trace(product @ product.T) * 3.0, np.eye(3), atol=4e-3)


def test_magnetometer_that_was_not_turned_is_refused():
    refused(log_of(typical(), course(["+z"], hold=5.0), names="mag"), "not turned through enough attitudes")
    refused(log_of(typical(), course(["+z"], hold=0.2), names="mag"), "hardly turned: 2")
    flat = course(["+z"] * 12, headings=np.arange(12) * 0.6, hold=0.2)
    refused(log_of(typical(), flat, names="mag"), "mag_x")


# The table.


@pytest.mark.parametrize("names", ["acc pose reference", "acc gyr pose"])
def test_tilt_of_the_table_is_found_when_the_sensor_is_turned_on_it(names):
    sensor, tilt = typical(13), (0.02, -0.012)
    where = course(TURNED, headings=HEADINGS, tilt=tilt, hold=1.0)
    result = calibrate(log_of(sensor, where, names=names))
    found = result.sensors["acc"].extras["table_tilt"]
    for axis, true in zip("xy", tilt, strict=True):
        error = found["standard_errors"][axis]
        assert error < 1e-3
        # Headings that the gyro tells are in a frame of the first pose's own: the size of the tilt is the same.
        if "reference" in names:
            assert abs(found[axis] - true) < 4.0 * error
    assert np.hypot(found["x"], found["y"]) == pytest.approx(np.hypot(*tilt), abs=2e-3)
    assert "is tilted" in result.verdict
    # The gyro's headings are good to a few millirad, which times the tilt is what they may cost.
    assert np.all(np.abs(pulls(result, sensor, *ACC)) < 4.0)


def test_level_table_is_not_called_tilted():
    where = course(TURNED, headings=HEADINGS, hold=1.0)
    verdict = calibrate(log_of(typical(14), where, names="acc pose reference")).verdict
    assert "level within the error" in verdict
    assert "The table is tilted" not in verdict


def test_tilt_and_bias_of_the_package_s_own_simulation_are_told_apart():
    tilt, bias = {"x": 0.015, "y": -0.01}, {"x": 0.2, "y": -0.1, "z": 0.3}
    log = simulate("poses", {"ref.tilt": tilt, "acc.bias": bias}, seed=1).to_log()
    acc = calibrate(log, sensors=["acc"]).sensors["acc"]
    found = acc.extras["table_tilt"]
    for axis, true in tilt.items():
        assert abs(found[axis] - true) < 4.0 * found["standard_errors"][axis] < 4e-3
    for axis, true in bias.items():
        assert abs(acc.effects["acc.bias"][axis] - true) < 4.0 * acc.standard_errors["acc.bias"][axis] < 0.05


def test_tilted_table_without_turns_on_it_leaks_into_misalignment_only():
    sensor = Sensor()
    acc = calibrate(log_of(sensor, course(SIDES, tilt=(0.02, 0.0)), names="acc pose")).sensors["acc"]
    assert max(abs(v) for v in acc.effects["acc.scale"].values()) < 2e-3
    off = max(abs(v) for v in acc.effects["acc.misalignment"].values())
    bias = max(abs(v) for v in acc.effects["acc.bias"].values()) / GRAVITY
    assert max(off, bias) > 0.01


# Temperature.


def warmed(temperatures, sensor, names="acc pose temp"):
    where = course([*SIDES] * len(temperatures), temperatures=np.repeat(temperatures, 6), hold=1.0)
    return log_of(sensor, where, names=names)


def test_slopes_by_temperature_are_found():
    sensor = typical(15, bias_slope=np.array([0.004, -0.006, 0.01]), scale_slope=np.array([2e-4, -4e-4, 3e-4]))
    result = calibrate(warmed([15.0, 25.0, 35.0], sensor))
    assert "bias and scale depend on it" in result.verdict
    slopes = ("acc.bias_temperature", "acc.scale_temperature")
    assert np.all(np.abs(pulls(result, sensor, *ACC, *slopes)) < 4.0)
    assert result.model.constants["temperature_mean"] == pytest.approx(25.0, abs=0.2)


def test_slope_of_the_bias_alone_is_found():
    sensor = typical(16, bias_slope=np.array([0.0, 0.0, 0.01]))
    result = calibrate(warmed([18.0, 32.0], sensor))
    assert np.all(np.abs(pulls(result, sensor, *ACC, "acc.bias_temperature")) < 4.0)


def test_sensor_that_does_not_mind_gets_no_slopes():
    result = calibrate(warmed([15.0, 35.0], typical(17)))
    assert "no dependence stands out" in result.verdict
    assert set(result.sensors["acc"].effects) == set(ACC)


def test_temperature_that_goes_with_the_pose_is_warned_of_and_not_fitted():
    where = course([*SIDES, *SIDES], temperatures=[20.0, 30.0] * 6, hold=1.0)
    sensor = typical(18, bias_slope=np.array([0.01, 0.01, 0.01]))
    result = calibrate(log_of(sensor, where, names="acc pose temp"))
    assert "confounded" in result.verdict
    assert set(result.sensors["acc"].effects) == set(ACC)


# Bad poses.


def judged(log, **keywords):
    result = calibrate(log, **keywords)
    return result, {pose.number: pose.reason for pose in result.poses if not pose.used}


@pytest.mark.parametrize("names", ["acc gyr pose", "acc gyr", "acc pose", "acc"])
def test_knock_in_a_pose_is_left_out_of_its_mean(names):
    where, sensor = course(SIDES, hold=3.0), typical(19)
    shake = np.zeros((len(where.t), 3))
    row = where.rests[2].start + 150
    shake[row : row + 15] = [6.0, -4.0, 8.0]
    result = calibrate(log_of(sensor, where, names=names, shake=shake))
    assert len(result.used) == 6
    pose = result.poses[2]
    assert [first <= row and row + 14 <= last for first, last in pose.knocks] == [True]
    assert np.linalg.norm(pose.mean - sensor.acc_gain @ UP["+y"] * GRAVITY - sensor.acc_bias) < 0.02
    assert np.all(np.abs(pulls(result, sensor, *ACC)) < 4.0)


def bad_poses():
    """Each log with one bad pose, its number, and what is said of it."""
    sensor = typical(20)
    where = course([*SIDES, "+x"], hold=2.0)
    row, t = where.rests[3], where.t
    inside = np.zeros(len(t))
    inside[row] = 1.0

    shaken = inside[:, None] * np.sin(25.0 * t[:, None] + [0.0, 1.0, 2.0])
    yield "unsteady", log_of(sensor, where, shake=shaken), 4, "not still"

    turned = course([*SIDES, "+x"], hold=6.0)
    rest = turned.rests[3]
    turned.up = turned.up.copy()
    angle = np.linspace(0.0, np.radians(1.5), rest.stop - rest.start)[:, None]
    turned.up[rest] = np.einsum("nij,nj->ni", exp(angle * np.array([0.6, 0.0, 0.8])), turned.up[rest])
    yield "moved", log_of(sensor, turned, names="acc pose"), 4, "moved by 1."

    shifted = course([*SIDES, "+x"], hold=4.0)
    rest = shifted.rests[3]
    shifted.up = shifted.up.copy()
    later = slice(rest.start + 200, rest.stop)
    shifted.up[later] = shifted.up[later] @ exp([0.03, 0.0, 0.03]).T
    yield "shifted", log_of(sensor, shifted, names="acc pose"), 4, "moved by 2."

    labels = where.label.copy()
    labels[row.start + 40 : row.stop] = ""
    yield "short", log_of(sensor, where, pose=[str(each) or None for each in labels]), 4, "too short"

    labels = where.label.copy()
    labels[row] = "+y"
    yield "mislabelled", log_of(sensor, where, pose=[str(each) or None for each in labels]), 4, "labelled +y, but -y"

    clipped = typical(20, acc_range=9.3)
    clipped.acc_gain, clipped.acc_bias = np.eye(3), np.array([-0.7, 0.0, 0.0]) - [0.0, 0.6, 0.0]
    clipped.acc_range = 10.1
    yield "saturated", log_of(clipped, where), 4, "acc_y stands at the end of its range"

    readings = sensor.read(where, 0, names="acc gyr pose")
    readings["acc"] = np.where(inside[:, None] > 0.0, 0.0, readings["acc"])
    yield "zeros", Log.from_arrays(**readings), 4, "every axis reads zero"


@pytest.mark.parametrize(("log", "number", "words"), [pytest.param(*rest, id=name) for name, *rest in bad_poses()])
def test_bad_pose_is_named_with_its_reason_and_not_used(log, number, words):
    result, reasons = judged(log)
    assert words in reasons[number]
    assert f"pose {number} (" in result.verdict
    listed = result.to_dict()["poses"][number - 1]
    assert (listed["used"], listed["residual"]) == (False, None)
    assert listed["reason"] == reasons[number]


# What cannot be calibrated from.


def without_noise_of_hands():
    """Each log that cannot be used, the cost, and what is said of it."""
    sensor = typical(21)
    plain = sensor.read(course(SIDES))
    tops = course(["+x", "+y", "+z"])
    yield "under-determined", log_of(sensor, tops), None, "12 unknowns cannot be found from the sides +x +y +z"
    yield "under-determined, remedy", log_of(sensor, tops), None, "Record also -x -y -z up."
    doubled = log_of(sensor, course(["+x", "+x", "+y", "+y"]))
    yield "duplicated", doubled, None, "poses 1 and 2 (+x), 3 and 4 (+y) are the same"
    swapped = Log.from_arrays(**{**plain, "acc": plain["acc"][:, [1, 0, 2]]})
    yield "swapped", swapped, None, "x up reads on y, y up reads on x"
    where = course(SIDES)
    shake = 1.5 * np.sin(where.t[:, None] * [9.0, 7.0, 11.0])
    yield "moving", log_of(sensor, where, shake=shake), None, "no pose can be used (pose 1 (+x): not still"
    yield "moving, unlabelled", log_of(sensor, where, names="acc gyr", shake=shake), None, "never lay still"
    yield "saturated", log_of(Sensor(acc_range=9.7), where), None, "acc_x stands at the end of its range"
    yield "g", Log.from_arrays(**{**plain, "acc": plain["acc"] / GRAVITY}), None, "It looks like g: map it"
    yield "mg", Log.from_arrays(**{**plain, "acc": plain["acc"] * 1000.0 / GRAVITY}), None, "It looks like mg"
    for counts in (16384, 8192, 4096, 2048):
        raw = np.round(plain["acc"] * counts / GRAVITY)
        yield f"{counts} counts", Log.from_arrays(**{**plain, "acc": raw}), None, f"{counts}LSB/g"
    yield "single", log_of(sensor, course(["+z"], hold=20.0)), None, "bias and tilt can't be separated"
    yield "six for the magnitude cost", log_of(sensor, where), "magnitude", "6 different poses are too few"
    twice = log_of(sensor, course([*SIDES, *SIDES], hold=1.0))
    yield "six, each twice", twice, "magnitude", "6 different poses are too few"
    ring = [np.array([np.cos(a), np.sin(a), 0.0]) for a in np.arange(12) * 0.52]
    yield "a circle", log_of(sensor, course(ring), names="acc"), "magnitude", "cannot be found from"
    yield "a circle, what to do", log_of(sensor, course(ring), names="acc"), "magnitude", "+z -z never pointed up"
    errors = np.random.default_rng(1).normal(size=(8, 3))
    sides = ("+x", "+y", "-y", "+z", "-z", "+x", "+y", "+z")
    hand = [UP[side] + 0.1 * e for side, e in zip(sides, errors, strict=True)]
    eight = log_of(sensor, course([v / np.linalg.norm(v) for v in hand]), names="acc")
    yield "eight, held by hand", eight, None, "the 8 poses show 5 different positions (nearest sides"
    yield "eight, what to do", eight, None, "Record also -x up, on a level table for 3 s each"
    yield "no sensor", Log.from_arrays(plain["t"], temp=np.ones(len(plain["t"]))), None, "there is nothing to calibrate"


@pytest.mark.parametrize(
    ("log", "cost", "words"), [pytest.param(*rest, id=name) for name, *rest in without_noise_of_hands()]
)
def test_unusable_log_gets_its_own_message(log, cost, words):
    refused(log, words, cost)


def test_unknown_cost_and_sensor_are_refused():
    refused(six(), "the cost 'length' is unknown", "length")
    refused(six(), "the sensor 'baro' is unknown", sensors=["baro"])
    refused([], "a log to calibrate from is missing")


# Logs as they come.


def test_missing_rows_gaps_jitter_and_a_slow_magnetometer_are_borne(tumbled):
    sensor = typical(22)
    where = joined(course(SIDES, rate=50.0, hold=3.0), tumbled)
    arrays = sensor.read(where, names="acc gyr mag pose")
    rng = np.random.default_rng(5)
    n = len(where.t)
    arrays["acc"][rng.random(n) < 0.05] = np.nan
    arrays["gyr"][rng.random(n) < 0.02] = np.nan
    arrays["mag"][np.arange(n) % 5 != 0] = np.nan
    arrays["t"] = arrays["t"] + rng.uniform(-2e-3, 2e-3, n)
    kept = np.ones(n, bool)
    kept[where.rests[1].start + 30 : where.rests[1].start + 45] = False
    arrays = {key: np.asarray(v)[kept] if key in ("t", "acc", "gyr", "mag", "pose") else v for key, v in arrays.items()}
    result = calibrate(Log.from_arrays(**{**arrays, "pose": list(arrays["pose"])}))
    assert np.all(np.abs(pulls(result, sensor, *ACC)) < 4.0)
    assert np.all(np.abs(pulls(result, sensor, "gyr.bias")) < 4.0)
    assert np.allclose(list(result.sensors["mag"].effects["mag.hard_iron"].values()), sensor.hard_iron, atol=0.3)


@pytest.mark.parametrize("rate", [12.5, 25.0, 400.0])
def test_rate_of_the_log_does_not_matter(rate):
    sensor = typical(23)
    result = calibrate(log_of(sensor, course(SIDES, rate=rate, hold=3.0)))
    assert len(result.used) == 6
    assert np.all(np.abs(pulls(result, sensor, *ACC)) < 4.0)


def test_digits_coarser_than_the_noise_are_in_the_standard_errors():
    # 12 bits over +-4 g: the noise hardly reaches the next step.
    step = 8.0 * GRAVITY / 4096.0
    values = []
    for seed in range(20):
        sensor = typical(100 + seed, acc_noise=0.2 * step, acc_step=step)
        values.append(pulls(calibrate(log_of(sensor, course(SIDES), seed, names="acc pose")), sensor, *ACC))
    assert 0.9 < np.mean(np.abs(values) < 2.0) <= 1.0
    assert np.max(np.abs(values)) < 4.5


def test_several_logs_add_up():
    sensor = typical(24)
    halves = [log_of(sensor, course(SIDES[:3]), 1), log_of(sensor, course(SIDES[3:]), 2)]
    for half in halves:
        refused(half, "cannot be found")
    result = calibrate(halves)
    assert [pose.log for pose in result.poses] == [0, 0, 0, 1, 1, 1]
    assert [pose.number for pose in result.poses] == [1, 2, 3, 4, 5, 6]
    assert np.all(np.abs(pulls(result, sensor, *ACC)) < 4.0)


@pytest.mark.parametrize(("poses", "cost"), [(SIDES, "vector"), (spread(14), "magnitude")])
def test_error_on_a_pose_left_out_is_finite_and_larger_than_on_those_fitted(poses, cost):
    acc = calibrate(log_of(typical(25), course(poses), names="acc")).sensors["acc"]
    assert acc.cost == cost
    assert acc.after < acc.held_out < 20.0 * acc.after


# Results.

KEYS = {
    "cost": str, "scale": list, "misalignment": list, "bias": list, "unit": str, "standard_errors": dict,
    "poses": list, "rest_norm_error": dict, "condition": float, "verdict": str,
}  # fmt: skip


def test_json_has_the_contract_s_keys_and_is_strict():
    result = calibrate(log_of(typical(26), course([*SIDES, "+x"])))
    value = strict_json(json.dumps(result.to_dict(), allow_nan=False))
    assert {key: type(value[key]) for key in KEYS} == KEYS
    assert (value["cost"], value["unit"]) == ("vector", "m/s^2")
    shapes = {"scale": (3,), "misalignment": (3, 3), "bias": (3,)}
    for name, shape in shapes.items():
        assert np.shape(value[name]) == np.shape(value["standard_errors"][name]) == shape
    assert set(value["standard_errors"]) == set(shapes)
    assert set(value["rest_norm_error"]) == {"before", "after", "held_out"}
    wanted = {"label", "t_start", "t_end", "n", "residual", "used", "reason"}
    assert all(wanted <= set(pose) for pose in value["poses"])
    assert [pose["label"] for pose in value["poses"]] == [*SIDES, "+x"]


def test_json_is_strict_where_there_is_nothing_to_leave_out():
    for log in (log_of(typical(27), course(["+x", "-x", "+y", "+z"]), names="acc pose"), six(names="acc gyr pose")):
        value = calibrate(log).to_dict()
        strict_json(json.dumps(value, allow_nan=False))
    lonely = calibrate(log_of(typical(), course(["+z"], hold=5.0)), sensors=["gyr"]).to_dict()
    strict_json(json.dumps(lonely, allow_nan=False))
    assert set(KEYS) <= set(lonely)


def test_saved_model_is_read_back_as_it_was(tmp_path):
    sensor = typical(28, bias_slope=np.array([0.01, -0.01, 0.01]))
    where = course([*SIDES] * 3, temperatures=np.repeat([15.0, 25.0, 35.0], 6), hold=1.0)
    result = calibrate(log_of(sensor, where, names="acc gyr pose temp"))
    assert {"acc.bias_temperature", "gyr.scale"} <= set(result.model.effects)
    result.save(tmp_path / "model.toml")
    model = SensorModel.load(tmp_path / "model.toml")
    assert model.parameters == result.model.parameters
    assert model.standard_errors == result.model.standard_errors
    assert model.constants["temperature_mean"] == result.model.constants["temperature_mean"]


# Standard errors.


def honest(make, cost, *, low=0.90, high=0.99):
    """Share of errors within two standard errors over 60 sensors."""
    values = []
    for seed in range(60):
        log, sensor = make(seed)
        result = calibrate(log, cost, sensors=["acc"])
        values.append(pulls(result, sensor, *ACC))
    share = np.mean(np.abs(values) < 2.0)
    assert low < share < high, share


def test_standard_errors_of_the_vector_cost_are_honest():
    def make(seed):
        sensor = typical(seed)
        return log_of(sensor, course(SIDES, hold=1.0, rate=50.0, move=0.8), seed, names="acc pose"), sensor

    honest(make, "vector")


def test_standard_errors_of_the_magnitude_cost_are_honest():
    def make(seed):
        sensor = typical(seed)
        sensor.acc_gain = 0.5 * (sensor.acc_gain + sensor.acc_gain.T)
        where = course(spread(14, seed), hold=1.0, rate=50.0, move=0.8)
        return log_of(sensor, where, seed, names="acc"), sensor

    honest(make, "magnitude")


def test_standard_errors_hold_poses_that_are_laid_half_a_degree_amiss():
    def make(seed):
        sensor = typical(seed)
        where = course([*SIDES, *SIDES], hold=1.0, rate=50.0, move=0.8, placement=0.5, seed=seed)
        return log_of(sensor, where, seed, names="acc pose"), sensor

    honest(make, "vector")


def test_standard_errors_of_the_gyro_are_honest():
    values = []
    for seed in range(16):
        sensor = typical(seed)
        where = course([*SIDES, *spread(4, seed)], hold=1.5, rate=50.0, move=1.0 + 0.1 * seed)
        values.append(pulls(calibrate(log_of(sensor, where, seed)), sensor, *GYR))
    share = np.mean(np.abs(values) < 2.0)
    assert 0.90 < share < 0.995, share


def test_five_turns_do_not_flip_a_gyro_axis():
    for seed in range(10):
        result = calibrate(log_of(typical(seed), course(SIDES, rate=50.0, hold=1.5), seed))
        assert "flipped" not in result.verdict
        assert np.all(np.abs(pulls(result, typical(seed), *GYR)) < 5.0)


def test_four_poses_of_unknown_placement_do_not_pretend_to_precision():
    values = []
    for seed in range(20):
        sensor = typical(seed)
        where = course(["+x", "-x", "+y", "+z"], hold=1.0, placement=0.5, seed=seed)
        result = calibrate(log_of(sensor, where, seed, names="acc pose"))
        assert "too few to show how well they were laid" in result.verdict
        values.append(pulls(result, sensor, *ACC))
    assert np.mean(np.abs(values) < 2.0) > 0.9
    assert np.max(np.abs(values)) < 5.0


@pytest.mark.parametrize(("angle_deg", "duration"), [(2.0, 4.0), (3.0, 8.0), (1.5, 6.0), (10.0, 10.0)])
def test_slow_turn_is_no_row_of_poses(angle_deg, duration):
    rng = np.random.default_rng(0)
    t = np.arange(0.0, 12.0 + duration, 0.01)
    angle = np.radians(angle_deg) * np.clip((t - 6.0) / duration, 0.0, 1.0)
    acc = 9.80665 * np.stack([np.sin(angle), 0.0 * t, np.cos(angle)], axis=1) + 0.03 * rng.normal(size=(t.size, 3))
    gyr = 0.002 * rng.normal(size=(t.size, 3))
    gyr[:, 1] += np.gradient(angle, t)
    used = [pose for pose in find_poses(Log.from_arrays(t, acc=acc, gyr=gyr)).poses if pose.used]
    shown = [np.degrees(np.arctan2(pose.mean[0], pose.mean[2])) for pose in used]
    np.testing.assert_allclose(shown, [0.0, angle_deg], atol=0.1)


def test_a_calibration_that_lowers_nothing_is_said_to():
    perfect = calibrate(six(typical(acc_gain=np.eye(3), acc_bias=np.zeros(3), bias_slope=np.zeros(3))))
    helped = calibrate(six())
    assert perfect.sensors["acc"].sentence().endswith("The calibration does not lower this error.")
    assert "does not lower" not in helped.sensors["acc"].sentence()


def test_the_gyro_misses_before_by_the_readings_as_they_are():
    rate, time = np.radians(2.0), 1.0
    missed = []
    for bias in (0.0, rate, 2.0 * rate):
        sensor = Sensor(gyr_noise=1e-4, gyr_bias=np.array([0.0, 0.0, bias]))
        gyr = calibrate(log_of(sensor, course([*SIDES, *spread(4)], move=time), names="acc gyr")).sensors["gyr"]
        missed.append(gyr.before)
        assert ("does not lower" in gyr.sentence()) == (bias == 0.0), gyr.sentence()
    # A bias turns the integral by its rate times the time at most; the edges of the rests belong to the turn.
    assert 0.3 * rate * time < missed[1] < 1.2 * rate * time
    assert missed[2] == pytest.approx(2.0 * missed[1], rel=0.05)


def between_sides(*pairs):
    """Return the attitudes half way between two axes, both of which point up there."""
    return [(UP[f"+{a}"] + UP[f"+{b}"]) / np.sqrt(2.0) for a, b in pairs]


@pytest.mark.parametrize("pair", ["xy", "xz", "yz"])
def test_poses_that_leave_the_angle_of_two_axes_open_say_which_and_its_remedy_works(pair):
    others = [other for other in ("xy", "xz", "yz") if other != pair]
    # The edges of the other two pairs, and those opposite: ten attitudes, but none that shows this angle.
    mirrored = [-edge for edge in between_sides(*others)]
    poses = [*SIDES, *between_sides(*others), *mirrored]
    words = refused(
        log_of(Sensor(), course(poses), names="acc"), f"the angle between the axes {pair[0]} and {pair[1]}", "magnitude"
    )
    assert f"one with {pair[0]} and {pair[1]} both about 45 deg" in words
    assert not any(f"axes {a} and {b}" in words for a, b in others)
    unasked = calibrate(log_of(Sensor(), course(poses), names="acc")).notes
    assert any(f"the angle between the axes {pair[0]} and {pair[1]}" in note for note in unasked)
    mended = calibrate(log_of(Sensor(), course([*poses, *between_sides(pair)]), names="acc"), "magnitude")
    assert "acc.misalignment" in mended.sensors["acc"].effects
