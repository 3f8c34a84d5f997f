"""Tilt from the specific force alone, as paper B has it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from imufit import _imufit

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def tilt_angles(acc: ArrayLike) -> NDArray[np.float64]:
    """Pitch, roll and inclination of a resting sensor from its specific force (paper B, eqs. 1 to 3).

    With the specific force ``(x, y, z)``, which points up at rest:

    - pitch ``atan(x / sqrt(y^2 + z^2))``, eq. 1: the angle of the body's x axis above the horizontal plane
    - roll ``atan(y / sqrt(x^2 + z^2))``, eq. 2: the angle of its y axis above the horizontal plane; this is not the
      roll of ``Rz Ry Rx``, which the filters give
    - inclination ``atan(sqrt(x^2 + y^2) / z)``, eq. 3: the angle of its z axis from the upward vertical. The paper
      calls it yaw, but gravity carries no heading.

    Parameters
    ----------
    acc : (n, 3) array
        Specific force in the body frame in any unit; only its direction counts.

    Returns
    -------
    (n, 3) array
        Angles, rad. Pitch and roll lie in [-pi/2, pi/2], the inclination in [0, pi]: upside down it is more than pi/2
        where the printed quotient would jump by pi. NaN where a reading is zero or not finite.

    Raises
    ------
    ValueError
        `acc` does not have the shape (n, 3).
    """
    return _imufit.tilt_angles(np.ascontiguousarray(acc, dtype=np.float64))
