"""A fault that happens in the course of a log: a mount that shifts.

How the sensors are turned against the reference belongs to a set-up and is the same all along. The evidence is kept in
blocks of time, so the rotation can be estimated in every block. With the columns of the whole catalogue fitted along
(nothing that an effect could explain is left), a turn that all sensors share and that differs before and after one
instant is a knock. It is named if

- it is significant by the delete-block jackknife, all instants counted that were tried (Hotelling's T^2, as for
  effects);
- it explains nearly all of what a free value in each block would: neither a random walk, nor a line mistaken for a step
  (which explains three quarters of it).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from imufit import _imufit
from imufit.model.catalogue import find_effect
from imufit.results import fault_words
from imufit.results.data_fault import DataFault

Array = NDArray[np.float64]

ALPHA: Final = 1e-4
"""Chance of naming a knock in a log that has none, all instants together."""
SHARE: Final = 0.85
"""Part of the drop that a free value in each block would bring."""
MIN_GAIN: Final = 40.0
"""Drop of the sum of squares, in units of the noise, below which nothing is asked further."""
MIN_BLOCKS: Final = 20
EDGE: Final = 3
"""Blocks before the first and after the last instant tried."""
MIN_TURN: Final = 1e-3
"""Smallest turn, rad, that is named."""
_RANK: Final = 1e-8
_SEEN: Final = 1e-4
"""Parts of the largest eigenvalue below which a direction of all parameters, and one of the turn, is not seen."""


def knock_faults(
    evidence: _imufit.Evidence, variance: list[float], places: Mapping[str, range], facts: _imufit.Facts
) -> list[DataFault]:
    """Name a knock.

    Parameters
    ----------
    evidence : Evidence
        Of the whole log, with the columns of the whole catalogue, as it stands (not whitened).
    variance : list of float
        Of each channel's residual, the whole catalogue fitted; NaN for a channel that the log has not.
    places : mapping
        Parameters of every effect by its id. Dependences without a name, whose columns come after theirs, are not among
        them.
    facts : Facts
        Of the log.
    """
    turn = next((list(at) for key, at in places.items() if find_effect(key).reference_part == "mount"), None)
    blocks = _equations(evidence, variance, max((at.stop for at in places.values()), default=0))
    known = blocks[:, -1, -1] > 0.0
    if turn is None or np.count_nonzero(known) < MIN_BLOCKS:
        return []
    edges = np.linspace(facts.t_start, facts.t_end, evidence.blocks + 1)[:-1][known]
    blocks = blocks[known]
    count = len(blocks)
    total = blocks.sum(axis=0)
    since = np.cumsum(blocks[::-1], axis=0)[::-1]
    basis = _basis(total[:-1, :-1], _RANK)
    tried = range(EDGE, count - EDGE)
    best = max(tried, key=lambda k: _step(total, since[k], turn, basis)[1])
    values, gain, rank = _step(total, since[best], turn, basis)
    # The cheaper questions first: most logs have no knock.
    if rank == 0 or gain < MIN_GAIN or gain < SHARE * _free_gain(blocks, turn) or np.linalg.norm(values) < MIN_TURN:
        return []
    left_out = []
    for b, block in enumerate(blocks):
        rest = total - block
        after = since[best] - block if b >= best else since[best]
        left_out.append(_step(rest, after, turn, _basis(rest[:-1, :-1], _RANK))[0])
    covariance = (count - 1.0) ** 2 / count * np.cov(np.transpose(left_out))
    if _hotelling(values, covariance, rank, count) * len(tried) > ALPHA:
        return []
    when, width = float(edges[best]), float(np.median(np.diff(edges)))
    rows = round(facts.n * (facts.t_end - when) / (facts.t_end - facts.t_start))
    words = fault_words.knock(when, width, values.tolist())
    return [DataFault("knock", None, None, when, facts.t_end, rows, *words, gain=gain)]


def _equations(evidence: _imufit.Evidence, variance: list[float], parameters: int) -> Array:
    """Return normal equations (b, p + 1, p + 1) of each block, the residual last, observations of unit variance."""
    sums = np.zeros((evidence.blocks, parameters + 1, parameters + 1))
    for channel, each in enumerate(variance):
        if not (np.isfinite(each) and each > 0.0):
            continue
        active = evidence.active(channel)
        inside = [k for k, place in enumerate(active) if place < parameters]
        at, taken = [*(active[k] for k in inside), parameters], [*inside, len(active)]
        for block in range(evidence.blocks):
            gram = evidence.gram(channel, block)
            if gram is not None:
                sums[block][np.ix_(at, at)] += gram[np.ix_(taken, taken)] / each
    return sums


def _basis(normal: Array, least: float, unseen: float = 0.0) -> Array:
    """Directions (p, r) of parameters in which their normal equations are the identity, without those hardly seen."""
    power = np.diag(normal)
    seen = power > unseen * max(float(power.max()), 1e-300)
    scale = np.where(seen, 1.0 / np.sqrt(np.where(seen, power, 1.0)), 0.0)
    values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
    kept = values > least * max(float(values[-1]), 1e-300)
    return np.asarray(scale[:, None] * vectors[:, kept] / np.sqrt(values[kept]))


def _step(total: Array, since: Array, turn: list[int], basis: Array) -> tuple[Array, float, int]:
    """Fit a turn that acts in some blocks, all else fitted along: its values, drop of the sum of squares, and its rank.

    Parameters
    ----------
    total, since : ndarray
        (p + 1, p + 1) normal equations of all blocks, and of those blocks.
    turn : list of int
        Parameters of the turn.
    basis : ndarray
        (p, r) of all parameters.
    """
    cross = basis.T @ since[:-1, turn]
    normal = since[np.ix_(turn, turn)] - cross.T @ cross
    own = _basis(normal, _SEEN, 1e-12)
    along = own.T @ (since[turn, -1] - cross.T @ (basis.T @ total[:-1, -1]))
    return own @ along, float(along @ along), len(along)


def _free_gain(blocks: Array, turn: list[int]) -> float:
    """Drop of the sum of squares if the turn had a value of its own in every block."""
    inverse = np.linalg.pinv(blocks[:, turn][:, :, turn], rcond=1e-8, hermitian=True)
    freed = (blocks - blocks[:, :, turn] @ inverse @ blocks[:, turn, :]).sum(axis=0)
    return _left(blocks.sum(axis=0)) - _left(freed)


def _left(equations: Array) -> float:
    """Sum of squares that a fit of all parameters leaves."""
    explained = equations[:-1, -1] @ _basis(equations[:-1, :-1], _RANK)
    return float(equations[-1, -1] - explained @ explained)


def _hotelling(values: Array, covariance: Array, rank: int, count: int) -> float:
    """p-value of all values being zero, by as many directions of their covariance as the log shows."""
    along = values @ _basis(covariance, 1e-12)[:, -rank:]
    square = float(along @ along)
    return float(fdtrc(rank, count - rank, square * (count - rank) / (rank * (count - 1.0))))
