"""How much a log turns and moves, and which readings stand at the end of a range."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from imufit.fitting.range_end import RangeEnd
from imufit.log import Log, LogSource
from imufit.log.size import BLOCK_ROWS
from imufit.results.log_info import ClippedInfo, MotionInfo

Array = NDArray[np.float64]


class MotionSeen:
    """Rates per axis, and specific force against gravity, chunk by chunk.

    Parameters
    ----------
    gravity : float
        m/s^2.
    """

    def __init__(self, gravity: float) -> None:
        self._gravity = gravity
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)
        self._square, self._count = np.zeros(3), np.zeros(3)
        self._force, self._forces = 0.0, 0

    def add(self, log: Log) -> None:
        """Take the rows of a chunk.

        Parameters
        ----------
        log : Log
            Its core.
        """
        if log.gyr is not None:
            known = np.isfinite(log.gyr)
            self._low = np.minimum(self._low, np.min(log.gyr, axis=0, where=known, initial=np.inf))
            self._high = np.maximum(self._high, np.max(log.gyr, axis=0, where=known, initial=-np.inf))
            self._square += np.sum(log.gyr**2, axis=0, where=known)
            self._count += known.sum(axis=0)
        if log.acc is not None:
            length = np.linalg.norm(log.acc, axis=1)
            length = length[np.isfinite(length)]
            self._force += float(np.sum((length - self._gravity) ** 2))
            self._forces += length.size

    def found(self) -> MotionInfo:
        """Return what was seen."""
        there = self._count > 0
        return MotionInfo(
            rate_low=tuple(_known(self._low, there)),
            rate_high=tuple(_known(self._high, there)),
            rate_rms=tuple(_known(np.sqrt(self._square / np.maximum(self._count, 1.0)), there)),
            force_rms=float(np.sqrt(self._force / self._forces)) if self._forces else None,
        )


def _known(values: Array, there: NDArray[np.bool_]) -> list[float | None]:
    return [float(value) if known else None for value, known in zip(values, there, strict=True)]


class RangesSeen:
    """Largest readings of accelerometer and gyroscope, and whether a range ends there, chunk by chunk."""

    def __init__(self) -> None:
        self._ends = {sensor: RangeEnd() for sensor in ("acc", "gyr")}

    def add(self, log: Log) -> None:
        """Take the rows of a chunk.

        Parameters
        ----------
        log : Log
            Its core.
        """
        for sensor, end in self._ends.items():
            column = getattr(log, sensor)
            if column is not None:
                end.add(column)

    def ends(self, log: LogSource) -> dict[str, float]:
        """Return where the range of each sensor ends, m/s^2 and rad/s: as stated, else as its readings pile up there.

        Parameters
        ----------
        log : LogSource
            Whose metadata may state the ranges.
        """
        found = {sensor: log.metadata.ranges.get(sensor) or end.end() for sensor, end in self._ends.items()}
        return {sensor: float(end) for sensor, end in found.items() if end is not None and end > 0.0}


def clipped(log: LogSource, ends: dict[str, float]) -> tuple[ClippedInfo, ...]:
    """Count the readings that stand at the end of a range.

    Parameters
    ----------
    log : LogSource
        Read once, chunk by chunk, if any range ends.
    ends : dict
        End of the range by sensor, m/s^2 and rad/s.
    """
    counts = {sensor: np.zeros(3, int) for sensor in ends}
    for chunk in log.chunks(BLOCK_ROWS) if ends else ():
        for sensor, end in ends.items():
            column = getattr(chunk.core, sensor)
            if column is not None:
                counts[sensor] += np.count_nonzero(np.abs(column) >= end * (1.0 - 1e-9), axis=0)
    return tuple(
        ClippedInfo(f"{sensor}_{axis}", ends[sensor], int(count))
        for sensor, of_axes in counts.items()
        for axis, count in zip("xyz", of_axes, strict=True)
        if count
    )
