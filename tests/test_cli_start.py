"""What starting the program costs: counted in modules, which a busy machine does not change."""

import subprocess
import sys

import pytest

HEAVY = {"numpy", "pyarrow", "pandas", "scipy", "matplotlib", "rich", "jinja2", "serial"}
"""Packages that cost more than a tenth of a second, or are only needed where something is shown or listened to."""


def imported(*words):
    """Run the program in a process of its own; return its exit code, its last line and the packages it imported."""
    script = (
        "import sys; from imufit.cli.app import main; code = main(sys.argv[1:]);"
        "print('|'.join([str(code), *sorted({name.partition('.')[0] for name in sys.modules})]))"
    )
    done = subprocess.run([sys.executable, "-c", script, *map(str, words)], capture_output=True, text=True, check=True)
    code, *packages = done.stdout.splitlines()[-1].split("|")
    return int(code), done.stderr, HEAVY & set(packages)


@pytest.mark.parametrize("words", [["--help"], ["diagnose", "--help"], ["monitor", "-h"], ["--version"], ["nonsense"]])
def test_help_imports_nothing_heavy(words):
    assert imported(*words)[2] == set()


def test_a_command_that_is_asked_for_is_the_only_one_imported():
    script = (
        "import sys; from imufit.cli.app import main; main(['compare', '--help']);"
        "from imufit.cli.on_demand import SUMMARIES;"
        "sys.exit(' '.join(n for n in SUMMARIES if f'imufit.cli.{n}' in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == "compare"


def test_a_file_that_is_not_there_is_refused_without_anything_heavy(tmp_path):
    code, err, heavy = imported("diagnose", tmp_path / "nofile.csv")
    assert (code, heavy) == (2, set())
    assert "nofile.csv" in err


@pytest.mark.parametrize("command", ["diagnose", "info", "replay", "ladder"])
def test_a_log_that_cannot_be_read_is_refused_by_what_reads_it_alone(tmp_path, command):
    log = tmp_path / "text.csv"
    log.write_text("t,acc_x,acc_y,acc_z\n0,0,0,9.8\n0.01,0,oops,9.8\n")
    code, err, heavy = imported(command, log)
    assert (code, heavy) == (2, {"numpy", "pyarrow"})
    assert "'oops' is not a number" in err


def test_python_m_imufit_is_the_program():
    command = [sys.executable, "-m", "imufit"]
    done = subprocess.run([*command, "--version"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.split()[0]) == (0, "imufit")
    done = subprocess.run([*command, "comprae"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "did you mean compare?" in done.stderr


def test_help_says_what_every_command_does():
    from imufit.cli.app import imufit as program
    from imufit.cli.on_demand import SUMMARIES

    assert list(program.commands) == list(SUMMARIES)
    for name, command in program.commands.items():
        assert command.name == name
        assert command.short_help == SUMMARIES[name]
