"""The device's clock on the host's while rows still come: what is known so far of the line under the arrivals."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.devices.record.arrived import Announced, Arrived
from imufit.devices.record.clock import drift, spread_arrivals
from imufit.devices.record.ticks import Unwrapper, guessed_unit, time_column

Array = NDArray[np.float64]

BIN: Final = 0.25
"""Of the arrivals in so much time the earliest is kept, s."""
KEPT: Final = 1200
"""Arrivals kept: the drift is that of the last five minutes."""
EACH: Final = 4
"""Arrivals kept after which the drift is fitted anew."""
SLEW: Final = 0.001
"""Share of the time that passes by which the offset is corrected, so that no step is off by more."""
_SETTLED: Final = 2.0  # of arrivals before a drift is accepted, s


class LiveClock:
    """Time of live rows on the host's clock, s from the first row, strictly increasing.

    Unlike the clock of a finished recording it uses only the rows so far. An offset that turns out wrong is corrected
    gently, by `SLEW`; a restart of the device or of the line begins a new offset.
    """

    def __init__(self) -> None:
        self._announced: Announced | None = None
        self._unwrapper: Unwrapper | None = None
        self._first: float | None = None
        self._end = -np.inf
        self._rate = 1.0
        self._alien = False
        self._offset = 0.0
        self._lowest = 0.0
        self._bin = 0.0  # where the bin of the last point begins
        self._segment = -1
        self._device_end = 0.0
        self._points: list[tuple[float, float]] = []  # device time, arrival less device time

    def times(self, rows: Arrived) -> Array:
        """Time of the next rows, (n,) s.

        Parameters
        ----------
        rows : Arrived
            They follow those of the last call.
        """
        t = self._mapped(rows)
        if self._first is None:
            self._first = float(t[0])
        t = np.maximum.accumulate(t - self._first)
        # as many rows as there are, each a little later than the one before
        tiny = 1e-6 * np.arange(1, t.size + 1)
        t = np.maximum.accumulate(np.maximum(t, self._end + tiny) - tiny) + tiny
        self._end = float(t[-1])
        return np.asarray(t, dtype=np.float64)

    def _mapped(self, rows: Arrived) -> Array:
        if rows.announced.form == "text" and time_column(rows.announced.columns) is None:
            return spread_arrivals(rows.arrival)
        if self._announced != rows.announced or self._unwrapper is None:
            self._begin(rows)
        assert self._unwrapper is not None
        device, segment = self._unwrapper.add(rows)
        out = np.empty(rows.n)
        for number in np.unique(segment):
            part = segment == number
            if number != self._segment:
                self._segment = int(number)
                self._points = []
            out[part] = self._piece(device[part], rows.arrival[part])
        return out

    def _begin(self, rows: Arrived) -> None:
        unit = None
        if rows.announced.form == "text":
            found = time_column(rows.announced.columns)
            assert found is not None
            unit = guessed_unit(rows.values[:, found[0]], rows.arrival) if found[1] is None else None
        self._announced = rows.announced
        self._unwrapper = Unwrapper(rows.announced, unit)
        self._segment = -1

    def _piece(self, device: Array, arrival: Array) -> Array:
        """Rows on one piece of the device's clock."""
        end, late = float(device[-1]), float(arrival[-1] - device[-1])
        new = not self._points
        if new or end - self._bin >= BIN:
            self._bin = end
            self._points.append((end, late))
            self._fit()
        elif late < self._points[-1][1]:
            self._points[-1] = (end, late)
        self._lowest = min(self._lowest, late - (self._rate - 1.0) * end)
        if new:
            self._offset, self._device_end = self._lowest, end
        before, passed = self._offset, end - self._device_end
        if passed > 0.0 and not self._alien:
            self._offset += min(max(self._lowest - self._offset, -SLEW * passed), SLEW * passed)
            share = np.clip((device - self._device_end) / passed, 0.0, 1.0)
            offset = before + (self._offset - before) * share
        else:
            offset = np.full(device.size, before)
        self._device_end = max(end, self._device_end)
        return np.asarray(offset + self._rate * device, dtype=np.float64)

    def _fit(self) -> None:
        """Fit the rate anew, so that the time goes on from where it is."""
        self._points = self._points[-KEPT:]
        x, y = np.array(self._points).T
        if x.size % EACH == 0 and x[-1] - x[0] >= _SETTLED and np.all(np.diff(x) > 0.0):
            slope = drift([(x, y)])
            self._alien = slope is None
            rate = 1.0 + (slope or 0.0)
            self._offset += (self._rate - rate) * self._device_end
            self._rate = rate
        self._lowest = float(np.min(y - (self._rate - 1.0) * x))
