"""A stretch of rows that is at fault, as one chunk of a log shows it, and how stretches of many chunks are joined."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.log import Chunk

SENSORS: Final = ("acc", "gyr", "mag")


def runs(values: NDArray[Any]) -> NDArray[np.intp]:
    """Return the stretches of equal values, (k, 2): the first of each, and the one after its last.

    Parameters
    ----------
    values : ndarray
        (n,) of any type.
    """
    edges = np.flatnonzero(np.concatenate(([True], values[1:] != values[:-1], [True])))
    return np.column_stack([edges[:-1], edges[1:]])


@dataclass(frozen=True)
class RowFault:
    """Consecutive rows of a log that are at fault.

    Attributes
    ----------
    fault : str
        ``stuck``, ``duplicate``, ``backlog`` or ``jump``.
    sensors : tuple of str
        Sensors concerned.
    axes : str
        Axes concerned, such as ``xyz``.
    first, stop : int
        First row of the log, and the row after the last.
    t_start, t_end : float
        Their times, s.
    figures : dict
        What the evidence is worded from.
    """

    fault: str
    sensors: tuple[str, ...]
    axes: str
    first: int
    stop: int
    t_start: float
    t_end: float
    figures: dict[str, float]

    @classmethod
    def within(
        cls,
        chunk: Chunk,
        span: tuple[int, int],
        fault: str,
        sensors: tuple[str, ...],
        axes: str = "xyz",
        **figures: float,
    ) -> list[RowFault]:
        """Return the part of a fault that lies in the core rows of a chunk, if any does.

        Parameters
        ----------
        chunk : Chunk
            Rows with margins.
        span : tuple of int
            First and last row in the chunk.
        fault, sensors, axes, figures
            As the attributes.
        """
        low, high = max(span[0], chunk.begin), min(span[1], chunk.end - 1)
        offset, t = chunk.start - chunk.begin, chunk.log.t
        if low > high:
            return []
        return [cls(fault, sensors, axes, offset + low, offset + high + 1, float(t[low]), float(t[high]), figures)]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.stop - self.first

    @property
    def kind(self) -> tuple[str, ...]:
        """The common parts of stretches that belong together: a block that comes twice does so in several sensors."""
        return (self.fault,) if self.fault == "duplicate" else (self.fault, *self.sensors, self.axes)


def joined(faults: Iterable[RowFault]) -> list[RowFault]:
    """Join stretches of one kind that meet, at the border of two chunks or in several sensors.

    Parameters
    ----------
    faults : iterable of RowFault
        In any order.
    """
    out: list[RowFault] = []
    for item in sorted(faults, key=lambda f: (f.kind, f.first)):
        last = out[-1] if out else None
        if last is None or last.kind != item.kind or item.first > last.stop:
            out.append(item)
            continue
        sensors = tuple(name for name in (*SENSORS, "ref") if name in last.sensors + item.sensors)
        figures = {key: max(value, last.figures[key]) for key, value in item.figures.items()}
        stop, end = max((item.stop, item.t_end), (last.stop, last.t_end))
        out[-1] = replace(last, sensors=sensors, stop=stop, t_end=end, figures=figures)
    return sorted(out, key=lambda f: f.first)
