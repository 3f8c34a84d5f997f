"""A reference that turns as the gyroscope does at another time, on another clock, or at no time at all.

A reference that is late, or early, by more than `ref.delay` can follow has the rates of the gyroscope at another time.
The lag is looked for as `imufit.joining` does between two recordings; here both stand in one log. Where no lag serves
the whole log, one that grows may: the clocks run at different rates. Where none of them does, the reference is of
another motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.faults.frames import MISSED, explains
from imufit.faults.samples import Samples, samples
from imufit.faults.turning import LEAST_SWING, Turning
from imufit.joining.likeliest import SURE, CommonRates, Likeliest, likeliest, placed
from imufit.joining.refine import Aligned
from imufit.joining.search import Correlation, comparable
from imufit.results import fault_words
from imufit.results.data_fault import DataFault

Array = NDArray[np.float64]
Part = Mapping[str, Any]

AS_DECLARED: Final = Aligned(0.0, 0.0, 0.0, 0.0, np.eye(3), 0.0, 0)
"""Reference and sensor on one clock, with parallel axes."""
ONE_MOTION: Final = 0.6
"""Correlation of the rates from which on two recordings show one motion, whatever else is wrong."""


def late_faults(turning: Turning, parts: Sequence[Part], facts: _imufit.Facts, path: Path | None) -> list[DataFault]:
    """Name a reference whose times or whose motion are not those of the sensors.

    Parameters
    ----------
    turning : Turning
        Of the log.
    parts : sequence of dict
        Windows of the log, see `imufit.faults.samples.windows`.
    facts : Facts
        Of the log as declared.
    path : Path or None
        File of the log, for the remedy.

    Returns
    -------
    list of DataFault
        None where the rates agree as declared or after a lag that `ref.delay` follows.
    """
    sensor, body = turning.sensor, turning.body
    if not comparable(sensor, body):
        return []
    rates = Correlation(sensor, body)
    declared = CommonRates.of(sensor, body, rates, AS_DECLARED)
    left = _left_by_an_effect(declared)
    if left <= MISSED:
        return []
    correlation = declared.correlation(np.eye(3))
    found = likeliest(sensor, body, rates)

    def named(fault: str, words: fault_words.Words) -> list[DataFault]:
        return [DataFault(fault, "ref", None, facts.t_start, facts.t_end, facts.n, *words, spoils=True)]

    fits = found is not None and explains(found.best.traces.left, left)
    drift = found if fits else likeliest(sensor, body, Correlation(sensor, body, None))
    if drift is not None and explains(drift.best.traces.left, left) and not drift.ambiguous:
        clocks, traces = drift.best.aligned, drift.best.traces
        # One lag, that in the middle, is named where the rates agree as well then.
        middle = clocks.lag + 0.5 * clocks.skew * float(body.t[-1] - body.t[0])
        steady = placed(sensor, body, rates, replace(clocks, lag=middle, skew=0.0))
        if explains(steady.traces.left, left) and drift.best.odds(steady) < SURE:
            return named("late", fault_words.late(middle, steady.traces.correlation, correlation, path))
        return named("skew", fault_words.skew(clocks.lag, clocks.skew, traces.correlation, correlation, path))
    if fits or _strange(turning, found, samples(parts, facts)):
        return named("another_motion", fault_words.another_motion(correlation, _lags(found), fits=fits))
    return []


def _lags(found: Likeliest | None) -> list[tuple[float, float]]:
    """Lags that fit best, s, each with the correlation of the rates."""
    placed = () if found is None else (found.best, found.second)
    return [(each.aligned.lag, each.traces.correlation) for each in placed if each is not None]


def _strange(turning: Turning, found: Likeliest | None, rows: Samples) -> bool:
    """Say whether reference and sensors show two motions: the rates at every lag, and what the other sensors see."""
    swing = float(np.max(np.ptp(turning.body.angle, axis=0)))
    if min(turning.swing, swing) < LEAST_SWING:
        return False
    if found is not None and found.best.traces.correlation >= ONE_MOTION:
        return False
    # Where gravity or the field turns as the reference states, the gyroscope is at fault.
    return not any(_agreement(rows, sensor) >= ONE_MOTION for sensor in rows.readings if sensor != "gyr")


def _agreement(rows: Samples, sensor: str) -> float:
    """Correlation of readings and ideal readings about their means; 0 where they do not change."""
    y, x = rows.readings[sensor], rows.ideal[sensor]
    known = np.isfinite(y).all(axis=1) & np.isfinite(x).all(axis=1)
    if not known.any():
        return 0.0
    y, x = (each[known] - each[known].mean(axis=0) for each in (y, x))
    size = float(np.sqrt(np.sum(y**2) * np.sum(x**2)))
    return float(np.sum(y * x)) / size if size > 0.0 else 0.0


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
    solved = np.linalg.lstsq(columns, measured, rcond=None)[0]
    return float(np.sum((measured - columns @ solved) ** 2) / max(float(measured @ measured), 1e-300))
