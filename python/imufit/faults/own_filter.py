"""A reference that was computed from the readings it is to judge.

A filter turns by each reading of the gyroscope, noise included, and adds a part of what accelerometer and magnetometer
show as its error. A separate instrument does not contain that noise: what it turns by differs from any mean of two
readings by at least 0.7 times the part of them that their neighbours do not foretell. Less than that is only left where
the reference was made of the readings.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from imufit import _imufit
from imufit.faults.turning import Turning
from imufit.results import fault_words
from imufit.results.data_fault import DataFault

Array = NDArray[np.float64]

CLOSER: Final = 0.25
"""Ratio of residual to unpredictable part below which the reference follows the noise: no instrument leaves less
than 0.7, and a filter leaves rounding."""
AROUND: Final = 8
"""Readings on either side that a reading is foretold from."""
POLYNOMIALS: Final = ((1, 1), (2, 3), (4, 4), (8, 6))
"""Readings on either side, and degree, of polynomials in time that foretell a reading: from a line between its
neighbours to a smooth curve through all."""
EVEN: Final = 0.2
"""Part by which a step may differ from the usual one."""
LEAST_ROWS: Final = 500
MOST_ROWS: Final = 20_000
_TRIMS: Final = 4
"""Times that the rows which fit worst are left out: resets, wild readings."""


def own_filter_faults(turning: Turning, facts: _imufit.Facts) -> list[DataFault]:
    """Name a reference that follows the readings sample by sample.

    Parameters
    ----------
    turning : Turning
        Of the log.
    facts : Facts
        Of the log as declared.
    """
    step = np.diff(turning.t)
    usual = float(np.median(step))
    even = np.asarray(np.abs(step - usual) < EVEN * usual)
    known = np.asarray(np.isfinite(np.concatenate((turning.gyr, turning.ref_q), axis=1)).all(axis=1))
    at = np.flatnonzero(even & known[1:] & known[:-1])[:MOST_ROWS]
    if len(at) < LEAST_ROWS:
        return []
    q = Rotation.from_quat(turning.ref_q[: at[-1] + 2][np.concatenate((at, at + 1))], scalar_first=True)
    first, second = q[: len(at)], q[len(at) :]
    rate = (first.inv() * second).as_rotvec() / step[at, None]
    own, after = turning.gyr[at], turning.gyr[at + 1]
    columns = [after - own, *_errors(turning, at, first)]
    left = _left(rate - own, np.stack(columns, axis=-1))
    place = np.cumsum(known) - 1
    rows = np.flatnonzero(known)[: place[at[-1]] + 1]
    unforeseen = _unforeseen(turning.t[rows], turning.gyr[rows])[place[at]]
    # Only the unpredictable part shows which reference followed it: readings that stand still are followed by every
    # reference.
    telling = unforeseen >= np.nanmedian(unforeseen)
    innovation, missed = float(np.median(unforeseen[telling])), float(np.median(left[telling]))
    if not (innovation > 0.0 and missed < CLOSER * innovation):
        return []
    words = fault_words.own_filter(missed, innovation)
    fault = DataFault("own_filter", "ref", None, facts.t_start, facts.t_end, facts.n, *words)
    return [replace(fault, spoils_sensors=("acc", "gyr"))]


def _errors(turning: Turning, at: NDArray[np.intp], attitude: Rotation) -> list[Array]:
    """Errors of the attitude that accelerometer and magnetometer show, (k, 3) rad each, and the same turned about."""
    found = []
    for readings, vertical in ((turning.acc[at], True), (turning.mag[at], False)):
        there = np.asarray(np.isfinite(readings).all(axis=1))
        if np.mean(there) < 0.9:
            continue
        size = np.linalg.norm(readings, axis=1, keepdims=True)
        direction = np.where(there[:, None], readings / np.maximum(size, 1e-12), 0.0)
        seen = attitude.apply(direction)
        # Filters hold gravity against the vertical, which is z in every frame.
        mean = np.array([0.0, 0.0, 1.0]) if vertical else seen.mean(axis=0)
        mean /= max(float(np.linalg.norm(mean)), 1e-12)
        found.append(np.cross(direction, attitude.inv().apply(mean)))
    return found


def _left(wanted: Array, columns: Array) -> Array:
    """Return the lengths (k,) of what columns (k, 3, p) leave of vectors (k, 3), those that fit worst left out."""
    kept = np.ones(len(wanted), bool)
    left = np.linalg.norm(wanted, axis=1)
    for _ in range(_TRIMS):
        # Every axis has an offset of its own: the filter's estimate of the bias.
        offset = np.broadcast_to(np.eye(3), (int(kept.sum()), 3, 3))
        design = np.concatenate((columns[kept], offset), axis=-1).reshape(-1, columns.shape[-1] + 3)
        solved = np.linalg.lstsq(design, wanted[kept].ravel(), rcond=None)[0]
        left = np.linalg.norm(wanted - columns @ solved[:-3] - solved[-3:], axis=1)
        kept = left <= np.quantile(left, 0.7)
    return np.asarray(left)


def _unforeseen(t: Array, gyr: Array) -> Array:
    """Length (n,) of what the readings around do not foretell of each reading, rad/s; NaN at the ends.

    A sensor may sample evenly although its stamps are not even, or unevenly as the stamps say: neighbours foretell a
    reading by their number and by their times.
    """
    missed = np.full(gyr.shape, np.nan)
    beside = np.arange(2 * AROUND + 1) != AROUND
    away = sliding_window_view(t, 2 * AROUND + 1)
    away = (away - away[:, [AROUND]]) / np.median(np.diff(t))
    weights = [_weights(away, reach, degree) for reach, degree in POLYNOMIALS]
    for axis in range(3):
        around = sliding_window_view(gyr[:, axis], 2 * AROUND + 1)
        foretold = [np.einsum("ij,ij->i", each, around) for each in weights]
        others = np.column_stack([around[:, beside], *foretold])
        solved = np.linalg.lstsq(others, around[:, AROUND], rcond=None)[0]
        missed[AROUND:-AROUND, axis] = around[:, AROUND] - others @ solved
    return np.asarray(np.linalg.norm(missed, axis=1))


def _weights(away: Array, reach: int, degree: int) -> Array:
    """Weights (k, w) of neighbours in the value at 0 of a polynomial through those nearest; `away` are their times."""
    near = [*range(AROUND - reach, AROUND), *range(AROUND + 1, AROUND + reach + 1)]
    powers = (away[:, near] / reach)[..., None] ** np.arange(degree + 1)
    weights = np.zeros(away.shape)
    weights[:, near] = np.linalg.pinv(powers)[:, 0]
    return weights
