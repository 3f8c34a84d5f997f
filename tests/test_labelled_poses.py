"""Six labelled poses without a reference attitude: what they tell, what they cannot, and labels that cannot be."""

import numpy as np
import pytest
from cli_stand_in import run, strict_json
from imufit import Log, SensorModel, ladder, read
from imufit.calibrating import calibrate
from imufit.errors import InputError
from recording import recording

SIDES = ("+x", "-x", "+y", "-y", "+z", "-z")
RATE = 100.0
GRAVITY = 9.80665
BIAS = (0.2, -0.1, 0.15)
SCALE = (0.01, -0.02, 0.015)


def up_of(side: str) -> np.ndarray:
    return np.eye(3)["xyz".index(side[1])] * (1.0 if side[0] == "+" else -1.0)


def turned(before: np.ndarray, after: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Up in the body along a turn (steps, 3) from one attitude to another, and the rate, rad/s."""
    axis = np.cross(before, after)
    axis /= np.linalg.norm(axis)
    angle = np.arccos(before @ after)
    phase = np.pi * np.arange(steps) / steps
    at = 0.5 * angle * (1.0 - np.cos(phase))[:, None]
    rate = 0.5 * angle * np.pi * np.sin(phase) * RATE / steps
    return before * np.cos(at) + np.cross(axis, before) * np.sin(at), -axis * rate[:, None]


def six_poses(seed, *, bias=(0, 0, 0), scale=(0, 0, 0), misaligned=None, gyr_bias=(0, 0, 0), labels=SIDES, sides=SIDES):
    """Lay a sensor on its sides for six seconds each, to within 0.3 degrees, turned in the hand between; one log."""
    rng = np.random.default_rng(seed)
    steps, still = 150, 600
    up, rate, cells = [], [], []
    before = None
    for side, label in zip(sides, labels, strict=True):
        after = up_of(side) + np.radians(0.3) * rng.normal(size=3)
        after /= np.linalg.norm(after)
        if before is not None:
            way, turn = turned(before, after, steps)
            up, rate, cells = [*up, way], [*rate, turn], [*cells, *[None] * steps]
        up, rate = [*up, np.tile(after, (still, 1))], [*rate, np.zeros((still, 3))]
        cells += [*[None] * 10, *[label] * (still - 20), *[None] * 10]
        before = after
    force, omega = GRAVITY * np.concatenate(up), np.concatenate(rate)
    gain = np.eye(3) + np.diag(scale) + (np.zeros((3, 3)) if misaligned is None else misaligned)
    acc = force @ gain.T + bias + rng.normal(0.0, 0.02, force.shape)
    gyr = omega + gyr_bias + rng.normal(0.0, 2e-3, omega.shape)
    return Log.from_arrays(np.arange(len(acc)) / RATE, acc=acc, gyr=gyr, pose=cells)


def named(diagnosis) -> set[str]:
    return {diagnosis.best, *diagnosis.ambiguous_with} - {None}


@pytest.mark.parametrize("seed", range(3))
def test_bias_and_gyro_bias_are_named(seed):
    assert SensorModel().fit(six_poses(seed, bias=BIAS)).diagnose().best == "acc.bias"
    rates = SensorModel().fit(six_poses(seed, gyr_bias=(0.01, -0.02, 0.01))).diagnose()
    assert (rates.verdict, rates.best) == ("missing", "gyr.bias")


@pytest.mark.parametrize("seed", range(3))
def test_scale_is_named_and_no_cubic_which_goes_through_any_three_readings(seed):
    # On its side an axis reads +-g or nothing: the cube of that is a scale, too.
    diagnosis = SensorModel().fit(six_poses(seed, scale=SCALE)).diagnose()
    assert diagnosis.verdict == "missing"
    assert named(diagnosis) == {"acc.scale"}
    with pytest.raises(InputError, match="4 are needed"):
        SensorModel(["acc.cubic"]).fit(six_poses(seed, scale=SCALE))


@pytest.mark.parametrize("seed", range(4))
def test_nothing_hidden_is_adequate(seed):
    diagnosis = SensorModel().fit(six_poses(seed)).diagnose()
    assert (diagnosis.verdict, diagnosis.evidence) == ("adequate", "rests")
    assert diagnosis.candidates[0].held_out_before < 1.3


@pytest.mark.parametrize("seed", range(3))
def test_bias_scale_and_misalignment_are_found_together(seed):
    misaligned = np.array([[0.0, 0.012, -0.008], [0.015, 0.0, 0.009], [-0.011, 0.007, 0.0]])
    fit = SensorModel(["acc.bias", "acc.scale", "acc.misalignment"]).fit(
        six_poses(seed, bias=BIAS, scale=SCALE, misaligned=misaligned)
    )
    truth = {("acc.bias", a): v for a, v in zip("xyz", BIAS, strict=True)}
    truth |= {("acc.scale", a): v for a, v in zip("xyz", SCALE, strict=True)}
    truth |= {("acc.misalignment", "xyz"[i] + "xyz"[j]): misaligned[i, j] for i in range(3) for j in range(3) if i != j}
    for parameter in fit.parameters:
        off = parameter.value - truth[parameter.effect, parameter.name]
        assert abs(off) < 5.0 * parameter.standard_error
        assert parameter.standard_error < (0.03 if parameter.effect == "acc.misalignment" else 5e-3)
    assert fit.diagnose().verdict == "adequate"


def test_misalignment_is_missed_beside_bias_and_scale():
    misaligned = np.array([[0.0, 0.02, -0.02], [0.02, 0.0, 0.02], [-0.02, 0.02, 0.0]])
    fit = SensorModel(["acc.bias", "acc.scale"]).fit(six_poses(1, bias=BIAS, scale=SCALE, misaligned=misaligned))
    assert fit.diagnose().best == "acc.misalignment"


def test_the_ladder_climbs_on_six_poses(capsys, tmp_path):
    log = six_poses(1, bias=BIAS, gyr_bias=(0.01, -0.02, 0.01))
    answer = ladder(log)
    assert set(answer.model) == {"acc.bias", "gyr.bias"}
    assert (answer.verdict, answer.attitude) == ("adequate", None)
    assert {item.channel for item in answer.comparison_start.channels} >= {"acc_norm", "acc_pose", "gyr_x"}
    assert answer.ratio_end < 1.2 < answer.ratio_start
    path = tmp_path / "six.parquet"
    log.write(path)
    code, out, _ = run(capsys, "add", "acc.bias", path, "-o", tmp_path / "model.toml", "--json", "-")
    added = strict_json(out)
    assert code == 0
    assert added["after"] < added["before"]


def test_six_poses_without_labels_are_too_few():
    with pytest.raises(InputError, match=r"too few rests.*six sides.*pose"):
        SensorModel().fit(six_poses(0, labels=[None] * 6))


@pytest.mark.parametrize(
    ("labels", "row", "words"),
    [
        (("+x", "-x", "+z", "-y", "+z", "-z"), 1510, r"label \+z contradicts.*\+y points up"),
        (("-x", "+x", "+y", "-y", "+z", "-z"), 10, r"label -x contradicts.*mapping="),
    ],
)
def test_a_label_that_contradicts_the_readings_is_named_with_its_row(labels, row, words):
    with pytest.raises(InputError, match=words) as raised:
        SensorModel().fit(six_poses(0, labels=labels))
    assert (raised.value.row, raised.value.column) == (row, "pose")


def test_a_label_that_changes_while_the_sensor_lies_still_is_named():
    log = six_poses(0)
    cells = log.pose.copy()
    cells[300:590] = "+y"
    with pytest.raises(InputError, match=r"changes from \+x to \+y") as raised:
        SensorModel().fit(Log.from_arrays(log.t, acc=log.acc, gyr=log.gyr, pose=cells))
    assert (raised.value.row, raised.value.column) == (300, "pose")


def test_a_label_that_is_no_side_is_refused_with_its_row():
    with pytest.raises(InputError, match="upside") as raised:
        six_poses(0, labels=("upside", "-x", "+y", "-y", "+z", "-z"))
    assert raised.value.column == "pose"


def test_six_poses_of_a_real_sensor_agree_with_their_calibration():
    whole = read(recording("six_positions/ferraris_session_A.parquet"))
    log = whole.select(whole.t < 60.0)
    calibrated = calibrate(log, sensors=("acc",)).sensors["acc"].effects
    stack = ["acc.bias", "acc.scale", "acc.misalignment", "gyr.bias"]
    fit = SensorModel(stack).fit(log)
    for parameter in fit.parameters:
        if parameter.effect in calibrated:
            expected = calibrated[parameter.effect][parameter.name]
            assert parameter.value == pytest.approx(expected, abs=0.5 * parameter.standard_error + 1e-4)
    first = SensorModel().fit(log).diagnose()
    assert (first.verdict, first.best) == ("missing", "acc.bias")
