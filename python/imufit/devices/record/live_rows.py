"""Rows of a device as they come, for one's own program."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from types import TracebackType
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from imufit.devices.record.arrived import Announced, Arrived
from imufit.devices.record.columns import Columns
from imufit.devices.record.live_clock import LiveClock
from imufit.devices.record.reception import Reception, listen
from imufit.devices.record.transport import Line
from imufit.errors import InputError

Array = NDArray[np.float64]

IDLE: Final = 0.1
"""Time without rows after which an empty batch is given to who wants such, s."""


class LiveRows:
    """Rows of a device, batch by batch, as they come: a context manager that is iterated over.

    A line that is lost is opened again; iteration ends with `duration`, `give_up` or `stopped`.

    Parameters
    ----------
    port : str
        Whatever pyserial opens: ``/dev/ttyUSB0``, ``COM3``, a pseudo-terminal, ``socket://127.0.0.1:5000``.
    baud : int
        Bits per second.
    form : {"auto", "binary", "text"}
        Form of the wire protocol.
    header : str, optional
        Names of the columns in text form, for a device that prints none: ``"t_ms,acc_x,acc_y,acc_z"``.
    mapping : mapping, optional
        Source text for target columns, such as ``{"acc_x": "-AccX[g]"}``.
    duration : float, optional
        Iteration ends so long after it began, s.
    give_up : float, optional
        Iteration ends when the line was lost for so long, s; without it waits for ever.
    idle : bool
        Whether to give a batch of no rows when nothing came for 0.1 s, so that the caller can look at other things.
    stopped : callable, optional
        Iteration ends when it returns True.
    watch : callable, optional
        Called after each read with the reception and the rows as they arrived, such as a `Recorder` takes.

    Raises
    ------
    InputError
        The port cannot be opened, or no log can be made of the columns that the device names.

    Examples
    --------
    >>> with LiveRows("/dev/ttyUSB0") as rows:  # doctest: +SKIP
    ...     for batch in rows:
    ...         print(batch["t"][-1], batch["acc_x"][-1])
    """

    def __init__(
        self,
        port: str,
        *,
        baud: int = 115200,
        form: str = "auto",
        header: str | None = None,
        mapping: Mapping[str, str] | None = None,
        duration: float | None = None,
        give_up: float | None = None,
        idle: bool = False,
        stopped: Callable[[], bool] = lambda: False,
        watch: Callable[[Reception, list[Arrived]], None] | None = None,
    ) -> None:
        self._line = Line(port, baud)
        self._reception = Reception(self._line, form, header)
        check_mapping(mapping)
        self._duration = duration
        self._give_up = give_up
        self._idle = idle
        self._stopped = stopped
        self._watch = watch
        self._converter = LiveConverter(mapping)

    def __enter__(self) -> Self:
        self._line.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._line.close()

    def __iter__(self) -> Iterator[dict[str, Array]]:
        """Give each batch as (n,) arrays by name: `t`, s from the first row, increasing; the rest in SI units."""
        last = time.monotonic()
        over = {"duration": self._duration, "give_up": self._give_up}
        for parts in listen(self._reception, stopped=self._stopped, **over):
            if self._watch is not None:
                self._watch(self._reception, parts)
            for rows in parts:
                yield self._converter.batch(rows)
            now = time.monotonic()
            if parts:
                last = now
            elif self._idle and now - last >= IDLE:
                last = now
                yield {"t": np.empty(0), **{name: np.empty(0) for name in self.columns}}
        for rows in self._reception.finish():
            yield self._converter.batch(rows)

    @property
    def name(self) -> str:
        """Name of the device; empty before it is known."""
        announced = self._converter.announced
        return "" if announced is None else announced.name

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns besides `t`; empty before they are known."""
        return self._converter.names

    @property
    def counts(self) -> dict[str, int]:
        """Bytes, samples, and what is ``lost``, ``damaged``, ``unknown``, ``unexplained``, ``restarts``."""
        return self._reception.counts

    @property
    def openings(self) -> int:
        """How often the line was opened anew."""
        return self._line.opening

    @property
    def connected(self) -> bool:
        """Whether the line is open."""
        return self._line.lost_since is None

    @property
    def trouble(self) -> str:
        """Why nothing could be decoded so far; empty if something was."""
        return self._reception.nothing_whole

    def take_texts(self) -> list[str]:
        """Messages of the device since the last call."""
        return self._reception.take_texts()


class LiveConverter:
    """Rows as they arrive to columns of a log.

    Parameters
    ----------
    mapping : mapping, optional
        As for `LiveRows`.
    """

    def __init__(self, mapping: Mapping[str, str] | None = None) -> None:
        self._mapping = mapping
        self._clock = LiveClock()
        self._columns: Columns | None = None
        self.announced: Announced | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Columns besides `t`; empty before they are known."""
        return () if self._columns is None else self._columns.names

    def batch(self, rows: Arrived) -> dict[str, Array]:
        """Columns of the next rows, SI units, with `t`.

        Parameters
        ----------
        rows : Arrived
            As `Reception.poll` gives them.
        """
        if self._columns is None or rows.announced != self.announced:
            self._columns = Columns(rows.announced, self._mapping)
            self.announced = rows.announced
        return {"t": self._clock.times(rows), **self._columns.of(rows.values)}


def check_mapping(mapping: Mapping[str, str] | None) -> None:
    """Refuse a mapping that makes the time: that is the recording's own.

    Parameters
    ----------
    mapping : mapping or None
        Source text for target columns.
    """
    if mapping and "t" in mapping:
        raise InputError(
            "the time of a recording cannot be mapped",
            column="t",
            remedy="Name the column of time t_ms, t_us or t in the header of the text.",
        )
