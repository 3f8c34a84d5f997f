"""The commands one after another, as a person would type them, on a simulated log with a known effect."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from cli_stand_in import run, strict_json
from imufit.lab.simulate.sealed import Truth, seal


def test_same_hidden_seed_makes_the_same_log_and_the_seal_hides_the_effect(capsys, tmp_path):
    for name in ("one.parquet", "two.parquet"):
        code, out, err = run(capsys, "simulate", "handheld", "--hidden", "5", "--duration", "20", "-o", tmp_path / name)
        assert (code, err) == (0, [])
        assert "acc." not in out
        assert "gyr." not in out
    assert (tmp_path / "one.parquet").read_bytes() == (tmp_path / "two.parquet").read_bytes()
    sealed = (tmp_path / "one.parquet.sealed").read_text()
    assert not any(sensor in sealed for sensor in ("acc.", "gyr.", "mag.", "ref."))


def test_reveal_states_units_and_knows_effects_outside_the_catalogue(capsys, tmp_path):
    log = tmp_path / "log.parquet"
    log.touch()
    effects = {"gyr.column:vbat": {"x": 0.01}, "acc.creep": {"share": 0.02}}
    seal(Truth("handheld", 1, effects, {}), log)
    code, out, err = run(capsys, "reveal", log)
    assert (code, err) == (0, [])
    assert "x 0.573 deg/s per vbat" in out
    assert "share 0.02" in out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--effect", "gyr.bias:q=1"], "q"),
        (["--effect", "rig.backlash"], "rig"),
        (["--rate", "0.001"], "rows"),
        (["--effect", "gyr.bias:x=nan"], "finite"),
    ],
)
def test_simulation_that_cannot_be_is_one_line(capsys, tmp_path, arguments, words):
    code, _, err = run(capsys, "simulate", "handheld", *arguments, "-o", tmp_path / "log.csv")
    assert code == 2
    assert len(err) == 1
    assert words in err[0]
    assert not (tmp_path / "log.csv").exists()


@pytest.mark.parametrize(
    "content",
    [b"", b"t,acc_x\n", b"t,acc_x,acc_y,acc_z\n0,1,2\n", b"\x00\x01\x02", b"t,acc_x,acc_y,acc_z\n0,a,b,c\n"],
)
@pytest.mark.parametrize("command", ["compare", "diagnose", "ladder", "replay"])
def test_bad_log_is_one_line_for_every_command(capsys, tmp_path, command, content):
    log = tmp_path / "bad.csv"
    log.write_bytes(content)
    code, out, err = run(capsys, command, log, "--json", "-")
    assert (code, out) == (2, "")
    assert len(err) == 1
    assert "bad.csv" in err[0]


def test_loop_finds_an_effect_that_was_put_in(capsys, tmp_path):
    log, model, answer = tmp_path / "log.parquet", tmp_path / "model.toml", tmp_path / "answer.json"
    effect = "gyr.bias:x=0.01,y=-0.02,z=0.005"
    assert run(capsys, "simulate", "handheld", "--effect", effect, "--seed", "3", "-o", log)[0] == 0

    code, out, err = run(capsys, "compare", log, "--json", "-")
    assert (code, err) == (0, [])
    assert strict_json(out)["sensors"]["gyr"]["ratio"] > 1.5
    code, out, err = run(capsys, "compare", log)
    assert [line for line in out.splitlines() if line.startswith("  imufit ")] == [f"  imufit diagnose {log}"]

    code, out, err = run(capsys, "diagnose", log, "--json", answer)
    assert (code, err) == (0, [])
    assert strict_json(answer.read_text())["best"] == "gyr.bias"
    commands = [shlex.split(line) for line in out.splitlines() if line.startswith("  imufit ")]
    assert commands == [["imufit", "add", "gyr.bias", str(log)], ["imufit", "ladder", str(log)]]
    assert all(run(capsys, *command)[0] == 0 for _, *command in commands)

    code, out, err = run(capsys, "add", "gyr.bias", log, "-o", model, "--json", "-")
    assert (code, err) == (0, [])
    added = strict_json(out)
    assert added["after"] < 1.1 < added["before"]
    assert added["parameters"]["y"]["value"] == pytest.approx(-0.02, abs=5 * added["parameters"]["y"]["standard_error"])

    code, out, err = run(capsys, "diagnose", log, "--model", model, "--json", "-")
    assert (code, err) == (0, [])
    assert strict_json(out)["verdict"] == "adequate"

    code, out, err = run(capsys, "ladder", log, "--html", tmp_path / "report.html", "--json", answer)
    assert (code, err) == (0, [])
    assert [step["effect"] for step in strict_json(answer.read_text())["steps"]] == ["gyr.bias"]
    code, out, err = run(capsys, "reveal", log, "--answer", answer)
    assert (code, err) == (0, [])
    assert "The answer names gyr.bias: right." in out


def test_demo_ends_with_the_truth(capsys, tmp_path):
    code, out, err = run(capsys, "demo", "-o", tmp_path / "shown")
    assert (code, err) == (0, [])
    assert out.index("wrote") < out.index("6. The truth")
    assert {"report.html", "ladder.png"} <= {path.name for path in (tmp_path / "shown").iterdir()}


def test_installed_program_starts(tmp_path):
    program = Path(sys.executable).with_name("imufit")
    done = subprocess.run([program, "--help"], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0
    assert "diagnose" in done.stdout
    environment = {**os.environ, "IMUFIT_DEBUG": ""}
    done = subprocess.run(
        [program, "compare", "x.csv"], capture_output=True, text=True, check=False, cwd=tmp_path, env=environment
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
