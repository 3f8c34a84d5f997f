"""The frame that the angles of a log without a reference are against, and the one in which it would start level."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from imufit import _imufit
from imufit.log.metadata import FRAMES
from imufit.remedy import option

Array = NDArray[np.float64]

UPSIDE_DOWN = -float(np.sqrt(0.5))
"""Cosine of 135 deg between the z of the body and of the frame: beyond it the opposite of the frame's z is the axis of
the frame that is nearest to the body's z."""


def frame_words(frame: str, start: Array | None) -> str:
    """Name the frame, and where the sensor starts upside down in it the frame in which it starts level.

    Parameters
    ----------
    frame : {"NED", "ENU", "NWU"}
        Frame of the attitudes.
    start : (4,) array or None
        First attitude, unit quaternion, scalar first, body to frame; None where no row has one.
    """
    up = _up(frame)
    words = f"The angles are against the frame {frame}, in which z points {'up' if up > 0.0 else 'down'}."
    if start is None or Rotation.from_quat(start, scalar_first=True).as_matrix()[2, 2] > UPSIDE_DOWN:
        return words
    seen = "down" if up > 0.0 else "up"
    return (
        f"{words} The sensor starts upside down in it: by the first readings its z points {seen}. "
        f"For angles that start near level use {option('frame', level_frame(frame))}."
    )


def level_frame(frame: str) -> str:
    """Return the frame with the opposite z, and the same x if there is one.

    Parameters
    ----------
    frame : {"NED", "ENU", "NWU"}
        The frame in which the sensor is upside down.
    """
    north = np.array(_imufit.frame_vectors(frame)["north"])
    opposite = [other for other in FRAMES if _up(other) != _up(frame)]
    return max(opposite, key=lambda other: float(north @ _imufit.frame_vectors(other)["north"]))


def _up(frame: str) -> float:
    """Return the vertical component of up in a frame, 1 or -1."""
    return float(_imufit.frame_vectors(frame)["up"][2])
