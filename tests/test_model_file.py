"""The file of a model: whatever it was cut at, no model with other values comes out of it."""

import os
import subprocess
import sys

import pytest
from imufit import InputError, SensorModel
from imufit.model.model_file import ModelFile
from imufit.replaying import read_settings, write_settings

MODEL = {
    "gyr.bias": {"x": -0.0123, "y": 1.25e-05, "z": 0.35},
    "acc.bias_temperature": {"x": 0.012, "y": -0.0045, "z": 0.75},
    "acc.column:vbat": {"x": 0.11, "y": 0.22, "z": 0.33},
    "rig.periodic": {"a": 0.0011, "b": -0.0022, "N": 12.0},
}
CONSTANTS = {"temperature_mean": 22.55, "covariate_means": {"vbat": 11.95}}
ERRORS = {key: dict.fromkeys(values, 1.5e-05) for key, values in MODEL.items()}


@pytest.fixture
def model():
    return SensorModel(list(MODEL), MODEL, constants=CONSTANTS, standard_errors=ERRORS)


def same(a, b):
    known = ("effects", "parameters", "constants")
    return all(getattr(a, name) == getattr(b, name) for name in known)


def loaded(path, data):
    path.write_bytes(data)
    return SensorModel.load(path)


def outcome(path, data):
    """The model that a file gives, or None where it is refused in one line that names the file."""
    try:
        return loaded(path, data)
    except InputError as error:
        refusal = str(error)
    assert refusal.startswith(f"{path.name}: ")
    assert "\n" not in refusal
    return None


def test_a_model_file_cut_at_any_byte_is_refused_or_gives_the_same_model(model, tmp_path):
    path = tmp_path / "model.toml"
    model.save(path)
    data = path.read_bytes()
    assert len(data) > 1000
    taken = []
    for length in range(len(data) + 1):
        found = outcome(path, data[:length])
        if found is not None:
            taken.append(length)
            assert same(found, model)
            assert found.standard_errors == model.standard_errors
    assert taken == [len(data) - 1, len(data)], "only the end of the last line may be lost"


def test_the_ideal_sensors_file_cut_at_any_byte_is_refused(tmp_path):
    path = tmp_path / "model.toml"
    SensorModel().save(path)
    data = path.read_bytes()
    assert [n for n in range(len(data) + 1) if outcome(path, data[:n]) is not None] == [len(data) - 1, len(data)]


def unmarked(path, *, tables=("constants", "parameters")):
    """The same model as a file without a mark, as an older version wrote it or a user by hand."""
    text = path.read_text().replace('last = "[end]"\n', "")
    head, *parts = text.split("\n\n[")
    kept = [part for part in parts if part.split(".")[0].split("]")[0] in tables]
    return ("\n\n[".join([head, *kept]).rstrip("\n") + "\n").encode()


@pytest.mark.parametrize(
    "tables",
    [("constants", "parameters"), ("constants", "parameters", "units"), ("constants", "parameters", "standard_errors")],
)
def test_a_file_without_the_mark_cut_at_any_byte_never_gives_other_values(model, tmp_path, tables):
    path = tmp_path / "model.toml"
    model.save(path)
    data = unmarked(path, tables=tables)
    assert b"[end]" not in data
    assert same(loaded(path, data), model), "whole, it is taken"
    for length in range(len(data)):
        found = outcome(path, data[:length])
        assert found is None or same(found, model), data[:length][-60:]


def test_constants_that_are_cut_off_behind_the_parameters_are_missed(model, tmp_path):
    path = tmp_path / "model.toml"
    model.save(path)
    whole, parameters = (unmarked(path, tables=of) for of in (("constants", "parameters"), ("parameters",)))
    constants = whole[whole.index(b"[constants]") : whole.index(b"[parameters")]
    data = parameters + b"\n" + constants
    assert same(loaded(path, data), model)
    for length in range(len(data)):
        found = outcome(path, data[:length])
        assert found is None or same(found, model), data[:length][-60:]


def test_a_value_may_be_edited_by_hand(model, tmp_path):
    path = tmp_path / "model.toml"
    model.save(path)
    text = path.read_text()
    edited = text.replace("x = -0.0123\n", "x = -0.0124 # measured again\n").replace(
        "complete = true", "complete=true # yes"
    )
    assert loaded(path, edited.encode()).parameters["gyr.bias"]["x"] == -0.0124


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("y = 1.25e-05\n", "", r"parameter y of gyr\.bias is missing.*Otherwise write y = VALUE in rad/s"),
        ('[parameters."gyr.bias"]', '[other."gyr.bias"]', r"parameter x of gyr\.bias is missing"),
        ("\n[end]\ncomplete = true\n", "", "its last lines are missing.*Copy or save"),
        ("complete = true", "complete = 1.5", r"cut off: its table \[end\] does not hold complete"),
        ("complete = true\n", 'complete = true\n[units."gyr.scale"]\nx = "1"\n', r"follows the table \[end\].*Move"),
        ("effects = [", "effect = [", "effects is not a list"),
        ('[parameters."gyr.bias"]\nx =', '[parameters]\n"gyr.bias" = 3\n[x]\nx =', "is 3, not a table"),
        (
            "temperature_mean = 22.55",
            'temperature_mean = "warm"',
            "the temperature is 'warm', not a finite",
        ),
        ("vbat = 11.95", "vbat = true", "the mean of vbat is True, not a finite number"),
        ("x = 1.5e-05", 'x = "small"', r"standard error of gyr\.bias x is 'small'"),
    ],
)
def test_what_is_missing_or_wrong_is_named_with_what_to_do(model, tmp_path, old, new, problem):
    path = tmp_path / "model.toml"
    model.save(path)
    text = path.read_text()
    assert old in text
    with pytest.raises(InputError, match=rf"^model\.toml: .*{problem}"):
        loaded(path, text.replace(old, new, 1).encode())


def test_units_beside_another_effect_do_not_matter_but_those_that_are_there_do(model, tmp_path):
    path = tmp_path / "model.toml"
    model.save(path)
    held = ModelFile.read(path)
    assert held.marked
    assert held.units["gyr.bias"] == dict.fromkeys("xyz", "rad/s")


def test_a_cut_model_is_not_applied_from_the_shell(model, tmp_path):
    path, log = tmp_path / "model.toml", tmp_path / "log.csv"
    log.write_text("t,gyr_x,gyr_y,gyr_z\n" + "".join(f"{k / 100},0.01,0.02,0.03\n" for k in range(300)))
    SensorModel(["gyr.bias"], {"gyr.bias": MODEL["gyr.bias"]}).save(path)
    path.write_bytes(path.read_bytes().split(b"z = 0.35")[0] + b"z = 0.3")
    command = [sys.executable, "-m", "imufit.cli.app", "apply", path, log, "-o", tmp_path / "out.csv"]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=60, env=os.environ)
    assert done.returncode == 2
    assert done.stderr.startswith("imufit: model.toml: the file is cut off: its last lines are missing.")
    assert not (tmp_path / "out.csv").exists()


def test_settings_of_filters_cut_at_any_byte_are_refused_or_the_same(tmp_path):
    path = tmp_path / "settings.toml"
    settings = {"mahony": {"k_p": 0.35, "k_i": 0.025}, "replay": {"max_gap": 0.55}}
    write_settings(settings, path)
    data, taken = path.read_bytes(), []
    for length in range(len(data) + 1):
        path.write_bytes(data[:length])
        try:
            found = read_settings(path)
        except InputError:
            continue
        assert found == settings
        taken.append(length)
    assert taken == [len(data) - 1, len(data)]


def test_settings_written_by_hand_need_no_mark(tmp_path):
    path = tmp_path / "settings.toml"
    path.write_text("[mahony]\nk_p = 0.35\n")
    assert read_settings(path) == {"mahony": {"k_p": 0.35}}
    path.write_text("[mahony]\nk_p = 0.3")
    with pytest.raises(InputError, match="the last line does not end"):
        read_settings(path)
