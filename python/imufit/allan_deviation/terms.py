r"""The usual terms of an Allan variance, fitted together to the whole curve.

.. math:: \sigma^2(\tau) = \frac{3 Q^2}{\tau^2} + \frac{N^2}{\tau} + \frac{2 \ln 2}{\pi} B^2 + \frac{K^2 \tau}{3}

(IEEE Std 952-1997, annex C) with quantisation Q, random walk N of the integral, bias instability B and random walk K of
the bias. The squares are found by weighted least squares that cannot go negative (Lawson and Hanson). The weights
come from the equivalent degrees of freedom under the kind of noise that dominates each averaging time, as the fit
determines it; both are repeated until they agree. Only averaging times an octave apart are fitted: those in between
repeat what these say, and the correlation of those an octave apart is taken into account.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincc

from imufit.results.json_value import json_value

Array = NDArray[np.float64]

TERMS: Final[dict[str, tuple[str, str, str]]] = {
    "quantisation": ("Q", "{}*s", "quantisation of the integral"),
    "white": ("N", "{}*sqrt(s)", "random walk of the integral"),
    "flicker": ("B", "{}", "bias instability"),
    "walk": ("K", "{}/sqrt(s)", "random walk of the bias"),
}
"""Kind of noise: letter in IEEE Std 952, unit out of the sensor's, name."""

_SURE = 3.0
"""A term whose square is not this many standard errors above 0 is not visible."""
_BOUND = 1.645
"""One-sided 95 % of a normal distribution."""
_ACCEPTED = 1e-6
"""A misfit less probable than this rejects the fit: the sensor's filter or noise of another colour shapes the curve."""
_LEAST = 4
"""Octaves that a fit needs."""
_FOOT = 1
"""Octaves by which the fit starts later where a filter bends the curve."""
_ROUNDS = 8
_GRID = 600


@dataclass(frozen=True)
class Term:
    """One term of the fit.

    Attributes
    ----------
    value : float or None
        Coefficient, in the sensor's unit times the term's power of s; None where this log does not show it.
    standard_error : float or None
        Of `value`.
    at_most : float
        Where it is not visible: with 95 % confidence it is no larger.
    """

    value: float | None
    standard_error: float | None
    at_most: float

    def to_dict(self) -> dict[str, Any]:
        """JSON of the term."""
        return {
            "value": json_value(self.value),
            "standard_error": json_value(self.standard_error),
            "at_most": json_value(self.at_most),
        }


@dataclass(frozen=True)
class Fitted:
    """All terms of one channel.

    Attributes
    ----------
    terms : dict of Term
        By kind of noise, as in `TERMS`.
    squares : dict of float
        Fitted coefficients squared, those that are not visible included.
    white_error : float
        Standard error of the square of N.
    tau_start : float
        Shortest averaging time that was fitted, s: below it the sensor's own filter shapes the curve.
    probability : float
        That noise of these kinds alone misfits as much.
    """

    terms: dict[str, Term]
    squares: dict[str, float]
    white_error: float
    tau_start: float
    probability: float


def basis(tau: Array) -> Array:
    """Return what each term adds to the variance at averaging times `tau` (s) with coefficient 1, (k, 4)."""
    return np.stack([3.0 / tau**2, 1.0 / tau, np.full_like(tau, 2.0 * np.log(2.0) / np.pi), tau / 3.0], axis=1)


def dominant(squares: Array, tau: Array) -> list[str]:
    """Return the kind of noise that adds most at each averaging time (s), for squares (4,) in the order of `TERMS`."""
    names = list(TERMS)
    return [names[k] for k in np.argmax(basis(tau) * squares, axis=1)]


def correlation(tau: Array, squares: Array) -> Array:
    r"""Return how the estimates at different averaging times hang together, (k, k), for squares (4,) as in `TERMS`.

    The estimator is the power behind a filter with :math:`|H|^2 = 2 \sin^4(\pi f \tau) / (\pi f \tau)^2`, and the
    covariance of two such powers of a Gaussian noise of density S goes as :math:`\int |H_1|^2 |H_2|^2 S^2 df`.
    """
    frequency = np.geomspace(0.02 / tau[-1], 0.5 / tau[0], _GRID)
    omega = 2.0 * np.pi * frequency
    density = squares @ np.stack([omega**2, np.ones_like(omega), 1.0 / omega, 1.0 / omega**2])
    phase = np.pi * frequency * tau[:, None]
    powers = np.sin(phase) ** 4 / phase**2 * density * np.sqrt(frequency)
    joint = powers @ powers.T
    size = np.sqrt(np.diag(joint))
    return np.asarray(joint / np.outer(size, size) + 1e-9 * np.eye(tau.size))


def fit(tau: Array, variance: Array, freedom: Callable[[str, int], float]) -> Fitted | None:
    """Fit the terms; None where there are fewer than four octaves.

    Parameters
    ----------
    tau : (k,) array
        Averaging times an octave apart, s, ascending.
    variance : (k,) array
        Allan variances.
    freedom : callable
        Equivalent degrees of freedom of point i under a kind of noise.
    """
    usable = np.isfinite(variance) & (variance > 0.0)
    if np.count_nonzero(usable) < _LEAST:
        return None
    rows = np.flatnonzero(usable)
    found = best = _fit(tau, variance, rows, freedom)
    if found.probability >= _ACCEPTED:
        return found
    last = len(rows) - _LEAST
    for first in range(1, last + 1):
        before, found = found, _fit(tau, variance, rows[first:], freedom)
        best = max(best, found, key=lambda each: each.probability)
        # Where the sensor's filter bends the curve, its foot still pulls at the first fits that pass.
        level = found.squares["white"] <= before.squares["white"] + before.white_error
        if before.probability >= _ACCEPTED and level:
            return _fit(tau, variance, rows[min(first + _FOOT, last) :], freedom)
    return best


def _fit(tau: Array, variance: Array, rows: NDArray[np.intp], freedom: Callable[[str, int], float]) -> Fitted:
    """Fit the terms to some of the points."""
    from scipy.optimize import nnls  # noqa: PLC0415 - takes 11 MB that most commands do not need

    # In units of the largest, so that no square of a variance leaves the range of the numbers.
    level = variance[rows].max()
    design, measured = basis(tau[rows]), variance[rows] / level
    if rows[0] > 0:
        # Behind a filter quantisation cannot be seen, and would only take up what is left of the filter's bend.
        design[:, 0] = 0.0
    model = measured.copy()
    kinds = ["white"] * len(rows)
    squares = np.array([0.0, 1.0, 0.0, 0.0])
    whitening, freedoms = np.eye(len(rows)), np.ones(len(rows))
    for _ in range(_ROUNDS):
        # The scatter is that of the model: a point that came out low by chance is not surer for it.
        freedoms = np.array([freedom(kind, int(row)) for kind, row in zip(kinds, rows, strict=True)])
        spread = model * np.sqrt(2.0 / freedoms)
        whitening = np.linalg.inv(np.linalg.cholesky(correlation(tau[rows], squares))) / spread
        squares = nnls(whitening @ design, whitening @ measured)[0]
        model = np.maximum(design @ squares, 1e-3 * measured)
        kinds = dominant(squares, tau[rows])
    # The likelihood ratio of variances, which few degrees of freedom leave far from normal.
    over = measured / (design @ squares)
    misfit = float(np.sum(freedoms * (over - 1.0 - np.log(over))))
    left = max(1, len(rows) - int(np.count_nonzero(squares)))
    probability = float(gammaincc(0.5 * left, 0.5 * misfit))
    # If the terms do not fit the curve, the misfit determines their uncertainty.
    inflation = np.sqrt(max(1.0, misfit / left))
    errors = level * inflation * _errors(whitening @ design, squares)
    squares = level * squares
    terms = {name: _term(squares[k], errors[k]) for k, name in enumerate(TERMS)}
    if rows[0] > 0:
        terms["quantisation"] = Term(None, None, float("nan"))
    fitted = Fitted(
        terms, dict(zip(TERMS, squares.tolist(), strict=True)), float(errors[1]), float(tau[rows[0]]), probability
    )
    return _at_the_ends(fitted, tau[rows])


def _errors(weighted: Array, squares: Array) -> Array:
    """Return standard errors of the squares: each among those above 0 and itself."""
    active = squares > 0.0
    errors = np.empty_like(squares)
    for k in range(squares.size):
        chosen = np.flatnonzero(active | (np.arange(squares.size) == k))
        normal = weighted[:, chosen].T @ weighted[:, chosen]
        at = int(np.flatnonzero(chosen == k)[0])
        errors[k] = np.sqrt(np.linalg.pinv(normal, hermitian=True)[at, at])
    return errors


def _term(square: float, error: float) -> Term:
    bound = float(np.sqrt(square + _BOUND * error))
    if square <= _SURE * error or square == 0.0:
        return Term(None, None, bound)
    value = float(np.sqrt(square))
    return Term(value, float(error / (2.0 * value)), bound)


def _at_the_ends(fitted: Fitted, tau: Array) -> Fitted:
    """Hide a bias instability that nothing but the last point shows: it needs a floor, not the foot of a slope."""
    term = fitted.terms["flicker"]
    if term.value is None:
        return fitted
    squares = np.array(list(fitted.squares.values()))
    shares = basis(tau) * squares
    floor = shares[:, 2] >= 0.5 * shares.sum(axis=1)
    if np.count_nonzero(floor) >= 2:
        return fitted
    return replace(fitted, terms={**fitted.terms, "flicker": Term(None, None, term.at_most)})
