"""Every example runs within a minute and says what it is there to show."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from test_readme import blocks

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
SHOWS = {
    "first_loop.py": ("acc.lever_arm is missing", "Nothing that this log can show is missing"),
    "foreign_csv.py": ("+ gyr.bias", "s at 100 Hz; acc, gyr, ref_q, temp; NED"),
    "paper_a_calibration.py": ("published as 0.995", "of the twelve parameters within 2 standard errors"),
    "own_effect_with_memory.py": ("missing gyr.die", "missing gyr.sticking", "-> 1.00"),
    "own_effect.py": ("gyr.fan is missing", "+ acc.bias"),
}
ON_A_PAGE = {"paper_b_tilt.py": "docs/tilt.md", "paper_c_hybrid.py": "docs/hybrid.md"}
"""Examples whose whole output stands on a page, where `test_readme.py` runs them."""


def test_every_example_is_tested():
    assert {path.name for path in EXAMPLES.glob("*.py")} == {*SHOWS, *ON_A_PAGE}
    for name, page in ON_A_PAGE.items():
        assert page in blocks.pages()
        assert f"python examples/{name}" in (EXAMPLES.parent / page).read_text(encoding="utf-8")


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
