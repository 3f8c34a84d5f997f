"""``imufit calibrate`` from files: what it prints, writes and refuses."""

import numpy as np
import pytest
from calibration_logs import GRAVITY, SIDES, course, spread, typical
from cli_stand_in import run, strict_json
from imufit import Log, SensorModel
from test_cli_errors import fails

SENSOR = typical(1)


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Six sides, oblique attitudes, and what cannot be used."""
    folder = tmp_path_factory.mktemp("logs")
    sides = SENSOR.read(course(SIDES))
    Log.from_arrays(**sides).write(folder / "six.csv")
    Log.from_arrays(**SENSOR.read(course(spread(12)), names="acc")).write(folder / "oblique.parquet")
    Log.from_arrays(**{**sides, "acc": sides["acc"] / GRAVITY}).write(folder / "in_g.csv")
    Log.from_arrays(**SENSOR.read(course(["+z"], hold=5.0))).write(folder / "one.csv")
    bad = (folder / "six.csv").read_text().replace("+y", "up")
    (folder / "bad_label.csv").write_text(bad)
    return folder


def test_calibrate_prints_the_verdict_the_poses_and_the_correction(capsys, logs):
    code, out, err = run(capsys, "calibrate", logs / "six.csv")
    assert (code, err) == (0, [])
    assert out.startswith("accelerometer: |f| at rest less g 0.")
    assert "gyroscope: angle missed after a turn" in out
    assert all(side in out for side in SIDES)
    assert "Corrected = C K reading + b" in out


def test_json_to_standard_output_stands_there_alone(capsys, logs):
    code, out, err = run(capsys, "calibrate", logs / "six.csv", "--json", "-")
    assert (code, err) == (0, [])
    value = strict_json(out)
    assert value["cost"] == "vector"
    assert len(value["poses"]) == 6
    inverse = np.array(value["misalignment"]) * value["scale"]
    assert np.allclose(inverse @ SENSOR.acc_gain, np.eye(3), atol=2e-3)


def test_model_plot_and_json_are_written(capsys, tmp_path, logs):
    model, figure, result = tmp_path / "model.toml", tmp_path / "poses.png", tmp_path / "result.json"
    code, out, err = run(
        capsys, "calibrate", logs / "six.csv", "-o", model, "--plot", figure, "--json", result
    )  # fmt: skip
    assert (code, err) == (0, [])
    for path in (model, figure, result):
        assert f"wrote {path}" in " ".join(out.split())
    assert figure.read_bytes()[1:4] == b"PNG"
    assert strict_json(result.read_text())["unit"] == "m/s^2"
    found = SensorModel.load(model).parameters["acc.bias"]
    assert [found[axis] for axis in "xyz"] == pytest.approx(SENSOR.acc_bias.tolist(), abs=0.01)


def test_cost_and_sensor_can_be_chosen(capsys, logs):
    code, out, _ = run(capsys, "calibrate", logs / "oblique.parquet", "--cost", "magnitude", "--json", "-")
    assert code == 0
    assert strict_json(out)["cost"] == "magnitude"
    code, out, _ = run(capsys, "calibrate", logs / "six.csv", "--sensor", "gyr", "--json", "-")
    assert code == 0
    value = strict_json(out)
    assert set(value["sensors"]) == {"gyr"}
    assert value["cost"] is None


def test_several_logs_are_calibrated_together(capsys, logs):
    code, out, _ = run(capsys, "calibrate", logs / "six.csv", logs / "six.csv", "--json", "-")
    assert code == 0
    assert [pose["log"] for pose in strict_json(out)["poses"]] == [0] * 6 + [1] * 6


def test_mapped_unit_is_calibrated_like_any_other(capsys, logs):
    maps = [word for axis in "xyz" for word in ("--map", f"acc_{axis}=acc_{axis}[g]")]
    code, out, err = run(capsys, "calibrate", logs / "in_g.csv", *maps, "--json", "-")
    assert (code, err) == (0, [])
    direct = strict_json(run(capsys, "calibrate", logs / "six.csv", "--json", "-")[1])
    assert strict_json(out)["scale"] == pytest.approx(direct["scale"], abs=1e-6)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "LOG"),
        (["nowhere.csv"], "nowhere.csv"),
        (["six.csv", "--cost", "length"], "length"),
        (["six.csv", "--sensor", "baro"], "baro"),
        (["six.csv", "--sensor", "mag"], "the log has no mag_x mag_y mag_z"),
        (["six.csv", "--hold", "0"], "--hold"),
        (["six.csv", "--hold", "30"], "still for"),
        (["six.csv", "--cost", "magnitude"], "6 different poses are too few"),
        (["six.csv", "-o", "six.csv"], ".toml"),
        (["six.csv", "--json", "six.csv"], "overwritten"),
        (["six.csv", "--plot", "poses.txt"], ".png"),
        (["in_g.csv"], "looks like g, not m/s^2. Use --map 'acc_x=acc_x[g]"),
        (["one.csv", "--sensor", "acc"], "pose 1 (+z up) is the only one"),
        (["bad_label.csv"], "'up' is not a pose"),
    ],
)
def test_unusable_arguments_and_logs_are_told_in_one_line(capsys, monkeypatch, logs, arguments, words):
    monkeypatch.chdir(logs)
    assert words in fails(capsys, "calibrate", *arguments)


def test_refused_log_leaves_no_model_behind(capsys, tmp_path, logs):
    fails(capsys, "calibrate", logs / "in_g.csv", "-o", tmp_path / "model.toml")
    assert list(tmp_path.iterdir()) == []
