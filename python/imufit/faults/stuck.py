"""Values that stand still while the body moves.

A sensor repeats a value for many reasons: it rests and its steps are coarse, it is read more often than it samples, its
axis does not take part in the motion. So a constant value alone is not a fault. It is one where a value is repeated,
bit for bit, at least `SAMPLES` times and for much longer than is usual in this log, while by the reference the reading
should
have changed by many times the steps and the noise of the channel, and by more than `MOVED`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from imufit import _imufit
from imufit.faults.row_fault import SENSORS, RowFault, runs
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
        rows = np.empty(0, np.intp) if column is None else np.flatnonzero(np.isfinite(column).all(axis=1))
        for axis in range(3) if rows.size >= 4 * SAMPLES else ():
            values = column[rows, axis]
            for first, last in _suspicious(values):
                low, high = int(rows[first]), int(rows[last])
                moved = _expected_change(log, sensor, axis, low, high)
                if moved > MOVED[sensor] and moved > STEPS * _noise_and_step(values):
                    found.setdefault((sensor, low, high), {})[axis] = moved
    return [
        part
        for (sensor, low, high), axes in found.items()
        for part in RowFault.within(
            chunk, (low, high), "stuck", (sensor,), "".join("xyz"[axis] for axis in axes), moved=max(axes.values())
        )
    ]


def _noise_and_step(values: Array) -> float:
    steps = np.abs(np.diff(values))
    steps = steps[steps > 0.0]
    return float(steps.min() + np.median(steps)) if steps.size else 0.0


def _suspicious(values: Array) -> list[tuple[int, int]]:
    """First and last sample of repetitions that are much longer than is usual, the longest first."""
    spans = runs(values)
    lengths = spans[:, 1] - spans[:, 0]
    longest = np.argsort(lengths)[::-1][:_MOST]
    longest = longest[lengths[longest] >= SAMPLES]
    others = np.delete(lengths, longest)
    usual = float(np.quantile(others, 0.99)) if others.size else 1.0
    top, bottom = values.max(), values.min()
    # At the end of its range a reading stands still for another reason; a dead channel has no other value.
    at_end = (values[spans[:, 0]] == top) != (values[spans[:, 0]] == bottom)
    return [(int(spans[k, 0]), int(spans[k, 1]) - 1) for k in longest if lengths[k] > USUAL * usual and not at_end[k]]


def _expected_change(log: Log, sensor: str, axis: int, low: int, high: int) -> float:
    """By how much the reading of an axis should have changed by the reference between two rows."""
    assert log.ref_q is not None
    rows = low + np.flatnonzero(np.isfinite(log.ref_q[low : high + 1]).all(axis=1))
    if rows.size < SAMPLES or log.t[rows[-1]] - log.t[rows[0]] < 0.5 * (log.t[high] - log.t[low]):
        return 0.0
    turned = Rotation.from_quat(log.ref_q[rows], scalar_first=True)
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
    mean: Array = Rotation.from_quat(log.ref_q[known], scalar_first=True).apply(log.mag[known]).mean(axis=0)
    return mean
