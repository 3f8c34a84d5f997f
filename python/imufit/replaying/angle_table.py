"""The angles of a replay at the times that say most: where a log has no reference, these are the answer."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from imufit.results.table import Table

Array = NDArray[np.float64]

ANGLES = ("roll", "pitch", "yaw")


def angle_table(t: Array, angles: Mapping[str, Array]) -> Table:
    """Roll, pitch and yaw of every filter at its first and last attitude and at the extremes of roll and pitch.

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
            places += [(f"least {what}", int(degrees[:, k].argmin())), (f"most {what}", int(degrees[:, k].argmax()))]
        for place, (when, row) in enumerate(places):
            cells = (f"{value:.2f}" for value in degrees[row])
            rows.append((name if place == 0 else "", when, f"{t[known[row]]:.2f}", *cells))
    return Table("Angles, deg", ("filter", "when", ">t, s", *(f">{what}" for what in ANGLES)), tuple(rows))
