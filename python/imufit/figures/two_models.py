"""Residual of each channel with either of two models."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from imufit.figures import place, style


def residuals_of_two(
    rows: Sequence[tuple[str, float, float]], first: str, second: str, ax: place.Place | None = None
) -> place.Drawing:
    """Draw the residual of each channel with two models as pairs of points on a line.

    Parameters
    ----------
    rows : sequence of (str, float, float)
        Channel, and residual RMS over noise floor with the first and with the second model.
    first, second : str
        Names of the models; empty is the ideal sensor.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
        Logarithmic where the residuals span more than a decade.
    """
    if not rows:
        return place.empty("The two models have no channel in common.", ax)
    drawing = place.panels(ax, (8.0, 1.6 + 0.35 * len(rows)))
    axes = drawing.axes[0]
    places = np.arange(len(rows))
    before = np.array([row[1] for row in rows])
    after = np.array([row[2] for row in rows])
    axes.hlines(places, before, after, color=style.GREY, linewidth=1.5)
    axes.plot(before, places, "o", color=style.ORANGE, label=first or "the ideal sensor")
    axes.plot(after, places, "D", color=style.BLUE, label=second or "the ideal sensor")
    axes.axvline(1.0, color=style.INK, linewidth=0.8, linestyle=":")
    if max(before.max(), after.max()) > 10.0 * min(before.min(), after.min()):
        axes.set_xscale("log")
    axes.set_yticks(places, [row[0] for row in rows])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlabel("residual RMS over the noise floor (dotted: at the floor)")
    axes.legend(loc="lower right", fontsize=9)
    style.title(axes, "Residual with either model")
    style.tidy(axes)
    return drawing
