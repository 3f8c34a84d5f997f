"""Each command parses, calls, prints and writes what it says."""

import pytest
from cli_stand_in import install, run, strict_json
from imufit.log import Reading


@pytest.fixture(autouse=True)
def calls(monkeypatch):
    """Put the hand-made engine behind the command line."""
    return install(monkeypatch)


@pytest.fixture
def log(tmp_path):
    """Any file: the stand-in does not read it."""
    path = tmp_path / "walk.csv"
    path.write_text("t\n0\n")
    return path


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        (["compare", "LOG"], "channels"),
        (["diagnose", "LOG"], "candidates"),
        (["add", "gyr.g_sensitivity", "LOG"], "expected"),
        (["ladder", "LOG"], "steps"),
        (["fit", "LOG", "--effects", "gyr.bias,gyr.scale"], "model"),
        (["explain", "gyr.g_sensitivity"], "physics"),
        (["replay", "LOG", "--filter", "mahony"], "filters"),
        (["convert", "LOG", "-o", "new.parquet"], "missing"),
        (["reveal", "LOG"], "truth"),
        (["grade", "--logs", "2", "--set", "one", "--seed", "7"], "correct"),
        (["simulate", "handheld", "--hidden", "1", "-o", "new.parquet"], "sealed"),
        (["demo", "-o", "shown"], "ladder"),
    ],
)
def test_json_to_standard_output_stands_there_alone(capsys, monkeypatch, log, arguments, key):
    monkeypatch.chdir(log.parent)
    arguments = [log if each == "LOG" else each for each in arguments]
    code, out, err = run(capsys, *arguments, "--json", "-")
    assert (code, err) == (0, [])
    assert key in strict_json(out)
    code, out, err = run(capsys, *arguments, "--json", "result.json")
    assert (code, err) == (0, [])
    assert "wrote result.json" in out
    assert key in strict_json((log.parent / "result.json").read_text())


def test_compare_prints_where_the_model_fails(capsys, log):
    code, out, _ = run(capsys, "compare", log)
    assert code == 0
    assert "gyr_x stands at 1.52 times its noise floor" in out
    assert "63 %" in out
    assert "The noise floor is estimated from 14 s of rest." in out


def test_diagnose_prints_verdict_and_ranked_candidates(capsys, log):
    _, out, _ = run(capsys, "diagnose", log)
    assert out.startswith("MISSING: Gyro x reads 0.02 deg/s per g")
    assert out.index("gyr.g_sensitivity") < out.index("gyr.bias_temperature")


def test_files_that_are_asked_for_are_written(capsys, tmp_path, log):
    for command in (["compare"], ["diagnose"], ["ladder"], ["add", "gyr.bias"]):
        page, figure = tmp_path / "page.html", tmp_path / "figure.png"
        code, out, err = run(capsys, *command, log, "--html", page, "--plot", figure)
        assert (code, err) == (0, [])
        assert page.read_text().startswith("\n<!doctype html>") or "<!doctype html>" in page.read_text()[:20]
        assert figure.read_bytes()[1:4] == b"PNG"
        assert f"wrote {figure}" in " ".join(out.split())
        page.unlink()
        figure.unlink()


def test_every_figure_is_written_as_png_and_svg(capsys, tmp_path, log):
    code, out, err = run(capsys, "ladder", log, "--plots", tmp_path / "figures")
    assert (code, err) == (0, [])
    written = {path.name for path in (tmp_path / "figures").iterdir()}
    assert {"error_fall.png", "error_fall.svg", "trace_gyr_x.png", "candidates.svg", "spectrum_acc.png"} <= written
    assert {name.rpartition(".")[0] for name in written if name.endswith("png")} == {
        name.rpartition(".")[0] for name in written if name.endswith("svg")
    }
    assert (tmp_path / "figures" / "error_fall.png").read_bytes()[1:4] == b"PNG"
    assert "<svg" in (tmp_path / "figures" / "error_fall.svg").read_text()
    assert f"wrote {len(written) // 2} figures into" in " ".join(out.split())


def test_models_are_written(capsys, tmp_path, log):
    for command in (["ladder", log], ["add", "gyr.bias", log], ["fit", log, "--effects", "gyr.bias"]):
        model = tmp_path / "model.toml"
        assert run(capsys, *command, "-o", model)[0] == 0
        assert model.read_text() == "saved"
        model.unlink()


def test_model_and_mapping_reach_the_engine(capsys, calls, tmp_path, log):
    model = tmp_path / "model.toml"
    model.write_text("")
    run(capsys, "compare", log, "--model", model, "--map", "acc_x=AccX[g]", "--map", "t=time[ms]")
    assert ("open_log", (log, Reading({"acc_x": "AccX[g]", "t": "time[ms]"})), {}) in calls
    assert ("sensor_model", (), {"path": model}) in calls


def test_own_effects_are_loaded_before_the_catalogue_is_asked(capsys, calls, tmp_path, log):
    own = tmp_path / "own.py"
    own.write_text("")
    run(capsys, "add", "gyr.bias", log, "--effects-from", own)
    names = [name for name, _, _ in calls]
    assert names.index("load_effects") < names.index("catalogue")


def test_simulate_passes_only_what_was_given(capsys, calls, tmp_path):
    out = tmp_path / "log.csv"
    code, text, _ = run(
        capsys,
        "simulate",
        "handheld",
        "--effect",
        "gyr.bias:x=0.01,y=-2e-3",
        "--effect",
        "acc.column:vbat",
        "--seed",
        "4",
        "--rate",
        "200",
        "-o",
        out,
    )
    assert code == 0
    name, arguments, settings = calls[-1]
    assert name == "simulate"
    assert arguments == ("handheld", {"gyr.bias": {"x": 0.01, "y": -0.002}, "acc.column:vbat": None})
    assert settings == {"rate": 200.0, "frame": "NED", "seed": 4}
    assert "200 rows" in text


def test_hidden_simulation_does_not_tell(capsys, calls, tmp_path):
    code, text, _ = run(capsys, "simulate", "handheld", "--hidden", "7", "--size", "small", "-o", tmp_path / "log.npz")
    assert code == 0
    assert "g_sensitivity" not in text
    assert calls[-1] == ("hidden", ("handheld", 7), {"size": "small", "frame": "NED"})


def test_reveal_tells_and_grades(capsys, tmp_path, log):
    answer = tmp_path / "answer.json"
    answer.write_text('{"verdict": "missing"}')
    code, out, _ = run(capsys, "reveal", log, "--answer", answer)
    assert code == 0
    assert "Put into this log: gyr.g_sensitivity." in out
    assert "0.0202 deg/s per g" in out
    assert "The answer names gyr.g_sensitivity: right." in out
    assert "0.01967 ± 0.00056 deg/s per g" in out


def test_grade_tells_a_fresh_seed_the_marks_and_each_failure_on_a_line(capsys, calls):
    code, out, _ = run(capsys, "grade", "--set", "one", "--set", "nothing", "--logs", "3", "--processes", "1")
    assert code == 0
    _, _, given = next(call for call in calls if call[0] == "grade_blind")
    assert (given["sets"], given["logs"], given["processes"]) == (("one", "nothing"), 3, 1)
    assert f"--seed {given['seed']} repeats this" in out
    assert "2/3" in out
    (line,) = [line for line in out.splitlines() if "--set one --seed 7 --logs 1" in line]
    assert line.endswith("ends here")


def test_explain_prints_a_card_or_the_catalogue(capsys):
    _, out, _ = run(capsys, "explain", "gyr.g_sensitivity")
    assert "Six static poses" in out
    _, out, _ = run(capsys, "explain")
    assert all(effect in out for effect in ("gyr.bias", "acc.bias", "mag.hard_iron"))


def test_replay_prints_a_dash_without_reference_and_writes_the_log(capsys, tmp_path, log):
    code, out, _ = run(capsys, "replay", log, "--filter", "mahony", "-o", tmp_path / "out.parquet")
    assert code == 0
    assert "mahony" in out
    assert "1.50" in out
    assert "2 rows skipped: gap." in out
    assert (tmp_path / "out.parquet").exists()


def test_demo_tells_the_truth_last_and_writes_report_and_ladder(capsys, tmp_path):
    code, out, err = run(capsys, "demo", "-o", tmp_path / "shown")
    assert (code, err) == (0, [])
    places = [
        out.index(words) for words in ("hidden effect", "Which effect", "4. Add", "5. Go on", "wrote", "The truth")
    ]
    assert places == sorted(places)
    assert "hidden: gyr.g_sensitivity" in out
    assert {each.name for each in (tmp_path / "shown").iterdir()} >= {"log.parquet", "report.html", "ladder.png"}
