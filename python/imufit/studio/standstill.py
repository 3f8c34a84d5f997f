"""The mean rate of the gyroscope at standstill, in a sentence: its bias, where nothing else can be judged."""

from __future__ import annotations

from typing import Final

import numpy as np

from imufit.figures import quantity
from imufit.inspection.rests import rests_of
from imufit.log import LogSource, judged_rows, whole

BLOCKS: Final = 10
"""Blocks of the rows at rest whose means scatter: noise that carries over from sample to sample is in their scatter."""


def standstill(log: LogSource) -> str:
    """Say how often a log rests, and the mean rate over its rests with the standard error.

    Parameters
    ----------
    log : LogSource
        Any log. Of one that is too long to be held, evenly spread stretches are looked at.
    """
    rests = rests_of(log)
    if not rests.spans or "gyr_x" not in log.columns:
        return rests.sentence
    held = whole(judged_rows(log))
    assert held.gyr is not None
    resting = np.any([(held.t >= begin) & (held.t <= end) for begin, end in rests.spans], axis=0)
    rates = held.gyr[resting & np.isfinite(held.gyr).all(axis=1)]
    if len(rates) < BLOCKS:
        return rests.sentence
    means = np.array([block.mean(axis=0) for block in np.array_split(rates, BLOCKS)])
    errors = means.std(axis=0, ddof=1) / np.sqrt(BLOCKS)
    words = [
        f"{axis} {quantity.with_error(float(mean), float(error), 'rad/s')}"
        for axis, mean, error in zip("xyz", rates.mean(axis=0), errors, strict=True)
    ]
    return (
        f"{rests.sentence} Mean rate at standstill: {', '.join(words)}. This rate is the gyroscope's bias and the "
        "earth's rate of 0.004 deg/s together."
    )
