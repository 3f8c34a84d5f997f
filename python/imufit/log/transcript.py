"""Serial transcripts: records with named values among boot messages and diagnostics."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.log.columns import POSES
from imufit.log.csv_layout import lines_in, text_of
from imufit.log.named_values import without_colour
from imufit.log.record import Found, Record
from imufit.log.time_order import DAY, over_midnight

_ROWS: Final = 20_000
_DETAILED: Final = 5
_LISTED: Final = 20
_POSE_MARK: Final = re.compile(
    r"\s*(?:#|//|%)?\s*(?:face|pose)[ _-]?(?:(?P<begin>begin|start)|end|stop)\b[\s:=]*(?P<label>\S*)", re.IGNORECASE
)


@dataclass
class _Tally:
    """Findings of a pass over the file, for the notes."""

    records: int = 0
    others: int = 0
    damaged: list[tuple[int, str]] = field(default_factory=list)
    elsewhere: dict[str, list[int]] = field(default_factory=dict)
    more: Counter[str] = field(default_factory=Counter)
    marks: list[str] = field(default_factory=list)


class TranscriptSource:
    """The records of a serial transcript as a source of blocks.

    Parameters
    ----------
    path : Path
        Text file.
    record : Record
        The kind of line that holds its data.
    """

    embedded: Mapping[str, Any] = {}
    text: frozenset[str] = frozenset({"pose"})

    def __init__(self, path: Path, record: Record) -> None:
        self._path = path
        self._record = record
        self._needed: tuple[int, ...] = ()
        poses = any(pose is not None for _, pose in _poses_marked(path))
        self.names = (*record.columns, *(["pose"] if poses and "pose" not in record.columns else []))
        self.n = 0
        self.notes: tuple[str, ...] = ()
        self.truths: dict[str, tuple[int | None, str]] = {}
        self.clues = (path.name, *self.names)

    def scan(self, columns: Sequence[str]) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """Count and judge all lines, and give the named columns; a record without them is left out from now on."""
        self._needed = tuple(self._record.columns.index(name) for name in columns if name in self._record.columns)
        tally = _Tally()
        yield from self._blocks(columns, tally)
        self.n = tally.records
        self.notes = tuple(f"{self._path.name}: {note}" for note in self._notes(tally))

    def blocks(self, columns: Sequence[str]) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """Give the named columns block by block."""
        yield from self._blocks(columns, _Tally())

    def line_of(self, row: int) -> int | None:
        """Line of the file, from 1, of a data row."""
        return next((line for k, (line, _, _) in enumerate(self._rows(_Tally())) if k == row), None)

    def _blocks(self, columns: Sequence[str], tally: _Tally) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        start = 0
        values: list[tuple[float, ...]] = []
        poses: list[str | None] = []
        for _, found, pose in self._rows(tally):
            values.append(found)
            poses.append(pose)
            if len(values) == _ROWS:
                yield start, len(values), self._arrays(values, poses, columns)
                start += len(values)
                values, poses = [], []
        if values:
            yield start, len(values), self._arrays(values, poses, columns)

    def _arrays(
        self, values: list[tuple[float, ...]], poses: list[str | None], columns: Sequence[str]
    ) -> dict[str, NDArray[Any]]:
        table = np.array(values, dtype=np.float64)
        arrays: dict[str, NDArray[Any]] = {}
        for name in columns:
            if name in self._record.columns:
                arrays[name] = table[:, self._record.columns.index(name)]
            else:
                arrays[name] = np.array(poses, dtype=object)
        return arrays

    def _rows(self, tally: _Tally) -> Iterator[tuple[int, tuple[float, ...], str | None]]:
        """Line, values and pose of every record that is kept."""
        pose: str | None = None
        clock = DayClock(self._record)
        for line, text in lines_of(self._path):
            if not text.strip():
                continue
            if mark := _POSE_MARK.match(text):
                pose = _pose_after(mark, line, tally)
                continue
            found = self._record.find(text, first=line == 1)
            if not isinstance(found, Found):
                tally.others += 1
                if found is not None:
                    tally.elsewhere.setdefault(found, []).append(line)
                continue
            kept = all(found.values[place] == found.values[place] for place in self._needed)
            tally.more.update(found.more)
            if found.twice:
                tally.damaged.append((line, "names a value twice: two lines may have run into one"))
            if found.missing or not kept:
                lacks = f"lacks {', '.join(found.missing) or 'its time'}" + ("" if kept else ", so it is left out")
                tally.damaged.append((line, lacks))
            if kept:
                for name, said in found.truths.items():
                    self.truths.setdefault(name, (tally.records, said))
                tally.records += 1
                yield line, clock.unrolled(found.values), pose

    def _notes(self, tally: _Tally) -> Iterator[str]:
        records = f"{tally.records} record{'' if tally.records == 1 else 's'} ({self._record.words})"
        yield f"{records}; {tally.others} other line{'' if tally.others == 1 else 's'} ignored"
        for line, what in tally.damaged[:_DETAILED]:
            yield f"the record in line {line} {what}"
        if more := tally.damaged[_DETAILED:]:
            yield f"{len(more)} more records are damaged, in line{_listed([line for line, _ in more])}"
        for lead, lines in list(tally.elsewhere.items())[:_DETAILED]:
            after = f"after {lead[:40]!r}" if lead else "at the begin of a line"
            count = f"{len(lines)} line{'' if len(lines) == 1 else 's'}"
            yield f"{count} with values of the same names {after} left out: line{_listed(lines)}"
        if len(tally.elsewhere) > _DETAILED:
            rest = sorted(line for each in list(tally.elsewhere.values())[_DETAILED:] for line in each)
            yield f"{len(rest)} lines with values of the same names after other words left out: line{_listed(rest)}"
        for names, times in self._record.others:
            yield f"{times} lines with other values ({names}) are not part of the record"
        if tally.more:
            names = ", ".join(list(tally.more)[:10])
            yield f"{max(tally.more.values())} records name more values ({names}), which are not read"
        yield from tally.marks[:_DETAILED]
        with self._path.open("rb") as file:
            file.seek(-1, 2)
            if file.read(1) not in b"\r\n":
                yield "the last line has no line end; if the transcript was cut off, its last value is wrong"


class DayClock:
    """The time of day in front of the records of one pass, counted on past midnight.

    Parameters
    ----------
    record : Record
        The kind of line that holds the data.
    """

    def __init__(self, record: Record) -> None:
        self._places = [k for k, name in enumerate(record.lead_names) if name == "clock"]
        self._last: dict[int, float] = {}
        self._days: dict[int, float] = {}

    def unrolled(self, values: tuple[float, ...]) -> tuple[float, ...]:
        """Return the values of the next record, with a day more for each midnight that its clock went past.

        Parameters
        ----------
        values : tuple of float
            One for each column of the record.
        """
        if not self._places:
            return values
        counted = list(values)
        for place in self._places:
            now = values[place]
            if np.isnan(now):
                continue
            if over_midnight(self._last.get(place, now), now):
                self._days[place] = self._days.get(place, 0.0) + DAY
            self._last[place] = now
            counted[place] += self._days.get(place, 0.0)
        return tuple(counted)


def lines_of(path: Path) -> Iterator[tuple[int, str]]:
    """Give number, from 1, and text of every line, without colour codes.

    Of a line that the terminal overwrote (a carriage return within it) only the last text counts.

    Parameters
    ----------
    path : Path
        Text file.
    """
    with path.open("rb") as file:
        for line, data in enumerate(lines_in(file, path), 1):
            text = without_colour(text_of(data)).rstrip("\r\n")
            yield line, text.rpartition("\r")[2].removeprefix("\ufeff")


def _poses_marked(path: Path) -> Iterator[tuple[int, str | None]]:
    """Lines at which a pose begins, and its label."""
    for line, text in lines_of(path):
        mark = _POSE_MARK.match(text)
        if mark and mark["begin"] and mark["label"].lower() in POSES:
            yield line, mark["label"].lower()


def _pose_after(mark: re.Match[str], line: int, tally: _Tally) -> str | None:
    """Pose from this mark on; None behind the end of one."""
    if not mark["begin"]:
        return None
    label = mark["label"].lower()
    if label in POSES:
        return label
    tally.marks.append(f"the mark in line {line} names no pose ({' '.join(POSES)}): {mark['label'][:20]!r}")
    return None


def _listed(lines: Sequence[int]) -> str:
    shown = ", ".join(str(line) for line in lines[:_LISTED])
    return f"{'s' if len(lines) > 1 else ''} {shown}{', ...' if len(lines) > _LISTED else ''}"
