"""The files of a running recording: bytes until rows come out of them, then rows, a batch five times a second."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from imufit.devices.record.arrived import Arrived
from imufit.devices.record.beginning import BeginningFile, beginning_path
from imufit.devices.record.circumstances import Circumstances
from imufit.devices.record.columns import Columns
from imufit.devices.record.finish import utc_now
from imufit.devices.record.part import PartFile, part_path
from imufit.devices.record.reception import Reception
from imufit.devices.record.rig import Rig
from imufit.errors import InputError
from imufit.log.metadata import Frame, Metadata
from imufit.remedy import Remedy, recovering

EVERY: Final = 0.2
"""Time after which rows are written, s: with the time that reading and writing take, a crash costs less than 0.25 s."""


class DiskError(InputError):
    """The disk is full or gone."""


class Journal:
    """The parts of a recording; another one begins when the device announces other columns.

    Until the first rows are in a part, the bytes themselves are kept: a device may announce itself late.

    Parameters
    ----------
    log : Path
        The log to be; its first part is made at once.
    reception : Reception
        Where the rows come from.
    mapping : mapping or None
        Source text for target columns.
    frame : {"NED", "ENU", "NWU"}
        Reference frame that the log will name.
    rig : Rig, optional
        The rig that the device is on, whose commanded angle becomes a column.

    Raises
    ------
    InputError
        A part is there already, left by a crash, or cannot be made.
    """

    def __init__(
        self,
        log: Path,
        reception: Reception,
        mapping: Mapping[str, str] | None,
        frame: Frame = "NED",
        rig: Rig | None = None,
    ) -> None:
        self._log = log
        self._reception = reception
        self._mapping = mapping
        self._about = Circumstances(
            port=reception.line.port,
            utc=utc_now(),
            monotonic=time.monotonic(),
            mapping=None if mapping is None else dict(mapping),
            frame=Metadata.from_mapping({"frame": frame}, None).frame,
            rig_axis=None if rig is None else rig.axis,
            rig_angle=None if rig is None else _plain(rig.angle),
        )
        # A recording may begin while the device has been listened to for long.
        self._counts_before = reception.counts
        self._rig = rig
        self._angles: list[tuple[float, float | None]] = []
        self._held: list[Arrived] = []
        self._texts: list[tuple[float, str]] = []
        self._lost_since: float | None = None
        self._next = 0.0
        for left in (part_path(log), beginning_path(log)):
            if left.exists():
                raise InputError(
                    "an earlier recording left this part",
                    file=left,
                    remedy="Run " + recovering(left) + " first, or delete it.",
                )
        self._parts = [self._made(1)]
        self._beginning: BeginningFile | None = None

    def _made(self, number: int) -> PartFile:
        path = part_path(self._log, number)
        try:
            return PartFile(path)
        except OSError as error:
            raise DiskError(f"{path} cannot be written ({error.strerror or error})", file=path) from None

    @property
    def paths(self) -> list[Path]:
        """Parts written so far."""
        return [part.path for part in self._parts]

    def take(self, rows: Sequence[Arrived], texts: Sequence[str] = ()) -> None:
        """Keep rows and messages, and write them when it is time.

        Parameters
        ----------
        rows : sequence of Arrived
            As they came.
        texts : sequence of str
            Messages of the device.

        Raises
        ------
        DiskError
            The disk is full or gone: what was written stays.
        InputError
            The device announces columns of which no log can be made. Earlier rows stay.
        """
        now = time.monotonic()
        self._keep_beginning()
        self._texts += [(now, text) for text in texts]
        for part in rows:
            if self._held and self._held[-1].announced != part.announced:
                self._write()
            self._held.append(part)
        told = self._lost_since != self._reception.line.lost_since
        if now >= self._next and (self._held or told or self._angles):
            self._write()

    def command(self, angle: float) -> None:
        """Note that from now on another angle of the rig is commanded; it is written with the rows of that time.

        Parameters
        ----------
        angle : float
            rad; NaN while the rig moves.
        """
        self._angles.append((time.monotonic(), _plain(angle)))

    @property
    def n(self) -> int:
        """Rows that are written."""
        return sum(part.rows for part in self._parts)

    def end(self, why: str, away: float | None = None) -> None:
        """Write what is left, and why the recording ended.

        Parameters
        ----------
        why : str
            For `Recording.ended`.
        away : float, optional
            Since when the line had been lost then, s on the clock of `time.monotonic`.
        """
        self._write(ended=why, lost_since=away)
        for part in self._parts:
            self._guarded(part, part.settle)

    def _keep_beginning(self) -> None:
        """Write the bytes that were read as they are, until rows that came out of them are written."""
        if self.n > 0:
            if self._beginning is not None:
                self._beginning.discard()
            return
        chunk = self._reception.chunk
        if chunk is None:
            return
        path = beginning_path(self._log)
        try:
            if self._beginning is None:
                self._beginning = BeginningFile(path, self._about, self._reception.listening)
            self._beginning.keep(chunk)
        except OSError as error:
            raise DiskError(f"{path} cannot be written ({error.strerror or error})") from None

    def close(self) -> None:
        """Close the files."""
        if self._beginning is not None:
            self._beginning.close()
        for part in self._parts:
            part.close()

    def _write(self, **more: Any) -> None:
        held, self._held = self._held, []
        texts, self._texts = self._texts, []
        now = time.monotonic()
        self._next = now + EVERY
        self._lost_since = self._reception.line.lost_since
        if held and held[0].announced != self._parts[-1].announced:
            names = Columns(held[0].announced, self._mapping).names
            if self._rig is not None and "ref_angle" in names:
                raise InputError(
                    "the device sends ref_angle itself",
                    column="ref_angle",
                    remedy="Record without "
                    + Remedy("rig", "--angle and --axis")
                    + ", and name rig_axis in the metadata.",
                )
            if self._parts[-1].announced is not None:
                self._parts.append(self._made(len(self._parts) + 1))
            self._parts[-1].begin(held[0].announced, self._about)
        part = self._parts[-1]
        if part.announced is None:
            self._texts = texts
            return
        counts = {name: n - self._counts_before.get(name, 0) for name, n in self._reception.counts.items()}
        told: dict[str, Any] = {"counts": counts, "now": now, "lost_since": self._lost_since, **more}
        if texts:
            told["texts"] = texts
        if self._angles:
            told["angles"], self._angles = self._angles, []
        self._guarded(part, lambda: part.write(Arrived.joined(held) if held else None, told))

    @staticmethod
    def _guarded(part: PartFile, write: Callable[[], None]) -> None:
        try:
            write()
        except OSError as error:
            raise DiskError(f"{part.path} cannot be written ({error.strerror or error})") from None


def _plain(angle: float) -> float | None:
    """Angle as JSON has it: None for one that is not known."""
    return None if math.isnan(angle) else angle
