"""Bytes and rows as they come from a line: the device's announcement, the numbers, and their times of arrival."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FORMS: Final = ("binary", "text")
_BY_ROW: Final = ("arrival", "opening", "start", "stamps", "sequence", "lost", "values")


@dataclass(frozen=True)
class Chunk:
    """Bytes as they were read at once.

    Attributes
    ----------
    arrival : float
        When, s on the clock of `time.monotonic`.
    opening : int
        How often the line was opened anew before.
    data : bytes
        At least one.
    """

    arrival: float
    opening: int
    data: bytes


@dataclass(frozen=True)
class Announced:
    """A device's announcement of its rows.

    Attributes
    ----------
    form : {"binary", "text"}
        Form of the wire protocol.
    name : str
        Name of the device; empty in text form.
    tick : float
        Tick of its clock, s; 0 in text form.
    columns : tuple of str
        Columns as it names them.
    ranges, rates : tuple of float
        Per column: value at which it clips, SI units, and rows per second; 0 where that is not known.

    Raises
    ------
    ValueError
        Another form.
    """

    form: str
    name: str
    tick: float
    columns: tuple[str, ...]
    ranges: tuple[float, ...] = ()
    rates: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.form not in {"binary", "text"}:
            raise ValueError(f"{self.form!r} is not a form of the wire protocol")


@dataclass(frozen=True)
class Arrived:
    """Rows of one start of a device, in order; n rows.

    Attributes
    ----------
    announced : Announced
        What they hold.
    arrival : (n,) array
        When the bytes that ended each row were read, s on the clock of `time.monotonic`.
    opening : (n,) uint32 array
        How often the line was opened anew before.
    start : (n,) uint8 array
        Number of the device's start; 0 in text form.
    stamps : (n,) uint32 array
        Ticks of the device's clock; 0 in text form.
    sequence : (n,) uint16 array
        Number of each frame; 0 in text form.
    lost : (n,) uint32 array
        Frames missing, or lines damaged, before each row.
    values : (n, columns) array
        Numbers as decoded: SI units in binary form.
    """

    announced: Announced
    arrival: Array
    opening: NDArray[np.uint32]
    start: NDArray[np.uint8]
    stamps: NDArray[np.uint32]
    sequence: NDArray[np.uint16]
    lost: NDArray[np.uint32]
    values: Array

    @property
    def n(self) -> int:
        """Number of rows."""
        return int(self.arrival.size)

    def part(self, begin: int, end: int) -> Self:
        """Rows ``begin <= row < end``.

        Parameters
        ----------
        begin, end : int
            First row, and the row after the last one, counted from 0.
        """
        return type(self)(self.announced, *(getattr(self, name)[begin:end] for name in _BY_ROW))

    @classmethod
    def joined(cls, parts: Sequence[Arrived]) -> Self:
        """Join rows of one announcement, in order.

        Parameters
        ----------
        parts : sequence of Arrived
            At least one.
        """
        return cls(parts[0].announced, *(np.concatenate([getattr(p, name) for p in parts]) for name in _BY_ROW))

    def where(self, wanted: NDArray[np.bool_]) -> Arrived:
        """Return some of the rows.

        Parameters
        ----------
        wanted : (n,) array of bool
            Which.
        """
        return Arrived(self.announced, *(getattr(self, name)[wanted] for name in _BY_ROW))


def of_frames(batch: Any, arrival: Array, opening: NDArray[np.uint32]) -> Arrived:
    """Rows of a batch of frames, as `WireDecoder.take` gives them, with what is known of when each came."""
    announced = Announced(
        "binary",
        batch["name"],
        batch["tick"],
        tuple(batch["columns"]),
        tuple(batch["ranges"]),
        tuple(batch["rates"]),
    )
    n = len(batch["stamps"])
    return Arrived(
        announced,
        arrival,
        opening,
        np.full(n, batch["start"], np.uint8),
        batch["stamps"],
        batch["sequence"],
        batch["lost"],
        batch["values"],
    )


def of_lines(batch: Any, arrival: float, opening: int) -> Arrived:
    """Rows of a batch of lines, as `LineDecoder.take` gives them."""
    n = len(batch["lost"])
    return Arrived(
        Announced("text", "", 0.0, tuple(batch["columns"])),
        np.full(n, arrival),
        np.full(n, opening, np.uint32),
        np.zeros(n, np.uint8),
        np.zeros(n, np.uint32),
        np.zeros(n, np.uint16),
        batch["lost"],
        batch["values"],
    )
