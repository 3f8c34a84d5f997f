"""From a pandas table to the checked fields of a log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from imufit.log.assemble import check_truth_values, fields_of, time_of
from imufit.log.foreign import plan_columns
from imufit.log.metadata import Metadata
from imufit.log.place import Place
from imufit.log.time_order import TimeScan
from imufit.log.unit_check import HEAD, Clock, check_units
from imufit.log.unmeasured import Unmeasured

if TYPE_CHECKING:
    import pandas as pd


def fields_from_frame(df: pd.DataFrame, mapping: Mapping[str, str] | None, metadata: Metadata) -> dict[str, Any]:
    """Check a table as if it were a file, and make the fields of a log.

    Parameters
    ----------
    df : DataFrame
        Columns as in a log file.
    mapping : mapping or None
        Source text for target columns.
    metadata : Metadata
        Frame, gravity and so on.

    Returns
    -------
    dict
        Fields as in `imufit.log.Log`.
    """
    place = Place()
    names = [str(name) for name in df.columns]
    plan = plan_columns(names, mapping, place)
    if df.empty:
        raise place.error("the table has no rows")
    block = {name: _column(df.iloc[:, names.index(name)]) for name in plan.sources}
    truths = {name: (None, "") for name, cells in block.items() if cells.dtype == np.bool_}
    check_truth_values(plan, truths, place)
    block = {name: cells if cells.dtype == object else cells.astype(np.float64) for name, cells in block.items()}
    scan = TimeScan(place, abs(plan.time.conversion.factor))
    scan.add(time_of(plan, block, 0, len(df), place))
    repair = scan.finish()
    unmeasured = Unmeasured(place)
    fields = fields_of(plan, block, 0, len(df), repair=repair, metadata=metadata, place=place, unmeasured=unmeasured)
    unmeasured.check()
    sensors: dict[str, NDArray[np.float64] | None] = {
        name: fields[name][:HEAD] for name in ("acc", "gyr", "mag", "ref_q", "temp") if name in fields
    }
    clock: Clock = "stated" if "t" in (mapping or {}) else "a log's" if metadata != Metadata() else "open"
    odd = check_units(fields["t"][:HEAD], sensors, metadata, place, plan.origin, clock)
    notes = tuple(note for note in (*plan.notes, repair.note, *odd, *unmeasured.notes) if note)
    return {**fields, "metadata": metadata, "notes": notes}


def _column(column: pd.Series[Any]) -> NDArray[Any]:
    """Give (n,) bool for truth values, (n,) float64 for other numbers, (n,) objects for the rest; always a copy."""
    import pandas as pd  # noqa: PLC0415  heavy, and only needed here

    if column.dtype == np.bool_:
        return column.to_numpy(copy=True)
    if pd.api.types.is_numeric_dtype(column.dtype) and not pd.api.types.is_complex_dtype(column.dtype):
        return column.to_numpy(dtype=np.float64, na_value=np.nan, copy=True)
    cells = np.empty(len(column), dtype=object)
    cells[:] = [None if pd.isna(cell) else cell for cell in column]
    return cells
