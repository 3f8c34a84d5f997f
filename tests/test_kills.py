"""A recorder is killed at any instant, from the first sample on: what it leaves is recovered."""

import numpy as np
import pytest
from killed_recorder import kill_one, running_device

ALLOWED = 0.25
"""What a crash may cost, s."""


@pytest.fixture(scope="module")
def device():
    with running_device() as device:
        yield device


@pytest.mark.parametrize("wait", [*np.linspace(0.05, 1.0, 9), *np.linspace(1.2, 1.6, 3)])
def test_a_recorder_that_is_killed_loses_a_quarter_of_a_second_at_most(device, tmp_path, wait):
    kill = kill_one(device, float(wait), tmp_path)
    assert kill.recovered > 0
    assert kill.lost <= ALLOWED
    assert kill.recovered >= kill.sent - 1.1 * ALLOWED * 500.0
