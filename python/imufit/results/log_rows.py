"""Rows of a log that a report shows beside the results: the channels over time, the measured field, noise at rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imufit.results.noise_part import NoisePart
from imufit.results.part import Part
from imufit.results.residual_trace import ResidualTrace


@dataclass(frozen=True, eq=False, repr=False)
class LogRows(Part):
    """Rows of one log.

    Attributes
    ----------
    traces : tuple of ResidualTrace
        One per channel.
    field : ndarray or None
        (k, 3) readings of the magnetometer spread over the log, uT.
    rests : tuple of (str, ndarray)
        Label or upper side of each rest and its mean specific force (3,), m/s^2, where rests stand in for a reference.
    noise : tuple of NoisePart
        Parts of the noise floor.
    allan : Allan or None
        Allan deviation over the longest rest, where one is long enough.
    log : str
        Name of the log, where it is one of several.
    """

    traces: tuple[ResidualTrace, ...] = ()
    field: NDArray[np.float64] | None = None
    rests: tuple[tuple[str, NDArray[np.float64]], ...] = ()
    noise: tuple[NoisePart, ...] = ()
    allan: Any = None
    log: str = ""
