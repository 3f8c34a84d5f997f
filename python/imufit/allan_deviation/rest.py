"""The rows of a log over which its sensors rested."""

from __future__ import annotations

import numpy as np

from imufit import _imufit
from imufit.errors import InputError
from imufit.log import Log

_WHOLE = 0.98
"""A rest over this part of the log is the whole log."""


def longest_rest(log: Log) -> tuple[Log, str]:
    """Return the longest stretch of the log at rest, and a sentence about it; empty where the whole log rests.

    Parameters
    ----------
    log : Log
        With `acc`, `gyr` or `mag`.

    Raises
    ------
    InputError
        The sensors never rested.
    """
    if log.acc is None:
        return log, ("Without an accelerometer a rest cannot be detected: it is taken to. Motion shows as a hump.")
    rests = [
        (log.t[last] - log.t[first], first, last)
        for first, last in _joined([pose["rows"] for pose in _poses(log)], log)
    ]
    if not rests:
        raise InputError(
            "the log never rests, and the Allan deviation of a moving sensor shows the motion",
            file=log.path or "log",
            remedy="Record the sensor lying still, an hour for the bias instability of a low-cost gyro.",
        )
    length, first, last = max(rests)
    if length >= _WHOLE * log.duration:
        return log, ""
    return log.rows(first, last + 1), (
        f"The log moves: only its longest rest was used, {length:.1f} of {log.duration:.1f} s, from "
        f"{log.t[first]:.1f} to {log.t[last]:.1f} s."
    )


def _poses(log: Log) -> list[_imufit._Pose]:
    """Find the rests that are fit for a mean."""
    assert log.acc is not None
    found = _imufit.find_rests(log.t, log.acc, log.gyr)["poses"]
    return [pose for pose in found if pose["flaw"] is None]


def _joined(rests: list[tuple[int, int]], log: Log) -> list[tuple[int, int]]:
    """Join rests that follow each other at once without a turn between them."""
    joined: list[tuple[int, int]] = []
    for first, last in rests:
        if joined and first - joined[-1][1] <= 2 and log.acc is not None:
            a, b = (np.nanmean(log.acc[i : j + 1], axis=0) for i, j in (joined[-1], (first, last)))
            if float(np.linalg.norm(np.cross(a, b))) <= np.radians(0.1) * float(a @ b):
                joined[-1] = (joined[-1][0], last)
                continue
        joined.append((first, last))
    return joined
