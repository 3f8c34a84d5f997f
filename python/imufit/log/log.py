"""A log in memory: one row a sample, contiguous float64 columns in SI units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from imufit.errors import InputError
from imufit.log.arrays import check_keywords, contiguous, fields_from_arrays
from imufit.log.columns import GROUPS, present
from imufit.log.frame import fields_from_frame
from imufit.log.metadata import Metadata
from imufit.log.parquet import ROW_GROUP
from imufit.log.scalar_first import quaternions_from_rotation, rotation_from_quaternions
from imufit.log.size import BLOCK_ROWS
from imufit.log.writer import write_rows

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
Text = NDArray[np.object_]

_WIDTHS = {"t": 0, "acc": 3, "gyr": 3, "mag": 3, "temp": 0, "ref_q": 4, "ref_p": 3, "ref_angle": 0}
_SINGLE = ("temp", "ref_angle")


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """A log in memory; n rows.

    NaN in a sensor, `temp`, a reference or a covariate is a missing sample.

    Parameters
    ----------
    t : (n,) array
        Time, s, strictly increasing.
    acc, gyr, mag : (n, 3) array, optional
        Specific force, m/s^2; angular rate, rad/s; magnetic flux density, uT; all in the body frame.
    temp : (n,) array, optional
        Sensor temperature, degC.
    ref_q : (n, 4) array, optional
        Reference attitude as unit quaternions, scalar first: body vectors into the reference frame.
    ref_p : (n, 3) array, optional
        Reference position in the reference frame, m.
    ref_angle : (n,) array, optional
        Commanded angle of a one-axis rig, rad.
    pose : (n,) object array, optional
        Label of a static pose, None where there is none.
    covariates : dict of (n,) arrays
        Other numeric columns by name.
    labels : dict of (n,) object arrays
        Other text columns by name, None where there is no text.
    metadata : Metadata
        Frame, gravity, field, rig axis, noise.
    path : Path, optional
        File that the log was read from.
    notes : tuple of str
        What reading noticed or changed.
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

    def __post_init__(self) -> None:
        n = len(self.t)
        for name, width in _WIDTHS.items():
            values = getattr(self, name)
            if values is not None:
                shape = (n, width) if width else (n,)
                object.__setattr__(self, name, contiguous(values, name, shape))
        covariates = {name: contiguous(values, name, (n,)) for name, values in self.covariates.items()}
        object.__setattr__(self, "covariates", covariates)
        for name, cells in [*self.labels.items(), *([("pose", self.pose)] if self.pose is not None else [])]:
            if cells.shape != (n,):
                raise InputError(f"the array has shape {cells.shape}, but ({n},) is wanted", file="log", column=name)

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
            raise ValueError(f"mask has shape {mask.shape} and type {mask.dtype}; ({self.n},) and bool are wanted")
        return self._picked(mask)

    def _picked(self, key: Any) -> Self:
        picked: dict[str, Any] = {
            name: None if (v := getattr(self, name)) is None else v[key] for name in (*_WIDTHS, "pose")
        }
        covariates = {name: values[key] for name, values in self.covariates.items()}
        labels = {name: cells[key] for name, cells in self.labels.items()}
        return replace(self, **picked, covariates=covariates, labels=labels)

    def with_reference(self, rotation: Rotation) -> Self:
        """Return the log with another reference attitude: n rotations, body to reference frame.

        Parameters
        ----------
        rotation : scipy.spatial.transform.Rotation
            n rotations, one for each row.
        """
        return replace(self, ref_q=quaternions_from_rotation(rotation))

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

    def to_dataframe(self) -> pd.DataFrame:
        """All columns as a pandas table."""
        import pandas as pd  # noqa: PLC0415  heavy, and only needed here

        return pd.DataFrame(self.table())

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
        given = {"acc": acc, "gyr": gyr, "mag": mag, "ref_p": ref_p, "temp": temp, "ref_angle": ref_angle}
        ref_q = quaternions_from_rotation(reference) if isinstance(reference, Rotation) else reference
        text = {**(labels or {}), **({} if pose is None else {"pose": pose})}
        check_keywords(metadata)
        meta = Metadata.from_mapping(metadata, "log")
        return cls(**fields_from_arrays(t, {**given, "ref_q": ref_q}, covariates or {}, text, meta))

    @classmethod
    def from_dataframe(
        cls,
        df: pd.DataFrame,
        metadata: Metadata | Mapping[str, Any] | None = None,
        mapping: Mapping[str, str] | None = None,
    ) -> Self:
        """Make a log from a pandas table, with the same checks as on reading a file.

        Parameters
        ----------
        df : DataFrame
            Columns as in a log file.
        metadata : Metadata or mapping, optional
            Frame, gravity and so on.
        mapping : mapping, optional
            Source text for target columns, as for files.
        """
        if not isinstance(metadata, Metadata):
            metadata = Metadata.from_mapping(metadata or {}, "log")
        return cls(**fields_from_frame(df, mapping, metadata))

    def sensors(self) -> dict[str, Array | None]:
        """Sensors and reference attitude by name, None where absent."""
        return {"acc": self.acc, "gyr": self.gyr, "mag": self.mag, "ref_q": self.ref_q}

    def __repr__(self) -> str:
        rate = f" at {(self.n - 1) / self.duration:.4g} Hz" if self.duration > 0.0 else ""
        held = [name for name in (*GROUPS, *_SINGLE, "pose") if getattr(self, name) is not None]
        more = [*self.covariates, *self.labels]
        parts = [f"{self.n} rows, {self.duration:.4g} s{rate}", ", ".join(held), self.metadata.frame]
        if more:
            parts.insert(2, "and " + ", ".join(more))
        return f"Log({f'{self.path.name}: ' if self.path else ''}{'; '.join(part for part in parts if part)})"


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


class LogSource(Protocol):
    """What a log in memory and a log on disk have in common."""

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
        """What reading noticed or changed."""
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
    return replace(gathered((chunk.core for chunk in log.chunks(BLOCK_ROWS)), log.n), notes=log.notes)


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
    return replace(first, **whole)


def _arrays(log: Log) -> dict[str, Any]:
    """Fields of a log that have a value for each row, and dicts of them."""
    held = {item.name: getattr(log, item.name) for item in fields(Log)}
    return {name: v for name, v in held.items() if isinstance(v, np.ndarray) or name in ("covariates", "labels")}


def _room(values: Any, n: int) -> Any:
    if isinstance(values, dict):
        return {name: _room(cells, n) for name, cells in values.items()}
    return np.empty((n, *values.shape[1:]), values.dtype)
