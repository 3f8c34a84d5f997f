"""A reference that is late, or early, by more than `ref.delay` can follow.

Its rates are those of the gyroscope at another time. The lag is looked for as `imufit.joining` does between two
recordings; here both stand in one log.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.faults.frames import MISSED, declared_shares, explains
from imufit.faults.samples import samples
from imufit.joining.course import Course, reference_course
from imufit.joining.likeliest import CommonRates, likeliest
from imufit.joining.refine import Aligned
from imufit.joining.search import LEAST_OVERLAP, Correlation
from imufit.results import fault_words
from imufit.results.data_fault import DataFault

Array = NDArray[np.float64]
Part = Mapping[str, Any]

AS_DECLARED: Final = Aligned(0.0, 0.0, 0.0, 0.0, np.eye(3), 0.0, 0)
"""Reference and sensor on one clock, with parallel axes."""
BLOCKS: Final = 60
"""Blocks of the attitude, of 1.5 s each, by which the lag is refined. Of a log of 25 minutes all blocks take minutes;
these take seconds, and still give the lag to some milliseconds."""


def late_faults(
    parts: Sequence[Part],
    facts: _imufit.Facts,
    chunks: Callable[[], Iterable[Part]],
    path: Path | None,
) -> list[DataFault]:
    """Name a reference that is late by a time that is too long for `ref.delay`.

    Parameters
    ----------
    parts : sequence of dict
        Windows of the log, see `imufit.faults.samples.windows`.
    facts : Facts
        Of the log as declared.
    chunks : callable
        Gives the whole log as the compiled core takes it, chunk by chunk. It is called only where an ideal gyroscope
        misses a fifth of the readings.
    path : Path or None
        File of the log, for the remedy.

    Returns
    -------
    list of DataFault
        None where the rates agree as declared or after a small lag, where several lags explain them equally well, or
        where none does.
    """
    if not parts or "gyr" not in facts.sensors:
        return []
    if declared_shares(samples(parts, facts), ["gyr"]).get("gyr", 0.0) <= MISSED:
        return []
    courses = _courses(chunks())
    if courses is None:
        return []
    sensor, body = courses
    rates = Correlation(sensor, body)
    declared = CommonRates.of(sensor, body, rates, AS_DECLARED)
    left = _left_by_an_effect(declared)
    if left <= MISSED:
        return []
    found = likeliest(sensor, body, rates, most=BLOCKS)
    if found is None or found.ambiguous or not explains(found.best.traces.left, left):
        return []
    words = fault_words.late(
        found.best.aligned.lag, found.best.traces.correlation, declared.correlation(np.eye(3)), path
    )
    return [DataFault("late", "ref", None, facts.t_start, facts.t_end, facts.n, *words, spoils=True)]


def _left_by_an_effect(declared: CommonRates) -> float:
    """Return the share of the rates (square) that the declared clock leaves if `ref.delay` comes to help.

    The effect starts from the derivative of the ideal readings. Where this column leaves less than a fifth, the effect
    finds the lag.
    """
    if not len(declared.measured):
        # At the declared times the two have no motion in common.
        return 1.0
    mount = declared.mount()
    columns = np.stack([(each @ mount.T).ravel() for each in (declared.expected, declared.change)], axis=1)
    measured = declared.measured.ravel()
    solved = np.linalg.lstsq(columns, measured)[0]
    return float(np.sum((measured - columns @ solved) ** 2) / max(float(measured @ measured), 1e-300))


def _courses(chunks: Iterable[Part]) -> tuple[Course, Course] | None:
    """Integrated rates of gyroscope and reference; None where one of them is too short to search."""
    times, rates, attitudes = [], [], []
    for chunk in chunks:
        core = slice(chunk["begin"], chunk["end"])
        if chunk["gyr"] is None or chunk["ref_q"] is None:
            return None
        times.append(np.array(chunk["t"][core]))
        rates.append(np.array(chunk["gyr"][core]))
        attitudes.append(np.array(chunk["ref_q"][core]))
    t, gyr, q = (np.concatenate(each) for each in (times, rates, attitudes))
    known = np.isfinite(gyr).all(axis=1), np.isfinite(q).all(axis=1)
    if min(float(np.ptp(t[rows])) if rows.any() else 0.0 for rows in known) < LEAST_OVERLAP:
        return None
    return Course.of(t, gyr), reference_course(t[known[1]], q[known[1]])
