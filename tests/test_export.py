"""What a model is exported to gives the same numbers as the model itself, wherever it runs."""

import json
import shutil
import subprocess

import numpy as np
import pytest
from imufit import InputError, Log, SensorModel
from imufit.cli.app import main
from imufit.exporting import FORMS, export

SIX = {"xy": 0.01, "xz": -0.02, "yx": 0.015, "yz": 0.005, "zx": -0.01, "zy": 0.02}
PARAMETERS = {
    "acc.bias": {"x": 0.3, "y": -0.2, "z": 0.1},
    "acc.scale": {"x": 0.02, "y": -0.03, "z": -2.0},
    "acc.misalignment": SIX,
    "gyr.bias": {"x": 0.02, "y": 0.01, "z": -0.03},
    "gyr.scale": {"x": 1.0, "y": 0.01, "z": -0.01},
    "mag.hard_iron": {"x": 10.0, "y": -20.0, "z": 5.0},
    "mag.soft_iron": {**SIX, "xx": 0.1, "yy": -0.2, "zz": 0.05},
}
ERRORS = {"acc.bias": {"x": 0.00123, "y": 0.001, "z": 0.002}}
MODEL = SensorModel(list(PARAMETERS), PARAMETERS, standard_errors=ERRORS)
WIDER = SensorModel(
    [*PARAMETERS, "gyr.bias_temperature", "acc.scale_temperature", "acc.lever_arm", "ref.delay"],
    {**PARAMETERS, "gyr.bias_temperature": {"x": 0.004}, "acc.lever_arm": {"x": 0.1}},
    constants={"temperature_mean": 31.25},
)
UNITS = {"acc": 10.0, "gyr": 2.0, "mag": 40.0}


@pytest.fixture(scope="module")
def recorded() -> Log:
    rng = np.random.default_rng(1)
    readings = {name: rng.normal(0.0, size, (40, 3)) for name, size in UNITS.items()}
    return Log.from_arrays(np.arange(40) * 0.01, **readings)


@pytest.fixture(scope="module")
def corrected(recorded) -> Log:
    return MODEL.apply(recorded)


def run_python(form: str, model: SensorModel = MODEL) -> dict:
    names: dict = {}
    exec(export(model, form), names)
    return names


MAIN = """
#include <stdio.h>
int main(void) {
    float acc[3], gyr[3], mag[3];
    while (scanf("%f %f %f %f %f %f %f %f %f", acc, acc + 1, acc + 2, gyr, gyr + 1, gyr + 2, mag, mag + 1, mag + 2)
           == 9) {
        CALLS
        printf("%.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g\\n", (double)acc[0], (double)acc[1], (double)acc[2],
            (double)gyr[0], (double)gyr[1], (double)gyr[2], (double)mag[0], (double)mag[1], (double)mag[2]);
    }
    return 0;
}
"""


def run_c(tmp_path, text: str, calls: str, compiler: list[str], suffix: str, log: Log) -> np.ndarray:
    """Compile with every warning an error, run on the log's readings; (n, 9)."""
    source = tmp_path / f"main{suffix}"
    source.write_text(text + MAIN.replace("CALLS", calls))
    program = tmp_path / "main"
    flags = ["-Wall", "-Wextra", "-Werror", "-Wconversion", "-pedantic"]
    done = subprocess.run(
        [*compiler, *flags, str(source), "-o", str(program)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    rows = np.concatenate([log.acc, log.gyr, log.mag], axis=1)
    given = "\n".join(" ".join(f"{value:.9g}" for value in row) for row in rows)
    said = subprocess.run([str(program)], input=given, capture_output=True, text=True, check=True).stdout
    return np.array([[float(word) for word in line.split()] for line in said.splitlines()])


def assert_same_to_float(found: np.ndarray, truth: Log) -> None:
    for k, (name, size) in enumerate(UNITS.items()):
        assert np.abs(found[:, 3 * k : 3 * k + 3] - getattr(truth, name)).max() < 4e-6 * size, name


def test_the_c_header_compiles_without_a_warning_and_gives_the_same(tmp_path, recorded, corrected):
    compiler = shutil.which("gcc") or shutil.which("cc")
    assert compiler, "a C compiler is part of the set-up"
    calls = "imufit_correct_acc(acc, acc); imufit_correct_gyr(gyr, gyr); imufit_correct_mag(mag, mag);"
    header = tmp_path / "calibration.h"
    header.write_text(export(MODEL, "c-header"))
    text = '#include "calibration.h"\n#include "calibration.h"\n'
    found = run_c(tmp_path, text, calls, [compiler, "-std=c99"], ".c", recorded)
    assert_same_to_float(found, corrected)


def test_the_sketch_gives_the_same(tmp_path, recorded, corrected):
    # Without a C++ compiler the sketch is tried as C, which it also is.
    cxx = shutil.which("g++") or shutil.which("c++")
    compiler, suffix = ([cxx], ".cpp") if cxx else ([shutil.which("gcc") or "cc", "-std=c2x"], ".c")
    found = run_c(tmp_path, export(MODEL, "arduino"), "imufitCorrect(acc, gyr, mag);", compiler, suffix, recorded)
    assert_same_to_float(found, corrected)


def test_offsets_of_the_sketch_are_also_given_in_the_units_of_makers():
    text = export(
        SensorModel(["acc.bias", "gyr.bias"], {"acc.bias": {"x": 9.80665}, "gyr.bias": {"z": 1.0}}), "arduino"
    )
    assert "// the offset in g: -1, 0, 0" in text.replace("-0,", "0,").replace("-0\n", "0\n")
    assert "-57.2958" in text


def test_imufusion_text_gives_the_same_in_its_units(recorded, corrected):
    names = run_python("imufusion")
    acc, gyr, mag = names["correct"](recorded.acc / 9.80665, np.degrees(recorded.gyr), recorded.mag)
    assert np.allclose(acc * 9.80665, corrected.acc, rtol=0, atol=1e-11)
    assert np.allclose(np.radians(gyr), corrected.gyr, rtol=0, atol=1e-11)
    assert np.allclose(mag, corrected.mag, rtol=0, atol=1e-11)
    assert np.array_equal(np.diag(names["acc_misalignment"]), np.ones(3))


def test_imufusion_itself_understands_the_arrays(recorded):
    pytest.importorskip("imufusion")
    names = run_python("imufusion")
    acc, gyr, mag = recorded.acc[0] / 9.80665, np.degrees(recorded.gyr[0]), recorded.mag[0]
    for own, theirs in zip(
        names["correct"](acc, gyr, mag), names["correct_with_imufusion"](acc, gyr, mag), strict=True
    ):
        assert np.allclose(own, theirs, rtol=1e-5, atol=1e-5)


def test_ahrs_text_gives_the_same_in_its_units(recorded, corrected):
    found = run_python("ahrs")["correct"](recorded.acc, recorded.gyr, recorded.mag)
    assert np.allclose(found["acc"], corrected.acc, rtol=0, atol=1e-11)
    assert np.allclose(found["gyr"], corrected.gyr, rtol=0, atol=1e-11)
    assert np.allclose(found["mag"], corrected.mag / 1000.0, rtol=0, atol=1e-14)
    assert set(run_python("ahrs")["correct"](recorded.acc, recorded.gyr)) == {"acc", "gyr"}


def test_a_level_sensor_at_rest_stays_level_in_ahrs():
    ahrs = pytest.importorskip("ahrs")
    truth = {"acc": [0.0, 0.0, 9.80665], "gyr": [0.0, 0.0, 1e-9], "mag": [0.0, 20.0, -44.0]}
    matrix = {name: np.array(run_python("ahrs")[f"{name}_matrix"]) for name in truth}
    offset = {name: np.array(run_python("ahrs")[f"{name}_offset"]) for name in truth}
    raw = {
        name: np.tile(np.linalg.solve(matrix[name], np.array(value) - offset[name]), (50, 1))
        for name, value in truth.items()
    }
    q = ahrs.filters.Mahony(**run_python("ahrs")["correct"](**raw), frequency=100.0).Q[-1]
    assert np.abs(q) == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-6)


def test_json_has_both_forms_of_the_same_numbers(recorded, corrected):
    value = json.loads(export(MODEL, "json"))
    for name, sensor in value["sensors"].items():
        raw, truth = getattr(recorded, name), getattr(corrected, name)
        matrix = np.array(sensor["matrix"])
        assert np.allclose(raw @ matrix.T + sensor["bias"], truth, rtol=0, atol=1e-11)
        assert np.allclose(np.array(sensor["misalignment"]) @ np.diag(sensor["scale"]), matrix, rtol=1e-14, atol=0)
        assert np.diag(sensor["misalignment"]).tolist() == [1.0, 1.0, 1.0]
    assert value["standard_errors"] == ERRORS


@pytest.mark.parametrize("form", FORMS)
def test_what_is_not_exported_is_said(form):
    text = export(WIDER, form)
    for told in ("acc.lever_arm", "ref.delay", "gyr.bias_temperature", "0.004", "31.25 degC"):
        assert told in text
    assert "acc.lever_arm" not in export(MODEL, form)


@pytest.mark.parametrize("form", [form for form in FORMS if form != "json"])
def test_no_name_of_a_column_ends_the_comment_it_stands_in(form):
    text = export(SensorModel(["acc.bias", "acc.column:a*/b\nint c;"]), form)
    (line,) = [line for line in text.splitlines() if "int c;" in line]
    assert line.startswith((" * ", "// ", "# "))
    assert "*/" not in line


@pytest.mark.parametrize("form", [form for form in FORMS if form != "json"])
def test_standard_errors_stand_in_the_comments(form):
    assert "acc.bias, m/s^2: x 0.3 +- 0.0012, y -0.2 +- 0.001" in export(MODEL, form)
    assert "gyr.bias, rad/s: x 0.02, y" in export(MODEL, form)


@pytest.mark.parametrize("form", ["imufusion", "ahrs"])
def test_an_axis_without_a_part_in_its_own_reading_is_exported_too(form, recorded):
    swap = {"xx": -1.0, "xy": 1.0, "yx": 1.0, "yy": -1.0}
    model = SensorModel(["mag.soft_iron"], {"mag.soft_iron": swap})
    found = run_python(form, model)["correct"](recorded.acc, recorded.gyr, recorded.mag)
    mag = found[2] if form == "imufusion" else 1000.0 * found["mag"]
    assert np.allclose(mag, recorded.mag[:, [1, 0, 2]], rtol=0, atol=1e-12)
    assert json.loads(export(model, "json"))["sensors"]["mag"]["scale"] == [1.0, 1.0, 1.0]


def test_what_cannot_be_exported_is_refused():
    with pytest.raises(InputError, match=r"no constant gain or offset.*acc\.bias"):
        export(SensorModel(["ref.delay"]), "json")
    with pytest.raises(InputError, match=r"acc\.scale cannot be undone"):
        export(SensorModel(["acc.scale"], {"acc.scale": {"x": -1.0}}), "c-header")
    with pytest.raises(InputError, match=r"the form 'matlab' is unknown.*c-header"):
        export(MODEL, "matlab")


def test_the_command_writes_every_form(tmp_path, capsys):
    MODEL.save(tmp_path / "m.toml")
    for form in FORMS:
        assert main(["export", str(tmp_path / "m.toml"), "--to", form]) == 0
        assert capsys.readouterr().out == export(MODEL, form)
        assert main(["export", str(tmp_path / "m.toml"), "--to", form, "-o", str(tmp_path / "out")]) == 0
        assert (tmp_path / "out").read_text() == export(MODEL, form)
        capsys.readouterr()
    assert main(["export", str(tmp_path / "m.toml"), "--to", "c-header", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(export(MODEL, "json"))
    assert main(["export", str(tmp_path / "m.toml"), "--to", "c-heade"]) == 2
    assert "did you mean c-header" in capsys.readouterr().err
    assert main(["export", "--help"]) == 0
    said = capsys.readouterr().out
    assert all(form in said for form in FORMS)
