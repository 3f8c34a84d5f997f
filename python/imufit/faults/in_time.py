"""A fault that happens in the course of a log: a mount that shifts.

How the sensors are turned against the reference belongs to a set-up and is the same all along. The evidence is kept in
blocks of time, so the turn can be asked for in every block. With the columns of the whole catalogue fitted along
(nothing that an effect could explain is left), a turn that all sensors share and that differs before and after one
instant is a knock. It is named if

- it is significant by the delete-block jackknife, all instants counted that were tried (Hotelling's T^2, as for
  effects);
- it explains nearly all of what a free value in each block would: neither a value that wanders, nor a line taken for a
  step (which explains three quarters of it).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from imufit import _imufit
from imufit.figures import quantity
from imufit.model.catalogue import find_effect
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


@dataclass(frozen=True, eq=False)
class Blocks:
    """Normal equations of each block over the effects' parameters, the residual last, observations of unit variance.

    Attributes
    ----------
    equations : ndarray
        (b, p + 1, p + 1).
    middle : ndarray
        (b,) middle of each block, s.
    edges : ndarray
        (b,) start of each block, s.
    """

    equations: Array
    middle: Array
    edges: Array

    @classmethod
    def of(cls, evidence: _imufit.Evidence, variance: list[float], parameters: int, facts: _imufit.Facts) -> Blocks:
        """Take them from evidence; blocks without samples are left out.

        Parameters
        ----------
        evidence : Evidence
            Of the whole log.
        variance : list of float
            Of each channel's residual, the whole catalogue fitted; NaN for a channel that the log has not.
        parameters : int
            Number of parameters that are looked at, the first ones of the evidence.
        facts : Facts
            Of the log.
        """
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
        edges = np.linspace(facts.t_start, facts.t_end, evidence.blocks + 1)
        known = sums[:, -1, -1] > 0.0
        return cls(sums[known], (0.5 * (edges[1:] + edges[:-1]))[known], edges[:-1][known])


def time_faults(
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
    parameters = max((place.stop for place in places.values()), default=0)
    blocks = Blocks.of(evidence, variance, parameters, facts)
    if len(blocks.equations) < MIN_BLOCKS:
        return []
    basis = _basis(blocks.equations.sum(axis=0))
    parts = {find_effect(key).reference_part: place for key, place in places.items()}
    if "mount" not in parts:
        return []
    return _knock(_Course.of(blocks, basis, parts["mount"]), facts)


def _knock(course: _Course, facts: _imufit.Facts) -> list[DataFault]:
    number = np.arange(len(course.blocks.middle))
    tried = number[EDGE:-EDGE]
    gains = [course.solved((number >= k).astype(np.float64))[1] for k in tried]
    best = int(tried[int(np.argmax(gains))])
    answer = _asked(course, (number >= best).astype(np.float64))
    if answer is None or answer.p_value * len(tried) > ALPHA:
        return []
    angle = float(np.linalg.norm(answer.values))
    if angle < MIN_TURN:
        return []
    when = float(course.blocks.edges[best])
    width = float(np.median(np.diff(course.blocks.edges)))
    rows = round(facts.n * (facts.t_end - when) / (facts.t_end - facts.t_start))
    axes = ", ".join(quantity.quantity(value, "rad") for value in answer.values)
    evidence = (
        f"From {when:.4g} s on (within {width:.2g} s) every sensor is turned by {np.degrees(angle):.3g} deg against "
        f"the reference (x y z {axes}): the mount shifted, or the reference jumped."
    )
    remedy = f"Fasten sensor and markers, and record again, or cut the log in two at {when:.4g} s."
    return [DataFault("knock", None, None, when, facts.t_end, rows, evidence, remedy, gain=answer.gain)]


def _basis(equations: Array) -> Array:
    """Directions (p, r) of the parameters that a log shows, in which their normal equations are the identity."""
    normal = equations[:-1, :-1]
    scale = np.sqrt(np.maximum(np.diag(normal), 0.0))
    scale = np.where(scale > 0.0, 1.0 / np.where(scale > 0.0, scale, 1.0), 0.0)
    values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
    kept = values > _RANK * max(float(values[-1]), 1e-300)
    return np.asarray(scale[:, None] * vectors[:, kept] / np.sqrt(values[kept]))


@dataclass(frozen=True, eq=False)
class _Course:
    """Some parameters that may follow a course over the blocks, all others fitted along.

    Attributes
    ----------
    blocks : the evidence.
    basis : (p, r), see `_basis`.
    place : parameters that follow the course.
    cross : (b, r, m) products of the basis with their columns, by block.
    right : (b, r) products of the basis with the residual.
    own : (b, m, m) products of their columns.
    seen : (b, m) products of their columns with the residual.
    """

    blocks: Blocks
    basis: Array
    place: list[int]
    cross: Array
    right: Array
    own: Array
    seen: Array

    @classmethod
    def of(cls, blocks: Blocks, basis: Array, place: range) -> _Course:
        """Take the products by block."""
        at, equations = list(place), blocks.equations
        columns = equations[:, :, at]
        cross, right = basis.T @ columns[:, :-1], equations[:, :-1, -1] @ basis
        return cls(blocks, basis, at, cross, right, columns[:, at], columns[:, -1])

    def solved(self, course: Array) -> tuple[Array, float, int]:
        """Parameters that follow a course, drop of the sum of squares, and how many directions can be seen."""
        cross = np.einsum("b,brm->rm", course, self.cross)
        own = np.einsum("b,bmn->mn", course**2, self.own)
        return _solved(own - cross.T @ cross, course @ self.seen - cross.T @ self.right.sum(axis=0))

    def left_out(self, course: Array) -> Array:
        """Parameters (b, m) that follow a course, each block left out in turn."""
        cross = np.einsum("b,brm->rm", course, self.cross)
        own = np.einsum("b,bmn->mn", course**2, self.own)
        right, seen = self.right.sum(axis=0), course @ self.seen
        identity = (1.0 + 1e-6) * np.eye(len(right))
        found = []
        for b, weight in enumerate(course):
            normal = identity - self.basis.T @ self.blocks.equations[b, :-1, :-1] @ self.basis
            less = np.column_stack([cross - weight * self.cross[b], right - self.right[b]])
            inside = np.linalg.solve(normal, less)
            part = own - weight**2 * self.own[b] - less[:, :-1].T @ inside[:, :-1]
            found.append(_solved(part, seen - weight * self.seen[b] - less[:, :-1].T @ inside[:, -1])[0])
        return np.array(found)

    def free_gain(self) -> float:
        """Drop of the sum of squares if the parameters had a value of their own in every block."""
        equations, at = self.blocks.equations, self.place
        freed = np.zeros_like(equations[0])
        for block in equations:
            inverse = np.linalg.pinv(block[np.ix_(at, at)], rcond=1e-8, hermitian=True)
            freed += block - block[:, at] @ inverse @ block[at, :]
        return _left(equations.sum(axis=0), self.basis) - _left(freed, _basis(freed))


@dataclass(frozen=True, eq=False)
class _Answer:
    """Parameters that follow a course, their standard errors, p-value, and drop of the sum of squares."""

    values: Array
    errors: Array
    p_value: float
    gain: float


def _solved(normal: Array, right: Array) -> tuple[Array, float, int]:
    """Solution, drop of the sum of squares, and how many directions can be seen."""
    power = np.diag(normal)
    seen = power > 1e-12 * max(float(power.max()), 1e-300)
    scale = np.where(seen, 1.0 / np.sqrt(np.where(seen, power, 1.0)), 0.0)
    values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
    kept = values > 1e-4
    along = vectors[:, kept].T @ (right * scale)
    solution = vectors[:, kept] @ (along / values[kept]) * scale
    return solution, float(np.sum(along**2 / values[kept])), int(kept.sum())


def _asked(question: _Course, course: Array) -> _Answer | None:
    """Fit a course over the blocks and judge it; None where it explains too little."""
    values, gain, rank = question.solved(course)
    count = len(course)
    # The cheaper questions first: most logs have no knock.
    if rank == 0 or gain < MIN_GAIN or gain < SHARE * question.free_gain():
        return None
    left_out = question.left_out(course)
    spread = left_out - left_out.mean(axis=0)
    covariance = (count - 1.0) / count * spread.T @ spread
    return _Answer(values, np.sqrt(np.diag(covariance)), _hotelling(values, covariance, rank, count), gain)


def _hotelling(values: Array, covariance: Array, rank: int, count: int) -> float:
    """p-value of all values being zero."""
    power = np.diag(covariance)
    scale = np.where(power > 0.0, 1.0 / np.sqrt(np.where(power > 0.0, power, 1.0)), 0.0)
    spread, vectors = np.linalg.eigh(covariance * np.outer(scale, scale))
    kept = np.argsort(spread)[::-1][:rank]
    z = vectors[:, kept].T @ (values * scale)
    square = float(np.sum(z**2 / np.maximum(spread[kept], 1e-12)))
    return float(fdtrc(rank, count - rank, square * (count - rank) / (rank * (count - 1.0))))


def _left(equations: Array, basis: Array) -> float:
    """Sum of squares that a fit of all parameters leaves."""
    return float(equations[-1, -1] - np.sum((equations[:-1, -1] @ basis) ** 2))
