"""Attitude error against what may cause it, before and after a model is applied."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from imufit.figures import place, style


class BinsLike(Protocol):
    """The input of one panel; `imufit.results.AttitudeBins` has it."""

    @property
    def part(self) -> str:
        """Part of the error."""

    @property
    def quantity(self) -> str:
        """Quantity along the abscissa."""

    @property
    def unit(self) -> str:
        """Its unit."""

    @property
    def centre(self) -> NDArray[np.float64]:
        """(k,) means of the bins."""

    @property
    def before(self) -> NDArray[np.float64]:
        """(k,) RMS error, deg."""

    @property
    def after(self) -> NDArray[np.float64]:
        """(k,) RMS error with the model applied, deg."""


def attitude_panels(bins: Sequence[BinsLike], sentence: str, ax: place.Place | None = None) -> place.Drawing:
    """Small multiples: one row for heading and one for inclination, one column for each quantity.

    Parameters
    ----------
    bins : sequence of BinsLike
        In any order.
    sentence : str
        What the figure shows.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
        Grey: readings as they are; blue: with the model's effects taken out.
    """
    if not bins:
        return place.empty("An attitude error to show is missing.", ax)
    parts = list(dict.fromkeys(item.part for item in bins))
    columns = list(dict.fromkeys(item.quantity for item in bins))
    count = len(parts) * len(columns)
    drawing = place.panels(
        ax,
        (2.6 * len(columns), 2.4 * len(parts)),
        place.rows_of(count, len(columns)),
        grid=lambda: style.new_grid(len(parts), len(columns), 2.6, 2.4),
    )
    grid = drawing.axes
    drawn = {(item.part, item.quantity): item for item in bins}
    changed = any(not np.array_equal(item.before, item.after, equal_nan=True) for item in bins)
    for i, part in enumerate(parts):
        top = max(float(np.nanmax([item.before, item.after])) for item in bins if item.part == part)
        for j, name in enumerate(columns):
            axes = grid[i * len(columns) + j]
            item = drawn.get((part, name))
            if item is None:
                axes.set_visible(False)
                continue
            axes.plot(item.centre, item.before, color=style.GREY, marker=".", linewidth=1.2, label="as it is")
            if changed:
                axes.plot(item.centre, item.after, color=style.BLUE, marker=".", linewidth=1.4, label="model applied")
            axes.set_ylim(0.0, 1.1 * top or 1.0)
            style.tidy(axes)
            axes.tick_params(labelsize=8)
            axes.locator_params(nbins=4)
            axes.set_xlabel(f"{name.replace('_', ' ')}, {item.unit}", fontsize=8)
            axes.set_ylabel(f"{part}, deg RMS", fontsize=8)
    if changed:
        grid[0].legend(frameon=False, fontsize=8)
    drawing.headline(sentence.split(". ", maxsplit=1)[0])
    return drawing
