"""Figures of a calibration: poses found in the readings, error of each pose before and after, field on the sphere."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from imufit.figures.place import Drawing, Place, panels
from imufit.figures.style import AXES, BLUE, GREY, INK, PALE, SKY, VERMILION, tidy, title

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
Readings = tuple[Array, Array | None, Array | None]
PoseMark = tuple[int, float, float, str, bool, str, float]

_MOST_POINTS = 6000


def calibration_figure(
    logs: Sequence[Readings],
    poses: Sequence[PoseMark],
    corrections: Mapping[str, tuple[Array, Array]],
    residuals: Sequence[float],
    gravity: float,
    field: float | None,
    ax: Place | None = None,
) -> Drawing:
    """Draw what a calibration saw and what it left.

    Parameters
    ----------
    logs : sequence of (t, acc, mag)
        Readings of each log, (n,) s, (n, 3) m/s^2 and uT or None; may be empty.
    poses : sequence of tuple
        (log, start s, end s, name, used, reason, length of the mean reading m/s^2).
    corrections : mapping
        (A, b) by sensor.
    residuals : sequence of float
        Of each used pose after the fit, m/s^2.
    gravity : float
        m/s^2.
    field : float or None
        Length of the field, uT, where a magnetometer was calibrated.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
    """
    with_poses = [index for index, (_, acc, _) in enumerate(logs) if acc is not None][:3] if poses else []
    rows = len(with_poses) + (1 if poses else 0) + (1 if field is not None else 0)
    drawing = panels(ax, (10.0, 1.0 + 2.6 * max(rows, 1)), [[row] for row in range(max(rows, 1))])
    free = iter(drawing.axes)
    for index in with_poses:
        _intervals(
            next(free),
            logs[index],
            [pose for pose in poses if pose[0] == index],
            f"log {index + 1}: " if len(logs) > 1 else "",
        )
    if poses:
        _errors(next(free), poses, residuals, gravity)
    if field is not None:
        _field(next(free), logs, corrections["mag"], field)
    return drawing


def _intervals(axes: Axes, readings: Readings, poses: Sequence[PoseMark], prefix: str) -> None:
    t, acc, _ = readings
    assert acc is not None
    step = -(-len(t) // _MOST_POINTS)
    named, apart = -np.inf, 0.03 * float(t[-1] - t[0]) if len(t) else 0.0
    for _, start, end, name, used, _, _ in poses:
        middle = 0.5 * (start + end)
        axes.axvspan(start, end, color=SKY if used else VERMILION, alpha=0.30 if used else 0.18, linewidth=0)
        if middle - named > apart:
            named = middle
            axes.text(
                middle,
                1.01,
                name if used else "×",
                transform=axes.get_xaxis_transform(),
                ha="center",
                va="bottom",
                fontsize=8,
                color=INK if used else VERMILION,
            )
    ends = np.array([_last(acc[:, axis]) for axis in range(3)])
    heights = _apart(ends, 0.07 * float(np.nanmax(acc) - np.nanmin(acc)))
    for axis, name in enumerate("xyz"):
        axes.plot(t[::step], acc[::step, axis], color=AXES[name], linewidth=0.8)
        axes.annotate(
            f"acc_{name}",
            (1.0, heights[axis]),
            xycoords=("axes fraction", "data"),
            xytext=(3, 0),
            textcoords="offset points",
            color=AXES[name],
            fontsize=9,
            va="center",
        )
    tidy(axes)
    count = sum(pose[4] for pose in poses)
    axes.set_xlabel("t (s)")
    axes.set_ylabel("specific force (m/s²)")
    left_out = len(poses) - count
    text = f"{prefix}{count} poses found" + (f", {left_out} left out (×)" if left_out else "")
    title(axes, text, pad=14)


def _last(values: Array) -> float:
    """Return the last reading that is not missing; zero without any."""
    seen = values[~np.isnan(values)]
    return float(seen[-1]) if seen.size else 0.0


def _apart(heights: Array, least: float) -> Array:
    """Move labels up until each is `least` above the one below."""
    moved = heights.copy()
    order = np.argsort(heights)
    for below, above in itertools.pairwise(order):
        moved[above] = max(moved[above], moved[below] + least)
    return moved


def _errors(axes: Axes, poses: Sequence[PoseMark], residuals: Sequence[float], gravity: float) -> None:
    used = [pose for pose in poses if pose[4]]
    before = np.array([abs(pose[6] - gravity) for pose in used])
    place = np.arange(len(used))
    axes.vlines(place, 1e-6, before, color=PALE, linewidth=6)
    axes.plot(place, np.maximum(before, 1e-5), "o", color=GREY, markersize=6)
    last = float(np.maximum(before, 1e-5)[-1]) if used else 1.0
    axes.annotate(
        "before", (len(used) - 1, last), xytext=(8, 0), textcoords="offset points", color=GREY, va="center", fontsize=9
    )
    if len(residuals) == len(used) and used:
        after = np.maximum(np.array(residuals), 1e-5)
        axes.plot(place, after, "o", color=BLUE, markersize=6)
        axes.annotate(
            "after",
            (len(used) - 1, float(after[-1])),
            xytext=(8, 0),
            textcoords="offset points",
            color=BLUE,
            va="center",
            fontsize=9,
        )
    axes.set_yscale("log")
    low = min([float(v) for v in before if v > 0.0] + [r for r in residuals if r > 0.0] + [1e-2])
    axes.set_ylim(max(0.5 * low, 1e-5), None)
    axes.set_xlim(-0.6, len(used) + 0.4)
    axes.set_xticks(place, [f"{name}" for _, _, _, name, _, _, _ in used], fontsize=8)
    tidy(axes)
    axes.set_ylabel("error (m/s²)")
    title(axes, "Error of each pose: length before, residual after the calibration")


def _field(axes: Axes, logs: Sequence[Readings], correction: tuple[Array, Array], field: float) -> None:
    matrix, bias = correction
    for t, _, mag in logs:
        if mag is None:
            continue
        known = ~np.isnan(mag).any(axis=1)
        step = -(-np.count_nonzero(known) // _MOST_POINTS) or 1
        raw = mag[known][::step]
        time = t[known][::step]
        axes.plot(time, np.linalg.norm(raw, axis=1), ".", color=GREY, markersize=1.5)
        axes.plot(time, np.linalg.norm(raw @ matrix.T + bias, axis=1), ".", color=BLUE, markersize=1.5)
    axes.axhline(field, color=INK, linewidth=0.8)
    axes.text(0.93, 1.02, "before", transform=axes.transAxes, color=GREY, ha="right", va="bottom", fontsize=9)
    axes.text(0.99, 1.02, "after", transform=axes.transAxes, color=BLUE, ha="right", va="bottom", fontsize=9)
    tidy(axes)
    axes.set_xlabel("t (s)")
    axes.set_ylabel("|m| (µT)")
    title(axes, f"Length of the field: it should be {field:.1f} µT in every attitude")
