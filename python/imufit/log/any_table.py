"""Types of tables whose columns become a log: of pandas, polars or Arrow, a dict of arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

if TYPE_CHECKING:
    import pandas as pd


class ArrowTable(Protocol):
    """A table that offers Arrow's stream: polars, pyarrow, duckdb, a log itself."""

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """Give the columns as a stream of Arrow."""
        ...


AnyTable: TypeAlias = "pd.DataFrame | ArrowTable | Mapping[str, Any]"
