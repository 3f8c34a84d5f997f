"""Ranked candidates: how far the held-out error is expected to fall with each effect."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from imufit.figures import place, quantity, style

_COLOURS = {"significant": style.BLUE, "not significant": style.GREY, "not testable here": style.PALE}


def candidate_bars(
    effects: Sequence[str],
    *,
    before: ArrayLike,
    after: ArrayLike,
    error: ArrayLike,
    status: Sequence[str],
    sentence: str = "",
    limit: int = 12,
    ax: place.Place | None = None,
) -> place.Drawing:
    """Bars from the held-out error now to the one expected with each effect.

    Parameters
    ----------
    effects : sequence of str
        Effect ids, best first.
    before, after : array_like
        (k,) held-out residual over noise floor now and with the effect. An effect that raises it alone gets no bar.
    error : array_like
        (k,) standard error of the drop; NaN where it is not known.
    status : sequence of str
        ``significant``, ``not significant`` or ``not testable here``.
    sentence : str
        Title; without it what the best candidate promises.
    limit : int
        Draw at most so many.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
        The dashed line is the error now, the solid one the noise floor.
    """
    before, after, error = (np.asarray(values, dtype=float) for values in (before, after, error))
    lowers = after < before
    # A rise is not a promise, and a large one would dwarf the falls.
    reached, error = np.where(lowers, after, before), np.where(lowers, error, np.nan)
    drawn = [index for index in range(len(effects)) if np.isfinite(before[index]) and np.isfinite(after[index])][:limit]
    if not drawn:
        return place.empty("No effect of the catalogue can be tested in this log.", ax)
    drawing = place.panels(ax, (10.0, 1.5 + 0.34 * len(drawn)))
    axes = drawing.axes[0]
    places = np.arange(len(drawn))
    for at, index in zip(places, drawn, strict=True):
        significant = status[index] == "significant"
        axes.barh(
            at,
            before[index] - reached[index],
            left=reached[index],
            height=0.62,
            color=_COLOURS.get(status[index], style.GREY),
            zorder=2,
        )
        if np.isfinite(error[index]):
            axes.errorbar(reached[index], at, xerr=error[index], color=style.INK, capsize=2.5, linewidth=1.0, zorder=3)
        axes.annotate(
            quantity.change(before[index], after[index]),
            (1.01, at),
            xycoords=axes.get_yaxis_transform(),
            annotation_clip=False,
            va="center",
            fontsize=9,
            color=style.INK,
            fontweight="bold" if significant else "normal",
        )
    now = float(np.nanmedian(before[drawn]))
    axes.axvline(1.0, color=style.INK, linewidth=1.2)
    axes.axvline(now, color=style.GREY, linewidth=1.0, linestyle="--")
    axes.set_yticks(places, [effects[index] for index in drawn])
    axes.invert_yaxis()
    margin = np.nan_to_num(error[drawn])
    low = min(1.0, float((reached[drawn] - margin).min()))
    high = max(now, float(before[drawn].max()), float((reached[drawn] + margin).max()), 1.02)
    axes.set_xlim(low - 0.04 * (high - low), high + 0.04 * (high - low))
    between = "\n" if drawing.narrow else " "
    axes.set_xlabel(f"held-out error over noise floor{between}(solid line: noise floor; dashed: now)", fontsize=9)
    best = drawn[0]
    style.title(axes, sentence or _promise(effects[best], before[best], after[best], status[best]))
    style.tidy(axes)
    return drawing


def _promise(effect: str, before: float, after: float, status: str) -> str:
    """Say what the best candidate would bring."""
    if status != "significant":
        return "No effect lowers the held-out error beyond chance"
    return quantity.promise(effect, before, after)
