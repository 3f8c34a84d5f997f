"""The time of every row of a recording, once all of them are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imufit.record.arrived import Arrived
from imufit.record.clock import ClockFit, fit_clock, increasing, spread_arrivals
from imufit.record.ticks import Unwrapper, guessed_unit, time_column

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Timing:
    """Time of n rows under one announcement.

    Attributes
    ----------
    t : (n,) array
        On the host's clock (`time.monotonic`), s, strictly increasing.
    run : (n,) int array
        Number of the run of the device's clock.
    fit : ClockFit or None
        None where the device tells no time.
    notes : tuple of str
        What was taken for granted.
    """

    t: Array
    run: NDArray[np.int64]
    fit: ClockFit | None
    notes: tuple[str, ...]


def timed(rows: Arrived) -> Timing:
    """Tell the time of rows.

    Parameters
    ----------
    rows : Arrived
        All rows under one announcement.
    """
    unit, notes = None, []
    if rows.announced.form == "text":
        found = time_column(rows.announced.columns)
        if found is None:
            note = (
                "the rows have no column of time (t, t_ms, t_us, millis, micros, ...): they are timed as they arrived"
            )
            return Timing(spread_arrivals(rows.arrival), np.zeros(rows.n, np.int64), None, (note,))
        if found[1] is None:
            name = rows.announced.columns[found[0]]
            unit = guessed_unit(rows.values[:, found[0]], rows.arrival)
            words = {1.0: "s", 1e-3: "ms", 1e-6: "us", 1e-9: "ns"}[unit]
            notes.append(f"column {name} does not name its unit: by the computer's clock it is {words}")
    device, segment = Unwrapper(rows.announced, unit).add(rows)
    fit = fit_clock(device, rows.arrival, segment, rows.start)
    if fit.alien:
        notes.append("the rows came at another pace than their time tells: the device's seconds were taken as they are")
    t = increasing(fit.offsets[segment] + fit.rate * device, segment, fit.offsets)
    new = np.concatenate(([0], (np.diff(fit.offsets) != 0.0).astype(np.int64)))
    return Timing(t, np.cumsum(new)[segment], fit, tuple(notes))
