"""A log in memory: one row a sample, contiguous float64 columns in SI units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol, Self, overload, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imufit.errors import InputError
from imufit.log.arrays import check_keywords, contiguous, fields_from_arrays
from imufit.log.columns import GROUPS, present
from imufit.log.metadata import Frame, Metadata
from imufit.log.origin import Origin
from imufit.log.parquet import ROW_GROUP
from imufit.log.scalar_first import quaternions_from_rotation, rotation_from_quaternions
from imufit.log.size import BLOCK_ROWS
from imufit.log.unit_check import Clock
from imufit.log.writer import write_rows
from imufit.printable import NAME, printable

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import pyarrow as pa
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from scipy.spatial.transform import Rotation

    from imufit.log.any_table import AnyTable

Array = NDArray[np.float64]
Text = NDArray[np.object_]

_WIDTHS = {"t": 0, "acc": 3, "gyr": 3, "mag": 3, "temp": 0, "ref_q": 4, "ref_p": 3, "ref_angle": 0}
METADATA = "imufit"
"""Name under which the metadata stand with a table of pandas or Arrow."""
HEAD_ROWS = 5
HEAD_COLUMNS: Final = 20
"""Columns of the table in a notebook: the names of the contract's columns of one log, seldom more."""
LINE: Final = 200
"""Characters of the columns that are named in one line of a shell."""
"""Rows that a notebook shows of a log: as many as pandas shows of a table by ``head``."""
_SINGLE = ("temp", "ref_angle")
_EMPTY: dict[str, Any] = {"covariates": {}, "labels": {}, "metadata": Metadata(), "notes": (), "origin": Origin()}


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Log:
    """A log in memory; n rows.

    NaN in a sensor, `temp`, a reference or a covariate is a missing sample. Arrays are taken as SI units and checked as
    the rows of a file are; units are not guessed at.

    Parameters
    ----------
    t : (n,) array
        Time, s, strictly increasing.
    acc, gyr, mag : (n, 3) array, optional
        Specific force, m/s^2; angular rate, rad/s; magnetic flux density, uT; all in the body frame.
    temp : (n,) array, optional
        Sensor temperature, degC.
    attitude : scipy.spatial.transform.Rotation or (n, 4) array, optional
        Reference attitude, body to reference frame; an array holds quaternions, scalar first.
    ref_p : (n, 3) array, optional
        Reference position in the reference frame, m.
    ref_angle : (n,) array, optional
        Commanded angle of a one-axis rig, rad; with the metadata `rig_axis` and no attitude it makes the attitude.
    pose : sequence of str or None, optional
        Label of a static pose, None where there is none.
    covariates : mapping of (n,) arrays, optional
        Other numeric columns by name.
    labels : mapping of sequences of str or None, optional
        Other text columns by name, None where the text is missing.
    metadata : Metadata or mapping, optional
        Frame, gravity, field, rig axis, noise.
    path : Path, optional
        File that the log was read from.
    notes : tuple of str
        Findings and changes of the reader.
    ref_q : (n, 4) array, optional
        `attitude` under the name of its columns.
    origin : Origin, optional
        Columns of the file that those of the log were made of, as the reader states them.
    **more
        Entries of the metadata: ``Log(t, gyr=gyr, frame="ENU")``.

    Raises
    ------
    InputError
        An array cannot be, or has a name that a log does not know.
    """

    t: Array
    acc: Array | None = None
    gyr: Array | None = None
    mag: Array | None = None
    temp: Array | None = None
    ref_q: Array | None = None
    ref_p: Array | None = None
    ref_angle: Array | None = None
    pose: Text | None = None
    covariates: dict[str, Array] = field(default_factory=dict)
    labels: dict[str, Text] = field(default_factory=dict)
    metadata: Metadata = field(default_factory=Metadata)
    path: Path | None = None
    notes: tuple[str, ...] = ()
    origin: Origin = field(default_factory=Origin)

    def __init__(
        self,
        t: ArrayLike,
        acc: ArrayLike | None = None,
        gyr: ArrayLike | None = None,
        mag: ArrayLike | None = None,
        temp: ArrayLike | None = None,
        *,
        attitude: Rotation | ArrayLike | None = None,
        ref_p: ArrayLike | None = None,
        ref_angle: ArrayLike | None = None,
        pose: Sequence[str | None] | Text | None = None,
        covariates: Mapping[str, ArrayLike] | None = None,
        labels: Mapping[str, Sequence[str | None] | Text] | None = None,
        metadata: Metadata | Mapping[str, Any] | None = None,
        path: Path | None = None,
        notes: Sequence[str] = (),
        ref_q: ArrayLike | None = None,
        origin: Origin | None = None,
        **more: Any,
    ) -> None:
        if attitude is not None and ref_q is not None:
            raise InputError("attitude and ref_q are both given", file="log", remedy="Give one of them: they are one.")
        known = attitude if ref_q is None else ref_q
        quaternions = known if known is None or isinstance(known, np.ndarray) else _quaternions(known)
        check_keywords(more)
        given = {"acc": acc, "gyr": gyr, "mag": mag, "temp": temp}
        given |= {"ref_q": quaternions, "ref_p": ref_p, "ref_angle": ref_angle}
        text = {**(labels or {}), **({} if pose is None else {"pose": pose})}
        if more or not isinstance(metadata, Metadata):
            stated = metadata.to_mapping() if isinstance(metadata, Metadata) else dict(metadata or {})
            metadata = Metadata.from_mapping({**stated, **more}, "log")
        checked = fields_from_arrays(t, given, covariates or {}, text, metadata)
        self._fill({**checked, "path": path, "notes": (*notes, *checked["notes"]), "origin": origin or Origin()})

    @classmethod
    def of_fields(cls, **values: Any) -> Self:
        """Make a log of fields that are checked already: nothing but their shapes is looked at.

        Parameters
        ----------
        **values
            `t` and any other field of a log, `ref_q` for the attitude.
        """
        log = object.__new__(cls)
        log._fill(values)
        return log

    def with_fields(self, **changes: Any) -> Self:
        """Return the log with other values of some fields, which are checked already.

        Parameters
        ----------
        **changes
            Any field of a log.
        """
        return self.of_fields(**({item.name: getattr(self, item.name) for item in fields(self)} | changes))

    def _fill(self, values: Mapping[str, Any]) -> None:
        t = np.asarray(values["t"])
        for item in fields(self):
            value = values.get(item.name, _EMPTY.get(item.name))
            width = _WIDTHS.get(item.name)
            if value is not None and width is not None:
                value = contiguous(value, item.name, (t.size, width) if width else (t.size,))
            object.__setattr__(self, item.name, value)
        numbers = {name: contiguous(column, name, (t.size,)) for name, column in self.covariates.items()}
        object.__setattr__(self, "covariates", numbers)
        object.__setattr__(self, "labels", dict(self.labels))
        for name, cells in [*self.labels.items(), *([("pose", self.pose)] if self.pose is not None else [])]:
            if cells.shape != (t.size,):
                raise InputError(
                    f"the array has shape {cells.shape}, but ({t.size},) is required", file="log", column=name
                )

    @property
    def n(self) -> int:
        """Number of rows."""
        return int(self.t.size)

    @property
    def duration(self) -> float:
        """Time from the first to the last row, s."""
        return float(self.t[-1] - self.t[0]) if self.n else 0.0

    @property
    def columns(self) -> tuple[str, ...]:
        """Contract columns that are there, such as ``acc_x``."""
        return present(self._contract_columns())

    @property
    def reference(self) -> Rotation | None:
        """Reference attitude, n rotations from the body to the reference frame; None without any.

        Rotations cannot be NaN: rows without a reference are the identity here and False in `has_reference`.
        """
        return None if self.ref_q is None else rotation_from_quaternions(self.ref_q)

    @property
    def has_reference(self) -> NDArray[np.bool_]:
        """Rows with a reference attitude, (n,)."""
        return np.zeros(self.n, np.bool_) if self.ref_q is None else ~np.isnan(self.ref_q[:, 0])

    def __len__(self) -> int:
        return self.n

    def __getitem__(self, rows: slice | NDArray[np.bool_]) -> Self:
        """Rows by a slice, ``log[100:200]`` or ``log[::10]``, or by a mask, ``log[log.t > 5.0]``.

        Parameters
        ----------
        rows : slice or (n,) array of bool
            Rows in the order of time; a slice gives views on the same memory.

        Raises
        ------
        TypeError
            Something else is given; readings of one row are ``log.acc[5]``.
        ValueError
            A slice runs backwards, or a mask has another length.
        """
        if not isinstance(rows, slice):
            if np.asarray(rows).dtype != np.bool_:
                raise TypeError("a log is sliced by rows, log[100:200], or by a mask, log[log.t > 5.0]")
            return self.select(rows)
        if rows.step is not None and rows.step < 1:
            raise ValueError(f"the step of a slice is {rows.step}, but time runs forwards: use a step of 1 or more")
        return self._picked(rows)

    def between(self, begin: float, end: float) -> Self:
        """Rows with ``begin <= t < end`` as views on the same memory.

        Parameters
        ----------
        begin, end : float
            Time of the log, s.
        """
        first, last = np.searchsorted(self.t, [begin, end])
        return self.rows(int(first), int(last))

    def head(self, rows: int = 5) -> Self:
        """First rows.

        Parameters
        ----------
        rows : int
            How many.
        """
        return self.rows(0, rows)

    def rows(self, start: int, stop: int) -> Self:
        """Rows ``start <= row < stop`` as views on the same memory.

        Parameters
        ----------
        start, stop : int
            First row, and the row after the last one, counted from 0.
        """
        return self._picked(slice(start, stop))

    def select(self, mask: NDArray[np.bool_]) -> Self:
        """Rows at which the (n,) mask is true, copied.

        Parameters
        ----------
        mask : ndarray of bool
            (n,), true where a row is kept.
        """
        mask = np.asarray(mask)
        if mask.dtype != np.bool_ or mask.shape != (self.n,):
            raise ValueError(f"mask has shape {mask.shape} and type {mask.dtype}; ({self.n},) and bool are required")
        return self._picked(mask)

    def _picked(self, key: Any) -> Self:
        picked: dict[str, Any] = {
            name: None if (v := getattr(self, name)) is None else v[key] for name in (*_WIDTHS, "pose")
        }
        covariates = {name: values[key] for name, values in self.covariates.items()}
        labels = {name: cells[key] for name, cells in self.labels.items()}
        return self.with_fields(**picked, covariates=covariates, labels=labels)

    def with_reference(self, rotation: Rotation) -> Self:
        """Return the log with another reference attitude: n rotations, body to reference frame.

        Parameters
        ----------
        rotation : scipy.spatial.transform.Rotation
            n rotations, one for each row.
        """
        return self.with_fields(ref_q=quaternions_from_rotation(rotation))

    def table(self) -> dict[str, NDArray[Any]]:
        """All columns by name, (n,) each, in the order in which they are written."""
        contract = self._contract_columns()
        return {**{name: contract[name] for name in present(contract)}, **self.covariates, **self.labels}

    def _contract_columns(self) -> dict[str, NDArray[Any]]:
        columns: dict[str, NDArray[Any]] = {"t": self.t}
        for name, members in GROUPS.items():
            values = getattr(self, name)
            if values is not None:
                columns |= {member: values[:, i] for i, member in enumerate(members)}
        columns |= {name: getattr(self, name) for name in (*_SINGLE, "pose") if getattr(self, name) is not None}
        return columns

    def to_pandas(self) -> pd.DataFrame:
        """All columns as a pandas table, SI units; the metadata stand in its ``attrs["imufit"]``."""
        import pandas as pd  # noqa: PLC0415  heavy, and only needed here

        table = pd.DataFrame(self.table())
        table.attrs[METADATA] = self.metadata.to_mapping()
        return table

    def to_dataframe(self) -> pd.DataFrame:
        """All columns as a pandas table, under the name that every result has for it."""
        return self.to_pandas()

    def to_polars(self) -> pl.DataFrame:
        """All columns as a polars table, SI units; needs polars."""
        try:
            import polars as pl  # noqa: PLC0415  optional
        except ImportError:
            raise InputError("polars is not installed", remedy="Install it: pip install polars") from None
        return pl.DataFrame(self.to_arrow())

    def to_arrow(self) -> pa.Table:
        """All columns as an Arrow table, SI units, the metadata in its schema as in a Parquet file."""
        import pyarrow as pa  # noqa: PLC0415  heavy, and only needed here

        columns = {name: pa.array(column) for name, column in self.table().items()}
        return pa.table(columns, metadata={METADATA: self.metadata.to_json()})

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """Arrow's interface for streams: ``polars.DataFrame(log)``, ``pyarrow.table(log)``, ``duckdb.from_arrow``."""
        return self.to_arrow().__arrow_c_stream__(requested_schema)

    def __dataframe__(self, nan_as_null: bool = False, allow_copy: bool = True) -> object:
        """Interchange protocol of data frames."""
        return self.to_arrow().__dataframe__(nan_as_null, allow_copy)

    @overload
    def plot(self, ax: None = None, **options: Any) -> Figure: ...

    @overload
    def plot(self, ax: Axes | Sequence[Axes] | Figure | SubFigure, **options: Any) -> Axes | list[Axes]: ...

    def plot(
        self, ax: Axes | Sequence[Axes] | Figure | SubFigure | None = None, **options: Any
    ) -> Figure | Axes | list[Axes]:
        """Draw the readings over time; the options are those of :func:`imufit.plot`.

        Parameters
        ----------
        ax : Axes, sequence of Axes, Figure or SubFigure, optional
            One Axes for each panel, or a Figure or SubFigure for all of them.
        **options
            ``columns``, ``show``, ``rows``, ``begin``, ``end``.
        """
        import imufit  # noqa: PLC0415  the figure is made by a layer above

        return imufit.plot(self, ax=ax, **options)

    def write(self, path: str | Path) -> None:
        """Write the log; the suffix decides on Parquet, NPZ or CSV.

        Reading it again gives the same log to the last bit, metadata included. CSV and NPZ have a sidecar
        ``NAME.toml`` for the metadata. An older log of that name is replaced once the new one is on the disk.

        Parameters
        ----------
        path : str or Path
            Ending in ``.parquet``, ``.npz`` or ``.csv``.
        """
        blocks = [self] if self.n == 0 else (chunk.core for chunk in self.chunks(ROW_GROUP))
        write_rows(Path(path), self.metadata, (block.table() for block in blocks))

    def chunks(self, rows: int, margin: int = 0) -> Iterator[Chunk]:
        """Cut the log into chunks of `rows` rows with up to `margin` rows more on either side.

        Parameters
        ----------
        rows : int
            Rows of a chunk's core.
        margin : int
            Rows of context on either side, fewer at the ends of the log.
        """
        check_chunk_size(rows, margin)
        for start in range(0, self.n, rows):
            stop = min(start + rows, self.n)
            first, last = max(0, start - margin), min(stop + margin, self.n)
            yield Chunk(self.rows(first, last), start, start - first, stop - first)

    @classmethod
    def from_arrays(
        cls,
        t: ArrayLike,
        *,
        acc: ArrayLike | None = None,
        gyr: ArrayLike | None = None,
        mag: ArrayLike | None = None,
        temp: ArrayLike | None = None,
        reference: Rotation | ArrayLike | None = None,
        ref_p: ArrayLike | None = None,
        ref_angle: ArrayLike | None = None,
        pose: Sequence[str | None] | Text | None = None,
        covariates: Mapping[str, ArrayLike] | None = None,
        labels: Mapping[str, Sequence[str | None] | Text] | None = None,
        **metadata: Any,
    ) -> Self:
        """Make a log from arrays, with the same checks of the values as on reading.

        Units are not guessed at: arrays are taken as SI.

        Parameters
        ----------
        t : (n,) array
            Time, s.
        acc, gyr, mag : (n, 3) array, optional
            m/s^2, rad/s, uT.
        temp : (n,) array, optional
            degC.
        reference : Rotation or (n, 4) array, optional
            Attitude, body to reference frame; an array is scalar first.
        ref_p : (n, 3) array, optional
            m.
        ref_angle : (n,) array, optional
            rad; with the metadata `rig_axis` and no reference it makes the reference.
        pose : sequence of str or None, optional
            Pose labels.
        covariates, labels : mapping, optional
            Further columns of numbers and of text.
        **metadata
            As in `Metadata`: frame, gravity, mag_reference, ...

        Raises
        ------
        InputError
            An array cannot be, or has a name that a log does not know.
        """
        return cls(
            t,
            acc,
            gyr,
            mag,
            temp,
            attitude=reference,
            ref_p=ref_p,
            ref_angle=ref_angle,
            pose=pose,
            covariates=covariates,
            labels=labels,
            **metadata,
        )

    @classmethod
    def from_dataframe(
        cls,
        df: AnyTable,
        metadata: Metadata | Mapping[str, Any] | None = None,
        mapping: Mapping[str, str] | None = None,
        *,
        frame: Frame | None = None,
        noise: Mapping[str, float] | None = None,
        drop: str | Sequence[str] = (),
    ) -> Self:
        """Make a log from a table, with the same checks as on reading a file.

        Parameters
        ----------
        df : DataFrame, table of Arrow or polars, Log, or mapping of columns
            Columns as in a log file.
        metadata : Metadata or mapping, optional
            Frame, gravity and so on; without it what :meth:`to_pandas` left with the table.
        mapping : mapping, optional
            Source text for target columns, as for files.
        frame, noise, drop
            As for :func:`imufit.read`.
        """
        from imufit import log as logs  # noqa: PLC0415  a table is read as a file is, which is built on this class

        table, left = logs.pandas_of(df)
        # the metadata that a table inherits were not stated of the time that it has now
        clock: Clock = "a log's" if metadata not in (None, {}, Metadata()) else "open"
        if metadata is None:
            metadata = left
        if not isinstance(metadata, Metadata):
            metadata = Metadata.from_mapping(metadata, "log")
        reading = logs.Reading(mapping, frame, noise or {}, (drop,) if isinstance(drop, str) else tuple(drop))
        held = logs.LogStream.of_source(logs.FrameSource(table), metadata, reading, clock).read()
        return cls.of_fields(**{item.name: getattr(held, item.name) for item in fields(held)})

    def sensors(self) -> dict[str, Array | None]:
        """Sensors and reference attitude by name, None where absent."""
        return {"acc": self.acc, "gyr": self.gyr, "mag": self.mag, "ref_q": self.ref_q}

    def _repr_html_(self) -> str:
        return self.table_html(repr(self))

    def table_html(self, sentence: str) -> str:
        """Return a sentence and the first rows as HTML.

        Parameters
        ----------
        sentence : str
            What stands above the rows.
        """
        head = self.head(HEAD_ROWS).to_pandas()
        head.columns = [printable(str(name), NAME) for name in head.columns]
        table = head.to_html(index=False, na_rep="", float_format="{:.6g}".format, max_cols=HEAD_COLUMNS)
        return f"<p>{escape(sentence)}</p>{table}"

    def __repr__(self) -> str:
        rate = f" at {(self.n - 1) / self.duration:.4g} Hz" if self.duration > 0.0 else ""
        held = [name for name in (*GROUPS, *_SINGLE, "pose") if getattr(self, name) is not None]
        more = [printable(", ".join([*self.covariates, *self.labels]), LINE)]
        parts = [f"{self.n} rows, {self.duration:.4g} s{rate}", ", ".join(held), self.metadata.frame]
        if more[0]:
            parts.insert(2, f"and {more[0]}")
        name = f"{printable(self.path.name, NAME)}: " if self.path else ""
        return f"Log({name}{'; '.join(part for part in parts if part)})"


@dataclass(frozen=True)
class Chunk:
    """Part of a log with margins.

    Parameters
    ----------
    log : Log
        Core rows and margins.
    start : int
        Row of the whole log that is the first core row.
    begin, end : int
        The core rows are ``log.rows(begin, end)``.
    """

    log: Log
    start: int
    begin: int
    end: int

    @property
    def core(self) -> Log:
        """The core rows alone."""
        return self.log.rows(self.begin, self.end)


@runtime_checkable
class LogSource(Protocol):
    """The common part of a log in memory and a log on disk."""

    @property
    def n(self) -> int:
        """Number of rows."""
        ...

    @property
    def metadata(self) -> Metadata:
        """Frame, gravity, field, rig axis, noise."""
        ...

    @property
    def columns(self) -> tuple[str, ...]:
        """Contract columns that are there."""
        ...

    @property
    def path(self) -> Path | None:
        """File of the log."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """Findings and changes of the reader."""
        ...

    @property
    def origin(self) -> Origin:
        """Columns of the file that those of the log were made of."""
        ...

    def chunks(self, rows: int, margin: int = 0) -> Iterator[Chunk]:
        """Cut into chunks of `rows` rows with up to `margin` rows more on either side.

        Parameters
        ----------
        rows : int
            Rows of a chunk's core.
        margin : int
            Rows of context on either side, fewer at the ends of the log.
        """
        ...


def check_chunk_size(rows: int, margin: int) -> None:
    """Refuse chunks without rows."""
    if rows < 1 or margin < 0:
        raise ValueError(f"chunks need rows >= 1 and margin >= 0, not rows = {rows} and margin = {margin}")


def concatenate(logs: Sequence[Log]) -> Log:
    """Join parts of one log, in order; all have the same columns.

    Parameters
    ----------
    logs : sequence of Log
        The parts; each begins after the one before it ends.
    """
    return logs[0] if len(logs) == 1 else gathered(logs, sum(log.n for log in logs))


def whole(log: LogSource) -> Log:
    """Return all rows of a log in memory.

    Parameters
    ----------
    log : LogSource
        The log, not empty; one in memory is returned as it is.
    """
    if isinstance(log, Log):
        return log
    return gathered((chunk.core for chunk in log.chunks(BLOCK_ROWS)), log.n).with_fields(notes=log.notes)


def gathered(pieces: Iterable[Log], n: int) -> Log:
    """Join parts of one log as they come: no more than one of them is held beside the whole.

    Parameters
    ----------
    pieces : iterable of Log
        As for `concatenate`, at least one.
    n : int
        Rows of all of them.
    """
    first, filled = None, 0
    whole: dict[str, Any] = {}
    for piece in pieces:
        if first is None:
            first = piece.rows(0, 0)
            whole = {name: _room(values, n) for name, values in _arrays(piece).items()}
        for name, values in _arrays(piece).items():
            if isinstance(values, dict):
                for column, cells in values.items():
                    whole[name][column][filled : filled + piece.n] = cells
            else:
                whole[name][filled : filled + piece.n] = values
        filled += piece.n
    if first is None:
        raise ValueError("a log is joined of at least one part")
    return first.with_fields(**whole)


def _quaternions(attitude: Rotation | ArrayLike) -> ArrayLike:
    """Return the quaternions of rotations; what is not rotations stays as it is."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - costs a fifth of a second, arrays do not need it

    return quaternions_from_rotation(attitude) if isinstance(attitude, Rotation) else attitude


def _arrays(log: Log) -> dict[str, Any]:
    """Fields of a log that have a value for each row, and dicts of them."""
    held = {item.name: getattr(log, item.name) for item in fields(Log)}
    return {name: v for name, v in held.items() if isinstance(v, np.ndarray) or name in ("covariates", "labels")}


def _room(values: Any, n: int) -> Any:
    if isinstance(values, dict):
        return {name: _room(cells, n) for name, cells in values.items()}
    return np.empty((n, *values.shape[1:]), values.dtype)
