"""The wizard on a running device: what it asks for, what it finds, what it keeps."""

import numpy as np
import pytest
from cli_stand_in import run, strict_json
from imufit import InputError, read
from imufit.calibrating import Wizard, calibrate
from imufit.calibrating.free_turning import FreeTurning
from imufit.devices.calibrate_live import calibrate_live
from imufit.devices.emulate import Emulator
from imufit.devices.record import record
from imufit.lab.simulate import simulate
from scipy.spatial.transform import Rotation
from test_cli_errors import fails

ACC = {
    "acc.bias": {"x": 0.15, "y": -0.1, "z": 0.2},
    "acc.scale": {"x": 0.02, "y": -0.015, "z": 0.01},
    "acc.misalignment": {"xy": 0.01, "xz": -0.005},
}
EFFECTS = {**ACC, "mag.hard_iron": {"x": 20.0, "y": -10.0, "z": 5.0}}
SIX = {"+x", "-x", "+y", "-y", "+z", "-z"}


def table(duration=120.0, sensors=None, seed=1):
    log = simulate("six_sides", {}, seed, duration, sensors=sensors).to_log()
    return {name: values for name, values in log.table().items() if values.dtype == float}


def fed(wizard, rows, step=10):
    stages = []
    for k in range(0, len(rows["t"]), step):
        stages.append(wizard.feed({name: values[k : k + step] for name, values in rows.items()}))
        if wizard.complete:
            break
    return stages


@pytest.fixture(scope="module")
def device():
    """Sides and free rotation of a sensor with a known fault, as fast as they are read."""

    def plugged(**changed):
        settings = {"effects": EFFECTS, "seed": 1, "speed": "max", "on": "socket://127.0.0.1:0", **changed}
        return Emulator("six_sides", **settings)

    return plugged


def test_wizard_wants_six_sides_then_free_rotation():
    wizard = Wizard()
    stages = fed(wizard, table())
    assert wizard.complete
    assert set(stages[-1].done) == SIX
    assert stages[-1].directions >= 21
    six = next(k for k, stage in enumerate(stages) if len(stage.done) == 6)
    assert "through all attitudes" in stages[six].message
    assert 34.0 < stages[six].t < 40.0
    assert 60.0 < stages[-1].t < 90.0
    assert all(stage.message and "\n" not in stage.message for stage in stages)


@pytest.mark.parametrize(
    ("sensors", "there"),
    [(("acc", "gyr"), None), (("acc", "gyr", "mag"), ("acc", "gyr", "temp")), (("acc",), ("acc",))],
)
def test_without_a_magnetometer_six_sides_are_enough(sensors, there):
    wizard = Wizard(sensors)
    stages = fed(wizard, table(sensors=there))
    assert wizard.complete
    assert 34.0 < stages[-1].t < 40.0
    assert wizard.wanted == ""


def test_more_rests_are_waited_for():
    wizard = Wizard(("acc", "gyr"), rests=14)
    stages = fed(wizard, table())
    assert wizard.complete
    assert stages[-1].rests == 14
    assert any("more rests for the gyro" in stage.message for stage in stages)


def test_magnetometer_alone_is_only_turned():
    wizard = Wizard(("mag",))
    stages = fed(wizard, table(sensors=("mag",)))
    assert wizard.complete
    assert stages[-1].done == ()


def test_what_is_missing_is_told():
    wizard = Wizard()
    fed(wizard, table(duration=12.0))
    assert set(wizard.wanted.removeprefix("sides ").split()) == {"-x", "+y", "-y"} | ({"-z"} - set(wizard.stage.done))
    assert not wizard.complete


def turned(rng, angles, axis=None):
    ways = rng.normal(size=(angles, 3)) if axis is None else np.tile(axis, (angles, 1))
    steps = Rotation.from_rotvec(0.25 * ways / np.linalg.norm(ways, axis=1)[:, None])
    attitude, out = Rotation.identity(), []
    for k in range(angles):
        attitude = attitude * steps[k]
        out.append(attitude.inv().apply([20.0, 0.0, 44.0]))
    return np.array(out)


def test_rotation_about_one_axis_is_no_free_rotation_whatever_the_hard_iron():
    rng, free, one = np.random.default_rng(0), FreeTurning(), FreeTurning()
    iron = np.array([90.0, -40.0, 10.0])
    for field in turned(rng, 1500):
        free.step(field + iron)
    assert free.complete
    # Iron that comes near at the end moves the middle: what is complete stays complete.
    for field in turned(rng, 1500, [0.0, 0.0, 1.0]):
        free.step(field + 5.0 * iron)
    assert free.complete
    for field in turned(rng, 1500, [0.0, 0.0, 1.0]) + rng.normal(0.0, 0.3, (1500, 3)):
        one.step(field + iron)
    assert not one.complete
    assert one.progress < 0.7


def test_live_calibration_finds_the_truth_and_is_that_of_the_log(device, tmp_path):
    keep = tmp_path / "kept.parquet"
    with device() as emulated:
        result, log = calibrate_live(emulated.port, keep)
    for effect, truth in EFFECTS.items():
        found, errors = result.model.parameters[effect], result.model.standard_errors[effect]
        for name, value in found.items():
            assert abs(value - truth.get(name, 0.0)) < 4.0 * errors[name], (effect, name)
    assert max(result.model.standard_errors["acc.bias"].values()) < 1e-3
    again = calibrate(read(keep))
    assert again.to_dict() == result.to_dict()
    assert log.metadata.to_mapping()["recording"]["gaps"] == []
    assert not list(tmp_path.glob("*.part*"))


def test_order_of_the_sides_does_not_matter_and_faults_of_the_line_neither(device, tmp_path):
    rates = {"garbage": 0.3, "crc": 0.3, "drop": 0.3}
    with device(seed=4, fault_rates=rates) as emulated:
        result, log = calibrate_live(emulated.port, tmp_path / "kept.csv", sensors=("acc",))
    bias = result.model.parameters["acc.bias"]
    assert [bias[axis] for axis in "xyz"] == pytest.approx([0.15, -0.1, 0.2], abs=0.005)
    assert log.metadata.to_mapping()["recording"]["gaps"]


def test_wizard_on_the_command_line_says_what_to_do_and_writes_model_and_log(capsys, device, tmp_path):
    model, result = tmp_path / "sensor.toml", tmp_path / "live.json"
    with device() as emulated:
        code, out, err = run(
            capsys, "calibrate", "--live", emulated.port, "-o", model, "--json", result, "--sensor", "acc"
        )
    assert (code, err) == (0, [])
    assert "6 of 6." in out
    assert all(f"{side} up is known" in out for side in SIX)
    assert out.index("6 of 6") < out.index("accelerometer: |f| at rest")
    live = strict_json(result.read_text())
    again = strict_json(run(capsys, "calibrate", tmp_path / "sensor.parquet", "--sensor", "acc", "--json", "-")[1])
    assert live == again
    assert model.exists()
    with device() as emulated:
        code, out, _ = run(capsys, "calibrate", "--live", emulated.port, "-o", model, "--sensor", "acc", "--json", "-")
    assert code == 0
    assert strict_json(out)["cost"] == "vector"
    assert (tmp_path / "sensor-2.parquet").exists()


def test_given_up_calibration_keeps_what_came(capsys, device, tmp_path):
    with device(duration=12.0) as emulated:
        said = fails(
            capsys, "calibrate", "--live", emulated.port, "--keep", tmp_path / "half.parquet", "--give-up", "0.5"
        )
    assert "given up after 0.5 s without anything new: sides" in said
    assert "half.parquet" in said
    assert read(tmp_path / "half.parquet").n == 1200


def test_stopped_calibration_keeps_what_came(device, tmp_path, monkeypatch):
    def stopped(*arguments, stopped, watch, **settings):
        seen = []

        def look(*came):
            seen.extend(came[1])
            watch(*came)

        return record(*arguments, stopped=lambda: bool(seen) or stopped(), watch=look, **settings)

    monkeypatch.setattr("imufit.devices.calibrate_live.record", stopped)
    with device() as emulated, pytest.raises(InputError, match=r"^stopped: sides .* missing"):
        calibrate_live(emulated.port, tmp_path / "kept.parquet")
    assert read(tmp_path / "kept.parquet").n > 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--live", "/dev/nowhere", "-o", "m.toml"], "the port /dev/nowhere does not exist"),
        (["--live", "/dev/nowhere"], "name a model with -o, or a log with --keep"),
        (["--live", "/dev/nowhere", "--keep", "old.csv"], "exists already"),
        (["--live", "/dev/nowhere", "old.csv", "-o", "m.toml"], "either a LOG or a device"),
        (["--live", "/dev/nowhere", "--rests", "5", "-o", "m.toml"], "--rests"),
        (["old.csv", "--baud", "9600"], "--baud is for --live"),
        ([], "name a LOG, or a device"),
    ],
)
def test_unusable_arguments_are_told_in_one_line(capsys, monkeypatch, tmp_path, arguments, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old.csv").write_text("t,acc_x,acc_y,acc_z\n0,0,0,9.8\n")
    assert words in fails(capsys, "calibrate", *arguments)
