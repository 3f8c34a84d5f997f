"""Logs of whatever holds one: a log, a file's name, a table of pandas, polars or Arrow, a dict of arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np

from imufit.errors import InputError
from imufit.log.any_table import AnyTable
from imufit.log.columns import GROUPS
from imufit.log.log import METADATA, Log, LogSource
from imufit.log.metadata import mapping_from_json
from imufit.log.stream import open_log

if TYPE_CHECKING:
    import pandas as pd


class LogHolder(Protocol):
    """Objects that give a log: a simulation."""

    def to_log(self) -> Log:
        """Give the log."""
        ...


AnyLog: TypeAlias = "LogSource | LogHolder | str | PathLike[str] | AnyTable"
AnyLogs: TypeAlias = "AnyLog | Sequence[AnyLog]"


def log_of(given: AnyLog) -> LogSource:
    """Return the log that something holds.

    Parameters
    ----------
    given : Log, LogStream, Simulation, str, Path, DataFrame or mapping
        A log is returned as it is, that of a simulation is made. A file is opened and stays on the disk. The columns
        of a table are recognised as those of a file are. A mapping holds arrays: either columns of a table
        (``acc_x``) or the arrays of :class:`imufit.Log` (``acc`` of shape (n, 3)).

    Raises
    ------
    InputError
        It holds no log, or the log cannot be read.
    """
    if isinstance(given, (str, PathLike)):
        return open_log(Path(given))
    if isinstance(given, Mapping):
        log = _log_of_groups(given)
        return Log.from_dataframe(given) if log is None else log
    if isinstance(given, LogSource):
        return given
    if hasattr(given, "to_log"):
        return given.to_log()
    table, stated = pandas_of(given)
    # the metadata that a table of pandas inherits were not stated of the time that it has now
    return Log.from_dataframe(table, None if table is given else stated)


def pandas_of(given: AnyTable) -> tuple[pd.DataFrame, Mapping[str, Any]]:
    """Return a table as one of pandas, with the metadata of a log that stand with it.

    Parameters
    ----------
    given : DataFrame, table of Arrow or polars, Log, or mapping
        A mapping holds arrays, as for `log_of`.

    Raises
    ------
    InputError
        It is not a table.
    """
    import pandas as pd  # noqa: PLC0415  heavy, and only needed here

    if isinstance(given, pd.DataFrame):
        return given, given.attrs.get(METADATA, {})
    if isinstance(given, Mapping):
        log = _log_of_groups(given)
        return (pd.DataFrame(_columns(given)), {}) if log is None else (log.to_pandas(), log.metadata.to_mapping())
    if hasattr(given, "__arrow_c_stream__"):
        import pyarrow as pa  # noqa: PLC0415  heavy, and only needed here

        table = pa.table(given)
        text = (table.schema.metadata or {}).get(METADATA.encode())
        return table.to_pandas(), mapping_from_json(text, Path("log")) if text else {}
    raise InputError(
        f"a log cannot be made of {type(given).__name__}",
        remedy="Pass a Log, the name of a file, a table of pandas or polars, or a dict of arrays.",
    )


def logs_of_any(given: AnyLogs) -> tuple[LogSource, ...]:
    """Return the logs of one sensor that something holds: one, or several in a sequence.

    Parameters
    ----------
    given : anything that `log_of` takes, or a sequence of these
        Names of files may stand in the sequence too.
    """
    if isinstance(given, Sequence) and not isinstance(given, str):
        return tuple(log_of(each) for each in given)
    return (log_of(given),)


def _log_of_groups(arrays: Mapping[str, Any]) -> Log | None:
    """Make the log of arrays of several columns; None where they are single columns of a table."""
    if not any(name in GROUPS or name == "attitude" for name in arrays):
        return None
    if "t" not in arrays:
        raise InputError("the arrays have no time", remedy='Give seconds as "t".')
    return Log(**arrays)


def _columns(arrays: Mapping[str, Any]) -> dict[str, Any]:
    """Check the columns of a table."""
    for name, column in arrays.items():
        if np.ndim(column) > 1:
            raise InputError(
                f"the array has {np.ndim(column)} dimensions",
                column=str(name),
                remedy=f"Arrays of several columns have the names {', '.join(GROUPS)}; a column has one dimension.",
            )
    lengths = {str(name): len(column) for name, column in arrays.items()}
    if len(set(lengths.values())) > 1:
        raise InputError("the arrays have different lengths: " + ", ".join(f"{k} {n}" for k, n in lengths.items()))
    return dict(arrays)
