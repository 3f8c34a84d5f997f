"""From the parts of a recording to its log."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.devices.record.arrived import Arrived
from imufit.devices.record.clock import typical_step
from imufit.devices.record.columns import Columns
from imufit.devices.record.part import BLOCK_ROWS, Part
from imufit.devices.record.timing import Clock, clock_of, timed_blocks
from imufit.errors import InputError
from imufit.log import Log, LogStream, Metadata
from imufit.log.assemble import group_fields
from imufit.log.metadata import read_sidecar, sidecar_path
from imufit.log.place import Place
from imufit.log.writer import write_rows
from imufit.remedy import Remedy
from imufit.results import Recording, RecordingClock, RecordingGap

Array = NDArray[np.float64]

KEY: Final = "recording"
"""Key of a log's metadata under which the recording is described."""
MESSAGES: Final = 200
"""Messages of the device that are kept in the log at most, the first ones."""


@dataclass(frozen=True)
class _Piece:
    """Some rows with their time, s on the host's clock, the run of the device's clock and the number of the part."""

    rows: Arrived
    t: Array
    run: NDArray[np.int64]
    part: int


@dataclass(frozen=True)
class _Timed:
    """Parts with rows and their clocks, whose rows are read as often as wanted."""

    parts: tuple[Part, ...]
    clocks: tuple[Clock, ...]

    @classmethod
    def of(cls, parts: Sequence[Part]) -> _Timed:
        held = tuple(part for part in parts if part.n)
        return cls(held, tuple(clock_of(part.blocks()) for part in held))

    def pieces(self) -> Iterator[_Piece]:
        """Rows in order; a part that would overlap the one before is moved behind it."""
        end = -np.inf
        for number, (part, clock) in enumerate(zip(self.parts, self.clocks, strict=True)):
            late: float | None = None
            for rows, t, run in timed_blocks(part.blocks(), clock):
                if late is None:
                    late = end + 0.1 * typical_step(t) - float(t[0]) if t[0] <= end else 0.0
                yield _Piece(rows, t + late, run, number)
                end = float(t[-1]) + late


@dataclass(frozen=True)
class _Commanded:
    """Commanded angle of the rig: from each time on another one, rad; NaN where it moves."""

    axis: str
    since: Array
    angle: Array

    @classmethod
    def of(cls, parts: Sequence[Part]) -> _Commanded | None:
        about = parts[0].about
        if about.rig_axis is None:
            return None
        later = [tuple(each) for part in parts for note in part.told for each in note.get("angles", ())]
        since, angle = np.array([(-np.inf, about.rig_angle), *later], dtype=np.float64).T
        return cls(about.rig_axis, since, angle)

    def at(self, t: Array) -> Array:
        """Angle at some times, s on the host's clock, (n,)."""
        return np.asarray(self.angle[np.searchsorted(self.since, t, side="right") - 1])


@dataclass
class _Survey:
    """Result of a pass over all rows: when they begin and end, runs of the clock, gaps, and steps from row to row."""

    first: float
    last: float = 0.0
    n: int = 0
    runs: int = 0
    gaps: list[RecordingGap] = field(default_factory=list)
    steps: list[Array] = field(default_factory=list)

    @classmethod
    def of(cls, pieces: Iterable[_Piece]) -> _Survey:
        found: _Survey | None = None
        before: _Piece | None = None
        for piece in pieces:
            found = found or cls(float(piece.t[0]))
            found._add(before, piece)
            end = piece.rows.n - 1
            before = _Piece(piece.rows.part(end, end + 1), piece.t[-1:], piece.run[-1:], piece.part)
        assert found is not None
        return found

    def _add(self, before: _Piece | None, piece: _Piece) -> None:
        self.gaps += _gaps(before, piece, self.first)
        if self.n < BLOCK_ROWS:
            self.steps.append(np.diff(piece.t, prepend=piece.t[:1] if before is None else before.t))
        self.runs += before is None or before.part != piece.part or before.run[-1] != piece.run[0]
        self.runs += int(piece.run[-1] - piece.run[0])
        self.n += piece.t.size
        self.last = float(piece.t[-1])

    @property
    def rate(self) -> float | None:
        """Rows per second by the median step of the first rows; None for a single row."""
        steps = np.concatenate(self.steps)
        steps = steps[steps > 0.0]
        return 1.0 / float(np.median(steps)) if steps.size else None


def make_log(parts: Sequence[Part], file: Path, ended: str | None = None, cpu_share: float | None = None) -> Recording:
    """Make a log of what the parts hold; their rows are read and written some at a time.

    Parameters
    ----------
    parts : sequence of Part
        In order; at least one has rows.
    file : Path
        The log to be. An existing file is replaced; metadata that a sidecar already holds for it are kept.
    ended : str, optional
        Why the recording ended; without it the state of the parts.
    cpu_share : float, optional
        Time of the processor over time that passed while it was recorded.

    Returns
    -------
    Recording
        What to say of it.

    Raises
    ------
    InputError
        It cannot be written. There is either all of it or nothing.
    """
    timed = _Timed.of(parts)
    held = timed.parts
    columns = [Columns(part.announced, part.about.mapping) for part in held]
    commanded = _Commanded.of(held)
    names = tuple(dict.fromkeys(name for each in columns for name in each.names))
    if commanded is not None:
        names = (*names, "ref_angle")
    seen = _Survey.of(timed.pieces())
    told: dict[str, Any] = {}
    for part in parts:
        for note in part.told:
            told |= note
    about = held[0].about
    counts = told.get("counts", {})
    began = about.began + timedelta(seconds=seen.first - about.monotonic)
    fit = timed.clocks[0].fit
    clock = RecordingClock("arrival")
    if fit is not None:
        offset = float(fit.offsets[0]) - seen.first
        clock = RecordingClock("device", offset, fit.drift_ppm, fit.jitter, fit.latest, seen.runs)
    device = held[0].announced
    why = ended or told.get("ended", "crash")
    duration = seen.last - seen.first
    recording = Recording(
        file=str(file),
        port=about.port,
        form=device.form,
        device=device.name,
        began=began.isoformat(timespec="microseconds"),
        n=seen.n,
        duration_s=duration,
        rate_hz=seen.rate,
        columns=names,
        **{name: int(counts.get(name, 0)) for name in ("lost", "damaged", "unknown", "unexplained")},
        gaps=(*seen.gaps, *(_gap_at_end(told, duration, seen.first) if why != "line lost" else ())),
        clock=clock,
        ended=why,
        cpu_share=cpu_share,
        notes=tuple(dict.fromkeys([*_dropped(parts), *(note for each in timed.clocks for note in each.notes)])),
    )
    messages = [
        {"t": round(arrival - seen.first, 6), "text": text}
        for part in parts
        for note in part.told
        for arrival, text in note.get("texts", ())
    ]
    kept = {name: value for name, value in read_sidecar(file).items() if name not in (KEY, "sensor")}
    own = _metadata(recording, held, messages[:MESSAGES])
    # The axis and the angles belong together, whatever a recording of that name had before.
    rig = {} if commanded is None else {"rig_axis": commanded.axis}
    metadata = Metadata.from_mapping({**own.to_mapping(), **kept, **rig}, sidecar_path(file))

    def tables() -> Iterator[dict[str, NDArray[Any]]]:
        for piece in timed.pieces():
            known = columns[piece.part].of(piece.rows.values)
            if commanded is not None:
                known["ref_angle"] = commanded.at(piece.t)
            numbers = {name: known.get(name, np.full(piece.rows.n, np.nan)) for name in names}
            t = piece.t - seen.first
            fields = group_fields(t, numbers, {}, start=0, metadata=own, place=Place())
            yield Log.of_fields(**fields, metadata=metadata).table()

    write_rows(file, metadata, tables())
    return recording


def _gaps(before: _Piece | None, piece: _Piece, first: float) -> list[RecordingGap]:
    """Report the gaps between rows, and before the first of them."""
    rows, t, run = piece.rows, piece.t, piece.run
    part = np.full(rows.n, piece.part)
    opening, start, lost = rows.opening, rows.start, rows.lost
    if before is not None:
        earlier = before.rows
        opening, start, lost, t, run, part = (
            np.concatenate(pair)
            for pair in (
                (earlier.opening, opening),
                (earlier.start, start),
                (earlier.lost, lost),
                (before.t, t),
                (before.run, run),
                ([before.part], part),
            )
        )
    anew = np.diff(opening.astype(np.int64)) != 0
    reset = (np.diff(start.astype(np.int64)) != 0) | (np.diff(run) != 0) | (np.diff(part) != 0)
    gaps = []
    for row in np.flatnonzero(anew | reset | (lost[1:] > 0)):
        reason = "unplugged" if anew[row] else "reset" if reset[row] else "lost frames"
        gaps.append(RecordingGap(float(t[row]) - first, float(t[row + 1]) - first, reason, int(lost[row + 1])))
    return gaps


def _gap_at_end(told: dict[str, Any], end: float, first: float) -> list[RecordingGap]:
    """Report a line that was lost and did not come back."""
    if told.get("lost_since") is None:
        return []
    return [RecordingGap(end, max(float(told["now"]) - first, end), "unplugged", 0)]


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
    return Metadata.from_mapping({**sensor, "frame": parts[0].about.frame, KEY: described})


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
        raise InputError(
            "this log exists already",
            file=log,
            remedy="Take another name, or " + Remedy("force=True", "--force") + " to overwrite it.",
        )
    older = read_sidecar(log)
    if older and log.suffix.lower() != ".parquet":
        from imufit.log.metadata import KNOWN  # noqa: PLC0415

        if not (KNOWN | {KEY}) & older.keys():
            raise InputError(
                "this file is in the way: it does not hold log metadata, but the log's metadata would be written there",
                file=sidecar_path(log),
                remedy="Record under another name.",
            )


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
        return f"the log is written, but reading it fails: {error}"
    if found != n:
        raise InputError(f"{found} rows stand in the log, but {n} were recorded", file=path)
    return ""


def utc_now() -> str:
    """Return the time, UTC, ISO 8601."""
    return datetime.now(UTC).isoformat()
