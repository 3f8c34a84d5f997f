"""An artificial horizon in characters."""

from __future__ import annotations

import math
from typing import Final

WIDTH: Final = 37
HEIGHT: Final = 11
"""Characters of the picture: with three filters and the line below it fits a terminal of 24 lines."""
VIEW: Final = 60.0
"""Angle from the top to the bottom of the picture, deg: a hand's motions stay within."""
ASPECT: Final = 2.0
"""Height of a character over its width, as common fonts have."""
SKY, GROUND, LINE = " ", "░", "━"


def horizon(roll: float, nose_up: float) -> list[str]:
    """Draw what somebody sees who looks along the body's x axis: sky, ground and the line between.

    Parameters
    ----------
    roll : float
        rad; positive where the right side is down.
    nose_up : float
        Angle of the body's x axis above the horizon, rad.

    Returns
    -------
    list of str
        `HEIGHT` lines of `WIDTH` characters.
    """
    step = VIEW / HEIGHT
    up, turned = math.cos(roll), math.sin(roll)
    # a step of a column is narrower than one of a row: the line is thick enough to be whole in either direction
    half = 0.5 * step * max(abs(up), abs(turned) / ASPECT)
    lines = []
    for row in range(HEIGHT):
        above = (HEIGHT // 2 - row) * step
        cells = []
        for column in range(WIDTH):
            right = (column - WIDTH // 2) * step / ASPECT
            elevation = math.degrees(nose_up) + above * up - right * turned
            cells.append(LINE if abs(elevation) <= half else SKY if elevation > 0.0 else GROUND)
        if row == HEIGHT // 2:
            cells[WIDTH // 2 - 2 : WIDTH // 2 + 3] = "<-+->"
        lines.append("".join(cells))
    return lines
