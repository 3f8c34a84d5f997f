"""Values that stand still while the body moves.

A sensor repeats a value for many reasons: it rests and its steps are coarse, it is read more often than it samples, its
axis does not take part in the motion. So standing still alone is no fault. It is one where a value is repeated, bit for
bit, at least `SAMPLES` times and for much longer than is usual in this log, while by the reference the reading should
have changed by many times the steps and the noise of the channel, and by more than `MOVED`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from imufit import _imufit
from imufit.faults.row_fault import SENSORS, RowFault
from imufit.log import Chunk, Log

Array = NDArray[np.float64]

SAMPLES: Final = 8
USUAL: Final = 4
"""Times longer than nearly all repetitions of the channel."""
STEPS: Final = 10.0
"""Times the noise and the step of the channel by which the reading should have changed."""
MOVED: Final = {"acc": 1.0, "gyr": 0.2, "mag": 5.0}
"""Least change, m/s^2, rad/s and uT."""
_MOST: Final = 20


def stuck(chunk: Chunk) -> list[RowFault]:
    """Find values that stand still in the core rows of a chunk.

    Parameters
    ----------
    chunk : Chunk
        Rows with margins, so that repetitions are seen in their full length.
    """
    log = chunk.log
    if log.ref_q is None:
        return []
    found: dict[tuple[str, int, int], dict[int, float]] = {}
    for sensor in SENSORS:
        column = getattr(log, sensor)
        if column is None:
            continue
        rows = np.flatnonzero(np.isfinite(column).all(axis=1))
        if rows.size < 4 * SAMPLES:
            continue
        for axis in range(3):
            for first, last in _suspicious(column[rows, axis]):
                low, high = int(rows[first]), int(rows[last])
                moved = _expected_change(log, sensor, axis, low, high)
                steps = np.abs(np.diff(column[rows, axis]))
                steps = steps[steps > 0.0]
                smallest = float(steps.min() + np.median(steps)) if steps.size else 0.0
                if moved > max(MOVED[sensor], STEPS * smallest):
                    found.setdefault((sensor, low, high), {})[axis] = moved
    return [_fault(chunk, *key, axes) for key, axes in found.items() if key[1] < chunk.end and key[2] >= chunk.begin]


def _fault(chunk: Chunk, sensor: str, low: int, high: int, axes: dict[int, float]) -> RowFault:
    low, high = max(low, chunk.begin), min(high, chunk.end - 1)
    t = chunk.log.t
    row = chunk.start - chunk.begin
    named = "".join("xyz"[axis] for axis in sorted(axes))
    span = row + low, row + high + 1
    value = getattr(chunk.log, sensor)[low, min(axes)]
    figures = {"moved": max(axes.values()), "value": float(value)}
    return RowFault("stuck", (sensor,), named, *span, float(t[low]), float(t[high]), figures)


def _suspicious(values: Array) -> list[tuple[int, int]]:
    """First and last sample of repetitions that are much longer than is usual, the longest first."""
    edges = np.flatnonzero(np.concatenate(([True], values[1:] != values[:-1], [True])))
    lengths = np.diff(edges)
    longest = np.argsort(lengths)[::-1][:_MOST]
    longest = longest[lengths[longest] >= SAMPLES]
    if not longest.size:
        return []
    others = np.delete(lengths, longest)
    usual = float(np.quantile(others, 0.99)) if others.size else 1.0
    top, bottom = values.max(), values.min()
    found = []
    for k in longest:
        value = values[edges[k]]
        # At the end of its range a reading stands still for another reason; a dead channel has no other value.
        at_end = (value == top) != (value == bottom)
        if lengths[k] > USUAL * usual and not at_end:
            found.append((int(edges[k]), int(edges[k + 1]) - 1))
    return found


def _expected_change(log: Log, sensor: str, axis: int, low: int, high: int) -> float:
    """By how much the reading of an axis should have changed by the reference between two rows."""
    assert log.ref_q is not None
    rows = low + np.flatnonzero(np.isfinite(log.ref_q[low : high + 1]).all(axis=1))
    if rows.size < SAMPLES or log.t[rows[-1]] - log.t[rows[0]] < 0.5 * (log.t[high] - log.t[low]):
        return 0.0
    turned = Rotation.from_quat(log.ref_q[rows][:, [1, 2, 3, 0]])
    if sensor == "gyr":
        width = max(5, rows.size // 6)
        if rows.size < 2 * width:
            return 0.0
        vector = (turned[:-width].inv() * turned[width:]).as_rotvec()
        expected = vector / (log.t[rows[width:]] - log.t[rows[:-width]])[:, None]
    else:
        expected = turned.inv().apply(_direction(log, sensor))
    return float(np.ptp(expected[:, axis]))


def _direction(log: Log, sensor: str) -> Array:
    """Return what the sensor reads at rest, in the reference frame."""
    if sensor == "acc":
        return log.metadata.gravity * np.array(_imufit.frame_vectors(log.metadata.frame)["up"])
    if log.metadata.mag_reference is not None:
        return np.array(log.metadata.mag_reference)
    assert log.ref_q is not None
    assert log.mag is not None
    known = np.isfinite(log.mag).all(axis=1) & np.isfinite(log.ref_q).all(axis=1)
    if not known.any():
        return np.zeros(3)
    mean: Array = Rotation.from_quat(log.ref_q[known][:, [1, 2, 3, 0]]).apply(log.mag[known]).mean(axis=0)
    return mean
