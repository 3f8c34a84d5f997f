"""Rests, moves and knocks of a log, from its reference and its accelerometer alone.

The errors of all methods are judged over the same stretches, so that no method chooses its own.

- A **rest** is a stretch of at least `REST` in which the reference turns by no more than `STILL` (and six times its
  own noise) within any half second.
- A **move** is what lies between two rests that differ by `MOVED` or more; it ends where the next rest begins.
- A **vibration** is a stretch of a rest in which the specific force's fluctuations, root mean square over 0.2 s and
  over all three axes, exceed `SHAKEN` times their median over the log's rests. All axes: a blow from the side turns the
  vertical that the accelerometer shows and hardly changes the length of its reading. The half second beside a move
  belongs to the move.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d

from imufit.log.segments import gaps

Array = NDArray[np.float64]
Rows = tuple[int, int]

REST = 0.5
"""Shortest rest, s."""
STILL = np.radians(0.1)
"""How far the reference may turn within `REST` at rest, rad."""
MOVED = np.radians(0.5)
"""Least turn between two rests that makes a move, rad."""
SHAKEN = 3.0
"""Fluctuation of the specific force over its usual size that makes a vibration."""

_MOST_STILL = np.radians(0.5)
_LEAST_FLUCTUATION = 0.01
"""m/s^2: below it, and below half a step of the readings, a fluctuation is the sensor's resolution."""
_WINDOW = 0.2
_SLOW = 1.0
_BESIDE_A_MOVE = 0.5
_APART = 0.5


@dataclass(frozen=True)
class Rest:
    """Rows ``start <= row < stop`` at rest.

    Parameters
    ----------
    start, stop : int
        Rows.
    turn : float
        Turn since the rest before (or since the log's first row), rad; 0 where the rest begins with the log.
    after_move : bool
        Whether a move led here.
    before_move : bool
        Whether the reference moves on afterwards, before the log or its reference ends.
    """

    start: int
    stop: int
    turn: float
    after_move: bool
    before_move: bool


@dataclass(frozen=True)
class Stretches:
    """The stretches of a log's time.

    Parameters
    ----------
    rests : tuple of Rest
        In order.
    moving : (n,) array of bool
        Rows with a reference that belong to no rest.
    vibrations : tuple of (int, int)
        Row ranges, each within one rest.
    """

    rests: tuple[Rest, ...]
    moving: NDArray[np.bool_]
    vibrations: tuple[Rows, ...]

    @property
    def moves(self) -> tuple[Rest, ...]:
        """Rests that a move led to."""
        return tuple(rest for rest in self.rests if rest.after_move)


def find_stretches(t: Array, ref_q: Array, acc: Array | None) -> Stretches:
    """Find the rests, moves and vibrations of a log.

    Parameters
    ----------
    t : (n,) array
        Time, s.
    ref_q : (n, 4) array
        Reference attitude, scalar first; NaN where there is none.
    acc : (n, 3) array or None
        Specific force, m/s^2; NaN where there is none.
    """
    known = np.flatnonzero(np.isfinite(ref_q).all(axis=1))
    if known.size < 3:
        return Stretches((), np.zeros(t.size, np.bool_), ())
    step = float(np.median(np.diff(t)))
    still = _still_rows(t, ref_q, known, step)
    rests = _rests(t, ref_q, known, still, step)
    moving: NDArray[np.bool_] = np.asarray(np.isfinite(ref_q).all(axis=1))
    for rest in rests:
        moving[rest.start : rest.stop] = False
    return Stretches(rests, moving, () if acc is None else _vibrations(t, acc, rests, step))


def _still_rows(t: Array, ref_q: Array, known: NDArray[np.intp], step: float) -> NDArray[np.bool_]:
    """Rows within half a second of which the reference keeps its attitude."""
    latest = np.maximum.accumulate(
        np.where(np.isin(np.arange(t.size), known, assume_unique=True), np.arange(t.size), 0)
    )
    latest[: known[0]] = known[0]
    fresh = np.abs(t - t[latest]) <= max(REST, 2.0 * float(np.median(np.diff(t[known]))))
    elements = _matrix(ref_q[latest])
    # Second differences of a rotation's elements: sqrt(2) times those of its angle, and those have variance 6.
    bends = np.linalg.norm(np.diff(_matrix(ref_q[known]), 2, axis=0), axis=1) / np.sqrt(2.0)
    noise = float(np.quantile(bends, 0.25)) / (0.319 * np.sqrt(6.0))
    window = _odd(REST / step, t.size)
    spread = maximum_filter1d(elements, window, axis=0) - minimum_filter1d(elements, window, axis=0)
    centre = spread.max(axis=1) <= min(STILL + 6.0 * noise, _MOST_STILL)
    return np.asarray(maximum_filter1d(centre.astype(np.uint8), window).astype(np.bool_) & fresh)


def _rests(t: Array, ref_q: Array, known: NDArray[np.intp], still: NDArray[np.bool_], step: float) -> tuple[Rest, ...]:
    found: list[Rest] = []
    first, last = int(known[0]), int(known[-1])
    before = ref_q[first]
    for part_start, part_stop in gaps(t, max(10.0, 1.0 / step)):
        for start, stop in _runs(still[part_start:part_stop], part_start):
            inside = known[(known >= start) & (known < stop)]
            if t[stop - 1] - t[start] + step < REST or not inside.size:
                continue
            middle = ref_q[inside[inside.size // 2]]
            turn = _angle(before, middle) if start > first else 0.0
            moved, moves = turn >= MOVED and start > part_start, stop <= last and stop < part_stop
            found.append(Rest(start, stop, turn, bool(moved), bool(moves)))
            before = middle
    return tuple(found)


def _vibrations(t: Array, acc: Array, rests: tuple[Rest, ...], step: float) -> tuple[Rows, ...]:
    margin = round(_BESIDE_A_MOVE / step)
    power = np.full(t.size, np.nan)
    for rest in rests:
        force = acc[rest.start : rest.stop]
        seen = np.isfinite(force).all(axis=1)
        if np.count_nonzero(seen) < 8:
            continue
        force = force[seen]
        slow = uniform_filter1d(force, _odd(_SLOW / step, len(force)), axis=0, mode="nearest")
        window = max(5, _odd(_WINDOW / step, len(force)))
        rows = rest.start + np.flatnonzero(seen)
        power[rows] = np.maximum(uniform_filter1d(((force - slow) ** 2).sum(axis=1), window, mode="nearest"), 0.0)
    if not np.isfinite(power).any():
        return ()
    usual = max(float(np.nanmedian(power)), 3.0 * max(_LEAST_FLUCTUATION, 0.5 * _resolution(acc)) ** 2)
    shaken = np.nan_to_num(power) > SHAKEN**2 * usual
    found: list[Rows] = []
    for rest in rests:
        start = rest.start + (margin if rest.after_move else 0)
        stop = rest.stop - (margin if rest.before_move else 0)
        joined: list[Rows] = []
        for run in _runs(shaken[start:stop], start) if stop > start else []:
            if joined and t[run[0]] - t[joined[-1][1] - 1] < _APART:
                joined[-1] = (joined[-1][0], run[1])
            else:
                joined.append(run)
        found += joined
    return tuple(found)


def _resolution(acc: Array) -> float:
    """Step of the readings, m/s^2: hardly any two that differ do so by less."""
    steps = np.abs(np.diff(acc, axis=0))
    steps = steps[steps > 1e-9]
    return float(np.quantile(steps, 0.01)) if steps.size else 0.0


def _matrix(q: Array) -> Array:
    """Rotation matrices, flattened to (n, 9): their elements turn with the body and do not jump."""
    w, x, y, z = q.T
    return np.stack(
        [
            1 - 2 * (y * y + z * z),
            2 * (x * y - w * z),
            2 * (x * z + w * y),
            2 * (x * y + w * z),
            1 - 2 * (x * x + z * z),
            2 * (y * z - w * x),
            2 * (x * z - w * y),
            2 * (y * z + w * x),
            1 - 2 * (x * x + y * y),
        ],
        axis=1,
    )


def _angle(q: Array, p: Array) -> float:
    """Angle between two attitudes, rad."""
    cosine = min(1.0, abs(float(q @ p)))
    return 2.0 * float(np.arccos(cosine))


def _runs(mask: NDArray[np.bool_], offset: int) -> list[Rows]:
    """Ranges of consecutive true rows."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [(int(a) + offset, int(b) + offset) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _odd(rows: float, n: int) -> int:
    """Odd number of rows of a window over n rows: beyond twice as many it sees nothing more, but takes its time."""
    return max(3, 2 * round(min(rows, 2.0 * n) / 2.0) + 1)
