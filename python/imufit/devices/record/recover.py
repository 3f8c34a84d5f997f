"""The part left by a crash becomes a log."""

from __future__ import annotations

import re
import time
from itertools import groupby
from pathlib import Path
from typing import Final

from imufit.devices.record.arrived import Arrived
from imufit.devices.record.beginning import Beginning, beginning_path, read_beginning
from imufit.devices.record.finish import check_target
from imufit.devices.record.part import PartFile, part_path, parts_of, read_part
from imufit.devices.record.reception import PAUSE, Reception
from imufit.devices.record.recorder import converted
from imufit.devices.record.transport import Line
from imufit.errors import InputError
from imufit.remedy import recovering
from imufit.results import Recording

PATIENCE: Final = 5.0
"""Time for a device to announce itself, s: opening its port may reset it, and a boot loader takes two."""


def recover(
    file: str | Path,
    log: str | Path | None = None,
    *,
    port: str | None = None,
    force: bool = False,
    keep: bool = False,
) -> Recording:
    """Make the log of what a recording left that was killed or ran out of disk.

    Every whole batch is saved; what was cut off behind the last one is left out, and said. Of a recording that was
    killed before any row was written, the bytes that had come are decoded.

    Parameters
    ----------
    file : str or Path
        The part, ``walk.parquet.part``, or the log that was to be, ``walk.parquet``.
    log : str or Path, optional
        Log to write; without it the one that was to be.
    port : str, optional
        Where the device is plugged in: it is asked what the samples of a recording hold that was killed before it
        announced itself. Not needed otherwise.
    force : bool
        Whether an existing log may be overwritten.
    keep : bool
        Whether the parts stay. Otherwise they are deleted once the log is on the disk and was read again.

    Returns
    -------
    Recording
        What was saved.

    Raises
    ------
    InputError
        The part is missing, nothing whole is in it, the columns of its samples are unknown, a recording is still
        writing it, or the log cannot be written.
    """
    file = Path(file)
    found = re.fullmatch(r"(.+)\.part\d*", file.name)
    wanted = file.with_name(found[1]) if found else file
    first = beginning_path(wanted)
    parts = parts_of(wanted)
    if not parts and not first.exists():
        raise InputError(
            f"{part_path(wanted)} does not exist", file=file, remedy="Name the .part file that the recording left."
        )
    target = wanted if log is None else Path(log)
    check_target(target, force)
    # what a part has rows of needs its bytes no more
    if first.exists() and not any(part.n for part in map(read_part, parts) if part is not None):
        begun = read_beginning(first)
        if begun is not None:
            _explain(begun, wanted, port)
            parts = parts_of(wanted)
    recording = converted(parts or [first], target, keep=keep)
    if not keep:
        first.unlink(missing_ok=True)
    return recording


def _explain(begun: Beginning, wanted: Path, port: str | None) -> None:
    """Decode the bytes that a recording began with, and write the rows as parts of it."""
    if not begun.chunks:
        return
    how, last = begun.how, begun.chunks[-1]
    line = Line(port or begun.about.port, how.baud)
    reception = Reception(line, how.form, how.header)
    rows = [part for chunk in begun.chunks for part in reception.take_in(chunk)]
    counts, texts = reception.counts, reception.take_texts()
    if not rows and port is not None:
        rows = _announced_now(reception, last.opening)
    rows += reception.finish()
    if not rows and (waiting := reception.unexplained):
        raise InputError(
            f"{waiting} samples are in it, but the recording was killed before the device announced their columns",
            file=beginning_path(wanted),
            remedy="Plug the device in, and run " + recovering(wanted, "PORT") + ".",
        )
    told = {"counts": counts, "now": last.arrival, "lost_since": None, "texts": [(last.arrival, t) for t in texts]}
    kept = [part.where(part.opening <= last.opening) for part in rows]
    for announced, group in groupby((part for part in kept if part.n), lambda part: part.announced):
        written = PartFile(part_path(wanted, len(parts_of(wanted)) + 1))
        try:
            written.begin(announced, begun.about)
            written.write(Arrived.joined(list(group)), told)
            written.settle()
        finally:
            written.close()


def _announced_now(reception: Reception, before: int) -> list[Arrived]:
    """Let the device, plugged in now, say what its samples hold; its own have a later opening."""
    reception.line.opening = before + 1
    reception.line.open()
    try:
        end = time.monotonic() + PATIENCE
        rows: list[Arrived] = []
        while not rows and time.monotonic() < end:
            rows = reception.poll()
            time.sleep(PAUSE[0])
        return rows
    finally:
        reception.line.close()
