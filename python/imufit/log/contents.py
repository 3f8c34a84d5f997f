"""The contents of a log and the missing parts, for display after reading."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.log.columns import GROUPS, SENSOR_NAMES, UNITS
from imufit.log.log import LogSource
from imufit.log.parquet import ROW_GROUP

Array = NDArray[np.float64]

SAMPLED: Final = 500_000
"""Rows that a median is taken of at most: its error is then a thousandth of the spread, and four digits are shown."""
LABELS: Final = 1000
"""Largest number of different texts of a column that are listed."""

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
        Smallest, middle and largest value; None for text and for a column without values. Of a log of more than
        500,000 rows the middle one of as many, evenly spread over it.
    labels : tuple of str
        The texts that occur, in the order of their first row, the first 1000 of them.
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
        """The missing parts, in words."""
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


def contents(log: LogSource) -> Contents:
    """Sum up what a log holds.

    Parameters
    ----------
    log : LogSource
        A log in memory or on disk: it is read once, and no more than a chunk of it is held.
    """
    every = -(-log.n // SAMPLED)
    summaries: dict[str, _Summary] = {}
    steps: list[Array] = []
    ends: list[float] = []
    for chunk in log.chunks(ROW_GROUP, 1):
        t = chunk.log.t[max(chunk.begin - 1, 0) : chunk.end]
        steps.append(np.diff(t)[::every])
        ends += [float(t[0]), float(t[-1])]
        for name, values in chunk.core.table().items():
            summaries.setdefault(name, _Summary(name, every)).add(values)
    columns = tuple(summary.column() for summary in summaries.values())
    held = {column.name for column in columns if column.samples}
    missing = tuple(name for name in _WANTED if not held & set(GROUPS.get(name, (name,))))
    rate = 1.0 / float(np.median(np.concatenate(steps))) if log.n > 1 else None
    return Contents(log.n, ends[-1] - ends[0] if ends else 0.0, rate, columns, missing, log.notes)


class _Summary:
    """Sums up one column, chunk by chunk."""

    def __init__(self, name: str, every: int) -> None:
        self._name = name
        self._every = every
        self._samples = 0
        self._low, self._high = np.inf, -np.inf
        self._kept: list[Array] = []
        self._labels: dict[str, None] = {}

    def add(self, values: NDArray[Any]) -> None:
        if values.dtype == object:
            texts = [str(cell) for cell in values if cell is not None]
            self._samples += len(texts)
            self._labels |= dict.fromkeys(texts)
            self._labels = dict.fromkeys(islice(self._labels, LABELS))
            return
        known = values[~np.isnan(values)]
        if known.size:
            self._samples += int(known.size)
            self._low, self._high = min(self._low, float(known.min())), max(self._high, float(known.max()))
            self._kept.append(known[:: self._every].copy())

    def column(self) -> ColumnContents:
        unit = UNITS.get(self._name, "")
        if not self._kept:
            return ColumnContents(self._name, unit, self._samples, labels=tuple(self._labels))
        median = float(np.median(np.concatenate(self._kept)))
        return ColumnContents(self._name, unit, self._samples, self._low, median, self._high)
