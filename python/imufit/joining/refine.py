"""Lag, skew and mount to a fraction of a sample, by the likelihood of both recordings over all that they share.

The turns of the reference from sample to sample are compared with what the gyroscope integrates over the same times.
Noise of the reference (white in its attitude) and of the gyroscope (a drift, vibration of rotors) have spectra of their
own, and so has the motion. All three are estimated, axis by axis, from blocks that overlap by half, and each frequency
counts by what its signal to noise ratio says about the delay (Hannan and Thomson 1973, Estimating group delay,
Biometrika 60; Knapp and Carter 1976, The generalized correlation method for estimation of time delay, IEEE Trans.
Acoustics, Speech, and Signal Processing 24). Lag, skew, the gyroscope's bias and a linear map of its rates (scale,
axes, the rest of the mount) are fitted together (Gauss-Newton).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from imufit import _imufit
from imufit.joining.course import CONJUGATE, Course, reference_course
from imufit.joining.search import LARGEST_SKEW, USUAL_SKEW, Candidate, bin_width, turn_between

Array = NDArray[np.float64]
Transform = NDArray[np.complex128]

BLOCK: Final = 8.0
"""Length of a block, s: its spectra separate a motion of some tenths of a hertz from the drift of a gyroscope."""
RAMP: Final = 0.1
"""Share of a block over which the ends of a stretch fade in and out."""
LEAST_SAMPLES: Final = 12
"""Samples of the reference in a stretch; a shorter one is left out."""
MOST_RATE: Final = 50.0
"""Rate to which a faster reference is averaged, Hz: people, vehicles and robots turn slower than 10 Hz."""
BAND: Final = 0.2
"""Half the band over which a spectrum is averaged, as a share of its frequency."""
ROUNDS: Final = 12
"""Gauss-Newton steps at most."""
UNHELD: Final = 4
"""Steps in which all skews that are looked for are as likely."""
WILD: Final = 20.0
"""A turn this many times as far off as the usual one (median) of its block is of a wild pose: of normal errors none is
beyond four."""
LARGEST_ERROR: Final = 0.1
"""Prior standard deviation of the linear map of the rates, 1: scale and axes of a sensor are right to some percent, the
mount as found by the rates to some degrees."""
MOST_AT_ONCE: Final = 2**16
"""Samples of the reference that are compared at once: 30 MB of transforms."""
UNKNOWNS: Final = 14
"""Lag, skew, the linear map (nine, row by row) and the bias (three)."""


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


def refine(
    sensor: Course,
    reference: Course,
    near: Candidate,
    skew_known: bool = False,
    lag_known: bool = False,
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

    Returns
    -------
    Aligned or None
        None where no block of the reference lies within the sensor's recording.
    """
    body = _averaged(reference)
    start = float(reference.t[0])
    middle = start if lag_known else float(0.5 * (reference.t[0] + reference.t[-1]))
    # The lag is that of the middle: there the skew hardly moves it.
    searched = near.lag + near.skew * (middle - start)
    at_middle, rate = searched, near.skew
    free = np.ones(UNKNOWNS, np.bool_)
    free[:2] = not lag_known, not skew_known
    linear, bias = np.zeros((3, 3)), np.zeros(3)
    # As far as the clocks may be off; at higher frequencies the phase of the motion does not show yet where they go.
    width = off = bin_width(sensor, reference)
    reach = float(np.max(np.abs(reference.t - middle)))
    for turn in range(ROUNDS):
        turns = _Turns.of(sensor, body, at_middle, rate, middle)
        sums = _sums(turns, (np.eye(3) + linear) @ near.mount, bias, off)
        if sums is None:
            return None
        # A Cauchy prior as the normal one of the same pull: a clock of a crystal is held, one that is far off is not.
        # It has a maximum of its own near no skew, so that the first rounds go to that of the likelihood, among the
        # skews that are looked for. The lag is known to a bin.
        held = LARGEST_SKEW**-2 if turn < UNHELD else 2.0 / (USUAL_SKEW**2 + rate**2)
        prior = np.concatenate(([width**-2, held], np.full(9, LARGEST_ERROR**-2), np.zeros(3)))
        scatter = sums.scatter(free)
        normal = (sums.normal.sum(axis=0) / scatter + np.diag(prior))[np.ix_(free, free)]
        away = np.concatenate(([at_middle - searched, rate], linear.ravel(), np.zeros(3)))
        pull = sums.scores.sum(axis=0) / scatter + prior * away
        step = np.zeros(UNKNOWNS)
        step[free] = -np.linalg.lstsq(normal, pull[free])[0]
        at_middle, rate = at_middle + step[0], rate + step[1]
        linear, bias = linear + step[2:11].reshape(3, 3), bias + step[11:]
        off = abs(step[0]) + abs(step[1]) * reach
        if turn > UNHELD and abs(step[0]) < 1e-6:
            break
    assert sums is not None
    solved = np.linalg.pinv(normal)
    covariance = np.zeros((UNKNOWNS, UNKNOWNS))
    noise = (sums.noise / scatter + np.diag(prior))[np.ix_(free, free)]
    covariance[np.ix_(free, free)] = solved @ noise @ solved.T
    if not lag_known and sums.noise[0, 0] == 0.0:
        # No frequency at which both saw the same: nothing shows the lag.
        covariance[0, 0] = np.inf
    to_start = np.array([1.0, start - middle])
    return Aligned(
        lag=float(at_middle + rate * (start - middle)),
        lag_error=float(np.sqrt(max(to_start @ covariance[:2, :2] @ to_start, 0.0))),
        skew=float(rate),
        skew_error=float(np.sqrt(covariance[1, 1])),
        mount=turn_between((np.eye(3) + linear) @ near.mount),
        attitude_error=sums.attitude_error,
        blocks=len(sums.scores),
    )


def _averaged(reference: Course) -> Course:
    """Average a reference that is faster than the motion, some samples at a time."""
    every = int(1.0 / (float(np.median(np.diff(reference.t))) * MOST_RATE))
    if every < 2:
        return reference
    pieces = np.split(np.arange(len(reference.t)), np.flatnonzero(reference.gap) + 1)
    rows = np.concatenate([piece[: len(piece) // every * every].reshape(-1, every) for piece in pieces])
    if len(rows) < 2:
        return reference
    first = reference.attitude[rows[:, 0]]
    since = _imufit.quaternion_product(np.repeat(first * CONJUGATE, every, axis=0), reference.attitude[rows.ravel()])
    mean = _imufit.rotation_vector_from_quaternion(since).reshape(len(rows), every, 3).mean(axis=1)
    q = _imufit.quaternion_product(first, _imufit.quaternion_from_rotation_vector(mean))
    return reference_course(reference.t[rows].mean(axis=1), q)


@dataclass(frozen=True)
class _Turns:
    """Turns from one sample of the reference to the next, (n, 3) rad, each in the body's axes.

    Attributes
    ----------
    step, usual : (n,) array, float
        Time between the samples and its median, s.
    since : (n,) array
        Time since the middle, s.
    there : (n,) array of bool
        Where both were recorded without a gap.
    own, body : (n, 3) array
        Of the sensor and of the reference.
    """

    step: Array
    usual: float
    since: Array
    there: NDArray[np.bool_]
    own: Array
    body: Array

    @classmethod
    def of(cls, sensor: Course, body: Course, lag: float, skew: float, middle: float) -> _Turns:
        since = body.t - middle
        t = body.t - lag - skew * since
        attitude = sensor.at(np.clip(t, sensor.t[0], sensor.t[-1]))
        own = _imufit.rotation_vector_from_quaternion(
            _imufit.quaternion_product(attitude[:-1] * CONJUGATE, attitude[1:])
        )
        step = np.diff(body.t)
        there = ~body.gap & sensor.seen(t[:-1], t[1:])
        return cls(step, float(np.median(step)), 0.5 * (since[1:] + since[:-1]), there, own, body.rate * step[:, None])

    def by_lag(self, turns: Array) -> Array:
        """Differentiate turns, (n, 3), by the lag, rad/s; zero beside a gap."""
        rate = turns / self.step[:, None]
        found = np.zeros_like(turns)
        inner = self.there[2:] & self.there[:-2]
        found[1:-1][inner] = 0.5 * (rate[:-2] - rate[2:])[inner]
        return found

    def tame(self, left: Array) -> NDArray[np.bool_]:
        """Say where both were recorded and what is `left`, (n, 3), is not that of a wild pose."""
        size = np.where(self.there, np.linalg.norm(left, axis=1), np.nan)
        length = _length(self.usual)
        number = np.minimum(np.arange(len(size)) // length, max(len(size) // length - 1, 0))
        cuts = np.flatnonzero(np.diff(number)) + 1
        most = [
            np.full(len(each), WILD * np.median(each[~np.isnan(each)])) if not np.isnan(each).all() else each
            for each in np.split(size, cuts)
        ]
        return np.asarray(self.there & ~(size > np.concatenate(most)))


def _length(step: float) -> int:
    """Count the samples in a block."""
    return max(LEAST_SAMPLES, round(BLOCK / step))


@dataclass(frozen=True)
class _Blocks:
    """Blocks cut from stretches: the rows (b, k) of each, and their weights (b, k).

    Blocks overlap. The squares of the weights of one row add up to one over all blocks.
    """

    rows: NDArray[np.intp]
    window: Array

    @classmethod
    def of(cls, there: NDArray[np.bool_], length: int) -> _Blocks:
        """Cut where samples are missing."""
        edges = np.flatnonzero(np.diff(np.concatenate(([False], there, [False]))))
        rows, windows = [np.zeros((0, length), np.intp)], [np.zeros((0, length))]
        for begin, end in edges.reshape(-1, 2):
            count = end - begin
            if count < LEAST_SAMPLES:
                continue
            size = min(count, length)
            number = int(np.ceil(2.0 * (count - size) / length)) + 1
            place = np.linspace(0, count - size, number).round().astype(int)[:, None] + np.arange(size)
            sine = np.broadcast_to(np.sin(np.pi * (np.arange(size) + 0.5) / size), place.shape)
            weight = np.bincount(place.ravel(), sine.ravel() ** 2)
            ramp = np.clip((np.minimum(np.arange(count), np.arange(count)[::-1]) + 0.5) / (RAMP * size), 0.0, 1.0)
            window = (np.sin(0.5 * np.pi * ramp) / np.sqrt(weight))[place] * sine
            rows.append(np.pad(begin + place, ((0, 0), (0, length - size)), mode="edge"))
            windows.append(np.pad(window, ((0, 0), (0, length - size))))
        return cls(np.concatenate(rows), np.concatenate(windows))

    def pieces(self) -> Iterator[tuple[slice, _Blocks]]:
        """Yield some blocks at a time."""
        size = max(1, MOST_AT_ONCE // self.rows.shape[1])
        for begin in range(0, len(self.rows), size):
            some = slice(begin, begin + size)
            yield some, _Blocks(self.rows[some], self.window[some])

    def transform(self, values: Array) -> Transform:
        """Transform (n, c) values, block by block: (b, frequencies, c)."""
        return np.asarray(fft.rfft(values[self.rows] * self.window[..., None], axis=1))


@dataclass(frozen=True)
class _Sums:
    """Normal equations by block.

    Attributes
    ----------
    normal, scores : (b, 14, 14) and (b, 14) array
        Sensitivity of the scores to the unknowns, and the scores.
    noise : (14, 14) array
        Covariance of the sum of the scores, if blocks are alike.
    alike : float
        Sum of the variances of the blocks' scores over the variance of the sum of all scores, if blocks are alike.
        Blocks overlap, so it is less than one.
    attitude_error : float
        RMS over axes of the attitude error within a block, rad.
    """

    normal: Array
    scores: Array
    noise: Array
    alike: float
    attitude_error: float

    def scatter(self, free: NDArray[np.bool_]) -> float:
        """Return the variance of the scores of lag and skew between blocks over that of blocks alike, 1 at least.

        Blocks scatter by more than their samples do (White 1980). It is taken at the solution without a prior of the
        clocks: at the guess, a clock that is fast would scatter too.
        """
        held = np.concatenate(([0.0, 0.0], np.full(9, LARGEST_ERROR**-2), np.zeros(3)))
        normal = (self.normal.sum(axis=0) + np.diag(held))[np.ix_(free, free)]
        step = np.zeros(UNKNOWNS)
        # Where nothing moves, the least of all steps does.
        step[free] = -np.linalg.lstsq(normal, self.scores.sum(axis=0)[free])[0]
        left = self.scores + self.normal @ step
        usual = self.alike * np.maximum(np.diag(self.noise)[:2], 1e-300)
        return max(1.0, float(np.mean(np.sum(left[:, :2] ** 2, axis=0) / usual)))


def _sums(turns: _Turns, mount: Array, bias: Array, off: float) -> _Sums | None:
    body = turns.body @ mount.T
    left = turns.own - body - turns.step[:, None] * bias
    length = _length(turns.usual)
    turns = replace(turns, there=turns.tame(left))
    blocks = _Blocks.of(turns.there, length)
    if not len(blocks.rows):
        return None
    shown = 2.0 * np.pi * off * fft.rfftfreq(length, turns.usual) < 1.0
    spectra = _Spectra.of(blocks, turns.own - turns.step[:, None] * bias, body, shown)
    weight = spectra.weight
    # Two sides of the spectrum, over the number of samples (Parseval).
    sides = np.full(length // 2 + 1, 2.0 / length)
    sides[0] = 1.0 / length
    if length % 2 == 0:
        sides[-1] = 1.0 / length
    normals, scores = [], []
    noise = np.zeros((UNKNOWNS, UNKNOWNS))
    # The noise of one recording is not in the other: the scores weigh the difference by what the sensor saw, and change
    # with the unknowns as the reference saw it (instrumental variables).
    by_lag = [(turns.by_lag(each), each) for each in (turns.own - turns.step[:, None] * bias, body)]
    for _, some in blocks.pieces():
        seen = [(some.transform(moved), some.transform(each)) for moved, each in by_lag]
        rest, flat = some.transform(left), some.transform(turns.step[:, None])
        since = np.sum(turns.since[some.rows] * some.window**2, axis=1) / np.sum(some.window**2, axis=1)
        count = len(some.rows)
        normal, score = np.zeros((count, UNKNOWNS, UNKNOWNS)), np.zeros((count, UNKNOWNS))
        for axis in range(3):
            place = np.array([0, 1, 2 + 3 * axis, 3 + 3 * axis, 4 + 3 * axis, 11 + axis])
            known, columns = (
                np.concatenate(
                    (moved[..., axis, None], moved[..., axis, None] * since[:, None, None], -each, -flat), axis=2
                )
                for moved, each in seen
            )
            scaled = known * (sides[:, None] * weight[:, :, axis].T)
            normal[:, place[:, None], place] += np.einsum("bfi,bfj->bij", scaled.conj(), columns).real
            score[:, place] += np.einsum("bfi,bf->bi", scaled.conj(), rest[..., axis]).real
            spread = spectra.noise[:, axis] / sides
            noise[place[:, None], place] += np.einsum("bfi,bfj,f->ij", scaled.conj(), scaled, spread).real
        normals.append(normal)
        scores.append(score)
    alike = float(np.sum(blocks.window**4) / np.sum(blocks.window**2))
    return _Sums(np.concatenate(normals), np.concatenate(scores), noise, alike, spectra.attitude_error)


@dataclass(frozen=True)
class _Spectra:
    """Mean squares of transforms over the blocks, for a sum of squared weights of one; (frequencies, 3).

    Attributes
    ----------
    motion : (f, 3) array
        Of what both saw.
    noise : (f, 3) array
        Of their difference.
    open : (f, 3) array
        Product of the noise of both over that of their difference: what the motion stands beside.
    """

    motion: Array
    noise: Array
    open: Array

    @classmethod
    def of(cls, blocks: _Blocks, own: Array, body: Array, shown: NDArray[np.bool_]) -> _Spectra:
        shape = 4, blocks.rows.shape[1] // 2 + 1, 3
        sums = np.zeros(shape)
        for _, some in blocks.pieces():
            one, other = some.transform(own), some.transform(body)
            sums += np.stack(
                [
                    np.sum(each, axis=0)
                    for each in (
                        np.abs(one) ** 2,
                        np.abs(other) ** 2,
                        (one.conj() * other).real,
                        np.abs(one - other) ** 2,
                    )
                ]
            )
        total = float(np.sum(blocks.window**2))
        sensor, reference, shared, noise = (_smooth(each) / total for each in sums)
        motion = np.maximum(shared, 0.0) * shown[:, None]
        noise = np.maximum(noise, 1e-12 * noise.max() + 1e-300)
        # Up to the frequency at which it is likelier that both saw the same (Akaike 1974, A new look at the statistical
        # model identification, IEEE Trans. Automatic Control 19).
        number = total / blocks.rows.shape[1]
        coherence = np.minimum(motion**2 / np.maximum(sensor * reference, 1e-300), 1.0 - 1e-9)
        width = 1.0 + 2.0 * _half(len(motion))
        gain = np.cumsum(np.sum(-number * np.log1p(-coherence), axis=1) - 3.0 / width)
        motion[int(np.argmax(gain)) + 1 :] = 0.0
        product = np.maximum(sensor - motion, 0.0) * np.maximum(reference - motion, 0.0)
        return cls(motion, noise, np.minimum(product / noise, 0.25 * noise))

    @property
    def weight(self) -> Array:
        """Weights of the difference in the scores of lag, skew, three of the linear map, bias: (6, frequencies, 3)."""
        share = self.motion / np.maximum(self.motion + self.open, 1e-300) / self.noise
        return np.stack([share] * 5 + [1.0 / self.noise])

    @property
    def attitude_error(self) -> float:
        """RMS over axes, rad."""
        count = len(self.noise)
        phase = np.pi * np.arange(1, count) / (count - 1)
        across = np.sum(self.noise[1:] / (4.0 * np.sin(0.5 * phase[:, None]) ** 2), axis=0) / count
        return float(np.sqrt(np.mean(across)))


def _half(count: int) -> NDArray[np.intp]:
    """Frequencies on either side over which a spectrum is averaged."""
    return np.asarray(np.maximum(1, (BAND * np.arange(count)).astype(np.intp)))


def _smooth(values: Array) -> Array:
    """Average a spectrum, (frequencies, 3), over bands."""
    count = len(values)
    first = np.maximum(np.arange(count) - _half(count), 0)
    last = np.minimum(np.arange(count) + _half(count) + 1, count)
    total = np.concatenate((np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)))
    return np.asarray((total[last] - total[first]) / (last - first)[:, None])
