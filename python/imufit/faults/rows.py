"""Faults of some rows of a log: stuck values, spikes, fillers, blocks recorded twice, times of arrival, rows lost."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from imufit.faults.backlog import backlogs
from imufit.faults.duplicate import duplicates
from imufit.faults.jump import jumps
from imufit.faults.outliers import outliers
from imufit.faults.row_fault import RowFault, joined
from imufit.faults.stuck import stuck
from imufit.log import LogSource
from imufit.results import column_words, fault_words
from imufit.results.data_fault import DataFault

CHUNK_ROWS: Final = 65536
MARGIN: Final = 4096
MOST: Final = 0.5
"""Share of a sensor's rows above which nothing is left out: little would be left to judge."""

LeftOut = tuple[str, int, int]
"""Sensor (or ``ref``), first row, and the row after the last, whose samples are not used."""


def row_faults(log: LogSource) -> tuple[list[DataFault], list[LeftOut]]:
    """Find rows that are certain to be wrong, in one pass over a log.

    Parameters
    ----------
    log : LogSource
        The log.

    Returns
    -------
    faults : list of DataFault
        In the order of time.
    left_out : list of LeftOut
        Samples that are not to be used.
    """
    found: list[RowFault] = []
    for chunk in log.chunks(CHUNK_ROWS, MARGIN):
        for look in (outliers, stuck, duplicates, backlogs, jumps):
            found += look(chunk)
    found = joined(found)
    faults, left_out = [], []
    for item in found:
        harmless = item.fault == "backlog" and not item.figures["moved"]
        too_many = _share(found, item, log.n) > MOST
        left_out_here = not (harmless or too_many)
        faults.append(_named(item, left_out=left_out_here, spoils=too_many and not harmless))
        if left_out_here:
            left_out += [(sensor, item.first, item.stop) for sensor in item.sensors]
    return faults, left_out


def _share(found: Sequence[RowFault], item: RowFault, n: int) -> float:
    """Largest share of a sensor's rows that all faults of this kind take."""
    same = [f for f in found if f.fault == item.fault]
    return max(sum(f.rows for f in same if sensor in f.sensors) / n for sensor in item.sensors)


def _named(item: RowFault, *, left_out: bool, spoils: bool) -> DataFault:
    sensor = item.sensors[0] if len(item.sensors) == 1 else None
    channel = f"{sensor}_{item.axes}" if sensor is not None and len(item.axes) == 1 else None
    rows, span, figures = item.rows, (item.t_start, item.t_end), item.figures
    if item.fault == "stuck":
        words = fault_words.stuck(item.sensors[0], item.axes, rows, span, figures["moved"])
    elif item.fault == "outlier":
        assert channel is not None
        values = -figures["low"], figures["high"]
        words = column_words.outliers(channel, rows, span, values, figures["usual"])
    elif item.fault == "duplicate":
        words = fault_words.duplicate(item.sensors, rows, span, figures["lag"])
    elif item.fault == "jump":
        words = fault_words.jump(figures["when"], figures["turned"], figures["read"])
    else:
        words = fault_words.backlog(rows, span, figures["rate"], figures["usual"], moved=bool(figures["moved"]))
    return DataFault(
        item.fault,
        sensor,
        channel,
        *span,
        rows,
        *words,
        left_out=left_out,
        false_readings=item.fault == "stuck",
        spoils=spoils,
    )
