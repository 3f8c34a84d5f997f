"""Lag, skew and mount to a fraction of a sample, by the attitude.

In blocks of a few seconds the reference's attitude is compared with what the gyroscope integrates from the start of the
block. Left out of the comparison are, block by block, the attitude at the start and a rate (the gyroscope's bias) and,
over all blocks, a linear map of the rates (its scale, its axes, the rest of the mount). The rest moves with the rate if
the lag is wrong, and with the rate times the time if a clock is fast (Gauss-Newton).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.joining.course import CONJUGATE, Course
from imufit.joining.search import USUAL_SKEW, Candidate, turn_between

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
MOST_AT_ONCE: Final = 2**16
"""Samples of the reference that are compared at once: 30 MB of columns."""


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


@dataclass(frozen=True)
class _Blocks:
    """The reference cut into blocks: rows (b, k), and which of them there are, (b, k); shorter blocks are filled up."""

    rows: NDArray[np.intp]
    there: NDArray[np.bool_]

    @classmethod
    def of(cls, reference: Course, most: int | None) -> _Blocks:
        """Cut a reference; `most` blocks at most, evenly over the recording."""
        steps = float(np.median(np.diff(reference.t)))
        every = max(1, int(1.0 / (steps * MOST_RATE)))
        length = max(BLOCK, LEAST_SAMPLES * steps * every)
        blocks = []
        for piece in np.split(np.arange(len(reference.t)), np.flatnonzero(reference.gap) + 1):
            number = np.floor((reference.t[piece] - reference.t[piece[0]]) / length)
            cuts = np.flatnonzero(np.diff(number)) + 1
            blocks += [rows[::every] for rows in np.split(piece, cuts) if len(rows[::every]) >= LEAST_SAMPLES]
        if most is not None and len(blocks) > most:
            blocks = [blocks[k] for k in np.linspace(0, len(blocks) - 1, most).astype(int)]
        longest = max(map(len, blocks), default=1)
        rows = np.array([np.concatenate((each, np.repeat(each[-1:], longest - len(each)))) for each in blocks])
        sizes = np.array([len(each) for each in blocks])
        return cls(rows.reshape(-1, longest), np.arange(longest) < sizes[:, None])

    def without(self, wild: NDArray[np.bool_]) -> _Blocks:
        """Leave some samples out."""
        return _Blocks(self.rows, self.there & ~wild)

    def pieces(self) -> Iterator[tuple[slice, _Blocks]]:
        """Yield some blocks at a time."""
        size = max(1, MOST_AT_ONCE // self.rows.shape[1])
        for begin in range(0, len(self.rows), size):
            some = slice(begin, begin + size)
            yield some, _Blocks(self.rows[some], self.there[some])


def refine(
    sensor: Course,
    reference: Course,
    near: Candidate,
    skew_known: bool = False,
    lag_known: bool = False,
    most: int | None = None,
) -> Aligned | None:
    """Refine lag, skew and mount from what is nearly right.

    Parameters
    ----------
    sensor, reference : Course
        Integrated rates, each on its own clock.
    near : Candidate
        Lag, skew and mount to a bin of the search.
    skew_known, lag_known : bool
        True for what is not to be refined: the skew, the lag at the first sample.
    most : int, optional
        Blocks to look at, evenly over the recording; all of them if None.

    Returns
    -------
    Aligned or None
        None where no block of the reference lies within the sensor's recording.
    """
    blocks = tame = _Blocks.of(reference, most)
    start = float(reference.t[0])
    middle = start if lag_known else float(0.5 * (reference.t[0] + reference.t[-1]))
    # The lag is that of the middle: there the skew hardly moves it.
    at_middle, rate, mount = near.lag + near.skew * (middle - start), near.skew, near.mount
    free = np.ones(11, np.bool_)
    free[:2] = not lag_known, not skew_known
    linear = np.zeros((3, 3))
    for turn in range(ROUNDS):
        guess = at_middle, rate, (np.eye(3) + linear) @ mount, middle
        sums = _sums(sensor, reference, tame, guess)
        if sums is None:
            return None
        # Blocks scatter by more than their samples do (White 1980): what the samples seem to say counts for less.
        variance = sums.variance * sums.scatter(free)
        # A Cauchy prior as the normal one of the same pull: a clock of a crystal is held, one that is far off is not.
        held = 2.0 / (USUAL_SKEW**2 + rate**2)
        prior = np.concatenate(([0.0, held], np.full(9, LARGEST_ERROR**-2)))
        normal = (sums.information / variance + np.diag(prior))[np.ix_(free, free)]
        pull = np.sum(sums.scores, axis=0) / variance + prior * np.concatenate(([0.0, rate], linear.ravel()))
        step = np.zeros(11)
        step[free] = -np.linalg.solve(normal, pull[free])
        at_middle, rate = at_middle + step[0], rate + step[1]
        linear = linear + step[2:].reshape(3, 3)
        if turn in (1, 4):
            tame = blocks.without(
                _wild(sensor, reference, blocks, (at_middle, rate, (np.eye(3) + linear) @ mount, middle))
            )
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


@dataclass(frozen=True)
class _Errors:
    """The compared data of some blocks.

    Attributes
    ----------
    seen : (blocks,) array of bool
        Blocks that lie within the sensor's recording; the other arrays are theirs alone.
    there : (b, k) array of bool
        Samples that count.
    error : (b, k, 3) array
        Attitude error since the start of the block, rad.
    columns : (b, k, 3, 11) array
        Its derivatives by lag, skew and the linear map of the rates.
    at_start : (b, k, 3, 6) array
        The same by the attitude at the start and a constant rate.
    """

    seen: NDArray[np.bool_]
    there: NDArray[np.bool_]
    error: Array
    columns: Array
    at_start: Array

    @property
    def samples(self) -> NDArray[np.intp]:
        """Number of samples of each block, (b,)."""
        return np.asarray(self.there.sum(axis=1))

    def left(self, values: Array) -> Array:
        """Take out of (b, k, 3, c) columns what the unknowns of a block explain; (b, 3 k, c), zero where none is."""
        own = _flat(values, self.there)
        start = _flat(self.at_start, self.there)
        start /= np.maximum(np.linalg.norm(start, axis=1, keepdims=True), 1e-300)
        across = start.transpose(0, 2, 1)
        # The ridge, far below the noise, keeps blocks apart whose samples are at one time.
        return np.asarray(own - start @ np.linalg.solve(across @ start + 1e-12 * np.eye(6), across @ own))


def _flat(values: Array, there: NDArray[np.bool_]) -> Array:
    """Lay samples and axes of (b, k, 3, c) columns in one row, zero where no sample is."""
    return np.asarray((values * there[:, :, None, None]).reshape(len(values), 3 * there.shape[1], values.shape[-1]))


def _errors(sensor: Course, reference: Course, blocks: _Blocks, guess: _Guess) -> _Errors:
    """Compare the attitude of some blocks with what the gyroscope integrates."""
    lag, skew, mount, middle = guess
    since = reference.t[blocks.rows] - middle
    t = reference.t[blocks.rows] - lag - skew * since
    number = np.arange(len(t))
    first = np.argmax(blocks.there, axis=1)
    last = blocks.there.shape[1] - 1 - np.argmax(blocks.there[:, ::-1], axis=1)
    seen = (blocks.there.sum(axis=1) >= LEAST_SAMPLES) & sensor.seen(t[number, first], t[number, last])
    rows, t, since, there, first = blocks.rows[seen], t[seen], since[seen], blocks.there[seen], first[seen]
    number = np.arange(len(t))
    flat = t.ravel()

    def since_start(q: Array) -> Array:
        """Turn since the start of the block, (b k, 4)."""
        start = np.repeat(q.reshape(*t.shape, 4)[number, first] * CONJUGATE, t.shape[1], axis=0)
        return _imufit.quaternion_product(start, q)

    own, q = since_start(sensor.at(flat)), since_start(reference.attitude[rows.ravel()])
    turned = _imufit.quaternion_from_rotation_vector(_imufit.rotation_vector_from_quaternion(q) @ mount.T)
    error = _imufit.rotation_vector_from_quaternion(_imufit.quaternion_product(own * CONJUGATE, turned))
    # Over more than a sample: the noise of the rate at a sample is part of the error that it is to explain.
    rate = ((sensor.angle_at(flat + SMOOTH) - sensor.angle_at(flat - SMOOTH)) / (2.0 * SMOOTH)).reshape(*t.shape, 3)
    angle = sensor.angle_at(flat).reshape(*t.shape, 3)
    angle -= angle[number, first][:, None]
    columns = np.zeros((*t.shape, 3, 11))
    columns[..., 0] = rate
    columns[..., 1] = rate * since[..., None]
    at_start = np.zeros((*t.shape, 3, 6))
    for i in range(3):
        columns[:, :, i, 2 + 3 * i : 5 + 3 * i] = angle
        unit = np.tile(np.eye(3)[i], (len(flat), 1))
        at_start[..., i] = _imufit.rotate_back(own, unit).reshape(*t.shape, 3)
        at_start[:, :, i, 3 + i] = t - t[number, first][:, None]
    return _Errors(seen, there, error.reshape(*t.shape, 3), columns, at_start)


@dataclass(frozen=True)
class _Sums:
    """Normal equations by block: information (b, 11, 11), scores (b, 11), and the variance of what is left, rad^2."""

    blocks: Array
    scores: Array
    variance: float

    @property
    def information(self) -> Array:
        """Sum over the blocks, (11, 11)."""
        return np.asarray(self.blocks.sum(axis=0))

    def scatter(self, free: NDArray[np.bool_]) -> float:
        """Return the variance of lag and skew between blocks over that within them, 1 at least.

        It is that at the solution without a prior of the clocks: at the guess, a clock that is fast would scatter too.
        """
        information = self.information
        held = self.variance * np.concatenate(([0.0, 0.0], np.full(9, LARGEST_ERROR**-2)))
        normal = (information + np.diag(held))[np.ix_(free, free)]
        step = np.zeros(11)
        # Where nothing moves, the least of all steps does.
        step[free] = -np.linalg.lstsq(normal, self.scores.sum(axis=0)[free])[0]
        left = self.scores + self.blocks @ step
        sizes = np.sum(left[:, :2] ** 2, axis=0) / (self.variance * np.maximum(np.diag(information)[:2], 1e-300))
        return max(1.0, float(np.mean(sizes)))


def _sums(sensor: Course, reference: Course, blocks: _Blocks, guess: _Guess) -> _Sums | None:
    products, freedom = [], []
    for _, some in blocks.pieces():
        found = _errors(sensor, reference, some, guess)
        left = found.left(np.concatenate((found.error[..., None], found.columns), axis=3))
        products.append(left.transpose(0, 2, 1) @ left)
        freedom.append(3 * found.samples - 6)
    if not any(map(len, products)):
        return None
    sums = np.concatenate(products)
    # The median of the blocks: a few bad ones do not widen the errors of all.
    variance = max(float(np.median(sums[:, 0, 0] / np.concatenate(freedom))), 1e-20)
    return _Sums(sums[:, 1:, 1:], sums[:, 1:, 0], variance)


def _wild(sensor: Course, reference: Course, blocks: _Blocks, guess: _Guess) -> NDArray[np.bool_]:
    """Say which samples of each block are far off."""
    sizes = np.zeros(blocks.rows.shape)
    usual = []
    for place, some in blocks.pieces():
        found = _errors(sensor, reference, some, guess)
        # By medians first: the start of the block may itself be wild.
        middle = np.nanmedian(np.where(found.there[..., None], found.error, np.nan), axis=1, keepdims=True)
        left = found.left((found.error - middle)[..., None]).reshape(*found.there.shape, 3)
        size = np.linalg.norm(left, axis=2)
        usual.append(size[found.there])
        sizes[place][found.seen] = size
    together = np.concatenate(usual) if usual else np.zeros(0)
    return np.asarray(sizes > WILD * float(np.median(together)) if together.size else np.zeros_like(blocks.there))
