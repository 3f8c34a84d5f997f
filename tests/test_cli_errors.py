"""Whatever goes wrong: one line on standard error, the right exit code, no traceback."""

import subprocess
import sys
import time

import pytest
from cli_stand_in import install, run
from imufit.cli import engine
from imufit.errors import InputError


@pytest.fixture(autouse=True)
def calls(monkeypatch):
    """Put the hand-made engine behind the command line."""
    monkeypatch.delenv("IMUFIT_DEBUG", raising=False)
    return install(monkeypatch)


@pytest.fixture
def log(tmp_path):
    """Any file: the stand-in does not read it."""
    path = tmp_path / "walk.csv"
    path.write_text("t\n0\n")
    return path


def fails(capsys, *arguments, code=2):
    """Run a command that fails; return its one line."""
    got, out, err = run(capsys, *arguments)
    assert got == code, (out, err)
    assert len(err) == 1, err
    assert err[0].startswith("imufit: ")
    assert "Traceback" not in out + err[0]
    return err[0]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["comprae", "LOG"], "did you mean compare?"),
        (["zzz"], "unknown command 'zzz'"),
        (["--nonsense"], "--nonsense"),
        (["compare"], "LOG"),
        (["compare", "nowhere.csv"], "nowhere.csv"),
        (["compare", "LOG", "--jsn", "-"], "--json"),
        (["compare", "LOG", "--report", "page.html"], "did you mean --html?"),
        (["compare", "LOG", "extra"], "extra"),
        (["compare", "LOG", "--html", "no/such/dir/page.html"], "does not exist"),
        (["compare", "LOG", "--plot", "figure.txt"], ".png"),
        (["add", "gyr.gsensitivity", "LOG"], "did you mean gyr.g_sensitivity?"),
        (["fit", "LOG", "--effects", "gyr.bais"], "did you mean gyr.bias"),
        (["fit", "LOG", "--effects", ","], "--effects acc.bias,gyr.bias"),
        (["fit", "LOG", "--effects", "gyr.bias,gyr.bias"], "twice"),
        (["fit", "LOG", "--effects", "gyr.column:"], "unknown effect"),
        (["fit", "LOG", "--effects", "gyr.bias", "--fix", "gyr.bias.x"], "EFFECT.PARAM=VALUE"),
        (["fit", "LOG", "--effects", "gyr.bias", "--fix", "gyr.bias.x=nan"], "'nan' is not a number"),
        (["fit", "LOG", "--effects", "gyr.bias", "--fix", "gyr.bias.x=2deg"], "'2deg' is not a number"),
        (["explain", "mag.hardiron"], "did you mean mag.hard_iron?"),
        (["replay", "LOG", "--filter", "mahoney"], "did you mean mahony?"),
        (["replay", "LOG", "--filter", "accel,kalmann"], "did you mean kalman?"),
        (["replay", "LOG", "--filter", ","], "names no filter"),
        (["replay", "LOG", "--set", "kalman"], "FILTER.NAME=VALUE"),
        (["replay", "LOG", "--set", "calman.acc_noise=1"], "did you mean kalman?"),
        (["replay", "LOG", "--set", "kalman.accnoise=1"], "did you mean acc_noise"),
        (["replay", "LOG", "--set", "kalman.zzz=1"], "acc_noise"),
        (["replay", "LOG", "--set", "kalman.acc_noise=much"], "'much' is not a number"),
        (["replay", "LOG", "--set", "accel.a=1"], "accel has no settings"),
        (["replay", "LOG", "--band", "0"], "--band"),
        (["replay", "LOG", "--band", "inf"], "--band"),
        (["replay", "LOG", "--band", "nan"], "--band"),
        (["calibrate", "LOG", "--hold", "nan"], "--hold"),
        (["simulate", "handheld", "-o", "x.csv", "--rate", "nan"], "--rate"),
        (["simulate", "handheld", "-o", "x.csv", "--seed", "1" + "0" * 30], "--seed"),
        (["convert", "LOG", "-o", "x\0.csv"], "NUL"),
        (["convert", "x\0.csv", "-o", "x.csv"], "NUL"),
        (["replay", "LOG", "--plot", "figure.txt"], ".png"),
        (["simulate", "handhold", "-o", "x.csv"], "did you mean handheld?"),
        (["simulate", "handheld"], "-o"),
        (["simulate", "handheld", "-o", "x.doc"], ".parquet"),
        (["simulate", "handheld", "-o", "x.csv", "--effect", "gyr.bias:x=much"], "NAME=NUMBER"),
        (["simulate", "handheld", "-o", "x.csv", "--effect", "gyr.bais"], "did you mean gyr.bias?"),
        (["simulate", "handheld", "-o", "x.csv", "--hidden", "1", "--effect", "gyr.bias"], "--hidden"),
        (["simulate", "handheld", "-o", "x.csv", "--rate", "-5"], "--rate"),
        (["simulate", "handheld", "-o", "x.csv", "--frame", "NUE"], "unknown frame"),
        (["convert", "LOG"], "-o"),
        (["convert", "LOG", "-o", "x.txt"], ".parquet"),
        (["convert", "LOG", "-o", "LOG"], "overwritten"),
        (["reveal", "LOG", "--answer", "LOG"], "not JSON"),
        (["grade", "--set", "onee"], "did you mean one"),
        (["grade", "--logs", "0"], "0 is not in the range"),
        (["ladder", "LOG", "-o", "LOG"], ".toml"),
        (["compare", "LOG", "--json", "LOG"], "overwritten"),
    ],
)
def test_unusable_arguments_are_told_in_one_line(capsys, monkeypatch, log, arguments, words):
    monkeypatch.chdir(log.parent)
    assert words in fails(capsys, *[log if each == "LOG" else each for each in arguments])


def test_unusable_input_is_told_in_one_line(capsys, monkeypatch, log):
    def refuse(path, mapping):
        raise InputError("t does not rise", file=path, row=57, column="t", remedy="Sort the log\nthere.")

    monkeypatch.setattr(engine, "open_log", refuse)
    line = fails(capsys, "compare", log)
    assert "walk.csv: row 57" in line
    assert "Sort the log there." in line


def test_file_that_cannot_be_read_is_told_by_its_name(capsys, monkeypatch, log):
    def refuse(path, mapping):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(engine, "open_log", refuse)
    assert "walk.csv: Permission denied" in fails(capsys, "diagnose", log)


def test_fault_of_the_program_hints_at_the_traceback_and_shows_it_on_request(capsys, monkeypatch, log):
    def broken(path, mapping):
        raise KeyError("gyr_x")

    monkeypatch.setattr(engine, "open_log", broken)
    assert "IMUFIT_DEBUG=1" in fails(capsys, "compare", log, code=1)
    monkeypatch.setenv("IMUFIT_DEBUG", "1")
    code, _, err = run(capsys, "compare", log)
    assert code == 1
    assert any("Traceback" in line for line in err)


def test_interruption_is_one_line_and_130(capsys, monkeypatch, log):
    def interrupted(path, mapping):
        raise KeyboardInterrupt

    monkeypatch.setattr(engine, "open_log", interrupted)
    assert "interrupted" in fails(capsys, "ladder", log, code=130)


def test_broken_effects_file_is_unusable_input(capsys, monkeypatch, tmp_path, log):
    import imufit

    def load(path):
        raise SyntaxError("invalid syntax")

    monkeypatch.undo()
    monkeypatch.setattr(imufit, "load_effects", load, raising=False)
    own = tmp_path / "own.py"
    own.write_text("def")
    assert "own.py" in fails(capsys, "explain", "--effects-from", own)


def test_an_input_is_never_overwritten(capsys, tmp_path, log):
    model = tmp_path / "model.toml"
    model.write_text("kept")
    fails(capsys, "compare", log, "--model", model, "--html", model)
    assert model.read_text() == "kept"


def test_help_and_version_succeed_and_without_arguments_there_is_help(capsys):
    for arguments in ([], ["--help"], ["compare", "-h"], ["simulate", "--help"]):
        code, out, err = run(capsys, *arguments)
        assert (code, err) == (0, [])
        assert "Usage" in out
    code, out, _ = run(capsys, "--version")
    assert code == 0
    assert out.startswith("imufit ")


def test_help_needs_neither_engine_nor_plots():
    script = (
        "import sys; from imufit.cli.app import main; main(['--help']);"
        "heavy = {'matplotlib', 'pandas', 'scipy', 'pyarrow', 'jinja2'} & set(sys.modules);"
        "sys.exit(f'imported {heavy}' if heavy else 0)"
    )
    start = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert time.perf_counter() - start < 5.0


def test_reader_that_goes_away_is_no_fault():
    done = subprocess.run(
        f"{sys.executable} -m imufit.cli.app --help | true; echo ${{PIPESTATUS[0]}}",
        shell=True,
        executable="/bin/bash",
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.strip() in ("0", "141")
    assert done.stderr == ""
