"""A line on standard error that shows how a recording goes."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Sequence
from itertools import groupby
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

import numpy as np

from imufit.devices.record.arrived import Arrived
from imufit.devices.record.attitude import LiveAttitude
from imufit.devices.record.live_rows import LiveConverter
from imufit.devices.record.reception import Reception
from imufit.errors import InputError
from imufit.log.metadata import Frame

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.live import Live

EVERY: Final = 0.2
"""Time between two states of the line, s."""
PATIENCE: Final = 5.0
"""Time after which it is said that nothing whole comes, s."""
SPARSE: Final = 10.0
"""Time between two lines where no terminal is, s: a file of one hour has 360 of them."""
HOW_TO_STOP: Final = "Ctrl-C ends it"
_WINDOW: Final = 2.0  # over which the rate is taken, s


class StatusLine:
    """Called as a recording's `watch`; a context manager that takes the line away again.

    Where no person is looking (standard error is not a terminal) the line is omitted; messages of the device are
    printed in either case.

    Parameters
    ----------
    mapping : mapping or None
        Source text for target columns.
    quiet : bool
        Whether to say nothing at all.
    frame : {"NED", "ENU", "NWU"}
        Reference frame of the attitude.
    """

    def __init__(self, mapping: Mapping[str, str] | None = None, quiet: bool = False, *, frame: Frame = "NED") -> None:
        self._frame: Frame = frame
        self._quiet = quiet
        self._shown = sys.stderr.isatty() and not quiet
        self._converter = LiveConverter(mapping)
        self._attitude: LiveAttitude | None = None
        self._held: list[Arrived] = []
        self._begin = time.monotonic()
        self._next = 0.0
        self._next_sparse = self._begin + SPARSE
        self._marks: deque[tuple[float, int]] = deque()
        self._temp = np.nan
        self._warned = False
        self._live: Live | None = None

    def __enter__(self) -> Self:
        if self._shown:
            from rich.console import Console  # noqa: PLC0415
            from rich.live import Live  # noqa: PLC0415

            console = Console(stderr=True, highlight=False, markup=False, emoji=False)
            self._live = Live(console=console, transient=True, auto_refresh=False)
            self._live.start()
        self._begin = time.monotonic()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()

    def __call__(self, reception: Reception, rows: Sequence[Arrived], texts: Sequence[str]) -> None:
        """Take what came, and renew the line when it is time."""
        if self._quiet:
            return
        for text in texts:
            self._say(f"device: {text}")
        now = time.monotonic()
        if not self._warned and now - self._begin > PATIENCE:
            self._warned = True
            if why := reception.nothing_whole:
                self._say(f"after {PATIENCE:.0f} s: {why}")
        if not self._shown:
            if now >= self._next_sparse:
                self._next_sparse = now + SPARSE
                self._say(self._line(reception, now))
            return
        self._held += rows
        if now < self._next:
            return
        self._next = now + EVERY
        self._follow()
        if self._live is not None:
            from rich.text import Text  # noqa: PLC0415

            self._live.update(Text(self._line(reception, now), no_wrap=True, overflow="ellipsis"), refresh=True)

    def say(self, text: str) -> None:
        """Print a line above the status, unless nothing is to be said at all."""
        if not self._quiet:
            self._say(text)

    def _say(self, text: str) -> None:
        """Print a line above the status."""
        plain = "".join(c if c.isprintable() else " " for c in text)
        if self._live is not None:
            self._live.console.print(plain)
        else:
            sys.stderr.write(plain + "\n")

    def _follow(self) -> None:
        """Run the filter over the rows that came."""
        held, self._held = self._held, []
        for _, parts in groupby(held, lambda part: part.announced):
            part = Arrived.joined(list(parts))
            if part.announced != self._converter.announced:
                self._attitude = None
            try:
                batch = self._converter.batch(part)
            except InputError:  # the recording itself states this
                return
            if self._attitude is None:
                sensors = self._converter.names
                filters = ("mahony",) if "mag_x" in sensors and "acc_x" in sensors else ()
                self._attitude = LiveAttitude(sensors, filters, frame=self._frame)
            self._attitude.add(batch)
            if "temp" in batch and np.isfinite(batch["temp"]).any():
                self._temp = float(batch["temp"][np.isfinite(batch["temp"])][-1])

    def _line(self, reception: Reception, now: float) -> str:
        """State in one line."""
        counts = reception.counts
        self._marks.append((now, counts["samples"]))
        while now - self._marks[0][0] > _WINDOW:
            self._marks.popleft()
        since, before = self._marks[0] if now > self._marks[0][0] else (self._begin, 0)
        passed = now - since
        rate = (counts["samples"] - before) / passed if passed > 0.0 else 0.0
        words = [f"{now - self._begin:.0f} s", f"{counts['samples']} rows", f"{rate:.0f} Hz"]
        if self._attitude is not None:
            words += [shown for name in ("mahony", "complementary") if (shown := self._angles(name))]
        if np.isfinite(self._temp):
            words.append(f"{self._temp:.1f} degC")
        words += [f"{what} {counts[what]}" for what in ("lost", "damaged") if counts[what]]
        if reception.line.opening:
            words.append(f"unplugged {reception.line.opening}")
        if reception.line.lost_since is not None:
            words = [f"line lost for {now - reception.line.lost_since:.0f} s, trying again", *words]
        return "  ".join([*words, HOW_TO_STOP])

    def _angles(self, name: str) -> str:
        """Roll, pitch and, with a magnetometer, yaw in degrees."""
        assert self._attitude is not None
        if name not in self._attitude.angles or not np.isfinite(self._attitude.angles[name]).all():
            return ""
        angles = np.degrees(self._attitude.angles[name])
        names = ("roll", "pitch", "yaw")[: 3 if "mag" in self._attitude.sensors else 2]
        return " ".join(f"{what} {angle:.1f}" for what, angle in zip(names, angles, strict=False)) + " deg"
