"""A residual that jumps between two levels (random telegraph noise): a loose contact, popcorn noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WINDOWS = (0.2, 0.4, 0.8)
"""Times over which the residual is averaged, s, the shortest first, ..."""
WINDOW_ROWS = 8
"""... at least so many rows."""
CLEAR = 5.0
"""Differences that are jumps stand out of the usual ones this many times."""
ALIKE = 0.3
"""Jumps differ from their middle size by no more than this part, half of them."""
FEWEST = 8
"""Jumps that chance does not make ..."""
IN_TURN = 0.9
"""... if so many of them are up and down in turn: both jumps of a visit that is shorter than a window may be lost."""
FEWEST_WINDOWS = 60
"""Fewer windows are not informative."""
STAYING = 0.7
"""Part of the size of the jumps by which the levels between them differ."""
SURE = 8.0
"""... and its standard errors: noise that is louder for a while jumps, too, but does not stay on a level."""


@dataclass(frozen=True)
class TelegraphNoise:
    """Jumps of a residual between two levels.

    Attributes
    ----------
    size : float
        Difference of the levels.
    first : float
        When the first jump comes, s.
    count : int
        Number of jumps.
    upper : float
        Part of the time on the level that is rarer.
    """

    size: float
    first: float
    count: int
    upper: float


def telegraph_noise(t: Array, residual: Array) -> TelegraphNoise | None:
    """Find whether a residual jumps between two levels.

    Noise of any colour has differences of all sizes, a burst of noise has jumps of all sizes, and a bias random walk
    does not return to its earlier value.

    Parameters
    ----------
    t, residual : ndarray
        (n,) time stamps, s, and residual; NaN where there is none.
    """
    known = np.isfinite(residual)
    t, residual = t[known], residual[known]
    if len(t) < 2:
        return None
    dt = float(np.median(np.diff(t)))
    tried = (_jumps(t, residual, max(WINDOW_ROWS, round(window / dt))) for window in WINDOWS)
    return next((found for found in tried if found is not None), None)


def _stay(means: Array, peaks: list[int], upper: NDArray[np.bool_], size: float) -> bool:
    """Return whether means stay on two levels between jumps at these places, away from the jumps themselves.

    `upper` states for each stay, those before the first and after the last jump too, whether it is on the upper level.
    """
    number = np.arange(len(means))
    middles = np.asarray(peaks) + 1
    away = np.min(np.abs(number[:, None] - middles), axis=1) > 1
    high = upper[np.searchsorted(middles, number)]
    levels = [means[away & side] for side in (high, ~high)]
    if min(map(len, levels)) < FEWEST:
        return False
    apart = abs(float(levels[0].mean() - levels[1].mean()))
    error = float(np.sqrt(sum(level.var() / len(level) for level in levels)))
    return apart >= max(STAYING * size, SURE * error)


def _jumps(t: Array, residual: Array, rows: int) -> TelegraphNoise | None:
    """Find jumps between means of so many rows."""
    windows = len(t) // rows
    if windows < FEWEST_WINDOWS:
        return None
    means = residual[: windows * rows].reshape(windows, rows).mean(axis=1)
    # The window between the two may hold the jump.
    change = means[2:] - means[:-2]
    usual = 1.4826 * float(np.median(np.abs(change)))
    high = np.abs(change) > CLEAR * usual
    edges = np.flatnonzero(np.diff(high, prepend=False, append=False))
    peaks = [begin + int(np.argmax(np.abs(change[begin:end]))) for begin, end in edges.reshape(-1, 2)]
    if len(peaks) < FEWEST:
        return None
    sizes = change[peaks]
    middle = float(np.median(np.abs(sizes)))
    in_turn = np.mean(np.sign(sizes[1:]) == -np.sign(sizes[:-1])) >= IN_TURN
    alike = float(np.median(np.abs(np.abs(sizes) - middle))) < 0.5 * ALIKE * middle
    if not (in_turn and alike):
        return None
    # After a jump up the residual is on the upper level; before the first one on the level that it leaves.
    upper = np.concatenate([[sizes[0] < 0.0], sizes > 0.0])
    if not _stay(means, peaks, upper, middle):
        return None
    at = t[[(k + 1) * rows for k in peaks]]
    stays = np.diff(np.concatenate([[t[0]], at, [t[-1]]]))
    share = float(np.sum(stays[upper]) / np.sum(stays))
    return TelegraphNoise(middle, float(at[0]), len(peaks), min(share, 1.0 - share))
