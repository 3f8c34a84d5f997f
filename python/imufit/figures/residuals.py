"""Residual against covariates: binned means with their band, beside the noise floor, worst first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from imufit.figures import place, quantity, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


VISIBLE: Final = 0.05
"""Part of a channel's excess over its noise floor from which on a covariate is said to explain it: less does not stand
out from the scatter of twelve bins."""


class PanelLike(Protocol):
    """The input of one panel; `imufit.results.Panel` has it."""

    @property
    def channel(self) -> str:
        """Channel of the residual."""

    @property
    def covariate(self) -> str:
        """Quantity along the abscissa."""

    @property
    def channel_unit(self) -> str:
        """SI unit of the residual."""

    @property
    def covariate_unit(self) -> str:
        """SI unit of the covariate."""

    @property
    def centre(self) -> NDArray[np.float64]:
        """(k,) centres of the bins, covariate's unit."""

    @property
    def mean(self) -> NDArray[np.float64]:
        """(k,) mean residual of each bin, channel's unit."""

    @property
    def band(self) -> NDArray[np.float64]:
        """(k,) half width of the 95 % band, channel's unit."""

    @property
    def noise_floor(self) -> float:
        """Standard deviation of the noise of one sample, channel's unit."""

    @property
    def share(self) -> float:
        """Fraction of the excess variance that the covariate explains."""


def worst_first(panels: Sequence[PanelLike]) -> list[PanelLike]:
    """Panels by falling share; those without a share come last."""
    return sorted(panels, key=lambda panel: -panel.share if np.isfinite(panel.share) else np.inf)


def residual_panels(
    panels: Sequence[PanelLike], limit: int = 12, columns: int = 4, ax: place.Place | None = None
) -> place.Drawing:
    """Small multiples of the residual against the covariates.

    Parameters
    ----------
    panels : sequence of PanelLike
        Channel and covariate pairs in any order.
    limit : int
        Draw at most so many, worst first.
    columns : int
        Panels side by side.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
        One small axes per pair; the grey band is plus and minus the noise of one sample.
    """
    chosen = worst_first(panels)[:limit]
    if not chosen:
        return place.empty("A residual to show against a covariate is missing.", ax)
    columns = min(columns, len(chosen))
    rows = -(-len(chosen) // columns)

    def grid() -> tuple[Figure, list[Axes]]:
        figure, made = style.new_grid(rows, columns, max(4.2, 10.4 * columns / 4) / columns, 2.45)
        for axes in made[len(chosen) :]:
            axes.set_visible(False)
        return figure, made

    drawing = place.panels(ax, (10.4, 2.45 * rows), place.rows_of(len(chosen), columns), grid=grid)
    for axes, panel in zip(drawing.axes, chosen, strict=True):
        _panel(axes, panel)
    worst = chosen[0]
    if np.isfinite(worst.share) and worst.share >= VISIBLE:
        sentence = (
            f"{worst.channel} depends most on {worst.covariate}: "
            f"{quantity.share(worst.share)} of its excess over the noise floor"
        )
    else:
        sentence = "No covariate explains a visible part of the residual"
    if columns > 1:
        drawing.headline(sentence, 12.0)
    return drawing


def _claim(panel: PanelLike) -> str:
    """Say what the panel shows."""
    if not np.isfinite(panel.share):
        return f"{panel.channel} against {panel.covariate}"
    return f"{panel.covariate} explains {quantity.share(panel.share)} of {panel.channel}"


def _panel(axes: Axes, panel: PanelLike) -> None:
    """Draw one channel against one covariate."""
    y_factor, y_unit = quantity.shown_unit(panel.channel_unit)
    x_factor, x_title = quantity.axis(panel.covariate, panel.covariate_unit)
    centre, mean = x_factor * np.asarray(panel.centre), y_factor * np.asarray(panel.mean)
    band = np.nan_to_num(y_factor * np.asarray(panel.band))
    floor = y_factor * panel.noise_floor
    reach = float(np.nanmax(np.abs(mean) + band)) if np.isfinite(mean).any() else 0.0
    limit = 1.15 * max(reach, min(floor, 3.0 * reach)) or 1.0
    axes.axhspan(-floor, floor, color=style.PALE, zorder=0)
    axes.axhline(0.0, color=style.GREY, linewidth=0.8, zorder=1)
    axes.fill_between(centre, mean - band, mean + band, color=style.SKY, alpha=0.45, linewidth=0.0, zorder=2)
    axes.plot(centre, mean, color=style.BLUE, marker=".", markersize=5, linewidth=1.3, zorder=3)
    axes.set_ylim(-limit, limit)
    style.tidy(axes)
    axes.tick_params(labelsize=8)
    axes.locator_params(nbins=4)
    if floor > limit:
        axes.text(
            0.98,
            0.04,
            f"noise of a sample ±{quantity.number(floor, 2)} {y_unit}",
            transform=axes.transAxes,
            ha="right",
            va="bottom",
            fontsize=7,
            color="#555555",
        )
    # From the edge of its cell on, where there is room; a height that is given need not be searched for.
    style.title(axes, _claim(panel), 8.5, x=-0.38, y=1.03)
    axes.set_xlabel(x_title, fontsize=8)
    axes.set_ylabel(f"residual, {y_unit}", fontsize=8)
