"""Lag, skew and mount to a fraction of a sample, by the attitude.

In blocks of a few seconds the reference's attitude is compared with what the gyroscope integrates from the start of the
block. Left out of the comparison are, block by block, the attitude at the start and a rate (the gyroscope's bias) and,
over all blocks, a linear map of the rates (its scale, its axes, the rest of the mount). The rest moves with the rate if
the lag is wrong, and with the rate times the time if a clock is fast (Gauss-Newton).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.joining.course import CONJUGATE, Course
from imufit.joining.search import turn_between

Array = NDArray[np.float64]

BLOCK: Final = 1.5
"""Length of a block, s. Of 60 simulated pairs of seeds that no figure on a page comes from, and of 19 recordings of a
robot arm whose radio is late by 85 ms, it leaves fewer far off than 1 s (slow motion is left to a block's start), 2 s
and 3 s (the noise of the rates adds up)."""
LEAST_SAMPLES: Final = 12
"""Samples of the reference in a block, which determine its six unknowns with some to spare."""
MOST_RATE: Final = 100.0
"""Rate to which a faster reference is thinned out, Hz: beyond, its samples say the same again."""
SMOOTH: Final = 0.05
"""Half the time over which the rate is taken that a wrong lag moves the attitude with, s."""
ROUNDS: Final = 9
"""Gauss-Newton steps at most; wild samples are looked for after the second and the fifth."""
WILD: Final = 5.0
"""Samples this many times as far off as the usual one (median) are left out."""
LARGEST_ERROR: Final = 0.1
"""Prior standard deviation of the linear map of the rates, 1: scale and axes of a sensor are right to some percent, the
mount as found by the rates to some degrees."""
LARGEST_SKEW: Final = 1e-4
"""Prior standard deviation of the skew, 1: crystals are right to some 50 ppm."""


@dataclass(frozen=True)
class Aligned:
    """A reference on the sensor's clock and in its axes.

    Attributes
    ----------
    lag, lag_error : float
        Time by which the reference's stamps are late at its first sample, s, and the standard error.
    skew, skew_error : float
        Rate of the reference's clock over the sensor's, less one, and the standard error.
    mount : (3, 3) array
        Turn from the reference body's axes to the sensor's.
    attitude_error : float
        RMS over axes of the attitude error within a block, rad.
    blocks : int
        Blocks compared.
    """

    lag: float
    lag_error: float
    skew: float
    skew_error: float
    mount: Array
    attitude_error: float
    blocks: int

    def on_sensor_clock(self, t: Array, start: float) -> Array:
        """Return times of the reference, which starts at `start`, on the sensor's clock."""
        return np.asarray(t - self.lag - self.skew * (t - start))


class _Blocks:
    """The reference cut into blocks."""

    def __init__(self, reference: Course) -> None:
        steps = float(np.median(np.diff(reference.t)))
        every = max(1, int(1.0 / (steps * MOST_RATE)))
        length = max(BLOCK, LEAST_SAMPLES * steps * every)
        pieces = np.split(np.arange(len(reference.t)), np.flatnonzero(reference.gap) + 1)
        self.rows: list[NDArray[np.intp]] = []
        for piece in pieces:
            number = np.floor((reference.t[piece] - reference.t[piece[0]]) / length)
            cuts = np.flatnonzero(np.diff(number)) + 1
            self.rows += [rows[::every] for rows in np.split(piece, cuts) if len(rows[::every]) >= LEAST_SAMPLES]


def refine(
    sensor: Course,
    reference: Course,
    lag: float,
    mount: Array,
    skew: float | None = None,
    known: bool = False,
    most: int | None = None,
) -> Aligned | None:
    """Refine lag, skew and mount from what is nearly right.

    Parameters
    ----------
    sensor, reference : Course
        Integrated rates, each on its own clock.
    lag : float
        Time by which the reference's stamps are late, s, to a bin of the search.
    mount : (3, 3) array
        Turn from the reference body's axes to the sensor's.
    skew : float, optional
        The skew, where it is known.
    known : bool
        True if the lag, that of the first sample, is known as well.
    most : int, optional
        Blocks to look at, evenly over the recording; all of them if None.

    Returns
    -------
    Aligned or None
        None where no block of the reference lies within the sensor's recording.
    """
    blocks = _Blocks(reference).rows
    if most is not None and len(blocks) > most:
        blocks = [blocks[k] for k in np.linspace(0, len(blocks) - 1, most).astype(int)]
    start = float(reference.t[0])
    middle = start if known else float(0.5 * (reference.t[0] + reference.t[-1]))
    # The lag is that of the middle: there the skew hardly moves it.
    at_middle, rate = lag, skew or 0.0
    kept: dict[int, NDArray[np.bool_]] = {}
    prior = np.concatenate(([0.0, LARGEST_SKEW**-2], np.full(9, LARGEST_ERROR**-2)))
    free = np.ones(11, np.bool_)
    free[:2] = not known, skew is None
    linear = np.zeros((3, 3))
    for turn in range(ROUNDS):
        guess = at_middle, rate, (np.eye(3) + linear) @ mount, middle
        sums = _sums(sensor, reference, blocks, kept, guess)
        if sums is None:
            return None
        # Blocks scatter by more than their samples do (White 1980): what the samples seem to say counts for less.
        meat = np.sum([np.outer(part, part) for part in sums.scores], axis=0) / sums.variance
        inflation = max(1.0, float(np.mean(np.diag(meat)[:2] / np.diag(sums.information)[:2])))
        variance = inflation * sums.variance
        normal = (sums.information / variance + np.diag(prior))[np.ix_(free, free)]
        pull = np.sum(sums.scores, axis=0) / variance + prior * np.concatenate(([0.0, rate], linear.ravel()))
        step = np.zeros(11)
        step[free] = -np.linalg.solve(normal, pull[free])
        at_middle, rate = at_middle + step[0], rate + step[1]
        linear = linear + step[2:].reshape(3, 3)
        if turn in (1, 4):
            kept = _tame(sensor, reference, blocks, (at_middle, rate, (np.eye(3) + linear) @ mount, middle))
        elif turn > 5 and abs(step[0]) < 1e-6:
            break
    assert sums is not None
    solved = np.linalg.inv(normal)
    mount = turn_between((np.eye(3) + linear) @ mount)
    to_start = start - middle
    covariance = np.zeros((11, 11))
    covariance[np.ix_(free, free)] = solved
    lag_variance = covariance[0, 0] + 2.0 * to_start * covariance[0, 1] + to_start**2 * covariance[1, 1]
    skew_variance = covariance[1, 1]
    errors = np.sqrt(max(lag_variance, 0.0)), np.sqrt(max(skew_variance, 0.0))
    lag_at_start = at_middle + rate * to_start
    return Aligned(
        lag_at_start, float(errors[0]), rate, float(errors[1]), mount, float(np.sqrt(sums.variance)), len(sums.scores)
    )


_Guess = tuple[float, float, Array, float]


def _block(
    sensor: Course, reference: Course, rows: NDArray[np.intp], guess: _Guess
) -> tuple[Array, Array, Array] | None:
    """Return error (k, 3), columns of the unknowns (k, 3, 11) and those of the block (k, 3, 6)."""
    lag, skew, mount, middle = guess
    since = reference.t[rows] - middle
    t = reference.t[rows] - lag - skew * since
    if not sensor.seen(t[:1], t[-1:])[0]:
        return None
    own = sensor.at(t)
    own = _imufit.quaternion_product(np.broadcast_to(own[0] * CONJUGATE, own.shape).copy(), own)
    q = reference.attitude[rows]
    q = _imufit.quaternion_product(np.broadcast_to(q[0] * CONJUGATE, q.shape).copy(), q)
    turned = _imufit.quaternion_from_rotation_vector(_imufit.rotation_vector_from_quaternion(q) @ mount.T)
    error = _imufit.rotation_vector_from_quaternion(_imufit.quaternion_product(own * CONJUGATE, turned))
    # Over more than a sample: the noise of the rate at a sample is part of the error that it is to explain.
    rate = (sensor.angle_at(t + SMOOTH) - sensor.angle_at(t - SMOOTH)) / (2.0 * SMOOTH)
    angle = sensor.angle_at(t) - sensor.angle_at(t[:1])
    k = len(rows)
    columns = np.zeros((k, 3, 11))
    columns[:, :, 0] = rate
    columns[:, :, 1] = rate * since[:, None]
    for i in range(3):
        columns[:, i, 2 + 3 * i : 5 + 3 * i] = angle
    at_start = np.zeros((k, 3, 6))
    for i in range(3):
        unit = np.broadcast_to(np.eye(3)[i], (k, 3)).copy()
        at_start[:, :, i] = _imufit.rotate_back(own, unit)
        at_start[:, i, 3 + i] = t - t[0]
    return error, columns, at_start


def _without_start(values: Array, at_start: Array) -> Array:
    """Take out of (k, 3, c) columns what the unknowns of a block explain; (3 k, c)."""
    flat = at_start.reshape(-1, 6)
    basis, _ = np.linalg.qr(flat / np.maximum(np.linalg.norm(flat, axis=0), 1e-300))
    own = values.reshape(len(flat), -1)
    return np.asarray(own - basis @ (basis.T @ own))


@dataclass(frozen=True)
class _Sums:
    """Normal equations of all blocks: information, scores by block, and the variance of what is left, rad^2."""

    information: Array
    scores: list[Array]
    variance: float


def _sums(
    sensor: Course,
    reference: Course,
    blocks: list[NDArray[np.intp]],
    kept: dict[int, NDArray[np.bool_]],
    guess: _Guess,
) -> _Sums | None:
    information, scores, variances = np.zeros((11, 11)), [], []
    for number, rows in enumerate(blocks):
        chosen = rows[kept[number]] if number in kept else rows
        found = _block(sensor, reference, chosen, guess) if len(chosen) >= LEAST_SAMPLES else None
        if found is None:
            continue
        error, columns, at_start = found
        left = _without_start(np.concatenate((error[:, :, None], columns), axis=2), at_start)
        information += left[:, 1:].T @ left[:, 1:]
        scores.append(left[:, 1:].T @ left[:, 0])
        variances.append(float(left[:, 0] @ left[:, 0]) / (len(left) - 6))
    if not scores:
        return None
    # The median of the blocks: a few bad ones do not widen the errors of all.
    return _Sums(information, scores, max(float(np.median(variances)), 1e-20))


def _tame(
    sensor: Course, reference: Course, blocks: list[NDArray[np.intp]], guess: _Guess
) -> dict[int, NDArray[np.bool_]]:
    """Say which samples of each block are not far off."""
    sizes = {}
    for number, rows in enumerate(blocks):
        found = _block(sensor, reference, rows, guess)
        if found is None:
            continue
        error, _, at_start = found
        # By medians first: the start of the block may itself be wild.
        middle = error - np.median(error, axis=0)
        left = _without_start(middle[:, :, None], at_start).reshape(-1, 3)
        sizes[number] = np.linalg.norm(left, axis=1)
    if not sizes:
        return {}
    usual = float(np.median(np.concatenate(list(sizes.values()))))
    return {number: size <= WILD * usual for number, size in sizes.items()}
