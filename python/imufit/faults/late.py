"""A reference that turns as the gyroscope does at another time, on another clock, or at no time at all.

A reference that is late, or early, by more than `ref.delay` can follow has the rates of the gyroscope at another time.
The lag is looked for as `imufit.joining` does between two recordings; here both stand in one log. Where no lag serves
the whole log, one that grows may: the clocks run at different rates. Where none of them does, the reference is of
another motion.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import fmin

from imufit import _imufit
from imufit.faults.frames import MISSED, explains
from imufit.faults.samples import Samples, samples
from imufit.faults.turning import LEAST_SWING, Turning
from imufit.joining.course import Course
from imufit.joining.likeliest import CommonRates, Likeliest, likeliest
from imufit.joining.refine import Aligned
from imufit.joining.search import Correlation
from imufit.results import fault_words
from imufit.results.data_fault import DataFault

Array = NDArray[np.float64]
Part = Mapping[str, Any]

AS_DECLARED: Final = Aligned(0.0, 0.0, 0.0, 0.0, np.eye(3), 0.0, 0)
"""Reference and sensor on one clock, with parallel axes."""
BLOCKS: Final = 60
"""Blocks of the attitude, of 1.5 s each, by which the lag is refined. Of a log of 25 minutes all blocks take minutes;
these take seconds, and still give the lag to some milliseconds."""
PIECE: Final = 8.0
"""Length, s, of the pieces whose lags show a clock that runs at another rate."""
MOST_PIECES: Final = 24
LARGEST_SKEW: Final = 0.03
"""Largest difference of the clocks' rates looked for, 1: a slip in a rate of sampling; clocks differ by far less."""
LARGEST_START: Final = 3.0
"""Largest lag at the start looked for beside it, s."""
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
    rates = Correlation(sensor, body)
    declared = CommonRates.of(sensor, body, rates, AS_DECLARED)
    left = _left_by_an_effect(declared)
    if left <= MISSED:
        return []
    correlation = declared.correlation(np.eye(3))
    found = likeliest(sensor, body, rates, most=BLOCKS)

    def named(fault: str, words: fault_words.Words) -> list[DataFault]:
        return [DataFault(fault, "ref", None, facts.t_start, facts.t_end, facts.n, *words, spoils=True)]

    fits = found is not None and explains(found.best.traces.left, left)
    if found is not None and fits and not found.ambiguous:
        best = found.best
        return named("late", fault_words.late(best.aligned.lag, best.traces.correlation, correlation, path))
    if not fits and (drift := Drift.of(sensor, body, rates)) is not None and explains(drift.left, left):
        return named("skew", fault_words.skew(drift.lag, drift.skew, drift.correlation, correlation, path))
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
    # Where gravity or the field turns as the reference says, the gyroscope is at fault.
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
    solved = np.linalg.lstsq(columns, measured)[0]
    return float(np.sum((measured - columns @ solved) ** 2) / max(float(measured @ measured), 1e-300))


@dataclass(frozen=True)
class Drift:
    """A lag that grows steadily.

    Attributes
    ----------
    lag : float
        Time by which the reference's stamps are late at its first sample, s.
    skew : float
        Rate of the reference's clock over the sensor's, less one.
    correlation : float
        Correlation of the rates then.
    """

    lag: float
    skew: float
    correlation: float

    @property
    def left(self) -> float:
        """Share of the rates (square) that is left."""
        return 1.0 - self.correlation**2

    @classmethod
    def of(cls, sensor: Course, body: Course, rates: Correlation) -> Drift | None:
        """Find the straight line of lags over time at which the rates are likeliest one motion, piece by piece.

        Parameters
        ----------
        sensor, body : Course
            Integrated rates of sensor and reference.
        rates : Correlation
            Of the two as a whole.
        """
        span = float(body.t[-1] - body.t[0])
        count = min(int(span / PIECE), MOST_PIECES)
        if count < 2:
            return None
        edges = np.linspace(body.t[0], body.t[-1], count + 1)
        places = np.searchsorted(body.t, edges)
        most = LARGEST_START + LARGEST_SKEW * span
        lags = np.arange(-most, most, rates.step)
        gains, middles = [], []
        for low, high in itertools.pairwise(places):
            if high - low < 3:
                continue
            piece = Course(*(each[low:end] for each, end in zip(_fields(body), _ends(high), strict=True)))
            own = Correlation(sensor, piece)
            at = own.first - own.step * np.arange(len(own.gain))
            gains.append(np.interp(lags, at[::-1], own.gain[::-1], left=0.0, right=0.0))
            middles.append(0.5 * float(piece.t[0] + piece.t[-1]) - float(body.t[0]))
        starts = np.arange(-LARGEST_START, LARGEST_START, rates.step)
        step = max(rates.step / span, 2.0 * LARGEST_SKEW / 400.0)
        best = (-1.0, 0.0, 0.0)
        for skew in np.arange(-LARGEST_SKEW, LARGEST_SKEW, step):
            total = sum(np.interp(starts + skew * x, lags, gain) for gain, x in zip(gains, middles, strict=True))
            place = int(np.argmax(total))
            best = max(best, (float(np.asarray(total)[place]), float(starts[place]), float(skew)))

        def missing(values: Array) -> float:
            return 1.0 - correlation(values)

        def correlation(values: Array) -> float:
            aligned = Aligned(float(values[0]), 0.0, float(values[1]) / span, 0.0, np.eye(3), 0.0, 0)
            common = CommonRates.of(sensor, body, rates, aligned)
            return common.correlation(common.mount()) if len(common.measured) else 0.0

        first = np.array((best[1], best[2] * span))
        simplex = first + np.array([[0.0, 0.0], [rates.step, 0.0], [0.0, rates.step]])
        found = fmin(missing, first, initial_simplex=simplex, disp=False)
        return cls(float(found[0]), float(found[1]) / span, correlation(found))


def _fields(course: Course) -> tuple[NDArray[Any], ...]:
    return course.t, course.rate, course.attitude, course.angle, course.gap


def _ends(high: int) -> tuple[int, ...]:
    """Place after the last sample of a piece in each of the arrays of a course."""
    return high, high - 1, high, high, high - 1
