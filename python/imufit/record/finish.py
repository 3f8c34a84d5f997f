"""From the parts of a recording to its log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log import Log, LogStream, Metadata
from imufit.log.assemble import group_fields
from imufit.log.metadata import read_sidecar, sidecar_path
from imufit.log.place import Place
from imufit.record.arrived import Arrived
from imufit.record.clock import typical_step
from imufit.record.columns import Columns
from imufit.record.part import Part
from imufit.record.timing import Timing, timed
from imufit.results import Recording, RecordingClock, RecordingGap

Array = NDArray[np.float64]

KEY: Final = "recording"
"""Key of a log's metadata under which the recording is described."""
MESSAGES: Final = 200
"""Messages of the device that are kept in the log at most, the first ones."""


@dataclass(frozen=True)
class _Piece:
    rows: Arrived
    timing: Timing
    columns: dict[str, Array]


def log_of(
    parts: Sequence[Part], file: Path, ended: str | None = None, cpu_share: float | None = None
) -> tuple[Log, Recording]:
    """Make a log of what the parts hold.

    Parameters
    ----------
    parts : sequence of Part
        In order; at least one has rows.
    file : Path
        The log to be.
    ended : str, optional
        Why the recording ended; without it what the parts tell.
    cpu_share : float, optional
        Time of the processor over time that passed while it was recorded.

    Returns
    -------
    tuple
        The log, and what to say of it.
    """
    held = [part for part in parts if part.rows is not None]
    pieces = _pieces(held)
    t = np.concatenate([piece.timing.t for piece in pieces])
    first = float(t[0])
    t = t - first
    names = dict.fromkeys(name for piece in pieces for name in piece.columns)
    numbers = {
        name: np.concatenate([piece.columns.get(name, np.full(piece.rows.n, np.nan)) for piece in pieces])
        for name in names
    }
    told: dict[str, Any] = {}
    for part in parts:
        for note in part.told:
            told |= note
    about = held[0].about
    counts = told.get("counts", {})
    began = datetime.fromisoformat(about["utc"]) + timedelta(seconds=first - about["monotonic"])
    fit = pieces[0].timing.fit
    clock = RecordingClock("arrival")
    if fit is not None:
        runs = sum(int(piece.timing.run[-1]) + 1 for piece in pieces)
        clock = RecordingClock("device", float(fit.offsets[0]) - first, fit.drift_ppm, fit.jitter, fit.latest, runs)
    device = held[0].announced
    why = ended or told.get("ended", "crash")
    recording = Recording(
        file=str(file),
        port=about["port"],
        form=device.form,
        device=device.name,
        began=began.isoformat(timespec="microseconds"),
        n=int(t.size),
        duration_s=float(t[-1]),
        rate_hz=1.0 / typical_step(t) if t.size > 1 else None,
        columns=tuple(names),
        **{name: int(counts.get(name, 0)) for name in ("lost", "damaged", "unknown", "unexplained")},
        gaps=(*_gaps(pieces, t), *(_gap_at_end(told, t, first) if why != "line lost" else ())),
        clock=clock,
        ended=why,
        cpu_share=cpu_share,
        notes=tuple(dict.fromkeys([*_dropped(parts), *(n for piece in pieces for n in piece.timing.notes)])),
    )
    messages = [
        {"t": round(arrival - first, 6), "text": text}
        for part in parts
        for note in part.told
        for arrival, text in note.get("texts", ())
    ]
    metadata = _metadata(recording, held, messages[:MESSAGES])
    fields = group_fields(t, numbers, {}, start=0, metadata=metadata, place=Place())
    return Log(**fields, metadata=metadata), recording


def _pieces(parts: Sequence[Part]) -> list[_Piece]:
    """Time and columns of each part; one that would overlap the one before is moved behind it."""
    pieces: list[_Piece] = []
    for part in parts:
        assert part.rows is not None
        timing = timed(part.rows)
        if pieces:
            end = float(pieces[-1].timing.t[-1])
            if timing.t[0] <= end:
                late = end + 0.1 * typical_step(timing.t) - float(timing.t[0])
                timing = replace(timing, t=timing.t + late)
        columns = Columns(part.announced, part.about.get("mapping")).of(part.rows.values)
        pieces.append(_Piece(part.rows, timing, columns))
    return pieces


def _gaps(pieces: Sequence[_Piece], t: Array) -> list[RecordingGap]:
    opening = np.concatenate([piece.rows.opening for piece in pieces])
    lost = np.concatenate([piece.rows.lost for piece in pieces])
    part = np.repeat(np.arange(len(pieces)), [piece.rows.n for piece in pieces])
    start = np.concatenate([piece.rows.start for piece in pieces])
    run = np.concatenate([piece.timing.run for piece in pieces])
    anew = np.diff(opening.astype(np.int64)) != 0
    reset = (np.diff(start.astype(np.int64)) != 0) | (np.diff(run) != 0) | (np.diff(part) != 0)
    gaps = []
    for row in np.flatnonzero(anew | reset | (lost[1:] > 0)):
        reason = "unplugged" if anew[row] else "reset" if reset[row] else "lost frames"
        gaps.append(RecordingGap(float(t[row]), float(t[row + 1]), reason, int(lost[row + 1])))
    return gaps


def _gap_at_end(told: dict[str, Any], t: Array, first: float) -> list[RecordingGap]:
    """Tell of a line that was lost and did not come back."""
    if told.get("lost_since") is None:
        return []
    return [RecordingGap(float(t[-1]), max(float(told["now"]) - first, float(t[-1])), "unplugged", 0)]


def _dropped(parts: Sequence[Part]) -> list[str]:
    return [
        f"{part.path.name} ends with {part.dropped} bytes of a batch that is not whole: they are left out"
        for part in parts
        if part.dropped
    ]


def _metadata(recording: Recording, parts: Sequence[Part], messages: list[dict[str, Any]]) -> Metadata:
    """Metadata of the log: what the device is, and how it was recorded."""
    described = recording.to_dict()
    for name in ("file", "n", "duration_s", "rate_hz", "columns", "cpu_share"):
        del described[name]
    for name in ("ranges", "rates"):
        known: dict[str, float] = {}
        for part in parts:
            known |= {c: v for c, v in zip(part.announced.columns, getattr(part.announced, name), strict=False) if v}
        if known:
            described[name] = known
    if messages:
        described["messages"] = messages
    sensor = {"sensor": recording.device} if recording.device else {}
    frame = {"frame": parts[0].about["frame"]} if "frame" in parts[0].about else {}
    return Metadata.from_mapping({**sensor, **frame, KEY: described})


def check_target(log: Path, force: bool) -> None:
    """Refuse a log that is in the way, or that could not be written later.

    Parameters
    ----------
    log : Path
        The log to be.
    force : bool
        Whether an existing one may be overwritten.

    Raises
    ------
    InputError
        Names the file and what to do.
    """
    if log.suffix.lower() not in (".parquet", ".csv", ".npz"):
        raise InputError(
            f"logs are not written as {log.suffix or 'a file without suffix'}",
            file=log,
            remedy="Write .parquet, .csv or .npz.",
        )
    if not log.parent.is_dir():
        raise InputError(f"the directory {log.parent} does not exist", file=log, remedy="Make it first.")
    if log.exists() and not force:
        raise InputError("this log is there already", file=log, remedy="Take another name, or --force to overwrite it.")
    older = read_sidecar(log)
    if older and log.suffix.lower() != ".parquet":
        from imufit.log.metadata import KNOWN  # noqa: PLC0415

        if not (KNOWN | {KEY}) & older.keys():
            raise InputError(
                "this file is in the way: it is no log metadata, but the log's metadata would be written there",
                file=sidecar_path(log),
                remedy="Record under another name.",
            )


def write_log(log: Log, path: Path) -> Log:
    """Write a log so that there is either all of it or nothing, and on the disk.

    Parameters
    ----------
    log : Log
        What to write.
    path : Path
        Where; what stands there is replaced. Metadata that a sidecar already holds for it are kept.

    Returns
    -------
    Log
        The log with those metadata.

    Raises
    ------
    InputError
        It cannot be written.
    """
    kept = {name: value for name, value in read_sidecar(path).items() if name not in (KEY, "sensor")}
    merged = Metadata.from_mapping({**log.metadata.to_mapping(), **kept}, sidecar_path(path))
    whole = replace(log, metadata=merged)
    whole.write(path)
    return whole


def unreadable(path: Path, n: int) -> str:
    """Why the log that was just written is refused when it is read; empty if it is not.

    Parameters
    ----------
    path : Path
        The log.
    n : int
        Rows that it has to have.

    Raises
    ------
    InputError
        It does not hold those rows.
    """
    try:
        found = LogStream(path).n
    except InputError as error:
        return f"the log is written, but reading it says: {error}"
    if found != n:
        raise InputError(f"{found} rows stand in the log, but {n} were recorded", file=path)
    return ""


def utc_now() -> str:
    """Return the time, UTC, ISO 8601."""
    return datetime.now(UTC).isoformat()
