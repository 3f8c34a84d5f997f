"""Attitudes expressed in another reference frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imufit import _imufit


def convert_frame(q: ArrayLike, source: str, target: str) -> NDArray[np.float64]:
    """Express attitudes of one reference frame in another; north, east and up stay where they are.

    Parameters
    ----------
    q : (n, 4) array
        Quaternions, scalar first, body to frame `source`.
    source, target : {"NED", "ENU", "NWU"}
        Reference frames.

    Returns
    -------
    (n, 4) array
        The same attitudes, body to frame `target`; NaN where a row of `q` is not an attitude.

    Raises
    ------
    ValueError
        An unknown frame, or not four numbers a row.
    """
    return _imufit.convert_frame(np.ascontiguousarray(q, dtype=np.float64), source, target)
