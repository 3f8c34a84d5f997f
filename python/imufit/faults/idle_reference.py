"""A reference that does not move while the body does: one attitude all along, or one that is held until the next."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.faults.row_fault import runs
from imufit.faults.turning import LEAST_SWING, Array, Turning
from imufit.results import fault_words
from imufit.results.data_fault import DataFault

STANDS: Final = 0.02
"""Part of the gyroscope's swing, half a turn at most, that a reference which stands goes through: a tracker's noise."""
MOVED: Final = 5.0
"""A pause of the reference counts where the gyroscope turned by this many times the usual noise of one step meanwhile.
"""
HELD: Final = 0.5
"""Part of the rows in which the body turns that lie in pauses, from which on the reference is held."""
LEAST_HELD: Final = 3
"""Rows at one attitude from which on they are a pause: two may be one sample read twice."""
LEAST_PAUSES: Final = 20
MADE_UP: Final = 0.25
"""Part of the squared turns of the gyroscope over pauses that the squared steps of a held reference have at least: 1
with exact readings, more than 0.4 with a scale that is wrong by half."""


def idle_faults(turning: Turning, facts: _imufit.Facts) -> list[DataFault]:
    """Name a reference that stands, or is held.

    Parameters
    ----------
    turning : Turning
        Of the log.
    facts : Facts
        Of the log as declared.
    """
    if turning.swing < LEAST_SWING:
        return []
    q = turning.ref_q[turning.rows]
    far = 2.0 * np.arccos(np.clip(np.abs(q @ q[len(q) // 2]), 0.0, 1.0))
    if float(np.quantile(far, 0.95)) < STANDS * min(turning.swing, np.pi):
        fault, words = "stands", fault_words.reference_stands(turning.swing)
    elif (pauses := _pauses(turning, q)) is not None:
        rate = 1.0 / float(np.median(np.diff(turning.body.t[pauses[:, 0]])))
        fault, words = "held", fault_words.reference_held(float(np.median(np.diff(pauses))), rate)
    else:
        return []
    return [DataFault(fault, "ref", None, facts.t_start, facts.t_end, facts.n, *words, spoils=True)]


def _pauses(turning: Turning, q: Array) -> NDArray[np.intp] | None:
    """Return the first row and the one after the last of each attitude that is held until the next; None if none is."""
    number = np.cumsum(np.concatenate(([0], np.any(np.diff(q, axis=0) != 0.0, axis=1))))
    spans = runs(number)
    long = spans[spans[:, 1] - spans[:, 0] >= LEAST_HELD]
    if len(long) < LEAST_PAUSES:
        return None
    # The last pause has no step behind it.
    long = long[long[:, 1] < len(q)]
    angle = np.concatenate((np.zeros((1, 3)), np.cumsum(turning.read, axis=0)))
    meanwhile = np.linalg.norm(angle[long[:, 1]] - angle[long[:, 0]], axis=1)
    step = np.linalg.norm(turning.turned[long[:, 1] - 1], axis=1)
    # Smallest rotation in a step of the reference, and the sum of noise over a pause.
    least = max(0.05 * float(np.median(step)), MOVED * _noise(turning) * float(np.sqrt(np.median(np.diff(long)))))
    moving = meanwhile > least
    held = int(np.sum(np.diff(long[moving], axis=1)))
    turning_rows = int(np.sum(np.linalg.norm(turning.read, axis=1) > least / float(np.median(np.diff(long)))))
    if np.count_nonzero(moving) < LEAST_PAUSES or held < HELD * max(turning_rows, 1):
        return None
    # The step behind a pause makes up for what the body turned meanwhile; an offset of the gyroscope turns no body.
    made_up = np.sum(step[moving] ** 2) >= MADE_UP * np.sum(meanwhile[moving] ** 2)
    # A tracker is held for equal times, an encoder between two of its steps for equal angles.
    by_time = _variation(np.diff(long[moving], axis=1)) <= _variation(step[moving])
    return long[moving] if made_up and by_time else None


def _variation(values: Array) -> float:
    """Scatter of positive values over their median, without those far out."""
    low, middle, high = np.quantile(values, (0.25, 0.5, 0.75))
    return float((high - low) / middle) if middle > 0.0 else np.inf


def _noise(turning: Turning) -> float:
    """Noise of the gyroscope's turn over one step, rad, by what changes from step to step."""
    change = np.diff(turning.read, n=2, axis=0)
    return float(np.median(np.linalg.norm(change, axis=1)) / np.sqrt(6.0))
