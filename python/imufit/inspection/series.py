"""The samples of one sensor in time: their rate, their gaps, the jitter of their stamps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.log import Log, LogSource
from imufit.log.columns import GROUPS
from imufit.log.contents import SAMPLED
from imufit.log.segments import is_gap
from imufit.log.size import BLOCK_ROWS
from imufit.results.log_info import LogGap, SeriesInfo

Array = NDArray[np.float64]

LISTED: Final = 1000
"""Gaps that are listed at most; all of them are counted. A log with more has no gaps but lost samples all over."""
ROWS: Final = "rows"
"""Name of the series of all rows."""
SERIES: Final = (ROWS, "acc", "gyr", "mag", "temp", "ref_q", "ref_p", "ref_angle")
"""Parts with a rate of their own: all rows, each sensor, each part of the reference."""


def sample_rows(log: Log, name: str) -> NDArray[np.bool_] | None:
    """Say in which rows a series has a sample; None where the log has no such column.

    Of a reference that was filled in between its samples (`ref_exact`) only the measured rows count.

    Parameters
    ----------
    log : Log
        A log or a part of one, n rows.
    name : str
        One of `SERIES`.

    Returns
    -------
    (n,) array of bool or None
    """
    if name == ROWS:
        return np.ones(log.n, np.bool_)
    values: Array | None = getattr(log, name)
    if values is None:
        return None
    known = np.isfinite(values)
    there = np.asarray(known.any(axis=1) if known.ndim == 2 else known)
    exact = log.covariates.get("ref_exact")
    return np.asarray(there & (exact == 1.0)) if exact is not None and name in ("ref_q", "ref_p") else there


class Steps:
    """Steps of time from sample to sample, chunk by chunk."""

    def __init__(self) -> None:
        self._last: float | None = None

    def add(self, t: Array) -> tuple[Array, Array]:
        """Take the times of the next samples.

        Parameters
        ----------
        t : (n,) array
            Times, s.

        Returns
        -------
        (m,) array, (m,) array
            Times at which a step begins, and the steps, s.
        """
        if self._last is not None:
            t = np.concatenate(([self._last], t))
        if t.size:
            self._last = float(t[-1])
        return t[:-1], np.diff(t)


def usual_steps(log: LogSource) -> dict[str, float]:
    """Median step of every series that has two samples, s.

    Parameters
    ----------
    log : LogSource
        Read once, chunk by chunk. Of a log of more than 500,000 rows as many steps are looked at, evenly spread.
    """
    every = -(-log.n // SAMPLED)
    steps: dict[str, Steps] = {}
    kept: dict[str, list[Array]] = {}
    for chunk in log.chunks(BLOCK_ROWS):
        for name in SERIES:
            there = sample_rows(chunk.core, name)
            if there is not None:
                _, found = steps.setdefault(name, Steps()).add(chunk.core.t[there])
                kept.setdefault(name, []).append(found[::every])
    medians = {name: np.concatenate(parts) for name, parts in kept.items()}
    return {name: float(np.median(parts)) for name, parts in medians.items() if parts.size}


class SeriesSeen:
    """Gaps, jitter and lost samples of one series, chunk by chunk.

    Parameters
    ----------
    name : str
        One of `SERIES`.
    usual : float
        Median step, s; NaN where there is none.
    """

    def __init__(self, name: str, usual: float) -> None:
        self._name = name
        self._usual = usual
        self._steps = Steps()
        self._samples = self._part = self._gaps = 0
        self._listed: list[LogGap] = []
        self._longest = 0.0
        self._lost = 0.0
        self._square, self._even = 0.0, 0
        self._ends: list[float] = []

    def add(self, log: Log) -> None:
        """Take the rows of a chunk.

        Parameters
        ----------
        log : Log
            Its core.
        """
        there = sample_rows(log, self._name)
        if there is None or not there.any():
            return
        t = log.t[there]
        self._samples += t.size
        self._ends += [float(t[0]), float(t[-1])]
        if self._name in GROUPS:
            self._part += int(np.isnan(getattr(log, self._name)[there]).any(axis=1).sum())
        begin, steps = self._steps.add(t)
        if not steps.size:
            return
        gap = is_gap(steps, self._usual)
        even = steps[~gap]
        self._square += float(np.sum((even - self._usual) ** 2))
        self._even += even.size
        self._lost += float(np.sum(np.round(steps / self._usual) - 1.0, where=steps > 1.5 * self._usual))
        self._gaps += int(gap.sum())
        self._longest = max(self._longest, float(np.max(steps, where=gap, initial=0.0)))
        for at, step in zip(begin[gap], steps[gap], strict=True):
            if len(self._listed) == LISTED:
                break
            self._listed.append(LogGap(float(at), float(at + step)))

    def found(self) -> SeriesInfo | None:
        """Return what was seen; None for a series without a sample."""
        if not self._samples:
            return None
        known = np.isfinite(self._usual)
        return SeriesInfo(
            name=self._name,
            samples=self._samples,
            t_start=self._ends[0],
            t_end=self._ends[-1],
            rate=1.0 / self._usual if known else None,
            missing=self._lost / (self._lost + self._samples),
            incomplete=self._part,
            jitter=float(np.sqrt(self._square / self._even)) if self._even else None,
            gap_count=self._gaps,
            longest_gap=self._longest,
            gaps=tuple(self._listed),
        )


def series_seen(usual: Mapping[str, float]) -> dict[str, SeriesSeen]:
    """Return an empty account of every series.

    Parameters
    ----------
    usual : mapping
        Median step of each, s.
    """
    return {name: SeriesSeen(name, usual.get(name, np.nan)) for name in SERIES}
