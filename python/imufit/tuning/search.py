"""Search for the least value over positive gains: a coarse grid over their logarithms, then steps that halve."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_COARSE = {1: 33, 2: 13, 3: 7}
"""Points of the grid along each gain."""
_SCATTERED = 512
_FINE = np.log(1.02)
_MOVES = 6


def coarse(low: Array, high: Array) -> Array:
    """Return points (k, d) over the box: a grid for up to three gains, scattered ones (Sobol) for more."""
    d = low.size
    if d in _COARSE:
        axis = np.linspace(0.0, 1.0, _COARSE[d])
        unit = np.array(list(product(axis, repeat=d)))
    else:
        from scipy.stats import qmc  # noqa: PLC0415  takes a second to load, and few filters need it

        unit = qmc.Sobol(d, seed=1).random(_SCATTERED)
    return np.asarray(low + unit * (high - low))


def refine(
    value: Callable[[Array], Array], best: Array, least: float, low: Array, high: Array, step: Array
) -> tuple[Array, float]:
    """Return the point around `best` with the least value, found by steps that halve until they are 2 %.

    Parameters
    ----------
    value : callable
        Values (k,) of points (k, d); all points of a step are requested at once.
    best : (d,) array
        Where to begin, logarithms.
    least : float
        The value there.
    low, high : (d,) array
        Box.
    step : (d,) array
        First step.
    """
    d = best.size
    around = np.array([each for each in product((-1.0, 0.0, 1.0), repeat=d) if any(each)])
    if d > 3:
        around = np.concatenate([np.eye(d), -np.eye(d)])
    step = step.copy()
    while step.max() > _FINE:
        for _ in range(_MOVES):
            points = np.clip(best + around * step, low, high)
            values = np.where(np.isfinite(found := value(points)), found, np.inf)
            at = int(np.argmin(values))
            if not values[at] < least:
                break
            best, least = points[at], float(values[at])
        step = 0.5 * step
    return best, least
