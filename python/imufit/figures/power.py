"""Share of blind logs whose effect is named, over the size of the effect."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imufit.figures import place, style

FloatArray = NDArray[np.float64]


def power(
    sizes: ArrayLike, curves: Mapping[str, Mapping[str, FloatArray]], ax: place.Place | None = None
) -> place.Drawing:
    """Draw how often an effect is named, against its size.

    Parameters
    ----------
    sizes : array_like
        (k,) root mean square of the effect over the white noise of its sensor.
    curves : mapping
        For each kind of noise ``named`` (alone or among rivals) and ``alone``: (k, 3) share, lower and upper end of
        its 95 % interval.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
        Full lines: named, alone or among rivals, with the interval as a band. Dashed: named alone.
    """
    sizes = np.asarray(sizes, dtype=float)
    drawing = place.panels(ax, (7.6, 4.4))
    axes = drawing.axes[0]
    for (name, curve), colour in zip(curves.items(), (style.BLUE, style.VERMILION), strict=False):
        share, low, high = 100.0 * np.asarray(curve["named"]).T
        axes.fill_between(sizes, low, high, color=colour, alpha=0.15, linewidth=0)
        axes.plot(sizes, share, color=colour, marker="o", markersize=4, label=f"{name}: named")
        alone = 100.0 * np.asarray(curve["alone"])[:, 0]
        axes.plot(sizes, alone, color=colour, linestyle="--", linewidth=1.1, label=f"{name}: named alone")
    axes.set_xscale("log")
    axes.set_xticks(sizes, [f"{size:g}" for size in sizes])
    axes.minorticks_off()
    axes.set_ylim(-2.0, 102.0)
    axes.set_xlabel("root mean square of the hidden effect over the noise of its sensor", fontsize=9)
    axes.set_ylabel("share of logs, %", fontsize=9)
    axes.axhline(95.0, color=style.GREY, linewidth=0.8, zorder=0)
    drawing.legend(loc="outside lower center", ncols=2)
    return drawing
