"""The recorder of the reference: it may be late, on a clock of its own, and smooth what it records.

A smoothed reference is an average of poses over times before and after its own: as many attitudes and positions of the
motion as the average needs, with the attitude nearest to all of them (the chordal mean of rotations), and positions
added up. Nothing is expanded in a series.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from imufit.lab.simulate.motion import Array
from imufit.lab.simulate.truth import Kinematics, Trajectory, turn

NODES = 12
"""Nodes of the quadrature to either side: an average over 30 ms of motion up to 5 Hz is exact to 1e-9."""

_PAST, _WEIGHT = (np.asarray(part, dtype=np.float64) for part in np.polynomial.laguerre.laggauss(NODES))
OFFSETS: Array = np.concatenate([-_PAST[::-1], _PAST])
WEIGHTS: Array = 0.5 * np.concatenate([_WEIGHT[::-1], _WEIGHT])
"""Times, in time constants, and weights of an average with weights that fall off exponentially to both sides."""


@dataclass(frozen=True)
class Recorder:
    """Records the motion of a body.

    Attributes
    ----------
    delay : time (s) by which each pose is recorded too late.
    skew : what the clock of the reference gains on that of the sensors, s/s.
    start : time (s) at which both clocks show the same.
    smoothing : half the variance (s^2) of the times over which poses are averaged: the square of the time constant of a
        low-pass of first order that runs over the recording forwards and backwards.
    """

    delay: float = 0.0
    skew: float = 0.0
    start: float = 0.0
    smoothing: float = 0.0

    def times(self, t: Array) -> Array:
        """Return when what is recorded at stamps `t` (n,), s, happened.

        Parameters
        ----------
        t : ndarray
            (n,) stamps of the reference, s.
        """
        late = t - self.delay
        return late if self.skew == 0.0 else self.start + (late - self.start) / (1.0 + self.skew)

    def poses(self, trajectory: Trajectory, t: Array) -> Kinematics:
        """Return the recorded motion at stamps `t` (n,), s, its derivatives by the recorder's own clock.

        Parameters
        ----------
        trajectory : Trajectory
            The motion.
        t : ndarray
            (n,) stamps of the reference, s.
        """
        then = self.times(t)
        found = trajectory.at(then) if self.smoothing == 0.0 else self._averaged(trajectory, then)
        return _at_pace(found, 1.0 / (1.0 + self.skew))

    def averaged(self, course: Callable[[Array], Array], t: Array) -> Array:
        """Return a recorded scalar course (n,) at stamps `t` (n,), s.

        Parameters
        ----------
        course : callable
            The course, of times (n,), s.
        t : ndarray
            (n,) stamps of the reference, s.
        """
        then = self.times(t)
        if self.smoothing == 0.0:
            return course(then)
        constant = float(np.sqrt(self.smoothing))
        total = np.zeros_like(t)
        for offset, weight in zip(OFFSETS, WEIGHTS, strict=True):
            total += weight * course(then + constant * offset)
        return total

    def _averaged(self, trajectory: Trajectory, t: Array) -> Kinematics:
        constant = float(np.sqrt(self.smoothing))
        mean, slope, bend = (np.zeros((t.size, 3, 3)) for _ in range(3))
        position, velocity, acceleration = (np.zeros((t.size, 3)) for _ in range(3))
        for offset, weight in zip(OFFSETS, WEIGHTS, strict=True):
            at = trajectory.at(t + constant * offset)
            turning = _cross(at.omega)
            mean += weight * at.rotation
            slope += weight * at.rotation @ turning
            bend += weight * at.rotation @ (turning @ turning + _cross(at.alpha))
            position += weight * at.position
            velocity += weight * at.velocity
            acceleration += weight * at.acceleration
        return Kinematics(*_nearest(mean, slope, bend), position, velocity, acceleration)


def _nearest(mean: Array, slope: Array, bend: Array) -> tuple[Array, Array, Array]:
    """Return the rotations nearest to matrices (n, 3, 3), and their body rate and angular acceleration, (n, 3) each.

    `slope` and `bend` are the matrices' first two derivatives. With the polar decomposition M = R S, R^T dM/dt =
    [omega] S + dS/dt, whose antisymmetric part is that of [(tr S - S) omega].
    """
    rotation = np.asarray(Rotation.from_matrix(mean).as_matrix(), dtype=np.float64)
    back = np.swapaxes(rotation, 1, 2)
    stretch = back @ mean
    stretch = 0.5 * (stretch + np.swapaxes(stretch, 1, 2))
    turned = back @ slope
    lever = _lever(stretch)
    omega = _solved(lever, _axial(turned))
    turning = _cross(omega)
    stretching = turned - turning @ stretch
    right = _axial(back @ bend - turning @ turned) - turn(_lever(stretching), omega)
    return rotation, omega, _solved(lever, right)


def _solved(matrix: Array, right: Array) -> Array:
    """Return the vectors (n, 3) that matrices (n, 3, 3) turn into `right` (n, 3)."""
    return np.asarray(np.linalg.solve(matrix, right[:, :, None])[:, :, 0], dtype=np.float64)


def _lever(stretch: Array) -> Array:
    """Return tr(S) 1 - S, (n, 3, 3)."""
    trace: Array = np.trace(stretch, axis1=1, axis2=2)
    return trace[:, None, None] * np.eye(3) - stretch


def _axial(matrix: Array) -> Array:
    """Return the vectors (n, 3) whose cross products are X - X^T, of matrices X (n, 3, 3)."""
    odd = matrix - np.swapaxes(matrix, 1, 2)
    return np.stack([odd[:, 2, 1], odd[:, 0, 2], odd[:, 1, 0]], axis=1)


def _cross(v: Array) -> Array:
    """Return the matrices (n, 3, 3) of cross products with vectors (n, 3)."""
    x, y, z = v.T
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)


def _at_pace(motion: Kinematics, pace: float) -> Kinematics:
    """Return a motion with its derivatives by a clock on which it goes `pace` times as fast."""
    if pace == 1.0:
        return motion
    return Kinematics(
        motion.rotation,
        pace * motion.omega,
        pace**2 * motion.alpha,
        motion.position,
        pace * motion.velocity,
        pace**2 * motion.acceleration,
    )
