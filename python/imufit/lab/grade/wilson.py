"""Interval of a share."""

from __future__ import annotations

import numpy as np


def interval(right: int, n: int) -> tuple[float, float]:
    """Return the 95 % interval of a share by Wilson's formula (1927).

    Parameters
    ----------
    right, n : int
        How many of how many, n at least 1.
    """
    z = 1.959964
    p = right / n
    centre = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return max(0.0, float(centre - half)), min(1.0, float(centre + half))
