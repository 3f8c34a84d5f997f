"""Map of a filter's error over two gains, and the error over each gain alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from imufit.figures import place, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class MapLike(Protocol):
    """The input of the map; `imufit.tuning.GainMap` has it."""

    @property
    def names(self) -> tuple[str, str]:
        """The two gains."""

    @property
    def x(self) -> NDArray[np.float64]:
        """(k,) values of the first."""

    @property
    def y(self) -> NDArray[np.float64]:
        """(k,) values of the second."""

    @property
    def values(self) -> NDArray[np.float64]:
        """(k, k) values, deg."""


class GainLike(Protocol):
    """The input of one line; `imufit.tuning.Gain` has it."""

    @property
    def name(self) -> str:
        """The gain."""

    @property
    def unit(self) -> str:
        """Its unit, ``1`` for a number."""

    @property
    def default(self) -> float:
        """Its default."""

    @property
    def tuned(self) -> float:
        """Its tuned value."""

    @property
    def factors(self) -> NDArray[np.float64]:
        """(k,) factors on it."""

    @property
    def values(self) -> NDArray[np.float64]:
        """(k,) values, deg."""


def gain_figure(
    over: MapLike | None,
    gains: Sequence[GainLike],
    rival: tuple[str, float] | None,
    label: str,
    ax: place.Place | None = None,
) -> place.Drawing:
    """Draw the map, if there is one, and the value over each gain alone.

    Parameters
    ----------
    over : MapLike or None
        Two gains.
    gains : sequence of GainLike
        Each gain.
    rival : (str, float) or None
        Another filter's name and value, deg.
    label : str
        What the value is.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
        One or two panels.
    """
    panels = 1 if over is None else 2
    drawing = place.panels(ax, (5.0 * panels, 3.8), [list(range(panels))])
    if over is not None:
        _map(drawing.axes[0], over, gains, rival, label)
    _lines(drawing.axes[-1], gains, rival, label)
    return drawing


def _map(axes: Axes, over: MapLike, gains: Sequence[GainLike], rival: tuple[str, float] | None, label: str) -> None:
    """Draw the logarithm of the value as colours, tuned gains and defaults as marks, the rival's value as a line."""
    values = np.where(np.isfinite(over.values) & (over.values > 0.0), over.values, np.nan)
    drawn = axes.pcolormesh(over.x, over.y, np.log10(values), cmap="cividis", shading="nearest", rasterized=True)
    figure = axes.get_figure()
    assert figure is not None
    bar = figure.colorbar(drawn, ax=axes)
    bar.ax.yaxis.set_major_formatter(lambda value, _: f"{10.0**value:.3g}")
    bar.set_label(label, fontsize=9)
    by_name = {gain.name: gain for gain in gains}
    a, b = (by_name[name] for name in over.names)
    axes.plot(a.tuned, b.tuned, marker="o", color="white", markeredgecolor=style.INK, linestyle="", label="tuned")
    inside = over.x[0] <= a.default <= over.x[-1] and over.y[0] <= b.default <= over.y[-1]
    if inside:
        axes.plot(a.default, b.default, marker="s", color=style.ORANGE, linestyle="", label="default")
    if rival is not None and np.nanmin(values) < rival[1] < np.nanmax(values):
        axes.contour(over.x, over.y, np.nan_to_num(values, nan=1e9), levels=[rival[1]], colors="white")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel(_with_unit(a), fontsize=9)
    axes.set_ylabel(_with_unit(b), fontsize=9)
    axes.legend(frameon=True, fontsize=8, loc="best")
    style.title(axes, "Over two gains, the others as tuned", 9.5)
    style.tidy(axes)


def _with_unit(gain: GainLike) -> str:
    return gain.name if gain.unit == "1" else f"{gain.name}, {gain.unit}"


def _lines(axes: Axes, gains: Sequence[GainLike], rival: tuple[str, float] | None, label: str) -> None:
    """Draw the value over the factor on each gain alone."""
    colours = (style.BLUE, style.VERMILION, style.GREEN, style.ORANGE, style.SKY, style.GREY)
    for k, gain in enumerate(gains):
        axes.plot(gain.factors, gain.values, color=colours[k % len(colours)], linewidth=1.4, label=gain.name)
    if rival is not None:
        axes.axhline(rival[1], color=style.INK, linewidth=1.0, linestyle=":", label=rival[0])
    axes.axvline(1.0, color=style.PALE, linewidth=1.0, zorder=0)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("factor on the tuned gain", fontsize=9)
    axes.set_ylabel(label, fontsize=9)
    axes.legend(frameon=False, fontsize=8, loc="best")
    style.title(axes, "One gain changed, the others as tuned", 9.5)
    style.tidy(axes)
