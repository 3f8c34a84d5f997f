"""Spectrum of the residual over its noise floor, one axes per sensor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from imufit.figures import place, quantity, style
from imufit.log.columns import SENSOR_NAMES

if TYPE_CHECKING:
    from matplotlib.axes import Axes


LINE: Final = 20.0
"""Times that a line stands above the median of its neighbours: noise of one periodogram of 256 bins has such a peak
once in 100 spectra at most (counted by a test), a mean of several rarer."""
NEIGHBOURS: Final = 16
"""Bins on each side that a line is compared with."""
LEGEND: Final = 0.25
"""Height of the legend's strip over that of the lines: a line of text over a panel of 25 mm."""


class SpectrumLike(Protocol):
    """The input of one line; `imufit.results.Spectrum` has it."""

    @property
    def channel(self) -> str:
        """Channel of the residual."""

    @property
    def frequency(self) -> NDArray[np.float64]:
        """(k,) frequencies, Hz."""

    @property
    def density(self) -> NDArray[np.float64]:
        """(k,) density of the residual, any unit."""

    @property
    def floor(self) -> float:
        """Density of the noise floor, same unit."""


def residual_spectra(spectra: Sequence[SpectrumLike], ax: place.Place | None = None) -> place.Drawing:
    """Density of each channel's residual over that of its noise floor.

    Parameters
    ----------
    spectra : sequence of SpectrumLike
        One per channel.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
        Both axes logarithmic; 1 is the noise floor.
    """
    sensors = list(dict.fromkeys(spectrum.channel.split("_")[0] for spectrum in spectra))
    if not sensors:
        return place.empty("The log is too short for a spectrum of the residual.", ax)
    drawing = place.panels(ax, (max(5.2, 4.2 * len(sensors)), 3.4), [list(range(len(sensors)))], sharey=True)
    for axes, sensor in zip(drawing.axes, sensors, strict=True):
        _sensor(axes, sensor, [spectrum for spectrum in spectra if spectrum.channel.split("_")[0] == sensor])
    drawing.axes[0].set_ylabel("residual density over noise floor", fontsize=9)
    return drawing


def lines(density: NDArray[np.float64]) -> list[int]:
    """Return the places of lines in a spectrum: peaks that stand far above their neighbours on both sides.

    Parameters
    ----------
    density : (k,) array
        Density at equally spaced frequencies.
    """
    found = []
    for at in range(NEIGHBOURS, density.size - NEIGHBOURS):
        left, right = density[at - NEIGHBOURS : at - 1], density[at + 2 : at + NEIGHBOURS + 1]
        highest = density[at] == density[at - NEIGHBOURS : at + NEIGHBOURS + 1].max()
        if highest and density[at] > LINE * max(np.median(left), np.median(right)):
            found.append(at)
    return found


def _sensor(axes: Axes, sensor: str, spectra: Sequence[SpectrumLike]) -> None:
    """Draw the lines of one sensor."""
    peak, peak_frequency = 0.0, float("nan")
    axes.axhline(1.0, color=style.INK, linewidth=1.0, linestyle=":")
    for spectrum in spectra:
        axis = spectrum.channel.rpartition("_")[2]
        frequency, density = np.asarray(spectrum.frequency), np.asarray(spectrum.density) / spectrum.floor
        usable = (frequency > 0.0) & (density > 0.0) & np.isfinite(density)
        if not usable.any():
            continue
        frequency, density = frequency[usable], density[usable]
        axes.plot(
            frequency,
            density,
            color=style.AXES.get(axis, style.INK),
            linestyle=style.LINES.get(axis, "-"),
            linewidth=1.2,
            label=axis,
        )
        for line in lines(density):
            axes.plot(frequency[line], density[line], marker="v", markersize=5, color=style.INK, zorder=5)
            axes.annotate(
                f"{quantity.number(float(frequency[line]), 3)} Hz",
                (frequency[line], density[line]),
                xytext=(0, 5),
                textcoords="offset points",
                ha="center",
                fontsize=7,
                color=style.INK,
            )
        if density.max() > peak:
            peak, peak_frequency = float(density.max()), float(frequency[density.argmax()])
    if peak > 0.0:
        axes.set_xscale("log")
        axes.set_yscale("log")
        style.decades(axes.yaxis)
        for scale in (axes.xaxis, axes.yaxis):
            scale.set_major_formatter(lambda value, _: quantity.number(float(value), 1))
            scale.set_minor_formatter(NullFormatter())
        # A strip over the lines is the legend's.
        low, high = axes.get_ylim()
        axes.set_ylim(low, high * (high / low) ** LEGEND)
        axes.legend(frameon=False, fontsize=8, ncols=3, loc="upper right", borderaxespad=0.0)
    name = SENSOR_NAMES.get(sensor, sensor)
    style.title(
        axes,
        f"The {name}'s residual peaks at {quantity.number(peak_frequency, 2)} Hz"
        if peak > 3.0
        else f"The {name}'s residual is flat",
        9.5,
    )
    axes.set_xlabel("frequency, Hz", fontsize=9)
    style.tidy(axes)
