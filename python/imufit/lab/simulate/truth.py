"""True rigid-body motion: attitude, position and their exact derivatives at any time.

Conventions: ``rotation`` R takes body vectors into the reference frame (x_n = R x_b). Angular rate ``omega`` and
angular acceleration ``alpha`` are body vectors, position and its derivatives reference-frame vectors. SI units.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from imufit.lab.simulate.motion import Array, Signal, Sum, smooth_step


def rotation_about(axis: Array, angle: Array) -> Array:
    """Return rotation matrices (n, 3, 3) by `angle` (n,) rad about the unit vector `axis`, (3,) or (n, 3)."""
    x, y, z = np.moveaxis(np.broadcast_to(axis, (angle.size, 3)), -1, 0)
    zero = np.zeros(angle.size)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
    sine, versine = np.sin(angle)[:, None, None], 2.0 * np.sin(0.5 * angle)[:, None, None] ** 2
    return np.asarray(np.eye(3) + sine * cross + versine * (cross @ cross), dtype=np.float64)


def rotation_from_vector(phi: Array) -> Array:
    """Return the rotation matrix (3, 3) ``exp([phi]x)`` of the rotation vector `phi` (3,), rad."""
    return np.asarray(Rotation.from_rotvec(phi).as_matrix(), dtype=np.float64)


def quaternion_from_matrix(rotation: Array) -> Array:
    """Return unit quaternions (n, 4), scalar first, without sign jumps, of rotation matrices (n, 3, 3)."""
    xyzw = np.asarray(Rotation.from_matrix(rotation).as_quat(), dtype=np.float64)
    q = xyzw[:, [3, 0, 1, 2]]
    flips = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
    start = -1.0 if q[0, 0] < 0.0 else 1.0
    return q * (start * np.concatenate([[1.0], np.cumprod(flips)]))[:, None]


def turn(rotation: Array, vector: Array) -> Array:
    """Return R x for matrices (n, 3, 3) or (3, 3) and vectors (n, 3) or (3,)."""
    return np.asarray(np.einsum("...ij,...j->...i", rotation, vector), dtype=np.float64)


def turn_back(rotation: Array, vector: Array) -> Array:
    """Return R^T x for matrices (n, 3, 3) or (3, 3) and vectors (n, 3) or (3,)."""
    return turn(np.swapaxes(rotation, -1, -2), vector)


@dataclass(frozen=True)
class Kinematics:
    """The motion of a body frame at n times.

    Attributes
    ----------
    rotation : (n, 3, 3), body to reference frame.
    omega, alpha : (n, 3), body frame, rad/s and rad/s^2.
    position, velocity, acceleration : (n, 3), reference frame, m, m/s, m/s^2.
    """

    rotation: Array
    omega: Array
    alpha: Array
    position: Array
    velocity: Array
    acceleration: Array

    def displaced(self, r: Array) -> Kinematics:
        """Return the motion of the point of this rigid body at `r` (3,), body frame, m.

        Parameters
        ----------
        r : ndarray
            (3,) the point, body frame, m.
        """
        if not np.any(r):
            return self
        swing = np.cross(self.omega, r)
        return replace(
            self,
            position=self.position + turn(self.rotation, r),
            velocity=self.velocity + turn(self.rotation, swing),
            acceleration=self.acceleration + turn(self.rotation, np.cross(self.alpha, r) + np.cross(self.omega, swing)),
        )

    def mounted(self, mount: Array) -> Kinematics:
        """Return the motion of a body frame fixed to this one and turned by `mount` (3, 3), its axes to this body's.

        Parameters
        ----------
        mount : ndarray
            (3, 3) rotation from the new frame's axes to this body's.
        """
        if np.array_equal(mount, np.eye(3)):
            return self
        return replace(
            self,
            rotation=self.rotation @ mount,
            omega=turn_back(mount, self.omega),
            alpha=turn_back(mount, self.alpha),
        )

    def carried(self, base: Array) -> Kinematics:
        """Return the same motion done on a base that is turned by `base` (3, 3) in the reference frame.

        Parameters
        ----------
        base : ndarray
            (3, 3) rotation of the base, reference frame.
        """
        if np.array_equal(base, np.eye(3)):
            return self
        return replace(
            self,
            rotation=base @ self.rotation,
            position=turn(base, self.position),
            velocity=turn(base, self.velocity),
            acceleration=turn(base, self.acceleration),
        )

    def specific_force(self, gravity: Array) -> Array:
        """Return R^T (a - g), shape (n, 3), body frame, m/s^2, for the gravity vector (3,) in the reference frame.

        Parameters
        ----------
        gravity : ndarray
            (3,) gravity, reference frame, m/s^2.
        """
        return turn_back(self.rotation, self.acceleration - gravity)

    def flux_density(self, field: Array) -> Array:
        """Return R^T m, shape (n, 3), body frame, for the field vector (3,) in the reference frame (uT).

        Parameters
        ----------
        field : ndarray
            (3,) magnetic field, reference frame, uT.
        """
        return turn_back(self.rotation, field)


class Turning(NamedTuple):
    """An attitude at n times: rotation (n, 3, 3), body rate and body angular acceleration (n, 3)."""

    rotation: Array
    omega: Array
    alpha: Array

    def then(self, inner: Turning) -> Turning:
        """Return this turning with `inner` carried by it (rotation = self.rotation inner.rotation)."""
        omega = turn_back(inner.rotation, self.omega)
        return Turning(
            self.rotation @ inner.rotation,
            omega + inner.omega,
            turn_back(inner.rotation, self.alpha) - np.cross(inner.omega, omega) + inner.alpha,
        )


class Link(Protocol):
    """A part of a chain whose attitude relative to the part before it is known at any time."""

    def turning(self, t: Array) -> Turning:
        """Return the relative attitude at times `t` (s), shape (n,)."""


@dataclass(frozen=True)
class Fixed:
    """A link that does not move: `matrix` (3, 3)."""

    matrix: Array

    def turning(self, t: Array) -> Turning:
        """Return the relative attitude at times `t` (s), shape (n,)."""
        still = np.zeros((t.size, 3))
        return Turning(np.broadcast_to(self.matrix, (t.size, 3, 3)), still, still)


@dataclass(frozen=True)
class Joint:
    """A hinge about `axis`, a unit vector (3,), whose angle (rad) follows `angle`."""

    axis: Array
    angle: Signal

    def turning(self, t: Array) -> Turning:
        """Return the relative attitude at times `t` (s), shape (n,)."""
        angle = self.angle.at(t)
        return Turning(
            rotation_about(self.axis, angle.value),
            np.multiply.outer(angle.rate, self.axis),
            np.multiply.outer(angle.acceleration, self.axis),
        )


@dataclass(frozen=True)
class Legs:
    """Attitudes held in turn; from each to the next the shortest way, as a smooth step.

    ``attitudes`` (k + 1, 3, 3); the k turns begin at ``start`` (k,) and last ``length`` (k,), s, without overlap.
    """

    start: Array
    length: Array
    attitudes: Array

    def turning(self, t: Array) -> Turning:
        """Return the relative attitude at times `t` (s), shape (n,)."""
        if self.start.size == 0:
            return Fixed(self.attitudes[0]).turning(t)
        way = Rotation.from_matrix(np.swapaxes(self.attitudes[:-1], 1, 2) @ self.attitudes[1:]).as_rotvec()
        total = np.linalg.norm(way, axis=1)
        axis = way / np.where(total > 0.0, total, 1.0)[:, None]
        k = np.maximum(np.searchsorted(self.start, t, side="right") - 1, 0)
        d = self.length[k]
        _, value, rate, acceleration = smooth_step((t - self.start[k]) / d)
        return Turning(
            self.attitudes[k] @ rotation_about(axis[k], total[k] * value),
            axis[k] * (total[k] * rate / d)[:, None],
            axis[k] * (total[k] * acceleration / d**2)[:, None],
        )


@dataclass(frozen=True)
class Trajectory:
    """A body carried by a chain of links from the reference frame outwards.

    Attributes
    ----------
    links : the chain; each link is carried by those before it.
    arms : for each link the vector (3,) from its hinge to the next one, m, in its own turned frame; empty = all zero.
    shift : three signals added to the position, reference frame, m; empty = none.
    rig_axis : index of the body axis of a one-axis rig whose angle is that of the last joint, or None.
    unreported, unreported_arms : links and arms on which the chain stands in reality, unknown to the reference.
    """

    links: Sequence[Link]
    arms: Sequence[Array] = ()
    shift: Sequence[Signal] = ()
    rig_axis: int | None = field(default=None)
    unreported: Sequence[Link] = ()
    unreported_arms: Sequence[Array] = ()

    @property
    def actual(self) -> Trajectory:
        """The motion that really happens: this one, which is reported, carried by what the reference does not know."""
        if not self.unreported:
            return self
        own = self.arms or [np.zeros(3)] * len(self.links)
        return replace(
            self,
            links=[*self.unreported, *self.links],
            arms=[*self.unreported_arms, *own],
            unreported=(),
            unreported_arms=(),
        )

    def at(self, t: Array) -> Kinematics:
        """Return the exact motion at times `t` (s), shape (n,); any time is allowed.

        Parameters
        ----------
        t : ndarray
            (n,) times, s.
        """
        still = np.zeros((t.size, 3))
        body = Turning(np.broadcast_to(np.eye(3), (t.size, 3, 3)), still, still)
        position, velocity, acceleration = (
            np.stack(part, axis=1) for part in zip(*(s.at(t) for s in self.shift or (Sum(()),) * 3), strict=True)
        )
        for i, link in enumerate(self.links):
            body = body.then(link.turning(t))
            if self.arms:
                here = Kinematics(*body, position, velocity, acceleration).displaced(self.arms[i])
                position, velocity, acceleration = here.position, here.velocity, here.acceleration
        return Kinematics(*body, position, velocity, acceleration)

    @property
    def rig_joint(self) -> Joint | None:
        """The joint of a one-axis rig, or None where the motion is not that of a rig."""
        last = self.links[-1]
        return last if self.rig_axis is not None and isinstance(last, Joint) else None

    def with_rig_angle(self, angle: Signal) -> Trajectory:
        """Return the rig's motion when its axis really follows `angle` instead of the commanded one.

        Parameters
        ----------
        angle : callable
            The angle, rad, as a signal of time.
        """
        joint = self.rig_joint
        if joint is None:
            raise ValueError("this motion is not that of a one-axis rig: use the scenario 'tilt'")
        return replace(self, links=[*self.links[:-1], replace(joint, angle=angle)])
