"""Rates of a sensor and of its reference over each other, before and after their clocks were joined."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from imufit.figures import place, style

Array = NDArray[np.float64]


class TraceLike(Protocol):
    """The input of the figure; `imufit.joining.joined.RateTrace` has it."""

    @property
    def sensor_t(self) -> Array:
        """(n,) times of the sensor, s."""

    @property
    def sensor(self) -> Array:
        """(n,) size of its rates, rad/s."""

    @property
    def reference_t(self) -> Array:
        """(m,) times of the reference on its own clock, s."""

    @property
    def reference(self) -> Array:
        """(m,) size of its rates, rad/s."""

    @property
    def aligned_t(self) -> Array:
        """(m,) times of the reference on the sensor's clock, s."""

    @property
    def label(self) -> str:
        """Name and unit of the values as they are drawn."""

    @property
    def factor(self) -> float:
        """Factor to this unit."""


CLOSE = 10.0
"""Length of the close view, s."""


def joined_rates(trace: TraceLike, sentence: str, ax: place.Place | None = None) -> place.Drawing:
    """Draw the rates on the clocks as recorded, on one clock, and ten seconds of these.

    Parameters
    ----------
    trace : TraceLike
        Rates of both.
    sentence : str
        Title of the figure.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Returns
    -------
    Drawing
        Three panels below one another.
    """
    drawing = place.panels(ax, (10.0, 6.6), [[0], [1], [2]])
    before, after, close = drawing.axes
    views = (
        (
            before,
            trace.sensor_t - trace.sensor_t[0],
            trace.reference_t - trace.reference_t[0],
            "Each from its own start",
        ),
        (after, trace.sensor_t, trace.aligned_t, "On the sensor's clock"),
        (close, trace.sensor_t, trace.aligned_t, f"The {CLOSE:.0f} s with most motion"),
    )
    for axes, own, other, words in views:
        axes.plot(own, trace.factor * trace.sensor, color=style.BLUE, linewidth=1.0, label="sensor")
        axes.plot(
            other, trace.factor * trace.reference, color=style.ORANGE, linewidth=1.0, linestyle="--", label="reference"
        )
        style.title(axes, words, 9.5)
        axes.set_ylabel(trace.label, fontsize=9)
        if np.nanmin(trace.sensor) >= 0.0:
            axes.set_ylim(bottom=0.0)
        style.tidy(axes)
    close.set_xlim(*_liveliest(trace))
    close.set_xlabel("time, s", fontsize=9)
    before.legend(frameon=False, fontsize=8, ncols=2, loc="upper right")
    drawing.headline(sentence, 12.0)
    return drawing


def _liveliest(trace: TraceLike) -> tuple[float, float]:
    """Return begin and end of the ten seconds in which the reference turns most."""
    t, rate = trace.aligned_t, np.abs(np.nan_to_num(trace.reference))
    inside = (t >= trace.sensor_t[0]) & (t <= trace.sensor_t[-1])
    total = np.concatenate(([0.0], np.cumsum(np.where(inside, rate, 0.0))))
    width = min(len(t), max(1, int(np.searchsorted(t, t[0] + CLOSE))))
    first = int(np.argmax(total[width:] - total[:-width]))
    return float(t[first]), float(t[first]) + CLOSE
