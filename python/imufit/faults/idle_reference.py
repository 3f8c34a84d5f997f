"""A reference that does not move while the body does: one attitude all along, or one that is held until the next."""

from __future__ import annotations

from typing import Final

import numpy as np

from imufit import _imufit
from imufit.faults.row_fault import runs
from imufit.faults.turning import LEAST_SWING, Turning
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
    span = facts.t_start, facts.t_end
    q = turning.ref_q[turning.rows]
    far = 2.0 * np.arccos(np.clip(np.abs(q @ q[len(q) // 2]), 0.0, 1.0))
    if float(np.quantile(far, 0.95)) < STANDS * min(turning.swing, np.pi):
        words = fault_words.reference_stands(turning.swing)
        return [DataFault("stands", "ref", None, *span, facts.n, *words, spoils=True)]
    number = np.cumsum(np.concatenate(([0], np.any(np.diff(q, axis=0) != 0.0, axis=1))))
    spans = runs(number)
    long = spans[spans[:, 1] - spans[:, 0] >= LEAST_HELD]
    if len(long) < LEAST_PAUSES:
        return []
    angle = np.concatenate((np.zeros((1, 3)), np.cumsum(turning.read, axis=0)))
    meanwhile = np.linalg.norm(angle[long[:, 1] - 1] - angle[long[:, 0]], axis=1)
    # Smallest rotation in a step of the reference, and the sum of noise over a pause.
    steps = np.linalg.norm(turning.turned[number[1:] != number[:-1]], axis=1)
    least = max(0.05 * float(np.median(steps)), MOVED * _noise(turning) * float(np.sqrt(np.median(np.diff(long)))))
    moving = meanwhile > least
    held = int(np.sum(np.diff(long[moving], axis=1)))
    turning_rows = int(np.sum(np.linalg.norm(turning.read, axis=1) > least / float(np.median(np.diff(long)))))
    if np.count_nonzero(moving) < LEAST_PAUSES or held < HELD * max(turning_rows, 1):
        return []
    rate = 1.0 / float(np.median(np.diff(turning.body.t[long[moving][:, 0]])))
    words = fault_words.reference_held(float(np.median(np.diff(long[moving]))), rate)
    return [DataFault("held", "ref", None, *span, facts.n, *words, spoils=True)]


def _noise(turning: Turning) -> float:
    """Noise of the gyroscope's turn over one step, rad, by what changes from step to step."""
    change = np.diff(turning.read, n=2, axis=0)
    return float(np.median(np.linalg.norm(change, axis=1)) / np.sqrt(6.0))
