"""Turns between neighbouring rests: rows over which a rate is integrated from one direction of gravity to the next."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from imufit.rests.poses import Pose

if TYPE_CHECKING:
    from imufit._imufit import _Span
    from imufit.log import Log

Array = NDArray[np.float64]
Correction = Callable[[Array, float], Array]

LONGEST = 60.0
"""Longest time (s) between two rests over which the rate is integrated."""


@dataclass(frozen=True)
class Turns:
    """Turns between the rests of one log.

    Attributes
    ----------
    log : Log
        With `gyr`.
    spans : tuple
        One for each pair of neighbouring rests, None where the rate cannot be integrated: rows, bias before and after,
        up before and after, variance.
    left_out : tuple of str
        Why.
    """

    log: Log
    spans: tuple[_Span | None, ...]
    left_out: tuple[str, ...]


def find_turns(
    log: Log,
    poses: Sequence[Pose],
    noise: float,
    gravity: float,
    correct: Correction | None = None,
    temperature_mean: float = np.nan,
) -> Turns:
    """Find the turns between neighbouring rests of a log.

    Parameters
    ----------
    log : Log
        With `gyr`.
    poses : sequence of Pose
        Its usable poses in the order of time.
    noise : float
        Gyro noise at rest, one axis, rad/s.
    gravity : float
        m/s^2.
    correct : callable, optional
        Corrects specific forces (3,), m/s^2, at so many K from that mean.
    temperature_mean : float
        Of the accelerometer's calibration, degC; NaN where it does not know the temperature.
    """
    gyr = log.gyr
    assert gyr is not None
    step = float(np.median(np.diff(log.t))) if log.n > 1 else np.nan
    clipped = _clipped(gyr)
    spans: list[_Span | None] = []
    left_out: list[tuple[str, str]] = []
    for before, after in itertools.pairwise(poses):
        first, last = before.rows[1], after.rows[0]
        rows = slice(first, last + 1)
        span = f"{before.t_end:.1f} to {after.t_start:.1f} s"
        seen = ~np.isnan(gyr[rows, 0])
        times = log.t[rows][seen]
        spans.append(None)
        if before.rate is None or after.rate is None or last - first < 3:
            continue
        if log.t[last] - log.t[first] > LONGEST:
            left_out.append(("too long", span))
        elif times.size < 3 or float(np.max(np.diff(times))) > max(5.0 * step, 0.05):
            left_out.append(("with a gap in the readings", span))
        elif np.any(clipped[rows]):
            left_out.append(("at the end of the gyro's range (turn more slowly)", span))
        else:
            up = [_up(pose, correct, temperature_mean) for pose in (before, after)]
            time = float(log.t[last] - log.t[first])
            direction = sum(float(np.mean(pose.variance)) for pose in (before, after)) / gravity**2
            wander = float(np.mean(np.concatenate([before.rate_variance, after.rate_variance]))) * time**2 / 2
            variance = direction + noise**2 * step * time + wander
            spans[-1] = (first, last, before.rate.tolist(), after.rate.tolist(), up[0], up[1], variance)
    return Turns(log, tuple(spans), _told_once(left_out))


def _told_once(left_out: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    """One sentence for each reason, with the times of its turns."""
    reasons = dict.fromkeys(reason for reason, _ in left_out)
    return tuple(
        f"Turns left out, {reason}: {', '.join(span for other, span in left_out if other == reason)}."
        for reason in reasons
    )


def _up(pose: Pose, correct: Correction | None, mean: float) -> list[float]:
    warmth = pose.temperature - mean if np.isfinite(mean) else 0.0
    reading = pose.mean if correct is None else correct(pose.mean, warmth)
    return list((reading / np.linalg.norm(reading)).tolist())


def _clipped(gyr: Array) -> NDArray[np.bool_]:
    """Rows at which a rate stands at the end of its range: the extreme, twice or more in a row."""
    clipped = np.zeros(len(gyr), dtype=np.bool_)
    for axis in range(3):
        rate = gyr[:, axis]
        for end in (np.nanmax(rate), np.nanmin(rate)):
            at_end = rate == end
            again = at_end[1:] & at_end[:-1]
            if np.count_nonzero(again) >= 2 and abs(end) > 1.0:
                clipped |= at_end
    return clipped
