"""Quaternions with the scalar first, to and from scipy's rotations, which put the scalar last."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


def rotation_from_quaternions(q: Array) -> Rotation:
    """Make rotations of (n, 4) quaternions, scalar first; rows of NaN become the identity."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - costs a fifth of a second that many do not need

    scalar_last = q[:, [1, 2, 3, 0]].copy()
    scalar_last[np.isnan(scalar_last).any(axis=1)] = [0.0, 0.0, 0.0, 1.0]
    return Rotation.from_quat(scalar_last)


def quaternions_from_rotation(rotation: Rotation) -> Array:
    """Return (n, 4) quaternions, scalar first; n = 1 for a single rotation."""
    return np.ascontiguousarray(np.atleast_2d(rotation.as_quat())[:, [3, 0, 1, 2]])
