"""Numbers out of Arrow's memory: its own `to_numpy` loads pandas, which costs 40 MB and a third of a second."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray


def numbers_of(column: Any) -> NDArray[np.float64]:
    """Numbers of an Arrow column of type float64.

    Parameters
    ----------
    column : pyarrow.Array or pyarrow.ChunkedArray
        Numbers; those of an array that has no null stay in Arrow's memory.

    Returns
    -------
    (n,) array of float64
        NaN where there is none.
    """
    if isinstance(column, pa.ChunkedArray):
        pieces = [numbers_of(piece) for piece in column.chunks]
        return np.concatenate(pieces) if pieces else np.empty(0)
    if not len(column):
        return np.empty(0)
    known, memory = column.buffers()
    numbers = np.frombuffer(memory, np.float64, len(column), 8 * column.offset)
    if not column.null_count:
        return numbers
    bits = np.unpackbits(np.frombuffer(known, np.uint8), bitorder="little")
    return np.where(bits[column.offset : column.offset + len(column)], numbers, np.nan)
