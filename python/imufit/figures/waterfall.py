"""The held-out error falling step by step towards the noise floor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.ticker import NullFormatter
from numpy.typing import ArrayLike, NDArray

from imufit.figures import place, quantity, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]
_LOGARITHMIC_ABOVE = 8.0
STEP_WIDTH: Final = 1.42
"""Width that the longest id of an effect, 27 letters of 9 points, takes beneath a step, inches."""


def waterfall(
    effects: Sequence[str],
    *,
    before: ArrayLike,
    expected: ArrayLike,
    after: ArrayLike,
    training: ArrayLike,
    start: float,
    ax: place.Place | None = None,
) -> place.Drawing:
    """Held-out error before and after each added effect.

    Parameters
    ----------
    effects : sequence of str
        (k,) effects in the order they were added; may be empty.
    before, expected, after, training : array_like
        (k,) held-out residual over noise floor before the step, as predicted, as realised, and the error on the
        training data after it.
    start : float
        Residual over noise floor of the first model.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
        The axis is logarithmic where the whole fall is large.
    """
    before, expected, after, training = (np.asarray(part, dtype=float) for part in (before, expected, after, training))
    count = len(effects)
    end = float(after[-1]) if count else start
    places = np.arange(count + 1)
    drawing = place.panels(ax, (min(max(7.0, 2.6 + 1.15 * count), 13.0), 4.6))
    axes = drawing.axes[0]
    everything = np.concatenate([[start, 1.0], before, after, expected, training])
    everything = everything[np.isfinite(everything) & (everything > 0.0)]
    logarithmic = start / max(float(everything.min()), 1e-9) > _LOGARITHMIC_ABOVE
    top = float(everything.max())
    bottom = 0.75 * float(everything.min()) if logarithmic else 0.0
    if logarithmic:
        axes.set_yscale("log")
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.yaxis.set_major_formatter(lambda value, _: quantity.number(float(value), 1))
    axes.set_ylim(bottom, top * (1.6 if logarithmic else 1.12))
    if logarithmic:
        style.decades(axes.yaxis)
    axes.bar(0, start - bottom, bottom=bottom, width=0.62, color=style.GREY, zorder=2)
    if count:
        falls = after <= before
        for chosen, colour in ((falls, style.BLUE), (~falls, style.VERMILION)):
            axes.bar(
                places[1:][chosen],
                np.abs(before - after)[chosen],
                bottom=np.minimum(before, after)[chosen],
                width=0.62,
                color=colour,
                zorder=2,
            )
        levels = np.concatenate([[start], after])
        for step in range(count):
            axes.plot([step + 0.31, step + 0.69], [levels[step]] * 2, color=style.GREY, linewidth=0.9, zorder=1)
        axes.plot(
            places[1:],
            expected,
            linestyle="none",
            marker="D",
            markersize=6.5,
            markerfacecolor="white",
            markeredgecolor=style.ORANGE,
            markeredgewidth=1.8,
            zorder=5,
            label="expected before it was added",
        )
        axes.plot(
            places[1:],
            training,
            color=style.VERMILION,
            linestyle="none",
            marker="x",
            markersize=6.5,
            markeredgewidth=1.6,
            zorder=6,
            label="training error",
        )
    _values(axes, places, np.concatenate([[start], before]), np.concatenate([[start], after]))
    axes.axhline(1.0, color=style.INK, linewidth=1.4, zorder=3, label="noise floor")
    slanted = count > (4 if drawing.whole is None else drawing.root.get_figwidth() / STEP_WIDTH - 1.0)
    axes.set_xticks(
        places,
        ["start", *(f"+ {effect}" for effect in effects)],
        rotation=30 if slanted else 0,
        ha="right" if slanted else "center",
        rotation_mode="anchor" if slanted else "default",
    )
    edge = 0.6 if count else 1.6
    axes.set_xlim(-edge, count + edge)
    axes.set_ylabel("held-out error over noise floor", fontsize=9)
    drawing.legend(loc="outside lower center", ncols=1 if drawing.narrow else 3)
    if count:
        effect_word = "effect takes" if count == 1 else "effects take"
        sentence = f"{count} {effect_word} the held-out error {quantity.fall(start, end)}"
    else:
        sentence = f"No effect was added: the held-out error stays at {quantity.ratio(start)} times the noise floor"
    style.title(axes, sentence, 12.0)
    style.tidy(axes)
    return drawing


def _values(axes: Axes, places: NDArray[np.integer], upper: FloatArray, lower: FloatArray) -> None:
    """Write each level above its bar."""
    for at, high, low in zip(places, upper, lower, strict=True):
        axes.annotate(
            f"→ {quantity.ratio(float(low))}" if at else quantity.ratio(float(low)),
            (at, max(high, low)),
            xytext=(0, 4),
            textcoords="offset points",
            ha="center",
            fontsize=10,
            fontweight="bold",
            color=style.INK,
        )
