"""Roll, pitch and yaw over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.figures import place
from imufit.figures.style import BLUE, GREEN, GREY, INK, ORANGE, SKY, VERMILION

Array = NDArray[np.float64]

COLOURS: Final = (BLUE, VERMILION, GREEN, ORANGE, SKY, GREY, INK)
MOST_POINTS: Final = 20_000
"""Points that are drawn of a line: ten for each pixel of a figure of 2000 pixels."""


def angle_panels(t: Array, angles: Mapping[str, Array], ax: place.Place | None = None) -> place.Drawing:
    """Draw a panel for each angle with a line for each filter.

    Parameters
    ----------
    t : (n,) array
        Time, s.
    angles : mapping of (n, 3) arrays
        Roll, pitch and yaw by filter, rad.
    ax : sequence of Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.
    """
    drawing = place.panels(ax, (8.0, 6.0), place.rows_of(3, 1), sharex=True)
    panels = drawing.axes
    thin = slice(None, None, max(1, len(t) // MOST_POINTS))
    for k, name in enumerate(("roll", "pitch", "yaw")):
        for number, (label, values) in enumerate(angles.items()):
            degrees = np.degrees(values[thin, k])
            # where an angle comes round from +180 to -180 deg the line is open, not a stroke across the panel
            with np.errstate(invalid="ignore"):
                degrees = np.where(np.abs(np.diff(degrees, prepend=degrees[:1])) > 180.0, np.nan, degrees)
            panels[k].plot(t[thin], degrees, color=COLOURS[number % len(COLOURS)], linewidth=1.0, label=label)
        panels[k].set_ylabel(f"{name}, deg")
    panels[-1].set_xlabel("time, s")
    handles, labels = panels[0].get_legend_handles_labels()
    drawing.legend(handles, labels, loc="outside lower center", ncols=2 if drawing.narrow else 7)
    return drawing
