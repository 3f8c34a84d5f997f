"""The progress bar: what is told, when it comes, and that nothing is claimed that nobody can know."""

import os
import pty
import re
import subprocess
import sys

import pytest
from imufit.cli.progress import ProgressBar


def screen(script):
    """Run Python whose standard error is a terminal of 100 columns; return what came to it."""
    own, other = pty.openpty()
    environment = {**os.environ, "COLUMNS": "100", "TERM": "xterm"}
    process = subprocess.Popen([sys.executable, "-c", script], stderr=other, env=environment)
    os.close(other)
    seen = b""
    try:
        while data := os.read(own, 4096):
            seen += data
    except OSError:
        pass
    os.close(own)
    assert process.wait() == 0
    return seen.decode()


SCRIPT = """
import time
from imufit.cli import progress
progress.PATIENCE_S = 0.2
with progress.ProgressBar(counted={counted}) as tell:
    for done, total, what in {calls}:
        tell(done, total, what)
        time.sleep(0.5)
"""


def test_a_search_tells_step_and_pass_and_the_time_so_far_and_no_share():
    calls = [(5, 10, "surveying"), (10, 10, "surveying"), (0, 1, "step 2: gyr.scale against 14 candidates")]
    seen = screen(SCRIPT.format(counted=False, calls=calls))
    assert "surveying" in seen
    assert "step 2: gyr.scale against 14 candidates" in seen
    assert "so far" in seen
    assert "%" not in seen
    assert "left" not in seen


def test_work_that_is_counted_tells_its_share_and_never_goes_back():
    seen = screen(SCRIPT.format(counted=True, calls=[(1, 4, "filter a"), (3, 4, "filter b"), (2, 4, "filter c")]))
    shares = [int(share) for share in re.findall(r"(\d+)%", seen)]
    assert {25, 75} <= set(shares)
    assert shares == sorted(shares)
    assert "left" in seen


def test_the_bar_comes_although_nobody_calls_any_more():
    seen = screen(SCRIPT.format(counted=False, calls=[(0, 1, "step 1: weighing")]))
    assert "step 1: weighing" in seen


def test_quick_work_and_a_file_get_no_bar(capsys):
    with ProgressBar() as tell:
        tell(1, 2, "surveying")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("calls", "words"),
    [
        ([], "working"),
        ([(1, 2, "surveying")], "surveying"),
        ([(2, 2, "surveying")], "working"),
        ([(0, 1, "step 1"), (1, 2, "taking evidence")], "step 1, taking evidence"),
        ([(0, 1, "step 1"), (2, 2, "taking evidence")], "step 1"),
    ],
)
def test_what_is_over_is_not_told_any_more(calls, words):
    with ProgressBar() as tell:
        for call in calls:
            tell(*call)
        assert tell.words == words


def test_the_ladder_tells_its_steps(tmp_path):
    import imufit
    from imufit.lab.simulate import simulate

    told = []
    log = simulate("handheld", {"gyr.bias": {"x": 0.02}}, seed=3, duration=40, rate=50).to_log()
    result = imufit.ladder(log, progress=lambda done, total, what: told.append((total, what)))
    steps = [what for total, what in told if total == 1]
    assert steps[0].startswith("step 1: looking for effects missing in")
    assert [step.effect for step in result.steps] == ["gyr.bias"]
    assert any(what.startswith("step 1: gyr.bias against ") and what.endswith(" candidates") for what in steps)
    assert any(what.startswith("step 2: looking for effects missing in gyr.bias") for what in steps)
