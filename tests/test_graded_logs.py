"""Logs of `imufit grade` that were once answered wrongly, each of a kind of its own."""

import pytest
from imufit.lab.grade import trial


@pytest.mark.parametrize(
    ("blind_set", "seed"),
    [
        # A delay of 0.2 ms: a low-pass takes 4 millionths more off the error, by smoothing the noise of the reference.
        ("small-realistic", 1_000_016),
        # A table that rotates about the vertical: one axis reads gravity all the time, the others next to nothing.
        ("one-realistic", 1_180_024),
        # A vibration hid a second effect while its power was a mean over a quarter of a second.
        ("two", 3_300_034),
        ("two", 3_300_035),
        ("two", 3_300_044),
    ],
)
def test_the_answer_has_no_fault(blind_set, seed):
    found = trial(blind_set, seed)
    assert not found.marks.faults, str(found)
