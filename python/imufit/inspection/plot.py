"""Readings of a log over time, the ideal readings of its reference, and its rests, as a figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.errors import InputError
from imufit.figures.readings import PanelLines, readings_figure
from imufit.inspection.circle import Unwound, on_circle
from imufit.inspection.rests import rests_of
from imufit.inspection.series import sample_rows, usual_steps
from imufit.inspection.traces import Trace
from imufit.joining.course import reference_course
from imufit.log import Log, LogSource, SomeRows, judged_rows
from imufit.log.columns import SENSOR_NAMES
from imufit.log.size import BLOCK_ROWS
from imufit.log.words import nearest, one_of
from imufit.progress import Progress, silent

if TYPE_CHECKING:
    from imufit.figures.place import Drawing, Place

Array = NDArray[np.float64]
Show = Literal["readings", "reference", "both"]

RATE_SPAN: Final = 0.02
"""Least time, s, over which a reference's turn is taken for a rate: 0.05 deg of noise of an optical reference make 3.5
deg/s then, and motions of a hand below 10 Hz stay."""
UNITS: Final = {"acc": ("m/s²", 1.0), "gyr": ("deg/s", 180.0 / np.pi), "mag": ("µT", 1.0)}
"""Unit of a panel, and the factor that leads there from SI."""


def drawing(
    log: LogSource,
    *,
    columns: Sequence[str] = (),
    show: Show = "both",
    rows: tuple[int, int] | None = None,
    begin: float | None = None,
    end: float | None = None,
    progress: Progress | None = None,
    ax: Place | None = None,
) -> Drawing:
    """Draw the readings of a log over time.

    A panel for each sensor that is there; the attitude of the reference as roll, pitch and yaw, and the rates that
    follow from it over those of the gyroscope. Rests are shaded, lines are interrupted over gaps. A long log is
    thinned to the smallest and the largest value of each pixel.

    Parameters
    ----------
    log : Log or LogStream
        Any log; it is read chunk by chunk.
    columns : sequence of str
        Further columns to draw, such as ``temp`` or ``motor_current``, a panel each.
    show : str
        ``readings``, ``reference`` or ``both``.
    rows : (int, int), optional
        Only these rows: the first, and the one after the last.
    begin, end : float, optional
        Only this stretch of time, s.
    progress : callable, optional
        Called with (rows done, rows in all, what is being done).
    ax : Axes, sequence of Axes, Figure or SubFigure, optional
        Where to draw: one Axes for one panel; of several panels one Axes each, or a Figure or SubFigure for all of
        them. One Axes in a grid gives its place to several panels.

    Returns
    -------
    Drawing

    Raises
    ------
    InputError
        The log has no such column, no such rows, or nothing to draw, or `show` is something else.
    """
    if show not in get_args(Show):
        raise InputError(f"{show!r} cannot be shown", remedy=one_of(show, get_args(Show)))
    progress = progress or silent
    part = log if rows is None else SomeRows(log, [rows])
    low, high = _extent(part, begin, end)
    drawn = _Drawn(part, columns, show, (low, high))
    for chunk in part.chunks(BLOCK_ROWS):
        inside = (chunk.core.t >= low) & (chunk.core.t <= high)
        if inside.any():
            # Times ascend: what is inside is one stretch.
            first, last = np.flatnonzero(inside)[[0, -1]]
            drawn.add(chunk.core.rows(int(first), int(last) + 1))
        progress(chunk.start + chunk.core.n, part.n, "reading")
    panels = drawn.panels()
    if not panels:
        what = "a reference" if show == "reference" else "readings"
        raise InputError(f"nothing can be drawn: no {what.removeprefix('a ')} in this part", file=log.path)
    # Rests of stretches of a long log would be shaded in these alone.
    spans = rests_of(part).spans if judged_rows(part) is part else ()
    rests = [(max(a, low), min(b, high)) for a, b in spans if a < high and b > low]
    name = "log" if log.path is None else log.path.name
    return readings_figure(panels, rests, (low, high), name, ax)


def _extent(log: LogSource, begin: float | None, end: float | None) -> tuple[float, float]:
    """Return the stretch of time to draw, s."""
    first = last = np.nan
    for chunk in log.chunks(BLOCK_ROWS):
        t = chunk.core.t
        if t.size:
            first, last = (float(t[0]) if np.isnan(first) else first), float(t[-1])
    low, high = first if begin is None else max(begin, first), last if end is None else min(end, last)
    if not low <= high:
        asked = " to ".join("the end" if value is None else f"{value:g} s" for value in (begin or 0.0, end))
        raise InputError(
            f"the log has no row from {asked}", file=log.path, remedy=f"It goes from {first:g} to {last:g} s."
        )
    return low, high


class _Drawn:
    """The traces of a figure, filled chunk by chunk."""

    def __init__(self, log: LogSource, columns: Sequence[str], show: Show, extent: tuple[float, float]) -> None:
        self._usual = usual_steps(log)
        self._extent = extent
        self._extra = self._checked(log, columns)
        sensors = [] if show == "reference" else [name for name in SENSOR_NAMES if name in self._usual]
        single = [] if show == "reference" else [name for name in SENSOR_NAMES if f"{name}_x" in log.columns]
        self._sensors = {name: self._trace(name, 3) for name in dict.fromkeys([*sensors, *single])}
        referenced = show != "readings" and "ref_qw" in log.columns
        self._attitude = self._trace("ref_q", 3) if referenced else None
        self._rates = self._trace("ref_q", 3) if referenced else None
        self._unwound = Unwound()
        self._left: tuple[Array, Array] = (np.empty(0), np.empty((0, 4)))

    def _checked(self, log: LogSource, columns: Sequence[str]) -> dict[str, Trace]:
        """Traces of further columns, which have to be there and to be numbers."""
        head = next(iter(log.chunks(1))).core
        numbers = {name for name, cells in head.table().items() if cells.dtype != object}
        for name in columns:
            if name not in numbers - {"t"}:
                near = nearest(name, numbers - {"t"})
                raise InputError(
                    "the log has no such column of numbers",
                    file=log.path,
                    column=name,
                    remedy=f"Did you mean {near[0]}?" if near else f"The columns are {', '.join(list(numbers)[:12])}.",
                )
        return {name: self._trace(name, 1) for name in columns}

    def _trace(self, name: str, columns: int) -> Trace:
        return Trace(*self._extent, columns, self._usual.get(name, np.nan))

    def add(self, log: Log) -> None:
        """Take rows that are all within the figure."""
        for name, trace in self._sensors.items():
            there = sample_rows(log, name)
            if there is not None:
                trace.add(log.t[there], UNITS[name][1] * getattr(log, name)[there])
        table = log.table() if self._extra else {}
        for name, trace in self._extra.items():
            there = np.isfinite(table[name])
            trace.add(log.t[there], table[name][there, None])
        if self._attitude is None or self._rates is None:
            return
        there = sample_rows(log, "ref_q")
        if there is None or log.ref_q is None or not there.any():
            return
        t, q = log.t[there], log.ref_q[there]
        self._attitude.add(t, self._unwound.add(np.degrees(_imufit.euler_from_quaternion(q))))
        self._add_rates(t, q)

    def _add_rates(self, t: Array, q: Array) -> None:
        """Take the rates that follow from the attitude, from one of `RATE_SPAN` to the next."""
        assert self._rates is not None
        t, q = np.concatenate([self._left[0], t]), np.concatenate([self._left[1], q])
        every = max(1, int(np.ceil(RATE_SPAN / self._usual.get("ref_q", RATE_SPAN) - 1e-6)))
        last = (t.size - 1) // every * every
        self._left = t[last:], q[last:]
        t, q = t[::every].copy(), q[::every].copy()
        if t.size < 2:
            return
        course = reference_course(t, q)
        middle = 0.5 * (t[1:] + t[:-1])
        # Over a gap the rate is unknown.
        self._rates.add(middle[~course.gap], UNITS["gyr"][1] * course.rate[~course.gap])

    def panels(self) -> list[PanelLines]:
        """Return what is to be drawn, panel by panel, those without any value left out."""
        rates = None if self._rates is None else self._rates.lines()
        found = []
        for name, trace in self._sensors.items():
            lines = trace.lines()
            if np.isfinite(lines[1]).any():
                beside = rates if name == "gyr" and rates is not None and np.isfinite(rates[1]).any() else None
                found.append(PanelLines(SENSOR_NAMES[name], UNITS[name][0], tuple("xyz"), *lines, beside=beside))
        if self._attitude is not None:
            lines = self._attitude.lines()
            if np.isfinite(lines[1]).any():
                angles = ("roll", "pitch", "yaw")
                found.append(PanelLines("reference", "deg", angles, *on_circle(*lines)))
            if "gyr" not in self._sensors and rates is not None and np.isfinite(rates[1]).any():
                found.append(PanelLines("rates of the reference", "deg/s", tuple("xyz"), *rates))
        for name, trace in self._extra.items():
            lines = trace.lines()
            if np.isfinite(lines[1]).any():
                found.append(PanelLines(name, "°C" if name == "temp" else "", ("",), *lines))
        return found
