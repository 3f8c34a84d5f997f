"""Cells of text, each word once in memory however often it stands there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from imufit.log.arrow_numbers import numbers_of


def cells_of(column: Any) -> NDArray[np.object_]:
    """Cells of an Arrow column that holds no numbers; equal ones are one object.

    Parameters
    ----------
    column : pyarrow.Array or pyarrow.ChunkedArray
        Text, or whatever `to_pylist` makes of it.

    Returns
    -------
    (n,) array of objects
        None where there is none.
    """
    if isinstance(column, pa.ChunkedArray):
        pieces = [cells_of(piece) for piece in column.chunks]
        return np.concatenate(pieces) if pieces else np.empty(0, dtype=object)
    if not pa.types.is_dictionary(column.type):
        try:
            column = pc.dictionary_encode(column)
        except pa.ArrowNotImplementedError:
            return _objects(column.to_pylist())
    words = _objects([*column.dictionary.to_pylist(), None])
    places = numbers_of(column.indices.cast(pa.float64()))
    return words[np.where(np.isnan(places), len(words) - 1, places).astype(np.intp)]


def _objects(cells: list[Any]) -> NDArray[np.object_]:
    """One object a cell, whatever it is."""
    objects = np.empty(len(cells), dtype=object)
    objects[:] = cells
    return objects
