"""Filters on the rows of a device, and what they say some times a second."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from imufit.devices.monitor.correction import LiveCorrection
from imufit.devices.record.attitude import LiveAttitude
from imufit.devices.record.live_rows import LiveRows
from imufit.log.metadata import Frame
from imufit.results.json_value import json_value

if TYPE_CHECKING:
    from imufit.loop import SensorModel

Array = NDArray[np.float64]

_WINDOW: Final = 2.0  # over which the rate is taken, s


@dataclass(frozen=True)
class MonitorState:
    """The present state of a device.

    Attributes
    ----------
    t : float
        Time of the last row, s from the first one; NaN before it.
    n : int
        Rows so far.
    rate_hz : float
        Rows per second over the last two seconds.
    lost, damaged : int
        Frames missing, and frames or lines damaged, so far.
    unplugged : int
        How often the line was opened anew.
    connected : bool
        Whether the line is open.
    temp : float
        Temperature of the sensor, degC; NaN where it is not known.
    angles : dict of (3,) arrays
        Roll, pitch and yaw by filter, rad; NaN before its start.
    device : str
        Name of the device.
    messages : tuple of str
        Messages of the device since the last state.
    trouble : str
        Why nothing could be decoded so far; empty if something was.
    readings : dict of float
        Last reading of every column, SI units, the model's effects taken out.
    """

    t: float
    n: int
    rate_hz: float
    lost: int
    damaged: int
    unplugged: int
    connected: bool
    temp: float
    angles: dict[str, Array]
    device: str
    messages: tuple[str, ...]
    trouble: str
    readings: dict[str, float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """JSON of `monitor`: angles in deg."""
        names = ("t", "n", "rate_hz", "lost", "damaged", "unplugged", "temp", "device")
        filters = {
            name: dict(zip(("roll_deg", "pitch_deg", "yaw_deg"), np.degrees(angles).tolist(), strict=True))
            for name, angles in self.angles.items()
        }
        told = {name: json_value(getattr(self, name)) for name in names}
        return {**told, "filters": json_value(filters), "readings": json_value(self.readings)}


class Monitor:
    """Several attitude filters on a running device: a context manager that is iterated over.

    Parameters
    ----------
    port : str
        Whatever pyserial opens.
    filters : sequence of str
        Names out of `imufit.replaying.FILTERS`; none means triad, mahony and hybrid with a magnetometer, and accel,
        gyro, complementary and kalman without one.
    model : SensorModel, optional
        Its effects are taken out of the readings first.
    frame : {"NED", "ENU", "NWU"}
        Reference frame of the angles: for a sensor that lies z up, NWU or ENU.
    every : float
        Time from one state to the next, s.
    stopped : callable, optional
        Iteration ends when it returns True.
    see : callable, optional
        Called with each batch of rows, (n,) arrays by name, that the filters have taken, the model's effects taken out.
    **options
        As for `imufit.devices.record.LiveRows`: `baud`, `form`, `header`, `mapping`, `duration`, `give_up`, `watch`.

    Raises
    ------
    InputError
        The port cannot be opened, a filter needs a sensor that is not there, or the model cannot be used live.
    """

    def __init__(
        self,
        port: str,
        filters: Sequence[str] = (),
        *,
        model: SensorModel | None = None,
        frame: Frame = "NED",
        every: float = 0.1,
        stopped: Callable[[], bool] = lambda: False,
        see: Callable[[dict[str, Array]], None] = lambda batch: None,
        **options: Any,
    ) -> None:
        self._filters = tuple(filters)
        self._correction = None if model is None else LiveCorrection(model)
        self._frame: Frame = frame
        self._every = every
        self._see = see
        self._rows = LiveRows(port, idle=True, stopped=stopped, **options)
        self._attitude: LiveAttitude | None = None
        self._columns: tuple[str, ...] = ()
        self._marks: deque[tuple[float, int]] = deque()
        self._t, self._n, self._temp = np.nan, 0, np.nan
        self._readings: dict[str, float] = {}

    def __enter__(self) -> Self:
        self._rows.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._rows.__exit__(kind, error, trace)

    def __iter__(self) -> Iterator[MonitorState]:
        """Give a state every so often, whether rows came or not, and one at the end."""
        held: list[dict[str, Array]] = []
        following = time.monotonic() + self._every
        for batch in self._rows:
            if held and held[-1].keys() != batch.keys():
                self._follow(held)
                held = []
            held.append(batch)
            now = time.monotonic()
            if now >= following:
                following = now + self._every
                self._follow(held)
                held = []
                yield self._state(now)
        self._follow(held)
        yield self._state(time.monotonic())

    def _follow(self, held: Sequence[dict[str, Array]]) -> None:
        """Run the filters over the batches that came."""
        if not held:
            return
        batch = {name: np.concatenate([part[name] for part in held]) for name in held[0]}
        if not batch["t"].size:
            return
        if self._correction is not None:
            batch = self._correction(batch)
        if self._attitude is None or self._columns != self._rows.columns:
            self._columns = self._rows.columns
            self._attitude = LiveAttitude(self._columns, self._filters, frame=self._frame)
        self._attitude.add(batch)
        self._see(batch)
        self._n += batch["t"].size
        self._t = float(batch["t"][-1])
        for name, values in batch.items():
            if name != "t" and np.issubdtype(values.dtype, np.number) and np.isfinite(values).any():
                self._readings[name] = float(values[np.isfinite(values)][-1])
        warm = batch.get("temp", np.empty(0))
        if np.isfinite(warm).any():
            self._temp = float(warm[np.isfinite(warm)][-1])

    def _state(self, now: float) -> MonitorState:
        counts = self._rows.counts
        self._marks.append((now, self._n))
        while now - self._marks[0][0] > _WINDOW:
            self._marks.popleft()
        passed = now - self._marks[0][0]
        return MonitorState(
            t=self._t,
            n=self._n,
            rate_hz=(self._n - self._marks[0][1]) / passed if passed > 0.0 else 0.0,
            lost=counts["lost"],
            damaged=counts["damaged"],
            unplugged=self._rows.openings,
            connected=self._rows.connected,
            temp=self._temp,
            angles={} if self._attitude is None else dict(self._attitude.angles),
            device=self._rows.name,
            messages=tuple(self._rows.take_texts()),
            trouble=self._rows.trouble,
            readings=dict(self._readings),
        )
