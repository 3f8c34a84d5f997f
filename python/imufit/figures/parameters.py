"""Predicted parameters beside the size that is typical for such sensors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from imufit.figures import place, quantity, style


def parameter_sizes(
    labels: Sequence[str],
    values: ArrayLike,
    standard_errors: ArrayLike,
    typical: ArrayLike,
    shown: Sequence[str],
    told: Sequence[bool],
    ax: place.Place | None = None,
) -> place.Drawing:
    """Each parameter over its typical size, with a 95 % interval.

    Parameters
    ----------
    labels : sequence of str
        Names, e.g. ``gyr.bias x``.
    values, standard_errors : array_like
        (k,) SI units.
    typical : array_like
        (k,) typical sizes, same units; rows with NaN are not drawn.
    shown : sequence of str
        (k,) values with their errors, as a person reads them.
    told : sequence of bool
        (k,) whether the log determines the value; of others only the words are shown.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
        Within the shaded band a parameter is of ordinary size.
    """
    values, errors, typical = (np.asarray(part, dtype=float) for part in (values, standard_errors, typical))
    usable = np.isfinite(values) & np.isfinite(typical) & (typical != 0.0)
    drawn = [index for index in range(len(labels)) if usable[index]]
    if not drawn:
        return place.empty("No typical size is known for these parameters.", ax)
    scaled = values[drawn] / np.abs(typical[drawn])
    margin = np.nan_to_num(1.96 * errors[drawn] / np.abs(typical[drawn]))
    drawing = place.panels(ax, (10.0, 1.5 + 0.32 * len(drawn)))
    axes = drawing.axes[0]
    places = np.arange(len(drawn))
    axes.axvspan(-1.0, 1.0, color=style.PALE, zorder=0)
    axes.axvline(0.0, color=style.GREY, linewidth=0.8)
    seen = np.array([told[index] for index in drawn])
    ordinary = (np.abs(scaled) <= 3.0) | ~seen
    for chosen, colour in ((ordinary & seen, style.BLUE), (~ordinary, style.VERMILION)):
        if chosen.any():
            axes.errorbar(
                scaled[chosen], places[chosen], xerr=margin[chosen], fmt="o", markersize=5, color=colour, capsize=3
            )
    reach = float(np.max((np.abs(scaled) + margin)[seen], initial=0.0))
    logarithmic = reach > 12.0
    if logarithmic:
        axes.set_xscale("symlog", linthresh=1.0)
        axes.set_xlim(-1.6 * reach, 1.6 * reach)
    else:
        axes.set_xlim(-1.1 * max(reach, 1.2), 1.1 * max(reach, 1.2))
    for at, index in () if drawing.narrow else zip(places, drawn, strict=True):
        axes.annotate(
            shown[index],
            (1.01, at),
            xycoords=axes.get_yaxis_transform(),
            va="center",
            fontsize=9,
            color=style.INK,
            annotation_clip=False,
        )
    axes.set_yticks(places, [labels[index] for index in drawn])
    axes.set_ylim(len(drawn) - 0.5, -0.5)
    between = "\n" if drawing.narrow else " "
    scale = "; logarithmic beyond 1" if logarithmic else ""
    axes.set_xlabel(f"value over typical size{between}(shaded: up to that size; bars: 95 %{scale})", fontsize=9)
    count = int((~ordinary).sum())
    if count == 0:
        sentence = "Every parameter is of a plausible size"
    else:
        largest = drawn[int((np.abs(scaled) * seen).argmax())]
        sentence = (
            f"{labels[largest]} is {quantity.number(float((np.abs(scaled) * seen).max()), 2)} times its typical size"
        )
    style.title(axes, sentence)
    style.tidy(axes)
    return drawing
