"""Every example runs within a minute and says what it is there to show."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
SHOWS = {
    "first_loop.py": ("acc.lever_arm is missing", "Nothing that this log can show is missing"),
    "foreign_csv.py": ("+ gyr.bias", "s at 100 Hz; acc, gyr, ref_q, temp; NED"),
    "paper_a_calibration.py": ("published as 0.995", "of the twelve parameters within 2 standard errors"),
    "own_effect.py": ("gyr.fan is missing", "+ acc.bias"),
}


def test_every_example_is_tested():
    assert {path.name for path in EXAMPLES.glob("*.py")} == set(SHOWS)


@pytest.mark.parametrize("name", SHOWS)
def test_example_shows_what_it_is_there_for(name, tmp_path):
    environment = {**os.environ, "MPLBACKEND": "agg", "PYTHONIOENCODING": "utf-8"}
    command = [sys.executable, str(EXAMPLES / name)]
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    for words in SHOWS[name]:
        assert words in done.stdout
