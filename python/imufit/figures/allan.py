"""Allan deviation over averaging time, one axes per sensor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from imufit.figures import place, quantity, style
from imufit.log.columns import SENSOR_NAMES


class ChannelLike(Protocol):
    """The input of one curve; `imufit.allan_deviation.Channel` has it."""

    @property
    def name(self) -> str:
        """Channel, such as ``gyr_x``."""

    @property
    def unit(self) -> str:
        """Unit of the readings."""

    @property
    def tau(self) -> NDArray[np.float64]:
        """(k,) averaging times, s."""

    @property
    def deviation(self) -> NDArray[np.float64]:
        """(k,) deviations."""

    @property
    def low(self) -> NDArray[np.float64]:
        """(k,) lower ends of the confidence interval."""

    @property
    def high(self) -> NDArray[np.float64]:
        """(k,) upper ends of it."""

    def fitted(self, tau: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """(k,) deviations of the fit."""


def allan_figure(channels: Sequence[ChannelLike], ax: place.Place | None = None) -> place.Drawing:
    """Deviation with its confidence band and the fit, axes logarithmic.

    Parameters
    ----------
    channels : sequence of ChannelLike
        One per curve.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
        One panel a sensor.
    """
    sensors = list(dict.fromkeys(channel.name.split("_")[0] for channel in channels))
    drawing = place.panels(ax, (max(5.2, 4.2 * len(sensors)), 3.8), [list(range(len(sensors)))])
    for axes, sensor in zip(drawing.axes, sensors, strict=True):
        shown = ""
        for channel in (each for each in channels if each.name.startswith(f"{sensor}_")):
            axis = channel.name.rpartition("_")[2]
            factor, shown = quantity.shown_unit(channel.unit)
            colour, line = style.AXES.get(axis, style.INK), style.LINES.get(axis, "-")
            axes.fill_between(channel.tau, factor * channel.low, factor * channel.high, color=colour, alpha=0.15, lw=0)
            axes.plot(channel.tau, factor * channel.deviation, color=colour, linestyle=line, linewidth=1.3, label=axis)
            fitted = channel.fitted(channel.tau)
            if fitted is not None:
                axes.plot(channel.tau, factor * fitted, color=style.INK, linewidth=0.8, linestyle=":")
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.legend(frameon=False, fontsize=8, ncols=3, loc="best")
        style.title(axes, f"The {SENSOR_NAMES.get(sensor, sensor)} at rest", 9.5)
        axes.set_xlabel("averaging time, s", fontsize=9)
        axes.set_ylabel(f"Allan deviation, {shown}", fontsize=9)
        style.tidy(axes)
    return drawing
