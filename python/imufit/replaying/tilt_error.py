"""The error of a method's tilt: about the rig's axis, or of the inclination as a whole.

Tilt is where up is in the body: ``up_b = R^T up``. It needs no heading, which gravity does not show and which drifts in
a filter without a magnetometer, and it goes through the gimbal lock and beyond 90 degrees.

- **A rig** (metadata `rig_axis`): the angle of `up_b` about that body axis, estimate less reference, one component:
  estimated angle = reference angle + error. For an axis that lies level and a heading that is right this is the twist
  of ``q_ref^-1 q_est`` about the axis.
- **A rig about the vertical**: up does not change when it turns. There the error is the heading's, the twist
  ``2 atan2(v . axis, w)`` of ``q_ref^-1 q_est``; a method without rate and without field shows nothing.
- **No rig**: the two horizontal components, in the reference frame, of the shortest rotation from the true to the
  estimated vertical.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.log import Log

Array = NDArray[np.float64]

_LEAST_LEVER = 0.2
"""Sine of the angle between rig axis and vertical below which the axis counts as vertical (11.5 degrees)."""


@dataclass(frozen=True)
class TiltReference:
    """The reference of the tilt of a log.

    Parameters
    ----------
    kind : {"rig", "heading", "inclination"}
        About the rig's axis; about a rig axis that is vertical; the inclination as a whole.
    axis : {"x", "y", "z"} or None
        Body axis of the rig.
    q : (n, 4) array
        Reference attitude, scalar first, body to reference frame; NaN where there is none.
    up : (3,) array
        Up in the reference frame.
    """

    kind: str
    axis: str | None
    q: Array
    up: Array

    @classmethod
    def of(cls, log: Log) -> TiltReference | None:
        """Find the reference of a log's tilt; None without a reference attitude.

        Parameters
        ----------
        log : Log
            With or without reference and rig axis.
        """
        if log.ref_q is None or not np.isfinite(log.ref_q).all(axis=1).any():
            return None
        up = np.array([0.0, 0.0, -1.0 if log.metadata.frame == "NED" else 1.0])
        axis = log.metadata.rig_axis
        if axis is None:
            return cls("inclination", None, log.ref_q, up)
        along = up_in_body(log.ref_q, up)["xyz".index(axis)]
        lever = float(np.nanmedian(np.sqrt(np.maximum(0.0, 1.0 - along**2))))
        return cls("rig" if lever > _LEAST_LEVER else "heading", axis, log.ref_q, up)

    def error(self, q: Array, bounded: bool = True) -> Array:
        """Error of estimated attitudes, (n, 1) or, for the inclination, (n, 2), rad.

        Parameters
        ----------
        q : (n, 4) array
            Estimates, scalar first; NaN before the start.
        bounded : bool
            Whether the method holds on to gravity or field, so that its error stays within half a turn. Otherwise the
            error is followed over any number of turns.
        """
        if self.kind == "inclination":
            return self._inclination(q)
        angle = self._about_axis(up_in_body(q, self.up)) if self.kind == "rig" else self._twist(q)
        return (angle if bounded else _unwrapped(angle))[:, None]

    def error_of_force(self, force: Array) -> Array:
        """Error of the tilt that the specific force alone shows, row by row; NaN for a rig about the vertical.

        Parameters
        ----------
        force : (n, 3) array
            Specific force, body frame, any length.
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            up = (force / np.linalg.norm(force, axis=1, keepdims=True)).T
        if self.kind == "rig":
            return self._about_axis(up)[:, None]
        if self.kind == "heading":
            return np.full((len(force), 1), np.nan)
        return self._horizontal(np.ascontiguousarray(up.T))

    def angle(self) -> Array:
        """Return the angle to draw, (n,), rad: about the rig's axis from the first row, or of z from the vertical.

        For a log with `ref_angle` that column is to be preferred, as it has an absolute zero.
        """
        if self.kind == "inclination":
            return inclination_of_z(self.q, self.up)
        if self.kind == "heading":
            first = self.q[np.flatnonzero(np.isfinite(self.q).all(axis=1))[0]]
            fixed = TiltReference(self.kind, self.axis, np.broadcast_to(first, self.q.shape), self.up)
            return _unwrapped(fixed._twist(self.q))
        turned = -_unwrapped(_angle_about(up_in_body(self.q, self.up), self.axis or "x"))
        known = np.isfinite(turned)
        return turned - (turned[known][0] if known.any() else 0.0)

    def _about_axis(self, up: Array) -> Array:
        axis = self.axis or "x"
        return _wrapped(_angle_about(up_in_body(self.q, self.up), axis) - _angle_about(up, axis))

    def _twist(self, q: Array) -> Array:
        w, part = _relative(self.q, q, "xyz".index(self.axis or "x"))
        return _wrapped(2.0 * np.arctan2(part, w))

    def _inclination(self, q: Array) -> Array:
        return self._horizontal(np.ascontiguousarray(up_in_body(q, self.up).T))

    def _horizontal(self, up: Array) -> Array:
        """Components x, y of the rotation from the true vertical to the estimated one, (n, 2)."""
        known = np.isfinite(self.q).all(axis=1) & np.isfinite(up).all(axis=1)
        seen = np.full((len(up), 3), np.nan)
        seen[known] = _imufit.rotate(np.ascontiguousarray(self.q[known]), np.ascontiguousarray(up[known]))
        cross = np.cross(seen, self.up)[:, :2]
        sine, cosine = np.hypot(cross[:, 0], cross[:, 1]), seen @ self.up
        with np.errstate(invalid="ignore", divide="ignore"):
            scale = np.where(sine > 0.0, np.arctan2(sine, cosine) / sine, 1.0)
        return np.asarray(cross * scale[:, None], dtype=np.float64)


def up_in_body(q: Array, up: Array) -> Array:
    """Direction of the vertical in the body, (3, n), from attitudes (n, 4).

    Parameters
    ----------
    q : (n, 4) array
        Scalar first, body to reference frame.
    up : (3,) array
        Up in the reference frame, along its z axis.
    """
    w, x, y, z = q.T
    return np.asarray(up[2] * np.stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)]))


def inclination_of_z(q: Array, up: Array) -> Array:
    """Angle between the body's z axis and the vertical line, (n,), rad: paper B's eq. (3) with its quadrant.

    Parameters
    ----------
    q : (n, 4) array
        Scalar first, body to reference frame.
    up : (3,) array
        Up in the reference frame; a body whose z axis points along the frame's own z axis has inclination 0.
    """
    x, y, z = up_in_body(q, up)
    return np.asarray(np.arctan2(np.hypot(x, y), z * up[2]), dtype=np.float64)


def _angle_about(up: Array, axis: str) -> Array:
    """Angle of a body vector (3, n) about a body axis, rad, right-handed."""
    first = "xyz".index(axis) + 1
    return np.asarray(np.arctan2(up[(first + 1) % 3], up[first % 3]), dtype=np.float64)


def _relative(q_ref: Array, q: Array, axis: int) -> tuple[Array, Array]:
    """Scalar part, and one component of the vector part, of ``q_ref^-1 q``."""
    w0, v0 = q_ref[:, 0], q_ref[:, 1:]
    w1, v1 = q[:, 0], q[:, 1:]
    b, c = (axis + 1) % 3, (axis + 2) % 3
    scalar = w0 * w1 + np.einsum("ij,ij->i", v0, v1)
    part = w0 * v1[:, axis] - w1 * v0[:, axis] - (v0[:, b] * v1[:, c] - v0[:, c] * v1[:, b])
    return scalar, part


def _wrapped(angle: Array) -> Array:
    """Angle within half a turn either way."""
    return np.asarray(np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi, dtype=np.float64)


def _unwrapped(angle: Array) -> Array:
    """Angle without jumps of a turn, from the known rows; NaN stays where it is."""
    known = np.isfinite(angle)
    followed = angle.copy()
    followed[known] = np.unwrap(angle[known])
    return followed
