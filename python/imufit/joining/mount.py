"""How a sensor sits on the body whose attitude a reference gives."""

from __future__ import annotations

from itertools import permutations, product
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from imufit import _imufit
from imufit.log.scalar_first import quaternions_from_rotation

Array = NDArray[np.float64]

SMALL: Final = np.deg2rad(15.0)
"""A turn so near to one that maps axes on axes is that one and a small error of mounting: `ref.alignment` finds it."""
OPEN: Final = 0.25
"""Standard error from which on a turn is not known, rad: at a normal error the nearest right angles are the wrong ones
in one case of a thousand."""
AXES: Final = "xyz"


def square_turns() -> list[Array]:
    """Return the 24 rotation matrices that map axes on axes."""
    found = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            if np.linalg.det(matrix) > 0.0:
                found.append(matrix)
    return found


def nearest_square_turn(mount: Array) -> tuple[Array, float]:
    """Return the nearest of the 24, and the angle that is left, rad."""
    best = max(square_turns(), key=lambda each: float(np.trace(each.T @ mount)))
    return best, float(Rotation.from_matrix(best.T @ mount).magnitude())


def words(mount: Array) -> str:
    """Say how the axes of the sensor lie on the reference body, such as ``x = +y, y = -x, z = +z``."""
    square, left = nearest_square_turn(mount)
    parts = []
    for axis in range(3):
        other = int(np.argmax(np.abs(square[axis])))
        parts.append(f"{AXES[axis]} = {'+' if square[axis, other] > 0.0 else '-'}{AXES[other]}")
    text = ", ".join(parts)
    return text if left < SMALL else f"{text} to within {np.rad2deg(left):.0f} deg"


def axis_words(axis: Array) -> str:
    """Say along which axis of a sensor a unit vector lies, such as ``+y``, or its components."""
    along = int(np.argmax(np.abs(axis)))
    if abs(axis[along]) >= np.cos(SMALL):
        return f"{'+' if axis[along] > 0.0 else '-'}{AXES[along]}"
    return ", ".join(f"{each:.3f}" for each in axis)


def turned(q: Array, mount: Array) -> Array:
    """Return the attitude of the sensor, (n, 4), from that of the reference body it is mounted on.

    Parameters
    ----------
    q : (n, 4) array
        Attitude of the reference body, scalar first, body to reference frame.
    mount : (3, 3) array
        Turn from the reference body's axes to the sensor's.
    """
    back = quaternions_from_rotation(Rotation.from_matrix(mount.T))
    return _imufit.quaternion_product(q, np.broadcast_to(back, q.shape).copy())
