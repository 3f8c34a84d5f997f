"""How samples stand on the line: frames of the wire protocol, or lines of text as Arduino sketches print them."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.devices.emulate.device import Device
from imufit.errors import InputError
from imufit.remedy import option

Array = NDArray[np.float64]

ANNOUNCED = 1.0
"""Time between two announcements, s."""
LONGEST = 1024
"""Bytes that a frame may have on the wire, its end not counted."""


class Form(Protocol):
    """The encoder of rows into bytes.

    Attributes
    ----------
    end : int
        Byte that ends a frame or line and stands nowhere else.
    every : float
        Time between two announcements, s; infinite if there is one at the start only.
    greets : bool
        Whether a reader that opens the port gets the announcement anew, as from a board that is reset by that.
    start : int
        Number of the device's start.
    sequence : int
        Number of the next frame since the start.
    """

    end: int
    every: float
    greets: bool
    start: int
    sequence: int

    def announce(self) -> bytes:
        """Return the announcement of the rows' columns."""

    def asks(self, said: bytes) -> bool:
        """Return whether a reader requests the announcement.

        Parameters
        ----------
        said : bytes
            What it said.
        """

    def rows(self, stamps: NDArray[np.uint32], values: Array) -> tuple[bytes, NDArray[np.uint64]]:
        """Return rows as bytes, and where each ends.

        Parameters
        ----------
        stamps : (n,) array
            Ticks of the device's clock.
        values : (n, columns) array
            Readings, SI units, NaN where there is none.
        """

    def restarted(self) -> Form:
        """Return the same after a reset: another start, frames counted from 0."""


class Binary:
    """Frames of the wire protocol; attributes as in `Form`.

    Parameters
    ----------
    device : Device
        What is announced.
    tick : int
        Length of a tick, ns.
    start : int
        Number of the start, 0 to 255.
    """

    end = 0
    every = ANNOUNCED
    greets = False

    def __init__(self, device: Device, tick: int, start: int) -> None:
        self._device, self._tick = device, tick
        self.start, self.sequence = start, 0
        try:
            self._encoder = _imufit.WireEncoder(device.name, tick, device.streams, start)
        except ValueError as error:
            raise InputError(str(error)) from error
        announcement = _imufit.WireEncoder(device.name, tick, device.streams, start).announce()
        if len(announcement) > LONGEST:
            raise InputError(
                f"{len(device.columns)} columns cannot be announced in a frame of {LONGEST} bytes",
                remedy="Use " + option("form", "text") + ", or a log with fewer columns.",
            )

    def announce(self) -> bytes:
        """Return the announcement as a frame."""
        self.sequence += 1
        return self._encoder.announce()

    def asks(self, said: bytes) -> bool:
        """Return whether a byte 0 came, as docs/wire.md has it."""
        return self.end in said

    def rows(self, stamps: NDArray[np.uint32], values: Array) -> tuple[bytes, NDArray[np.uint64]]:
        """Return samples as frames, and where each ends."""
        self.sequence += len(stamps)
        return self._encoder.samples(stamps, np.ascontiguousarray(values))

    def restarted(self) -> Binary:
        """Return the same after a reset."""
        return Binary(self._device, self._tick, (self.start + 1) % 256)


def cell(value: float) -> str:
    """Return a number as it stands in a line; nothing for one that is not there.

    Parameters
    ----------
    value : float
        The number, or NaN.
    """
    return "" if math.isnan(value) else f"{value:.7g}"


class Text:
    """A header and lines of numbers separated by commas; arguments as `Binary`, attributes as in `Form`."""

    end = ord("\n")
    every = np.inf
    greets = True

    def __init__(self, device: Device, tick: int, start: int) -> None:
        self._device, self._tick = device, tick
        self.start, self.sequence = start, 0

    def announce(self) -> bytes:
        """Return the header: ticks of a millisecond are called t_ms, all others become t_us."""
        time = "t_ms" if self._tick == 1_000_000 else "t_us"
        return (",".join([time, *self._device.columns]) + "\r\n").encode()

    def asks(self, said: bytes) -> bool:
        """Return False: a sketch that prints text does not read the line."""
        return False

    def rows(self, stamps: NDArray[np.uint32], values: Array) -> tuple[bytes, NDArray[np.uint64]]:
        """Return lines, and where each ends; what is not there is an empty cell."""
        self.sequence += len(stamps)
        unit = 1_000_000 if self._tick == 1_000_000 else 1000
        times = stamps.astype(np.uint64) * np.uint64(self._tick) // np.uint64(unit)
        lines = [
            ",".join([str(t), *map(cell, row)]) + "\r\n" for t, row in zip(times.tolist(), values.tolist(), strict=True)
        ]
        return "".join(lines).encode(), np.cumsum([len(line) for line in lines], dtype=np.uint64)

    def restarted(self) -> Text:
        """Return the same after a reset."""
        return Text(self._device, self._tick, (self.start + 1) % 256)


FORMS: dict[str, type[Binary] | type[Text]] = {"binary": Binary, "text": Text}
"""Forms by name."""
