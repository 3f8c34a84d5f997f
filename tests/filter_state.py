"""Where the numbers of a filter stand in its state: after those of the rules come attitude (4) and bias (3)."""

from __future__ import annotations

import numpy as np

RULES = 25
"""Numbers of the rules."""


def own(state: np.ndarray) -> np.ndarray:
    """Numbers of the filter itself."""
    return state[RULES:]


def bias_of(state: np.ndarray) -> np.ndarray:
    """Gyro bias, rad/s."""
    return own(state)[4:7]
