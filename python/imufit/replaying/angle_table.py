"""The angles of a replay at the times that say most: where a log has no reference, these are the answer."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from imufit.results.table import Table

Array = NDArray[np.float64]

ANGLES = ("roll", "pitch", "yaw")
HALF_TURN = 180.0
"""Step (deg) between two rows beyond which the shorter way goes across +-180 deg."""


def angle_table(t: Array, angles: Mapping[str, Array]) -> Table:
    """Roll, pitch and yaw of every filter at its first and last attitude and at the extremes of roll and pitch.

    The extremes of a roll that passes 180 deg are left out: they are not those of the motion.

    Parameters
    ----------
    t : (n,) array
        Time, s.
    angles : mapping of (n, 3) arrays
        Roll, pitch and yaw by filter, rad; NaN where there is none.
    """
    rows: list[tuple[str, ...]] = []
    for name, three in angles.items():
        known = np.flatnonzero(np.isfinite(three).all(axis=1))
        if not known.size:
            rows.append((name, "no attitude", "-", "-", "-", "-"))
            continue
        degrees = np.degrees(three[known])
        places = [("start", 0), ("end", known.size - 1)]
        for k, what in enumerate(ANGLES[:2]):
            # An angle that comes round from 180 to -180 deg has neither a least value nor a largest one.
            if np.any(np.abs(np.diff(degrees[:, k])) > HALF_TURN):
                continue
            places += [(f"least {what}", int(degrees[:, k].argmin())), (f"most {what}", int(degrees[:, k].argmax()))]
        for place, (when, row) in enumerate(places):
            cells = (f"{value:.2f}" for value in degrees[row])
            rows.append((name if place == 0 else "", when, f"{t[known[row]]:.2f}", *cells))
    return Table("Angles, deg", ("filter", "when", ">t, s", *(f">{what}" for what in ANGLES)), tuple(rows))
