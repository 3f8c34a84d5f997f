"""Errors that an MPU-6050 may have by its data sheet: what a breadboard's sensor has before it is calibrated."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

G: Final = 9.80665
"""Standard gravity, m/s^2."""
LIMITS: Final[dict[str, tuple[float, float, float]]] = {
    "acc.bias": (0.05 * G, 0.05 * G, 0.08 * G),
    "acc.scale": (0.03, 0.03, 0.03),
    "gyr.bias": (math.radians(20.0), math.radians(20.0), math.radians(20.0)),
    "gyr.scale": (0.03, 0.03, 0.03),
}
"""Largest error of each axis, SI units (InvenSense, MPU-6000 and MPU-6050 product specification, revision 3.4, tables
6.1 and 6.2: zero-g output +-50 mg in x and y, +-80 mg in z; sensitivity +-3 %; zero-rate output +-20 deg/s)."""


def data_sheet_errors(seed: int) -> dict[str, dict[str, float]]:
    """Draw the errors of one sensor, evenly within the limits of the data sheet.

    Parameters
    ----------
    seed : int
        Picks the sensor.

    Returns
    -------
    dict
        Parameters by effect, SI units.
    """
    random = np.random.default_rng(seed)
    return {
        effect: dict(zip("xyz", (random.uniform(-1.0, 1.0, 3) * limits).tolist(), strict=True))
        for effect, limits in LIMITS.items()
    }
