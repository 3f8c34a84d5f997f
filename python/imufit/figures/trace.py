"""One channel over time: measured and predicted, and beneath the residual before and after."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from imufit.figures import place, quantity, style

Array = NDArray[np.float64]


class TraceLike(Protocol):
    """The input of the figure; `imufit.results.ResidualTrace` has it."""

    @property
    def channel(self) -> str:
        """Channel, such as ``gyr_x``."""

    @property
    def unit(self) -> str:
        """SI unit of the readings."""

    @property
    def t(self) -> Array:
        """(m,) times, s."""

    @property
    def measured(self) -> Array:
        """(m,) readings, `unit`."""

    @property
    def predicted(self) -> Array:
        """(m,) predicted readings, `unit`."""

    @property
    def residual(self) -> Array:
        """(m,) measured minus predicted, `unit`."""

    @property
    def before(self) -> Array | None:
        """(m,) residual with the first model, `unit`."""

    @property
    def noise_floor(self) -> float:
        """Noise of one sample, `unit`."""


def residual_trace(trace: TraceLike, ax: place.Place | None = None) -> place.Drawing:
    """Draw measured and predicted readings over time, and beneath them the residual.

    Parameters
    ----------
    trace : TraceLike
        One channel.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
        Two panels; the grey band is plus and minus the noise of one sample.
    """
    drawing = place.panels(ax, (9.6, 4.6), [[0], [1]], sharex=True)
    above, below = drawing.axes
    factor, unit = quantity.shown_unit(trace.unit)
    if not np.isfinite(trace.measured).any():
        above.text(0.5, 0.5, "no reading", transform=above.transAxes, ha="center", color=style.INK)
    above.plot(trace.t, factor * trace.measured, color=style.GREY, linewidth=1.6, label="measured")
    above.plot(trace.t, factor * trace.predicted, color=style.BLUE, linewidth=0.8, linestyle="--", label="predicted")
    floor = factor * trace.noise_floor
    if np.isfinite(floor):
        below.axhspan(-floor, floor, color=style.PALE, zorder=0, label="noise of a sample (±)")
    if trace.before is not None:
        below.plot(trace.t, factor * trace.before, color=style.ORANGE, linewidth=0.9, label="residual before")
    after = "residual" if trace.before is None else "residual after"
    below.plot(trace.t, factor * trace.residual, color=style.BLUE, linewidth=0.8, label=after)
    above.set_ylabel(f"{trace.channel}, {unit}", fontsize=9)
    below.set_ylabel(f"residual, {unit}", fontsize=9)
    below.set_xlabel("time, s", fontsize=9)
    for axes in drawing.axes:
        axes.margins(x=0.01)
        style.tidy(axes)
    shown = [pair for axes in drawing.axes for pair in zip(*axes.get_legend_handles_labels(), strict=True)]
    handles, labels = [pair[0] for pair in shown], [pair[1] for pair in shown]
    drawing.legend(handles, labels, loc="outside lower center", ncols=2 if drawing.narrow else 5)
    return drawing
