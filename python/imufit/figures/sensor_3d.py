"""The sensor in space: its axes beside right angles, the measured field beside its sphere, its poses on a sphere.

Deviations are drawn larger than they are, by a factor that the title states.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.figures import quantity, style
from imufit.figures.place import Drawing
from imufit.log.columns import SENSOR_NAMES
from imufit.wrapping import lines_of

if TYPE_CHECKING:
    from imufit.figures.place import Place

Array = NDArray[np.float64]

SEEN_ANGLE: Final = math.radians(25.0)
"""Angle that the largest deviation of an axis is drawn with: as wide as can be without two axes meeting."""
SEEN_SHARE: Final = 0.3
"""Share of the field's length that the largest deviation is drawn with."""
_VIEW: Final = (22.0, -52.0)
"""Elevation and azimuth of the view, deg: no two axes of the body lie behind each other."""
_LETTERS: Final = 52
"""Letters of 10 points in 4 inches."""
_CIRCLE: Final = np.linspace(0.0, 2.0 * np.pi, 61)


def misaligned_axes(matrix: Array, sensor: str, ax: Place | None = None) -> Drawing:
    """Draw the sensitive axes of a sensor beside the axes of the body.

    Parameters
    ----------
    matrix : (3, 3) array
        Misalignment: row k is added to the body's axis k to give the sensitive axis of channel k, rad.
    sensor : str
        ``acc``, ``gyr`` or ``mag``.
    ax : Figure or SubFigure, optional
        Where to draw.

    Returns
    -------
    Drawing
        Grey and dashed: the body; colours: the sensor.
    """
    drawing = _space(ax)
    axes: Any = drawing.axes[0]
    angles = np.arctan(np.linalg.norm(matrix - np.diag(np.diag(matrix)), axis=1))
    largest = float(angles.max())
    factor = _round_factor(math.tan(SEEN_ANGLE) / math.tan(largest)) if largest > 0.0 else 1.0
    sensitive = np.eye(3) + factor * (matrix - np.diag(np.diag(matrix)))
    for k, name in enumerate("xyz"):
        axes.plot(*_from_origin(1.1 * np.eye(3)[k]), color=style.GREY, linestyle="--", linewidth=1.2)
        axes.plot(*_from_origin(sensitive[k]), color=style.AXES[name], linewidth=2.2)
        axes.text(
            *(1.42 * sensitive[k]),
            f"{sensor}_{name}\n{quantity.number(math.degrees(angles[k]), 2)} deg",
            color=style.AXES[name],
            fontsize=9,
            ha="center",
            va="center",
        )
    axes.set_axis_off()
    _cube(axes, -0.2, 1.25, zoom=1.05)
    times = "" if factor == 1.0 else f", drawn {factor:g} times as large"
    off = f"{quantity.number(math.degrees(largest), 2)} deg"
    _headed(axes, f"The axes of the {SENSOR_NAMES[sensor]} are off by up to {off}{times} (dashed: the body)")
    return drawing


def field_ellipsoid(centre: Array, matrix: Array, points: Array | None, ax: Place | None = None) -> Drawing:
    """Draw the field that a magnetometer reads as its sensor is turned, beside the sphere of an ideal one.

    Parameters
    ----------
    centre : (3,) array
        Hard iron, uT.
    matrix : (3, 3) array
        Soft iron, added to the unit matrix.
    points : (k, 3) array or None
        Readings, uT.
    ax : Figure or SubFigure, optional
        Where to draw.

    Returns
    -------
    Drawing
        Grey and dashed: an ideal sensor; blue: the model; orange: readings.
    """
    drawing = _space(ax)
    axes: Any = drawing.axes[0]
    change = np.eye(3) + matrix
    known = np.empty((0, 3)) if points is None else np.asarray(points)
    ideal = np.linalg.solve(change, (known - centre).T).T
    length = float(np.median(np.linalg.norm(ideal, axis=1))) if len(known) else 1.0
    deviation = float(np.linalg.norm(centre)) / length + float(np.linalg.norm(matrix, 2))
    factor = max(1.0, _round_factor(SEEN_SHARE / deviation)) if deviation > 0.0 else 1.0
    for first, second in ((0, 1), (1, 2), (2, 0)):
        ring = np.zeros((3, _CIRCLE.size))
        ring[first], ring[second] = length * np.cos(_CIRCLE), length * np.sin(_CIRCLE)
        axes.plot(*ring, color=style.GREY, linewidth=0.9, linestyle="--")
        drawn = ring + factor * (matrix @ ring + np.asarray(centre)[:, None])
        axes.plot(*drawn, color=style.BLUE, linewidth=1.5)
    if len(known):
        shown = ideal + factor * (known - ideal)
        axes.plot(*shown.T, linestyle="none", marker=".", markersize=2.5, color=style.ORANGE)
    axes.plot(*np.stack([np.zeros(3), factor * np.asarray(centre)], axis=1), color=style.VERMILION, linewidth=2.0)
    _cube(axes, -1.35 * length, 1.35 * length, zoom=0.85)
    for axis, name in ((axes.xaxis, "x"), (axes.yaxis, "y"), (axes.zaxis, "z")):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.set_label_text(f"mag_{name}, µT", fontsize=8)
        axis.set_tick_params(labelsize=7)
    axes.locator_params(nbins=4)
    times = "" if factor == 1.0 else f", deviations drawn {factor:g} times as large"
    shift = quantity.quantity(float(np.linalg.norm(centre)), "uT")
    size = float(np.linalg.norm(matrix, 2))
    stretch = f" and stretches it by up to {quantity.share(size)}" if size > 0.0 else ""
    _headed(axes, f"Iron shifts the field by {shift}{stretch}{times} (dashed: ideal; dots: readings)")
    return drawing


def pose_sphere(directions: Array, names: Sequence[str], ax: Place | None = None) -> Drawing:
    """Draw where up was in the sensor's axes at each rest.

    Parameters
    ----------
    directions : (k, 3) array
        Mean specific force of each rest, any length.
    names : sequence of str
        (k,) labels of the poses.
    ax : Figure or SubFigure, optional
        Where to draw.

    Returns
    -------
    Drawing
        Points on a sphere; those on its far side are pale.
    """
    drawing = _space(ax)
    axes: Any = drawing.axes[0]
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    for first, second in ((0, 1), (1, 2), (2, 0)):
        ring = np.zeros((3, _CIRCLE.size))
        ring[first], ring[second] = np.cos(_CIRCLE), np.sin(_CIRCLE)
        axes.plot(*ring, color=style.GREY, linewidth=0.9, linestyle="--")
    for k, name in enumerate("xyz"):
        axes.plot(*_from_origin(1.35 * np.eye(3)[k]), color=style.AXES[name], linewidth=1.2)
        axes.text(*(1.45 * np.eye(3)[k]), name, color=style.AXES[name], fontsize=9, ha="center", va="center")
    elevation, azimuth = np.radians(_VIEW)
    towards = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    near = unit @ towards > 0.0
    for chosen, colour in ((near, style.BLUE), (~near, style.SKY)):
        axes.plot(*unit[chosen].T, linestyle="none", marker="o", markersize=5, color=colour)
    # Poses of one name lie close together: the first stands for all.
    for name, at in dict(zip(reversed(names), unit[::-1], strict=True)).items():
        axes.text(*(1.25 * at), name, fontsize=8, color=style.INK, ha="center", va="center")
    axes.set_axis_off()
    _cube(axes, -1.0, 1.0, zoom=1.4)
    count = len(unit)
    _headed(axes, f"{count} {'rest' if count == 1 else 'rests'}: the direction up in the sensor's axes")
    return drawing


def _space(ax: Place | None) -> Drawing:
    """Make axes in space on a figure of its own, or on the given one."""
    if ax is not None and not isinstance(ax, Figure | SubFigure):
        raise InputError("ax is not a matplotlib Figure", remedy="Give a Figure: the panel is drawn in space.")
    figure = style.new_figure(4.2, 3.8) if ax is None else ax
    axes = figure.add_subplot(projection="3d")
    axes.view_init(*_VIEW)
    return Drawing([axes], figure, own=ax is None)


def _cube(axes: Any, low: float, high: float, zoom: float = 1.0) -> None:
    axes.set(xlim=(low, high), ylim=(low, high), zlim=(low, high))
    axes.set_box_aspect((1.0, 1.0, 1.0), zoom=zoom)


def _headed(axes: Any, sentence: str) -> None:
    """Put a sentence above the axes, broken to the width of the figure."""
    style.title(axes, "\n".join(lines_of(sentence, _LETTERS)), 10.0)


def _from_origin(end: Array) -> Array:
    return np.stack([np.zeros(3), end], axis=1)


def _round_factor(factor: float) -> float:
    """Round down to 1, 2 or 5 times a power of ten; at least 1."""
    if factor <= 1.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(factor))
    return next(step * power for step in (5.0, 2.0, 1.0) if step * power <= factor * (1.0 + 1e-9))
