"""A reference that turns as the gyroscope does at another time, on another clock, or at no time at all.

A reference that is late, or early, by more than `ref.delay` can follow has the rates of the gyroscope at another time.
The lag is looked for as `imufit.joining` does between two recordings; here both stand in one log. Where a lag that
grows leaves less of the rates, beyond chance, the clocks run at different rates. Where no lag serves, the reference is
of another motion.
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
from imufit.joining.likeliest import SURE, CommonRates, Likeliest, likeliest_of_all_widths, placed
from imufit.joining.refine import Aligned
from imufit.joining.search import Correlation, comparable
from imufit.model.catalogue import find_effect
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
    reach = max(size for (size,) in find_effect("ref.delay").search(facts))
    declared = CommonRates.of(sensor, body, Correlation(sensor, body), AS_DECLARED)
    left, lag = _left_by_effects(declared)
    if left <= MISSED and lag <= reach:
        return []

    def named(fault: str, words: fault_words.Words) -> list[DataFault]:
        return [DataFault(fault, "ref", None, facts.t_start, facts.t_end, facts.n, *words, spoils=True)]

    correlation = declared.correlation(np.eye(3))
    found = _likeliest_clock(turning)
    fits = _explains(turning, found)
    if found is not None and fits and not found.ambiguous:
        clocks = found.best.aligned
        at_end = clocks.lag + clocks.skew * float(body.t[-1] - body.t[0])
        if left <= MISSED and max(abs(clocks.lag), abs(at_end)) <= reach:
            return []
        return named(*_clock_words(turning, found, 0.5 * (clocks.lag + at_end), correlation, path))
    if left > MISSED and (fits or _strange(turning, found, samples(parts, facts))):
        return named("another_motion", fault_words.another_motion(correlation, _lags(found), fits=fits))
    return []


def _clock_words(
    turning: Turning, found: Likeliest, middle: float, declared: float, path: Path | None
) -> tuple[str, fault_words.Words]:
    """Name what is wrong with a clock: one lag, that in the middle (s), where the rates agree as well then."""
    clocks = found.best.aligned
    steady = placed(turning.sensor, turning.body, found.search, replace(clocks, lag=middle, skew=0.0))
    if found.best.odds(steady) < SURE:
        return "late", fault_words.late(middle, steady.traces.correlation, declared, path)
    return "skew", fault_words.skew(clocks.lag, clocks.skew, found.best.traces.correlation, declared, path)


def _likeliest_clock(turning: Turning) -> Likeliest | None:
    """Find the likeliest lag, or one that grows where it leaves less of the rates beyond chance, or alone little."""
    one, growing = (likeliest_of_all_widths(turning.sensor, turning.body, skew) for skew in (0.0, None))
    if one is None or growing is None or not _explains(turning, growing):
        return one
    steady = placed(turning.sensor, turning.body, growing.search, one.best.aligned)
    return growing if growing.best.odds(steady) >= SURE or not _explains(turning, one) else one


def _explains(turning: Turning, found: Likeliest | None) -> bool:
    """Say whether an alignment leaves little of the rates, and little of what the declared clock leaves of them."""
    if found is None:
        return False
    declared = placed(turning.sensor, turning.body, found.search, AS_DECLARED)
    return explains(found.best.traces.left, declared.traces.left)


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


def _left_by_effects(declared: CommonRates) -> tuple[float, float]:
    """Return what `ref.delay` and `ref.skew` leave of the rates, and the largest lag that they would stand for, s.

    The first is a share of the squares. Both effects start from the derivative of the ideal readings. Where these
    columns leave less than a fifth, and the lag is one that the effects follow, they find it.
    """
    if not len(declared.measured):
        # At the declared times the two have no motion in common.
        return 1.0, 0.0
    mount = declared.mount()
    since = (declared.since / max(float(declared.since.max()), 1e-300))[:, None]
    shown = (declared.expected, declared.change, declared.change * since)
    columns = np.stack([(each @ mount.T).ravel() for each in shown], axis=1)
    measured = declared.measured.ravel()
    solved = np.linalg.lstsq(columns, measured, rcond=None)[0]
    left = float(np.sum((measured - columns @ solved) ** 2) / max(float(measured @ measured), 1e-300))
    # The rates of late stamps are scale * expected(t + lag).
    lags = np.array([solved[1], solved[1] + solved[2]]) / solved[0] if solved[0] else np.zeros(2)
    return left, float(np.abs(lags).max())
