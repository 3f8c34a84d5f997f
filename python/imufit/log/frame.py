"""A table of pandas as a source of blocks, so that it is read as a file of the same columns is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.log.each_once import check_each_once
from imufit.log.place import Place
from imufit.log.size import BLOCK_ROWS

if TYPE_CHECKING:
    import pandas as pd

INDEX: Final = "time"
"""Name of an index of dates that has none of its own: pandas keeps the time of a series there."""


class FrameSource:
    """A pandas table as a source of blocks.

    An index that has a name, or that holds dates, is a column like the others.

    Parameters
    ----------
    df : DataFrame
        Columns as in a log file.
    """

    def __init__(self, df: pd.DataFrame) -> None:
        import pandas as pd  # noqa: PLC0415  heavy, and only needed here

        if isinstance(df.index, pd.DatetimeIndex | pd.TimedeltaIndex) and df.index.name is None:
            df = df.rename_axis(INDEX)
        if df.index.name is not None and df.index.name not in df.columns:
            df = df.reset_index()
        self._columns = {str(name): df.iloc[:, place] for place, name in enumerate(df.columns)}
        check_each_once([str(name) for name in df.columns], Place())
        self.n = len(df)
        self.names = tuple(self._columns)
        self.notes: tuple[str, ...] = ()
        self.clues: tuple[str, ...] = ()
        self.embedded: Mapping[str, Any] = {}
        self.truths: dict[str, tuple[int | None, str]] = {
            name: (None, "") for name, column in self._columns.items() if column.dtype == np.bool_
        }
        self.text = frozenset(name for name, column in self._columns.items() if _as_array(column[:0]).dtype == object)

    def scan(self, columns: Sequence[str]) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """Give the named columns block by block.

        Parameters
        ----------
        columns : sequence of str
            Columns of the table.
        """
        yield from self.blocks(columns)

    def blocks(self, columns: Sequence[str]) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """Give the named columns block by block.

        Parameters
        ----------
        columns : sequence of str
            Columns of the table.
        """
        for start in range(0, self.n, BLOCK_ROWS):
            rows = min(BLOCK_ROWS, self.n - start)
            yield start, rows, {name: _as_array(self._columns[name][start : start + rows]) for name in columns}

    def line_of(self, row: int) -> int | None:
        """Tables have no lines.

        Parameters
        ----------
        row : int
            Row, from 0.
        """


def _as_array(column: pd.Series[Any]) -> NDArray[Any]:
    """Give (n,) float64 for numbers and for dates (s since 1970), (n,) objects for the rest; always a copy."""
    import pandas as pd  # noqa: PLC0415  heavy, and only needed here

    if pd.api.types.is_datetime64_any_dtype(column.dtype):
        dates = pd.DatetimeIndex(column)
        return np.asarray((dates - pd.Timestamp(0, tz=dates.tz)) / pd.Timedelta(seconds=1), dtype=np.float64)
    if pd.api.types.is_timedelta64_dtype(column.dtype):
        return np.asarray(pd.TimedeltaIndex(column) / pd.Timedelta(seconds=1), dtype=np.float64)
    if pd.api.types.is_numeric_dtype(column.dtype) and not pd.api.types.is_complex_dtype(column.dtype):
        return column.to_numpy(dtype=np.float64, na_value=np.nan, copy=True)
    cells = np.empty(len(column), dtype=object)
    cells[:] = [None if pd.isna(cell) else cell for cell in column]
    return cells
