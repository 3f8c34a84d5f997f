"""A device without hardware, as a context that runs beside the program that reads it."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

import numpy as np
import pyarrow as pa

from imufit.devices.emulate.capacity import check, load_of
from imufit.devices.emulate.clock import Clock
from imufit.devices.emulate.course import Course
from imufit.devices.emulate.device import DEVICES
from imufit.devices.emulate.faults import Fault, Schedule, parse_fault
from imufit.devices.emulate.form import FORMS
from imufit.devices.emulate.line import line_at
from imufit.devices.emulate.pace import Pace
from imufit.devices.emulate.sent import Sent
from imufit.devices.emulate.source import Effects, Source, open_source
from imufit.devices.emulate.transmission import DRAINED, Parts, Transmission
from imufit.errors import InputError
from imufit.log import Log
from imufit.log.metadata import Frame
from imufit.remedy import keyword, option

PROBE = 5.0
"""Length (s) of a scenario by which the load of the line is judged."""


class Emulator:
    """A device without hardware: it uses the wire protocol, or text, on a pty or a socket.

    As a context it runs in a thread from entering to leaving; `run` runs it here.

    Parameters
    ----------
    source : str, Path or Log
        Name of a scenario out of `imufit.lab.simulate.SCENARIOS`, file of a log, or a log.
    on : str
        ``pty`` or ``socket://127.0.0.1:PORT``, port 0 for a free one.
    link : Path, optional
        Symbolic link to the pty, which stays the same when the device is unplugged and comes back.
    device : {"floats", "mpu6050", "gy86"}
        Floats of whatever the source has, or registers of these chips.
    form : {"binary", "text"}
        Frames of the wire protocol, or lines of text.
    rate : float or "max", optional
        Rows a second; "max" is the highest that `baud` carries.
    duration : float, optional
        Time until it ends, s; that of the source without it.
    loop : bool
        Whether it begins again after the last row of the source.
    speed : float or "max"
        Seconds of the device in a second; "max" sends as fast as it is read.
    baud : int, optional
        Bits a second of the line: a rate that it does not carry is refused.
    clock : Clock, optional
        The device's clock.
    faults : sequence of Fault or str
        What goes wrong, such as ``unplug@3:1``.
    fault_rates : mapping of str to float, optional
        What goes wrong by chance, so many a second on average.
    effects : mapping, optional
        Effects of a scenario's sensor, as for `imufit.lab.simulate.simulate`.
    seed : int
        Of a scenario, the jitter, and all chance.
    frame : {"NED", "ENU", "NWU"}
        In which a scenario is simulated. Its device lies level there, but that of `six_sides`, which begins with its z
        axis up in every frame.
    start : int
        Number of the device's first start, 0 to 255.
    wait : bool, optional
        Whether the device is only switched on when somebody listens; True for a socket without it.
    sent : Path or bool
        Where to keep every sample with what became of it: a Parquet file, or True for memory.
    mapping : iterable of str
        Columns and units of a log's file.

    Raises
    ------
    InputError
        A source, line or fault that cannot be, or a rate that the line does not carry.

    Examples
    --------
    >>> with Emulator("handheld", duration=1.0, speed="max") as device:
    ...     print(device.port)  # doctest: +SKIP
    /dev/pts/3
    """

    def __init__(
        self,
        source: str | Path | Log,
        *,
        on: str = "pty",
        link: Path | None = None,
        device: str = "floats",
        form: str = "binary",
        rate: float | Literal["max"] | None = None,
        duration: float | None = None,
        loop: bool = False,
        speed: float | Literal["max"] = 1.0,
        baud: int | None = None,
        clock: Clock | None = None,
        faults: Sequence[Fault | str] = (),
        fault_rates: Mapping[str, float] | None = None,
        effects: Effects | None = None,
        seed: int = 0,
        frame: Frame = "NED",
        start: int = 1,
        wait: bool | None = None,
        sent: Path | bool = False,
        mapping: Iterable[str] = (),
    ) -> None:
        for name, known, given in (("device", DEVICES, device), ("form", FORMS, form)):
            if given not in known:
                raise InputError(f"the {name} {given!r} is not known", remedy=f"Use one of {', '.join(known)}.")
        hurry = np.inf if speed == "max" else float(speed)
        if not hurry > 0.0:
            raise InputError(f"the speed is {speed}", remedy="Give a number above 0, or max.")
        if rate == "max" and baud is None:
            raise InputError("the highest rate depends on the line", remedy="Give " + keyword("baud") + " as well.")
        if duration is not None and not duration > 0.0:
            raise InputError(f"the duration is {duration} s", remedy="Give a number above 0.")
        ticks = clock or Clock()
        opened_at = partial(
            open_source, source, device=device, effects=effects, seed=seed, frame=frame, mapping=tuple(mapping)
        )
        # Capacity of the line in a second of the device.
        carried = None if baud is None else int(baud / (hurry if np.isfinite(hurry) else 1.0))
        if carried is not None and (rate == "max" or np.isfinite(hurry)):
            short = opened_at(rate=None if rate == "max" else rate, duration=PROBE)
            probe = DEVICES[device](short)
            load = load_of(probe, FORMS[form](probe, ticks.tick, 0))
            if rate == "max":
                rate = load.highest_rate(carried)
            else:
                check(load, short.rate, carried)
        opened = opened_at(rate=None if rate == "max" else rate, duration=duration)
        streams = DEVICES[device](opened)
        planned = [parse_fault(fault) if isinstance(fault, str) else fault for fault in faults]
        unplugged = any(fault.kind == "unplug" for fault in planned) or (fault_rates or {}).get("unplug", 0.0) > 0.0
        if unplugged and on == "pty" and link is None:
            raise InputError(
                "an unplugged pty returns with another name",
                remedy="Give " + keyword("link") + " a path, or use " + option("on", "socket://127.0.0.1:5000"),
            )
        self.source: Source = opened
        self._wait = on != "pty" if wait is None else wait
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._error: BaseException | None = None
        by_chance = np.random.default_rng([seed, 1])
        self._sent = Sent(streams, sent)
        self._line = line_at(on, link)
        parts = Parts(
            streams,
            FORMS[form](streams, ticks.tick, start),
            ticks,
            self._line,
            Pace(hurry, self._stop),
            Course(opened.t, opened.length, np.inf if duration is None else duration, loop=loop),
            Schedule(planned, fault_rates or {}, by_chance),
            self._sent,
            np.random.default_rng([seed, 2]),
        )
        self._transmission = Transmission(parts, self._stop)

    @property
    def port(self) -> str:
        """Name that a reader opens: path of the pty or its link, or URL of the socket."""
        return self._line.address

    def open(self) -> Self:
        """Plug it in without switching it on, so that `port` can be printed."""
        self._line.open()
        return self

    def run(self) -> None:
        """Send until the source ends or `stop`; the line is open before and closed after."""
        try:
            with self._sent:
                if self._wait:
                    self._transmission.await_reader()
                self._transmission.run()
                self._line.drain(0.0 if self._stop.is_set() else DRAINED)
        finally:
            self._line.close()

    def stop(self) -> None:
        """End it soon."""
        self._stop.set()

    def join(self, timeout: float | None = None) -> bool:
        """Wait until it has sent everything; return whether it has.

        Parameters
        ----------
        timeout : float, optional
            Longest wait, s.
        """
        if self._thread is not None:
            self._thread.join(timeout)
            return not self._thread.is_alive()
        return True

    def _run_beside(self) -> None:
        try:
            self.run()
        except BaseException as error:  # raised when the context is left
            self._error = error

    def __enter__(self) -> Self:
        self.open()
        self._thread = threading.Thread(target=self._run_beside, name="imufit emulator", daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()
        self.join()
        if self._error is not None and error is None:
            raise self._error

    @property
    def sent(self) -> pa.Table:
        """Samples so far with the fate of each, as in `Sent`; of a run that keeps them in memory."""
        return self._sent.table()

    def summary(self) -> dict[str, Any]:
        """Return what was sent: samples, how many of them intact, faults with their times (s)."""
        return {"port": self.port, "source": self.source.name, "rate": self.source.rate, **self._transmission.summary()}
