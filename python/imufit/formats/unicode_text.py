"""Texts of arrays that were read from a file: numpy does not check their code points."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray


def unicode_only(array: NDArray[Any]) -> NDArray[Any]:
    """Return an array whose texts Python can hold.

    Parameters
    ----------
    array : array
        Of any type.

    Raises
    ------
    ValueError
        A text has a code point beyond those of Unicode.
    """
    if array.dtype.kind == "U" and array.dtype.itemsize:
        codes = np.ascontiguousarray(array).view(np.dtype(np.uint32).newbyteorder(array.dtype.byteorder))
        if codes.max(initial=0) > sys.maxunicode:
            raise ValueError("a text has a code point beyond those of Unicode")
    return array
