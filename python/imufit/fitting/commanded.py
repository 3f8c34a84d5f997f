"""Attitude of a one-axis rig from its commanded angle, where the measured one is the same but for its noise."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from imufit.log import Log

Array = NDArray[np.float64]

LESS_NOISE = 0.3
"""Part of the measured angle's fourth differences, to which motion adds little, that the commanded one's may have."""
GROUPS = 32
ONLY_NOISE = 2.0
"""Groups of rows, by time and by angle, may differ by this many times the variance that noise gives their means."""
LEAST_ROWS = 16
"""... of which groups with fewer rows say nothing."""


@dataclass(frozen=True)
class CommandedAttitude:
    """Attitude of a rig at the angle zero, and the axis about which it turns.

    Attributes
    ----------
    axis : int
        0, 1, 2 for the body's x, y, z.
    zero : Rotation
        Body to reference frame at the angle zero.
    """

    axis: int
    zero: Rotation

    @classmethod
    def of(cls, parts: Iterable[Log], axis: int) -> CommandedAttitude | None:
        """Take the commanded angle for the reference if the measured attitude adds nothing to it but noise.

        Parameters
        ----------
        parts : iterable of Log
            The log, part by part.
        axis : int
            Axis of the rig.

        Returns
        -------
        CommandedAttitude or None
            None if the log has not both, if the angle is not less noisy, or if they differ by more than noise: then the
            measured attitude adds information.
        """
        attitudes, angles = [], []
        for part in parts:
            if part.ref_q is None or part.ref_angle is None:
                return None
            known = np.isfinite(part.ref_q[:, 0]) & np.isfinite(part.ref_angle)
            attitudes.append(part.ref_q[known])
            angles.append(part.ref_angle[known])
        q, angle = np.concatenate(attitudes), np.concatenate(angles)
        if angle.size < GROUPS * LEAST_ROWS:
            return None
        zeros = Rotation.from_quat(q, scalar_first=True) * Rotation.from_rotvec(-np.outer(angle, np.eye(3)[axis]))
        apart = (zeros[0].inv() * zeros).as_rotvec()
        measured = angle + apart[:, axis]
        if not _roughness(angle) < LESS_NOISE * _roughness(measured):
            return None
        mean = apart.mean(axis=0)
        if not _only_noise(apart - mean, angle):
            return None
        return cls(axis, zeros[0] * Rotation.from_rotvec(mean))

    def attitude(self, angle: Array) -> Array:
        """Return the attitude at commanded angles.

        Parameters
        ----------
        angle : ndarray
            (n,) rad; NaN where it is not known.

        Returns
        -------
        ndarray
            (n, 4) unit quaternions, scalar first, body to reference frame; NaN where the angle is not known.
        """
        out = np.full((angle.size, 4), np.nan)
        known = np.isfinite(angle)
        turned = self.zero * Rotation.from_rotvec(np.outer(angle[known], np.eye(3)[self.axis]))
        out[known] = turned.as_quat(scalar_first=True)
        return out


def _roughness(angle: Array) -> float:
    return float(np.median(np.abs(np.diff(angle, 4))))


def _only_noise(apart: Array, angle: Array) -> bool:
    """Return whether differences (n, 3) depend neither on time nor on the angle and the direction of travel."""
    variance = np.mean(np.diff(apart, axis=0) ** 2, axis=0) / 2.0
    if not np.all(variance > 0.0):
        return False
    n = angle.size
    ranks = np.argsort(np.argsort(angle, kind="stable"), kind="stable")
    upwards = np.gradient(angle) > 0.0
    by_time = np.arange(n) * GROUPS // n
    by_angle = 2 * (ranks * GROUPS // n) + upwards
    return all(_alike(apart, group, variance) for group in (by_time, by_angle))


def _alike(apart: Array, group: NDArray[np.int64], variance: Array) -> bool:
    counts = np.bincount(group)
    means = np.stack([np.bincount(group, weights=column) for column in apart.T], axis=1)
    told = counts >= LEAST_ROWS
    squares = means[told] ** 2 / counts[told, None] / variance
    return bool(np.all(squares.mean(axis=0) < ONLY_NOISE))
