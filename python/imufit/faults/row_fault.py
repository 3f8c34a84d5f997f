"""A stretch of rows that is at fault, as one chunk of a log shows it, and how stretches of many chunks are joined."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

SENSORS: Final = ("acc", "gyr", "mag")
UNITS: Final = {"acc": "m/s^2", "gyr": "rad/s", "mag": "uT"}


@dataclass(frozen=True)
class RowFault:
    """Consecutive rows of a log that are at fault.

    Attributes
    ----------
    fault : str
        ``stuck``, ``duplicate`` or ``backlog``.
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

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.stop - self.first


def joined(faults: Iterable[RowFault]) -> list[RowFault]:
    """Join stretches of one kind that meet at the border of two chunks.

    Parameters
    ----------
    faults : iterable of RowFault
        In any order.
    """
    out: list[RowFault] = []
    for item in sorted(faults, key=lambda f: (f.fault, f.sensors, f.axes, f.first)):
        last = out[-1] if out else None
        if (
            last is not None
            and (last.fault, last.sensors, last.axes) == (item.fault, item.sensors, item.axes)
            and item.first <= last.stop
        ):
            figures = {key: max(value, last.figures.get(key, value)) for key, value in item.figures.items()}
            stop, end = (item.stop, item.t_end) if item.stop > last.stop else (last.stop, last.t_end)
            out[-1] = replace(last, stop=stop, t_end=end, figures=figures)
        else:
            out.append(item)
    return sorted(out, key=lambda f: f.first)
