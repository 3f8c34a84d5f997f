"""Faults of some rows of a log: stuck values, blocks recorded twice, rows stamped with their arrival."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from imufit.faults.backlog import backlogs
from imufit.faults.duplicate import duplicates
from imufit.faults.row_fault import UNITS, RowFault, joined
from imufit.faults.stuck import stuck
from imufit.figures import quantity
from imufit.log import LogSource
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
        for look in (stuck, duplicates, backlogs):
            found += look(chunk)
    found = joined(found)
    found = _beside_each_other(found)
    faults, left_out = [], []
    for item in found:
        harmless = item.fault == "backlog" and not item.figures["moved"]
        too_many = _share(found, item, log.n) > MOST
        left_out_here = not (harmless or too_many)
        faults.append(_worded(item, left_out=left_out_here, spoils=too_many and not harmless))
        if left_out_here:
            left_out += [(sensor, item.first, item.stop) for sensor in item.sensors]
    return faults, left_out


def _beside_each_other(found: Sequence[RowFault]) -> list[RowFault]:
    """Name copies of several sensors in the same rows as one."""
    out: list[RowFault] = []
    for item in found:
        last = next((f for f in reversed(out) if f.fault == item.fault == "duplicate"), None)
        if last is not None and abs(item.first - last.first) <= 16 and abs(item.stop - last.stop) <= 16:
            out.remove(last)
            sensors = tuple(dict.fromkeys((*last.sensors, *item.sensors)))
            first, stop = min(item.first, last.first), max(item.stop, last.stop)
            times = min(item.t_start, last.t_start), max(item.t_end, last.t_end)
            out.append(RowFault("duplicate", sensors, "xyz", first, stop, *times, item.figures))
        else:
            out.append(item)
    return out


def _share(found: Sequence[RowFault], item: RowFault, n: int) -> float:
    """Largest share of a sensor's rows that all faults of this kind take."""
    same = [f for f in found if f.fault == item.fault]
    return max(sum(f.rows for f in same if sensor in f.sensors) / n for sensor in item.sensors)


def _worded(item: RowFault, *, left_out: bool, spoils: bool) -> DataFault:
    sensor = item.sensors[0] if len(item.sensors) == 1 else None
    channel = f"{sensor}_{item.axes}" if sensor is not None and len(item.axes) == 1 else None
    words = {"stuck": _stuck, "duplicate": _duplicate, "backlog": _backlog}[item.fault]
    evidence, remedy = words(item)
    return DataFault(
        item.fault,
        sensor,
        channel,
        item.t_start,
        item.t_end,
        item.rows,
        evidence,
        remedy,
        left_out=left_out,
        spoils=spoils,
    )


def _stuck(item: RowFault) -> tuple[str, str]:
    (sensor,) = item.sensors
    which = f"{sensor}_{item.axes}" if len(item.axes) == 1 else f"{sensor} ({', '.join(item.axes)})"
    unit = UNITS[sensor]
    span = quantity.span(item.t_start, item.t_end)
    moved = quantity.quantity(item.figures["moved"], unit)
    return (
        f"{which} repeats one value in {item.rows} rows at {span}, while by the reference it should have changed by "
        f"{moved}.",
        "Look for a bus that hangs or a buffer that is read without a new sample; record again.",
    )


def _duplicate(item: RowFault) -> tuple[str, str]:
    span = quantity.span(item.t_start, item.t_end)
    return (
        f"The {item.rows} rows at {span} repeat the samples of {' '.join(item.sensors)} of "
        f"{quantity.quantity(item.figures['lag'], 's')} before, bit for bit.",
        "Delete the copy, and look for a buffer that is written twice.",
    )


def _backlog(item: RowFault) -> tuple[str, str]:
    rate, usual = item.figures["rate"], item.figures["usual"]
    harmless = "" if item.figures["moved"] else " The body was at rest, so they do no harm here."
    return (
        f"{item.rows} rows at {quantity.span(item.t_start, item.t_end)} come at {rate:.0f} a second instead of "
        f"{usual:.0f}: their times are those of arrival, not of sampling.{harmless}",
        "Let the sensor stamp its samples, or cut these rows off.",
    )
