"""Arrays by name, as MATLAB and HDF5 files hold them, laid side by side as tables."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.formats.limits import LIST, check_values
from imufit.formats.recording import Table
from imufit.formats.rows import left_out_note, number, time_name
from imufit.formats.unicode_text import unicode_only

_RATES: Final = re.compile(
    r"(sampl(e|ing)_?)?(rate|freq(uency)?)(_?hz)?|frame_?rate|f_?s|samplerate|samplingrate|odr|hz", re.IGNORECASE
)
"""Names of a number that is the rate of the arrays beside it, Hz, such as `FrameRate` and `sampling_rate`."""
_CLOCKS: Final = re.compile(r"(.*[._/ ])?(t|time|times|timestamps?|time_?(s|ms|us|ns))([\[(_ ].*)?", re.IGNORECASE)
"""Names of an array that has the times of the arrays beside it."""
_FASTEST: Final = 1e6
"""Hz; no inertial sensor is faster, so that a larger number is not a rate."""
_LEAST: Final = 2
"""Rows of a table: a single number is a setting."""


@dataclass
class Named:
    """The content of a file, by path.

    Parameters
    ----------
    separator : str
        Stands between the names of a path.
    arrays : dict
        Numbers or texts of any shape.
    settings : dict
        Single numbers.
    left_out : list of str
        Names that are neither.
    """

    separator: str
    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)
    settings: dict[str, float] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)

    def add(self, name: str, value: Any) -> None:
        """Add a value: a single number is a setting, an array of numbers or texts a column or several."""
        array = np.asarray(value)
        if array.dtype.kind == "S":
            array = np.char.decode(array, "utf-8", "replace")
        if array.dtype.kind == "U" or (array.dtype == object and array.size and _texts(array)):
            if array.size > 1:
                self.arrays[name] = unicode_only(array).astype(object)
        elif array.dtype.kind in "biuf":
            if array.size == 1:
                self.settings[name] = number(array.reshape(-1)[0])
            elif array.size:
                self.arrays[name] = array
        elif array.dtype.kind == "M":
            times = array.astype("datetime64[ns]").astype(np.int64) * 1e-9
            self.arrays[name] = np.where(np.isnat(array), np.nan, times)
        elif array.size:
            self.left_out.append(name)

    def group(self, name: str) -> str:
        """Return the path without its last name."""
        return name.rpartition(self.separator)[0]

    def within(self, name: str, group: str) -> bool:
        """Return whether a path leads through a group; every path does through the nameless one."""
        return not group or name == group or name.startswith(group + self.separator)


def tables_of(path: Path, named: Named) -> tuple[tuple[Table, ...], tuple[str, ...]]:
    """Lay arrays of equal length side by side, with the clock that stands nearest to them.

    Parameters
    ----------
    path : Path
        The file, for messages.
    named : Named
        Its arrays and numbers.

    Returns
    -------
    tables : tuple of Table
        Named after the group of their clock, which their columns then leave out of their path; with a column `t`
        where a rate is given and no array of times.
    notes : tuple of str
        Names that were left out.
    """
    check_values(path, sum(array.size for array in named.arrays.values()))
    columns = _columns(named)
    clocks = {
        (named.group(name), len(column))
        for name, column in columns.items()
        if column.dtype != object and _CLOCKS.fullmatch(name.rpartition(named.separator)[2])
    }
    rates = {
        named.group(name): value
        for name, value in named.settings.items()
        if _RATES.fullmatch(name.rpartition(named.separator)[2]) and 0 < value < _FASTEST
    }
    grouped: dict[tuple[str | None, int], dict[str, NDArray[Any]]] = {}
    for name, column in columns.items():
        grouped.setdefault((_nearest(named, name, len(column), clocks, rates), len(column)), {})[name] = column
    tables = []
    for (group, n), found in grouped.items():
        if all(column.dtype == object for column in found.values()):
            named.left_out += found
            continue
        members = {name[len(group) + 1 :] if group else name: column for name, column in found.items()}
        time = None
        if group is not None and (group, n) not in clocks:
            time = time_name(members)
            members = {time: np.arange(n) / rates[group], **members}
        tables.append(Table(group or "", members, time))
    notes = (left_out_note(named.left_out),) if named.left_out else ()
    return tuple(tables), notes


def _nearest(named: Named, name: str, n: int, clocks: set[tuple[str, int]], rates: Mapping[str, float]) -> str | None:
    """Return the innermost group around an array that has times of its length, or a rate."""
    group = named.group(name)
    while True:
        if (group, n) in clocks or group in rates:
            return group
        if not group:
            return None
        group = named.group(group)


def _columns(named: Named) -> dict[str, NDArray[Any]]:
    shapes = {name: tuple(k for k in array.shape if k != 1) for name, array in named.arrays.items()}
    lengths = Counter(shape[0] for shape in shapes.values() if len(shape) == 1 and shape[0] > LIST)
    lengths.update(max(shape) for shape in shapes.values() if len(shape) > 1)
    columns: dict[str, NDArray[Any]] = {}
    for name, shape in shapes.items():
        array = named.arrays[name].reshape(shape)
        known = [axis for axis, k in enumerate(shape) if lengths[k] > (1 if len(shape) > 1 else 0)]
        axis = known[0] if known else int(np.argmax(shape))
        # a stack of matrices is written row by row, whichever axis counts the samples
        table = np.moveaxis(array, axis, 0).reshape(shape[axis], -1)
        n, width = table.shape
        if n < _LEAST or width > LIST:
            named.left_out.append(name)
        else:
            for index in range(width):
                column = table[:, index]
                key = name if width == 1 else f"{name}[{index}]"
                columns[key] = column if column.dtype == object else column.astype(float)
    return columns


def _texts(array: NDArray[Any]) -> bool:
    flat = array.reshape(-1)
    return all(isinstance(value, str | bytes) for value in flat)
