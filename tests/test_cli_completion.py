"""What a shell completes, and what is probably meant by a word that is not known."""

import json
import os
import subprocess
import sys

import pytest
from cli_stand_in import run
from imufit.cli.names import FILTERS


def offered(*words):
    """What bash offers behind these words, the last of which is begun."""
    line = {"COMP_WORDS": " ".join(["imufit", *words]), "COMP_CWORD": str(len(words))}
    environment = {**os.environ, **line, "_IMUFIT_COMPLETE": "bash_complete"}
    done = subprocess.run(
        [sys.executable, "-m", "imufit"], capture_output=True, text=True, env=environment, check=False
    )
    assert done.stderr == ""
    return [entry.partition(",")[2] for entry in done.stdout.splitlines()]


@pytest.mark.parametrize(
    ("words", "some"),
    [
        (["dia"], {"diagnose"}),
        (["diagnose", "--ht"], {"--html"}),
        (["explain", "mag.h"], {"mag.hard_iron"}),
        (["add", "gyr.g"], {"gyr.g_sensitivity"}),
        (["fit", "x.csv", "--effects", "gyr.bias,gyr.g"], {"gyr.bias,gyr.g_sensitivity"}),
        (["simulate", "hand"], {"handheld"}),
        (["simulate", "handheld", "--effect", "acc.q"], {"acc.quadratic"}),
        (["simulate", "handheld", "--frame", "E"], {"ENU"}),
        (["replay", "x.csv", "--filter", "m"], {"mahony", "mekf"}),
        (["replay", "x.csv", "--filter", "gyro,ma"], {"gyro,mahony"}),
        (["tune", "x.csv", "--filter", "mah"], {"mahony"}),
        (["export", "m.toml", "--to", "ard"], {"arduino"}),
        (["emulate", "six"], {"six_sides"}),
        (["emulate", "six_sides", "--device", "g"], {"gy86"}),
        (["diagnose", "x.csv", "--frame", "N"], {"NED", "NWU"}),
    ],
)
def test_names_are_completed(words, some):
    assert some <= set(offered(*words))


def test_every_filter_is_offered():
    assert set(FILTERS) <= set(offered("replay", "x.csv", "--filter", ""))


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_for_a_shell_is_printed(capsys, shell):
    code, out, err = run(capsys, "--completion", shell)
    assert (code, err) == (0, [])
    assert "_IMUFIT_COMPLETE" in out


@pytest.mark.parametrize(
    ("part", "begins", "holds"),
    [
        ("acc", "acc.", "acc."),
        ("gyr.bias_", "gyr.bias_", "gyr.bias_"),
        ("delay", "", ".delay"),
        ("ACC", "acc.", "acc."),
    ],
)
def test_explain_lists_the_effects_of_a_part(capsys, part, begins, holds):
    code, out, err = run(capsys, "explain", part, "--json", "-")
    assert (code, err) == (0, [])
    ids = [card["id"] for card in json.loads(out)]
    assert len(ids) > 1
    assert all(each.startswith(begins) and holds in each for each in ids)
    code, out, _ = run(capsys, "explain", part)
    assert all(each in out for each in ids)


def test_an_effect_that_begins_another_is_explained_alone(capsys):
    code, out, _ = run(capsys, "explain", "gyr.bias")
    assert code == 0
    assert out.startswith("gyr.bias: ")
    assert "gyr.bias_drift" not in out.splitlines()[0]


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (["plot", "LOG", "--show", "reading"], "readings"),
        (["emulate", "handheld", "--device", "mpu605"], "mpu6050"),
        (["emulate", "handhold"], "handheld"),
        (["tune", "LOG", "--filter", "mahoni"], "mahony"),
        (["diagnose", "LOG", "--frame", "NEDD"], "NED"),
        (["calibrate", "LOG", "--cost", "vektor"], "vector"),
        (["export", "LOG", "--to", "c-heder"], "c-header"),
        (["diagnose", "wlak.csv"], "walk.csv"),
        (["--completion", "bsh"], "bash"),
        (["compare", "LOG", "--verbos"], "--verbose"),
    ],
)
def test_what_was_probably_meant_is_said(capsys, monkeypatch, tmp_path, arguments, meant):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "walk.csv").write_text("t\n0\n")
    code, _, err = run(capsys, *[word.replace("LOG", "walk.csv") for word in arguments])
    assert code == 2
    assert len(err) == 1
    assert "did you mean" in err[0].lower()
    assert meant in err[0]
