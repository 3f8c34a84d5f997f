"""Axes that were exchanged or turned round: the 48 signed permutations, in words and as a mapping of columns."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

AXES: Final = "xyz"


def _signed_permutations() -> list[Array]:
    found = [
        np.eye(3)[list(order)] * np.array(signs)[:, None]
        for order in itertools.permutations(range(3))
        for signs in itertools.product((1.0, -1.0), repeat=3)
    ]
    # Those that change least come first, rotations before reflections.
    return sorted(found, key=lambda p: (-np.trace(p), -np.linalg.det(p)))


PERMUTATIONS: Final = np.stack(_signed_permutations())
"""(48, 3, 3), the identity first."""

PROPER: Final = np.flatnonzero(np.linalg.det(PERMUTATIONS) > 0.0)
"""Which of them are rotations."""


def in_words(sensor: str, matrix: Array) -> str:
    """Say what each axis of a sensor shows, such as ``gyr_x shows -y``, where it is not its own.

    Parameters
    ----------
    sensor : str
        Its prefix.
    matrix : ndarray
        (3, 3) signed permutation P: the reading is P times the true vector.
    """
    other = [i for i in range(3) if not np.array_equal(matrix[i], np.eye(3)[i])]
    return ", ".join(f"{sensor}_{AXES[i]} shows {_signed(matrix[i], '')}" for i in other)


def mapping(sensor: str, matrix: Array) -> str:
    """Return the mapping of columns that undoes a signed permutation, such as ``gyr_x=gyr_y,gyr_y=gyr_x``.

    Parameters
    ----------
    sensor : str
        Its prefix.
    matrix : ndarray
        (3, 3) signed permutation P: the reading is P times the true vector.
    """
    back = matrix.T
    other = [i for i in range(3) if not np.array_equal(back[i], np.eye(3)[i])]
    return ",".join(f"{sensor}_{AXES[i]}={_signed(back[i], f'{sensor}_')}" for i in other)


def turn(matrix: Array) -> str:
    """Say a rotation as angle and axis.

    Parameters
    ----------
    matrix : ndarray
        (3, 3) rotation.
    """
    vector = Rotation.from_matrix(matrix).as_rotvec()
    angle = float(np.linalg.norm(vector))
    axis = vector / max(angle, 1e-12)
    named = [k for k in range(3) if abs(abs(axis[k]) - 1.0) < 1e-6]
    if named:
        return f"{np.degrees(angle):.0f} deg about {'-' if axis[named[0]] < 0 else ''}{AXES[named[0]]}"
    return f"{np.degrees(angle):.0f} deg about ({_numbers(axis)})"


def _numbers(values: Sequence[float] | Array) -> str:
    return ", ".join(f"{value:.3g}" for value in values)


def _signed(row: Array, prefix: str) -> str:
    k = int(np.argmax(np.abs(row)))
    return f"{'-' if row[k] < 0.0 else ''}{prefix}{AXES[k]}"
