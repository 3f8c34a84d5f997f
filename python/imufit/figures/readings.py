"""Readings over time, a panel for each sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from imufit.figures import place, style
from imufit.printable import NAME, printable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

DENSE = 2000
"""Points of a line from which on it is drawn thin: they stand closer than a pixel."""
HALF_CIRCLE = 180.0
"""Extent of angles, deg, from which on right angles are marked."""
ROBUST = 1.5
"""A reference that goes beyond the readings by this factor does not decide the scale: its outliers are cut off."""


@dataclass(frozen=True, eq=False)
class PanelLines:
    """The content of one panel.

    Attributes
    ----------
    name, unit : str
        Of the quantity, as it stands at the axis.
    labels : tuple of str
        One for each column of `values`; empty for no legend.
    t : (n,) array
        Times, s.
    values : (n, k) array
        In `unit`; NaN interrupts a line.
    beside : tuple of arrays, optional
        Times (m,) and values (m, k) of the reference.
    """

    name: str
    unit: str
    labels: tuple[str, ...]
    t: Array
    values: Array
    beside: tuple[Array, Array] | None = None


def readings_figure(
    panels: Sequence[PanelLines],
    rests: Sequence[tuple[float, float]],
    extent: tuple[float, float],
    name: str,
    ax: place.Place | None = None,
) -> place.Drawing:
    """Draw readings over time.

    Parameters
    ----------
    panels : sequence of PanelLines
        From top to bottom.
    rests : sequence of (float, float)
        Stretches to shade, s.
    extent : (float, float)
        Begin and end of the time axis, s.
    name : str
        Title.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
        Panels below one another with one axis of time.
    """
    size = 10.0, 0.9 + 1.9 * len(panels)
    drawing = place.panels(ax, size, [[k] for k in range(len(panels))], sharex=True)
    for axes, panel in zip(drawing.axes, panels, strict=True):
        _panel(axes, panel)
        for begin, end in rests:
            axes.axvspan(begin, end, color=style.PALE, alpha=0.6, linewidth=0.0, zorder=0)
    drawing.axes[-1].set_xlabel("time, s", fontsize=9)
    if extent[1] > extent[0]:
        for axes in drawing.axes:
            axes.set_xlim(*extent)
    shaded = "; rests are shaded" if rests else ""
    drawing.headline(f"{printable(name, NAME)}{shaded}")
    return drawing


def _panel(axes: Axes, panel: PanelLines) -> None:
    colours = list(style.AXES.values())
    width = 0.6 if len(panel.t) > DENSE else 1.1
    for k, label in enumerate(panel.labels):
        # A sample between two missing ones has no line: a dot shows it.
        marker: dict[str, Any] = {"marker": ".", "markersize": 3.0} if len(panel.t) < 100 else {}
        axes.plot(panel.t, panel.values[:, k], color=colours[k], linewidth=width, label=label or None, **marker)
    if panel.beside is not None:
        t, values = panel.beside
        # Close lines would hide the readings: there the reference lies under them, and shows where it differs.
        dense = max(len(t), len(panel.t)) > DENSE
        look: dict[str, Any] = {
            "color": style.GREY if dense else style.INK,
            "linewidth": 0.6,
            "zorder": 1.5 if dense else 2.5,
        }
        for k, label in enumerate(panel.labels):
            axes.plot(t, values[:, k], linestyle="-" if dense else style.LINES[label], **look)
        axes.plot([], [], label="reference", **look)
        _scale_by_readings(axes, panel)
    axes.set_ylabel(f"{printable(panel.name, NAME)}{f', {panel.unit}' if panel.unit else ''}", fontsize=9)
    if panel.unit == "deg" and np.nanmax(panel.values) - np.nanmin(panel.values) > HALF_CIRCLE:
        axes.set_yticks([-180.0, -90.0, 0.0, 90.0, 180.0])
    if any(panel.labels):
        axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.2)
    style.tidy(axes)


def _scale_by_readings(axes: Axes, panel: PanelLines) -> None:
    """Let the readings decide the scale where single values of the reference lie far beyond."""
    assert panel.beside is not None
    low, high = float(np.nanmin(panel.values)), float(np.nanmax(panel.values))
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    values = panel.beside[1]
    if half > 0.0 and np.nanmax(np.abs(values - middle)) > ROBUST * half:
        axes.set_ylim(middle - ROBUST * half, middle + ROBUST * half)
