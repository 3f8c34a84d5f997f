"""What a log holds and what it lacks, for whoever has just read one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from imufit.log.columns import CONTRACT, GROUPS
from imufit.log.log import Log

_UNITS: Final = {
    "t": "s",
    **dict.fromkeys(GROUPS["acc"], "m/s^2"),
    **dict.fromkeys(GROUPS["gyr"], "rad/s"),
    **dict.fromkeys(GROUPS["mag"], "uT"),
    "temp": "degC",
    **dict.fromkeys(GROUPS["ref_q"], "1"),
    **dict.fromkeys(GROUPS["ref_p"], "m"),
    "ref_angle": "rad",
}
SENSOR_NAMES: Final = {"acc": "accelerometer", "gyr": "gyroscope", "mag": "magnetometer"}
"""What the sensors are called in a sentence."""
_WANTED: Final = {
    **SENSOR_NAMES,
    "temp": "temperature",
    "ref_q": "reference attitude",
    "pose": "pose labels",
}


@dataclass(frozen=True)
class ColumnContents:
    """One column of a log.

    Parameters
    ----------
    name : str
        Column.
    unit : str
        Its unit; empty for covariates and text.
    samples : int
        Rows that hold a value.
    low, median, high : float or None
        Smallest, middle and largest value; None for text and for a column without values.
    labels : tuple of str
        The texts that occur, in the order of their first row.
    """

    name: str
    unit: str
    samples: int
    low: float | None = None
    median: float | None = None
    high: float | None = None
    labels: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        plain: dict[str, Any] = {"name": self.name, "unit": self.unit, "samples": self.samples}
        if self.labels:
            return {**plain, "labels": list(self.labels)}
        return {**plain, "low": self.low, "median": self.median, "high": self.high}


@dataclass(frozen=True)
class Contents:
    """Size, rate and columns of a log, and what is not there.

    Parameters
    ----------
    n : int
        Rows.
    duration : float
        From the first to the last row, s.
    rate : float or None
        Rows per second by the median time step; None for a single row.
    columns : tuple of ColumnContents
        In the order in which they are written.
    missing : tuple of str
        ``acc``, ``gyr``, ``mag``, ``temp``, ``ref_q``, ``pose``, as far as they are not there or hold no value.
    notes : tuple of str
        What reading noticed or changed.
    """

    n: int
    duration: float
    rate: float | None
    columns: tuple[ColumnContents, ...]
    missing: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def missing_words(self) -> str:
        """What is not there, in words."""
        return ", ".join(_WANTED[name] for name in self.missing)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "n": self.n,
            "duration_s": self.duration,
            "rate_hz": self.rate,
            "columns": [column.to_dict() for column in self.columns],
            "missing": list(self.missing),
            "notes": list(self.notes),
        }


def contents(log: Log) -> Contents:
    """Sum up what a log holds.

    Parameters
    ----------
    log : Log
        A log in memory.
    """
    columns = tuple(_column(name, values) for name, values in log.table().items())
    held = {column.name for column in columns if column.samples}
    missing = tuple(name for name in _WANTED if not held & set(GROUPS.get(name, (name,))))
    rate = 1.0 / float(np.median(np.diff(log.t))) if log.n > 1 else None
    return Contents(log.n, log.duration, rate, columns, missing, log.notes)


def _column(name: str, values: np.ndarray[Any, Any]) -> ColumnContents:
    if values.dtype == object:
        texts = [str(cell) for cell in values if cell is not None]
        return ColumnContents(name, "", len(texts), labels=tuple(dict.fromkeys(texts)))
    finite = values[~np.isnan(values)]
    unit = _UNITS[name] if name in CONTRACT else ""
    if finite.size == 0:
        return ColumnContents(name, unit, 0)
    low, high = float(np.min(finite)), float(np.max(finite))
    return ColumnContents(name, unit, int(finite.size), low, float(np.median(finite)), high)
