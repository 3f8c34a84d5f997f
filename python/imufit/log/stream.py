"""Logs from files: whole, or chunk by chunk in flat memory."""

from __future__ import annotations

import math
import shlex
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log.assemble import check_truth_values, fields_of, time_of
from imufit.log.columns import CONTRACT, EULER, GROUPS
from imufit.log.completed import completed
from imufit.log.cut import cut
from imufit.log.foreign import Plan, plan_columns
from imufit.log.log import HEAD_ROWS, LINE, Chunk, Log, concatenate, gathered
from imufit.log.metadata import Frame, Metadata, read_metadata, read_sidecar, sidecar_path
from imufit.log.origin import Origin
from imufit.log.parquet import ROW_GROUP
from imufit.log.place import Place
from imufit.log.reading import Reading
from imufit.log.recognise import Readable, recognise
from imufit.log.size import HELD, KEPT, NUMBER, TEXT_CELL, size_in_words
from imufit.log.source import SeekingSource, Source, open_source
from imufit.log.tables import TablesSource
from imufit.log.time_order import Copies, TimeRepair, TimeScan
from imufit.log.unit_check import HEAD, Clock, check_units
from imufit.log.unmeasured import Unmeasured
from imufit.log.writer import write_rows
from imufit.printable import NAME, printable
from imufit.remedy import MAP, REFERENCE_MAP, Remedy


class LogStream:
    """A log that stays on disk and is read chunk by chunk.

    Opening it reads the time stamps and the first rows, so that order and units are checked before any work begins.
    The other checks are made row by row as the chunks are read.

    Parameters
    ----------
    path : str or Path
        Log file.
    mapping : mapping, optional
        Source text for target columns, such as ``{"acc_x": "-AccX[g]"}``.
    bare : bool
        True if the file needs neither a sensor nor a reference: what it has becomes covariates.
    frame, noise, drop
        As for `Reading`.
    """

    def __init__(
        self,
        path: str | Path,
        mapping: Mapping[str, str] | None = None,
        bare: bool = False,
        *,
        frame: Frame | None = None,
        noise: Mapping[str, float] | None = None,
        drop: str | Sequence[str] = (),
    ) -> None:
        file = Path(path)
        if not file.name:
            file = file.resolve()  # "." has no name to be called by
        source = open_source(file)
        # a source that states that it is a log may have rows as far apart as stated
        is_log = bool(source.embedded) or sidecar_path(file).is_file()
        reading = Reading(mapping, frame, noise or {}, (drop,) if isinstance(drop, str) else tuple(drop))
        stated = {**source.embedded, **read_sidecar(file)}
        metadata = read_metadata(file, source.embedded)
        self._begin(source, file, metadata, stated, "a log's" if is_log else "open", reading, bare)

    @classmethod
    def of_source(
        cls, source: Source, metadata: Metadata, reading: Reading | None = None, clock: Clock = "open"
    ) -> Self:
        """Make the log of a source that is not a file.

        Parameters
        ----------
        source : Source
            A table in memory.
        metadata : Metadata
            Frame, gravity and so on.
        reading : Reading, optional
            How the table is to be read, where it does not say so itself.
        clock : "open" or "a log's"
            Whether the source states that it is a log, so that its time is in seconds.
        """
        log = cls.__new__(cls)
        log._begin(source, None, metadata, {}, clock, reading or Reading(), bare=False)
        return log

    def _begin(
        self,
        source: Source,
        path: Path | None,
        metadata: Metadata,
        stated: Mapping[str, Any],
        clock: Clock,
        reading: Reading,
        bare: bool,
    ) -> None:
        self._path, self._source, self._metadata = path, source, reading.metadata(metadata)
        # A file that needs no sensor is the REFERENCE of a join, which has an option of its own.
        self._place = Place(path, source.line_of, REFERENCE_MAP if bare else MAP)
        names = source.names
        dropped = reading.dropped(names, [*CONTRACT, *EULER, *(reading.mapping or {})], self._place)
        left = _Left(source, dropped) if dropped else source
        several = isinstance(self._source, TablesSource) and self._source.several
        try:
            found = recognise(left, completed(reading.mapping, left, self._place), self._place, bare)
            self._plan = plan_columns(
                names,
                found.mapping,
                self._place,
                bare,
                rest=bare or not several,
                dropped=reading.dropped(names, found.mapping, self._place),
                computed=found.computed,
            )
        except InputError:
            if next(iter(source.scan([])), None) is None:
                raise self._no_rows() from None  # which columns the rows would need is a later question
            raise
        self._origin = Origin(found.mapping, {target: found.mapping[target] for target in reading.mapping or {}})
        if isinstance(self._source, TablesSource):
            self._source.choose(self._plan.sources)
        self._repair = self._scan()
        self._unmeasured = Unmeasured(self._place)
        head = self._head()
        clock = "stated" if "t" in found.mapping else clock
        read = {**head.sensors(), "temp": head.temp}
        tick = abs(self._plan.time.conversion.factor)
        odd = check_units(head.t, read, self._metadata, self._place, self._plan.origin, clock, tick)
        self._columns = head.columns
        told = reading.notes(stated, self._place)
        notes = (*self._source.notes, *found.notes, *told, *self._plan.notes, self._repair.note, *odd)
        if "ref_angle" in self._columns and "ref_qw" not in self._columns:
            notes = (*notes, f"{self._place.name}: ref_angle makes no reference without the metadata rig_axis")
        self._notes = tuple(note for note in notes if note)

    def _scan(self) -> TimeRepair:
        time = self._plan.time
        scan = TimeScan(self._place, abs(time.conversion.factor))
        for start, rows, block in self._source.scan(list(time.names)):
            if time.name in self._source.truths:
                break
            written = time.name is not None and block[time.name].dtype == object
            scan.add(time_of(self._plan, block, start, rows, self._place), written)
        check_truth_values(self._plan, self._source.truths, self._place)
        if self._source.n == 0:
            raise self._no_rows()
        repair = scan.finish()
        if repair.often:
            copies = Copies(repair)
            columns = [name for name in self._plan.sources if name != time.name]
            for start, _, block in self._source.blocks(columns):
                copies.add(block, start)
            if copies.many:
                raise scan.repeated()
        return repair

    def _no_rows(self) -> InputError:
        return self._place.error("the file has a header but no rows", remedy="Record or copy it again.")

    def _head(self) -> Log:
        pieces: list[Log] = []
        rows = 0
        for piece in self.pieces():
            pieces.append(piece)
            rows += piece.n
            if rows >= HEAD:
                break
        return concatenate(pieces).rows(0, HEAD)

    @property
    def n(self) -> int:
        """Number of rows."""
        return self._source.n

    @property
    def metadata(self) -> Metadata:
        """Frame, gravity, field, rig axis, noise."""
        return self._metadata

    @property
    def columns(self) -> tuple[str, ...]:
        """Contract columns that are there."""
        return self._columns

    @property
    def path(self) -> Path | None:
        """File of the log; None for a table in memory."""
        return self._path

    @property
    def notes(self) -> tuple[str, ...]:
        """Findings and changes of the reader, in the rows read so far."""
        return (*self._notes, *self._unmeasured.notes)

    @property
    def origin(self) -> Origin:
        """Columns of the file that those of the log were made of."""
        return self._origin

    def pieces(self) -> Iterator[Log]:
        """Give the checked rows in blocks of whatever size the file offers."""
        for start, rows, block in self._source.blocks(self._plan.sources):
            yield self._checked(self._plan, start, rows, block, self._unmeasured)
        self._unmeasured.check()

    def _checked(
        self, plan: Plan, start: int, rows: int, block: dict[str, NDArray[Any]], unmeasured: Unmeasured
    ) -> Log:
        fields = fields_of(
            plan,
            block,
            start,
            rows,
            repair=self._repair,
            metadata=self._metadata,
            place=self._place,
            unmeasured=unmeasured,
        )
        return Log.of_fields(**fields, metadata=self._metadata, path=self._path, origin=self._origin)

    @property
    def seeks(self) -> bool:
        """Whether `rows` reads any rows without a pass over those before them."""
        return isinstance(self._source, SeekingSource) and self._source.seeks

    def rows(self, start: int, stop: int, columns: Collection[str] | None = None) -> Log:
        """Rows ``start <= row < stop`` in memory.

        Parameters
        ----------
        start, stop : int
            First row, and the row after the last one, counted from 0.
        columns : collection of str, optional
            Columns of the log that are wanted, and the time; those that belong together come together.
        """
        start, stop = min(max(start, 0), self.n), min(stop, self.n)
        begin = min(start, self.n - 1)  # one row at least is read, since an empty log has columns, too
        plan = self._plan if columns is None else self._part_of_plan(columns)
        source = self._source
        if isinstance(source, SeekingSource):
            blocks = source.blocks_between(plan.sources, begin, max(stop, begin + 1))
        else:
            blocks = source.blocks(plan.sources)
        # Impossible readings have been counted when the log was read as a whole.
        unmeasured = Unmeasured(self._place)
        pieces: list[Log] = []
        for first, rows, block in blocks:
            if first >= stop and pieces:
                break
            if first + rows > begin:
                piece = self._checked(plan, first, rows, block, unmeasured)
                pieces.append(piece.rows(max(start - first, 0), max(stop - first, 0)))
        return concatenate(pieces)

    def _part_of_plan(self, columns: Collection[str]) -> Plan:
        """Return the plan of some columns, the time, and whatever belongs to them."""
        wanted = {"t", *columns}
        for group in GROUPS.values():
            if wanted.intersection(group):
                wanted.update(group)
        if wanted.intersection(GROUPS["ref_q"]):
            wanted.update((*EULER, "ref_angle"))  # of which the attitude may be made
        return replace(self._plan, columns=tuple(each for each in self._plan.columns if each.target in wanted))

    def chunks(self, rows: int, margin: int = 0) -> Iterator[Chunk]:
        """Cut into chunks of `rows` rows with up to `margin` rows more on either side.

        Parameters
        ----------
        rows : int
            Rows of a chunk's core.
        margin : int
            Rows of context on either side, fewer at the ends of the log.
        """
        for chunk in cut(self.pieces(), rows, margin):
            yield replace(chunk, log=chunk.log.with_fields(notes=self.notes))

    def read(self) -> Log:
        """Whole log in memory, however large it is."""
        log = gathered(self.pieces(), self.n)
        return log.with_fields(notes=self.notes)

    @property
    def size(self) -> int:
        """Bytes that the whole log would take in memory, computed from rows and columns."""
        text = sum(column.name in self._source.text for column in self._plan.columns)
        numbers = len(self._plan.columns) - text
        if "ref_angle" in self._columns and self._metadata.rig_axis is not None:
            numbers += 4  # the reference attitude that follows from the angle
        return self.n * (NUMBER * numbers + TEXT_CELL * text)

    def held(self, more: int = 0, gigabytes: float = 1.0, option: str = "") -> Log:
        """Whole log in memory, for what needs all of its rows at once.

        Parameters
        ----------
        more : int
            Bytes that are made of each row besides, and kept.
        gigabytes : float
            Memory that all of it may take, GB.
        option : str
            Option of the command that allows more, for the message.

        Raises
        ------
        InputError
            It is too large for that; the message states how to take a part of it.
        """
        made = self.size + self.n * more
        held, kept = HELD * gigabytes, KEPT * gigabytes
        if self.size <= held and made <= kept:
            return self.read()
        share = min(held / self.size, kept / made)
        rows = int(self.n * share)
        more_words = f", or allow more with {option} {math.ceil(gigabytes / share)}" if option else ""
        whole = "" if self._path is None else f"imufit.open_log({str(self._path)!r}, stream=True)"
        file = self._path or Path("log.parquet")
        part = file.with_name(f"{file.stem}-part.parquet")
        raise self._place.error(
            f"{self.n} rows take {size_in_words(made)} of memory, and this needs all of them at once",
            remedy="Take a part: "
            + Remedy(
                f"next({whole or 'log'}.chunks({rows})).core",
                f"imufit convert {shlex.quote(str(file))} --rows 0:{rows} -o {shlex.quote(str(part))}{more_words}",
            ),
        )

    def write(self, path: str | Path) -> None:
        """Write the log as :meth:`Log.write` does, without holding more of it than a row group.

        Parameters
        ----------
        path : str or Path
            Ending in ``.parquet``, ``.npz`` or ``.csv``.
        """
        write_rows(Path(path), self._metadata, (chunk.core.table() for chunk in self.chunks(ROW_GROUP)))

    def _repr_html_(self) -> str:
        return next(iter(self.chunks(HEAD_ROWS))).core.table_html(repr(self))

    def __repr__(self) -> str:
        names = printable(", ".join(self._columns), LINE)
        return f"LogStream({printable(self._place.name, NAME)}: {self.n} rows; {names}; {self._metadata.frame})"


class _Left:
    """A source without the columns that are left out, for recognising the others."""

    def __init__(self, source: Readable, dropped: Collection[str]) -> None:
        self._source = source
        self._dropped = frozenset(dropped)

    @property
    def names(self) -> tuple[str, ...]:
        """Columns of the file that are not left out."""
        return tuple(name for name in self._source.names if name not in self._dropped)

    @property
    def clues(self) -> tuple[str, ...]:
        """Marks of its maker."""
        return self._source.clues

    def scan(self, columns: Sequence[str]) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """First pass over the file, with the named columns only."""
        return self._source.scan(columns)


def open_log(
    path: str | Path,
    mapping: Mapping[str, str] | None = None,
    stream: bool | None = None,
    *,
    frame: Frame | None = None,
    noise: Mapping[str, float] | None = None,
    drop: str | Sequence[str] = (),
) -> Log | LogStream:
    """Open a log file, in memory or as a stream.

    Parameters
    ----------
    path : str or Path
        Parquet, NPZ or text file.
    mapping : mapping, optional
        Source text for target columns, such as ``{"acc_x": "-AccX[g]"}``.
    stream : bool, optional
        Whether to leave the log on disk; None does so if it would take more than 200 MB of memory, by its rows and
        columns.
    frame, noise, drop
        As for `read`.
    """
    log = LogStream(path, mapping, frame=frame, noise=noise, drop=drop)
    if stream is None:
        stream = log.size > HELD
    return log if stream else log.read()


def read(
    path: str | Path,
    mapping: Mapping[str, str] | None = None,
    *,
    frame: Frame | None = None,
    noise: Mapping[str, float] | None = None,
    drop: str | Sequence[str] = (),
) -> Log:
    """Read a log file into memory.

    Parameters
    ----------
    path : str or Path
        Parquet, NPZ or text file.
    mapping : mapping, optional
        Source text for target columns, such as ``{"acc_x": "-AccX[g]"}``.
    frame : {"NED", "ENU", "NWU"}, optional
        Reference frame, whatever the file states.
    noise : mapping, optional
        White noise standard deviation of one sample of "acc" (m/s^2), "gyr" (rad/s) and "mag" (uT), whatever the file
        states.
    drop : str or sequence of str, optional
        Columns to leave out, of the file or of the log; "acc", "gyr", "mag", "ref_q" and "ref_p" stand for all of
        that group.

    Raises
    ------
    InputError
        The file cannot be used; the message names row, column and remedy.
    """
    return LogStream(path, mapping, frame=frame, noise=noise, drop=drop).read()
