"""Tilt by several methods over time beside the reference: the whole log, a move, a blow, and the error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from imufit.figures import place, quantity, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

_COLOURS = {"accel": style.SKY, "gyro": style.ORANGE, "complementary": style.GREEN, "kalman": style.VERMILION}
_OTHERS = ("#CC79A7", style.BLUE, "#7A5C00", "#5E4FA2", style.GREY)
_COLUMNS = 1500
"""Lines are drawn by the least and largest value of so many columns: more cannot be seen."""
_RUN_AWAY, _WORST = 10.0, 2.0
"""A line that needs ten times the room of the others gets only twice their room on either side."""


@dataclass(frozen=True)
class Zoom:
    """A stretch of time that has a panel of its own.

    Attributes
    ----------
    title : str
        What happens there.
    start, end : float
        s.
    marks : tuple of (float, float)
        Stretches to shade, s.
    """

    title: str
    start: float
    end: float
    marks: tuple[tuple[float, float], ...] = ()


def tilt_figure(
    t: Array,
    reference: Array,
    angles: Mapping[str, Array],
    errors: Mapping[str, Array],
    zooms: Sequence[Zoom] = (),
    *,
    angle: str = "angle",
    error: str = "Error: estimate less reference",
    whole: Zoom | None = None,
    ax: place.Place | None = None,
) -> place.Drawing:
    """Draw what each method makes of the tilt.

    Parameters
    ----------
    t : (n,) array
        Time, s.
    reference : (n,) array
        True angle, deg; NaN is not drawn.
    angles : mapping of (n,) arrays
        Per method, deg; the noisier ones are drawn beneath the others.
    errors : mapping of (n,) arrays
        Per method, deg.
    zooms : sequence of Zoom
        Panels between the whole log and the error.
    angle : str
        What the angle is, for the axes.
    error : str
        What the error is, for its title.
    whole : Zoom, optional
        What stands in the first panel instead of the whole log.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
    """
    rows = 3 if zooms else 2
    below = [[1 + k for k in range(len(zooms))]] if zooms else []
    columns = max(1, len(zooms))
    mosaic = [[0] * columns, *below, [1 + len(zooms)] * columns]
    drawing = place.panels(ax, (10.0, 0.6 + 2.5 * rows), mosaic)
    colours = _colours(angles)

    lines = {**angles, "reference": reference}
    first, last = drawing.axes[0], drawing.axes[-1]
    _zoomed(first, t, lines, colours, whole or Zoom("The whole log", float(t[0]), float(t[-1])))
    first.set_ylabel(f"{angle}, deg", fontsize=9)
    for axes, zoom in zip(drawing.axes[1:-1], zooms, strict=True):
        _zoomed(axes, t, lines, colours, zoom)
        if zoom is zooms[0]:
            axes.set_ylabel(f"{angle}, deg", fontsize=9)
    last.axhline(0.0, color=style.INK, linewidth=1.0, linestyle="--", zorder=4)
    _lines(last, t, errors, colours)
    style.title(last, error)
    last.set_ylabel("error, deg", fontsize=9)
    last.set_xlabel("t, s", fontsize=9)
    named = dict(zip(*reversed(first.get_legend_handles_labels()), strict=True))
    labels = list(lines)
    handles = [named[name] for name in labels]
    legend = drawing.legend(handles, labels, loc="outside upper right", ncols=len(labels))
    for line in legend.get_lines():
        line.set_linewidth(2.2)
    return drawing


def _zoomed(axes: Axes, t: Array, lines: Mapping[str, Array], colours: Mapping[str, str], zoom: Zoom) -> None:
    """Draw a stretch of time."""
    inside = (t >= zoom.start) & (t <= zoom.end)
    for start, end in zoom.marks:
        axes.axvspan(start, end, color=style.PALE, linewidth=0, zorder=0)
    _lines(axes, t[inside], {name: values[inside] for name, values in lines.items()}, colours)
    style.title(axes, zoom.title)


def _colours(names: Mapping[str, Array]) -> dict[str, str]:
    """Colour of each method: its own, or the next free one."""
    free = iter(_OTHERS * len(names))
    return {name: _COLOURS.get(name) or next(free) for name in names}


def _lines(axes: Axes, t: Array, lines: Mapping[str, Array], colours: Mapping[str, str]) -> None:
    """Draw the methods and, dashed on top, the reference."""
    limits = _limits(lines)
    for name in sorted(lines, key=lambda name: -_roughness(lines[name])):
        known = np.isfinite(values := lines[name])
        is_reference = name == "reference"
        axes.plot(
            *_thinned(t[known], values[known]),
            color=style.INK if is_reference else colours[name],
            linewidth=1.1,
            linestyle="--" if is_reference else "-",
            label=name,
            zorder=5 if is_reference else 2,
        )
    style.tidy(axes)
    axes.margins(x=0.01)
    if limits is None:
        return
    axes.set_ylim(*limits)
    gone = [
        f"{name} leaves the picture: {quantity.number(float(values[np.nanargmax(np.abs(values))]), 3)} deg at most"
        for name, values in lines.items()
        if np.isfinite(values).any()
        and (np.nanmax(values) > limits[1] or np.nanmin(values) < limits[0])
        and _outside(values, limits) > 0.001
    ]
    for line, text in enumerate(gone):
        axes.text(
            0.99,
            0.03 + 0.09 * line,
            text,
            transform=axes.transAxes,
            ha="right",
            fontsize=8,
            color=style.INK,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5},
            zorder=6,
        )


def _roughness(values: Array) -> float:
    """Mean step from row to row."""
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    return float(steps.mean()) if steps.size else 0.0


def _outside(values: Array, limits: tuple[float, float]) -> float:
    known = values[np.isfinite(values)]
    return float(np.mean((known < limits[0]) | (known > limits[1])))


def _limits(lines: Mapping[str, Array]) -> tuple[float, float] | None:
    """Range that shows all lines, but not one that runs far away from the others."""
    ranges = {
        name: (float(np.nanmin(values)), float(np.nanmax(values)))
        for name, values in lines.items()
        if np.isfinite(values).any()
    }
    if not ranges:
        return None
    widest = max(ranges, key=lambda name: ranges[name][1] - ranges[name][0])
    others = [span for name, span in ranges.items() if name != widest] or [ranges[widest]]
    low, high = min(span[0] for span in others), max(span[1] for span in others)
    least, most = ranges[widest]
    room = _WORST * (high - low) if most - least > _RUN_AWAY * (high - low) > 0.0 else np.inf
    low, high = min(low, max(least, low - room)), max(high, min(most, high + room))
    margin = 0.05 * max(high - low, 1e-3)
    return low - margin, high + margin


def _thinned(t: Array, values: Array) -> tuple[Array, Array]:
    """Least and largest value of each column of the picture, in the order in which they come."""
    if t.size <= 4 * _COLUMNS:
        return t, values
    size = -(-t.size // _COLUMNS)
    whole = t.size // size * size
    blocks = values[:whole].reshape(-1, size)
    ends = np.sort(np.stack([blocks.argmin(axis=1), blocks.argmax(axis=1)], axis=1), axis=1)
    rows = np.append((ends + size * np.arange(len(blocks))[:, None]).ravel(), t.size - 1)
    return t[rows], values[rows]
