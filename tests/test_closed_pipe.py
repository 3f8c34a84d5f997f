"""Whoever reads the output may stop: the program ends without a word, as other programs do."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from imufit.lab.simulate import simulate

QUIET = (0, 141)
"""Exit codes of a program whose reader went away: done before that, or ended by SIGPIPE (128 + 13)."""


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pipe") / "walk.parquet"
    simulate("handheld", {}, seed=1, duration=20).to_log().write(path)
    return path


@pytest.mark.parametrize(
    "arguments",
    [
        ("info", "LOG", "--quick"),
        ("info", "LOG", "--quick", "--json", "-"),
        ("replay", "LOG", "--filter", "accel"),
        ("--help",),
    ],
)
def test_a_closed_pipe_ends_a_command_quietly(log: Path, arguments: tuple[str, ...]):
    reading, writing = os.pipe()
    os.close(reading)
    words = [str(log) if word == "LOG" else word for word in arguments]
    try:
        done = subprocess.run(
            [sys.executable, "-m", "imufit.cli.app", *words],
            stdout=writing,
            stderr=subprocess.PIPE,
            timeout=120,
            check=False,
        )
    finally:
        os.close(writing)
    assert done.stderr == b""
    assert done.returncode == 141


def test_the_files_are_written_though_nobody_reads_the_output(log: Path, tmp_path: Path):
    reading, writing = os.pipe()
    os.close(reading)
    answer = tmp_path / "answer.json"
    try:
        done = subprocess.run(
            [sys.executable, "-m", "imufit.cli.app", "compare", str(log), "--json", str(answer)],
            stdout=writing,
            stderr=subprocess.PIPE,
            timeout=120,
            check=False,
        )
    finally:
        os.close(writing)
    assert done.stderr == b""
    assert done.returncode == 141
    assert json.loads(answer.read_text())["channels"]


def test_a_reader_that_takes_the_first_line_has_it(log: Path):
    with subprocess.Popen(
        [sys.executable, "-m", "imufit.cli.app", "info", str(log), "--quick"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        assert b"2000 rows" in running.stdout.readline()
        running.stdout.close()
        assert running.stderr.read() == b""
    assert running.returncode in QUIET


def test_a_closed_standard_error_ends_a_command_that_fails_quietly(tmp_path: Path):
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, "-m", "imufit.cli.app", "info", str(tmp_path / "nowhere.csv")],
        stdout=subprocess.PIPE,
        stderr=writing,
        timeout=120,
        check=False,
    )
    os.close(writing)
    assert (done.returncode, done.stdout) == (141, b"")
