"""A single array of numpy (``.npy``)."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from imufit.errors import InputError
from imufit.formats.arrays import Named, tables_of
from imufit.formats.limits import COLUMNS, WHOLE, check_size, check_values
from imufit.formats.recording import Recording, Table

FORM: Final = "NumPy array"
_MAGIC: Final = b"\x93NUMPY"


def recognises(head: bytes, _path: Path) -> bool:
    """Return whether a file begins as an array of numpy does."""
    return head.startswith(_MAGIC)


def read(path: Path) -> Recording:
    """Read a structured array as columns by name, one of numbers as ``c1``, ``c2``, ..."""
    size = check_size(path, 2 * WHOLE)
    with path.open("rb") as file:
        version = np.lib.format.read_magic(file)
        readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        shape, _, dtype = readers[version](file)
        if dtype.hasobject:
            raise InputError(
                "the array holds Python objects, and reading one would run code that the file contains",
                file=path,
                remedy="Write an array of numbers, or a table with pandas: frame.to_parquet(FILE).",
            )
        values = int(np.prod([float(k) for k in shape])) if shape else 1
        check_values(path, values * max(len(dtype.names or ()), 1))
        if file.tell() + values * dtype.itemsize > size:
            part = (size - file.tell()) / max(values * dtype.itemsize, 1)
            raise InputError(f"the file is cut off: it has {100 * part:.1f} % of the array that it declares", file=path)
    array = np.load(path, allow_pickle=False)
    if array.dtype.names:
        named = Named(".")
        for name in array.dtype.names:
            named.add(name, array[name].reshape(len(array), -1) if array.ndim else array[name])
        tables, notes = tables_of(path, named)
        return Recording(FORM, tables, notes)
    if array.dtype.kind not in "biuf" or array.ndim not in (1, 2):
        raise InputError(
            f"the array has the shape {array.shape} and the type {array.dtype}, not rows of numbers", file=path
        )
    table = array.reshape(len(array), -1)
    if table.shape[1] > COLUMNS or (table.shape[1] > 64 and table.shape[0] < table.shape[1]):
        table = table.T
    columns: dict[str, Any] = {f"c{index + 1}": table[:, index].astype(float) for index in range(table.shape[1])}
    return Recording(FORM, (Table("", columns),) if len(table) else ())
