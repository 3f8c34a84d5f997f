"""Columns of a log over time, as many points as a screen shows, however long the log is.

A pass over the log fills a pyramid of smallest and largest values. A window that the pyramid resolves to a pixel is
drawn from the pyramid. The rows of a narrower window are read again from the log.
"""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from types import TracebackType
from typing import Final, NamedTuple, Self, TypeGuard

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.errors import InputError
from imufit.fitting.log_evidence import LogEvidence
from imufit.fitting.passes import CHANNELS, CHUNK_ROWS, UNITS
from imufit.fitting.row_residuals import check_reference, residual_chunks, residuals_of_chunk
from imufit.log import Chunk, Log, LogSource, LogStream
from imufit.log.columns import GROUPS, SENSORS
from imufit.log.columns import UNITS as COLUMN_UNITS
from imufit.log.segments import GAP_STEPS
from imufit.log.size import BLOCK_ROWS
from imufit.log.writer import write_rows
from imufit.progress import Progress, silent

Array = NDArray[np.float64]
Table = Mapping[str, Array]
Reader = Callable[[int, int, Sequence[str]], tuple[Array, Table]]

BLOCK: Final = 64
"""Rows of a block of the pyramid: a window of so many rows a pixel is read again, 77,000 rows for 1200 pixels, which
takes a tenth of a second. The pyramid of 20 million rows of 14 columns then takes 150 MB."""
EVALUATED: Final = 8_192
"""Rows of which the model's readings are computed anew for a window: at 5 us a row a twentieth of a second."""
STRETCHES: Final = 3
"""Stretches that a window is drawn from of which too few rows are judged, half of these rows together: to read one and
to evaluate it with its past takes 16 ms at 1 kHz."""
EVALUATED_BLOCK: Final = 16
"""Rows of a block of the pyramid of a model's readings: 512 blocks in the narrowest window that is drawn from them. The
pyramid of 2 million judged rows then takes 36 MB."""


class Kind(Enum):
    """Kinds of columns."""

    MEASURED = "measured"
    REFERENCE = "reference"
    COVARIATE = "covariate"


@dataclass(frozen=True)
class Channel:
    """One column that can be drawn.

    Attributes
    ----------
    name : str
        Column of the log.
    kind : Kind
        Reading of a sensor, reference, or covariate (the temperature too).
    unit : str
        SI unit as in the log; empty where it is unknown.
    """

    name: str
    kind: Kind
    unit: str


class Points(NamedTuple):
    """Points of one column in a window, (m,) each, at most twice as many as pixels.

    Attributes
    ----------
    t : ndarray
        Time, s.
    low, high : ndarray
        Smallest and largest value around that time; NaN where the line is interrupted.
    """

    t: Array
    low: Array
    high: Array

    def line(self) -> tuple[Array, Array]:
        """Return times and values, (k,) each, of one line that covers from the smallest to the largest value.

        The two follow one another as the line rises or falls, a quarter of the way to the neighbours: one above the
        other they would make a staircase of a slope.
        """
        both = self.low != self.high  # true where both are NaN, too: such a point is needed once
        both &= np.isfinite(self.low)
        middle = 0.5 * (self.low + self.high)
        falls = np.zeros(middle.size, dtype=bool)
        falls[1:-1] = middle[2:] < middle[:-2]
        falls[:1], falls[-1:] = middle[1:2] < middle[:1], middle[-1:] < middle[-2:-1]
        step = np.diff(self.t)
        aside = 0.25 * np.minimum(np.append(step, step[-1:]), np.append(step[:1], step)) if step.size else 0.0 * self.t
        second = np.flatnonzero(both) + np.cumsum(both)[both]
        times, values = np.repeat(self.t, 1 + both), np.repeat(np.where(falls, self.high, self.low), 1 + both)
        values[second] = np.where(falls, self.low, self.high)[both]
        times[second] += aside[both]
        times[second - 1] -= aside[both]
        return times, values


class _Columns:
    """The pyramid of some columns.

    Parameters
    ----------
    gaps : mapping of str to float
        For each column the time between two samples from which on its line is interrupted, s.
    block : int
        Rows of a block.
    """

    def __init__(self, gaps: Mapping[str, float], block: int) -> None:
        self.gaps = dict(gaps)
        self._number = {name: k for k, name in enumerate(self.gaps)}
        self.pyramid = _imufit.Pyramid(list(self.gaps.values()), block)

    def feed(self, t: Array, table: Table) -> None:
        """Take the next rows."""
        self.pyramid.feed(np.ascontiguousarray(t), [np.ascontiguousarray(table[name]) for name in self.gaps])

    def window(self, names: Sequence[str], begin: float, end: float, pixels: int) -> dict[str, Points]:
        """Return the points of some columns from the pyramid."""
        lines = self.pyramid.lines([self._number[name] for name in names], begin, end, pixels)
        return {name: Points(*line) for name, line in zip(names, lines, strict=True)}

    def of_rows(
        self, rows: tuple[Array, Table], names: Sequence[str], begin: float, end: float, pixels: int
    ) -> dict[str, Points]:
        """Return the points of some columns from their rows."""
        t, table = rows
        return {name: Points(*_imufit.thinned(t, table[name], self.gaps[name], begin, end, pixels)) for name in names}


class _RowsRead:
    """The rows that were read last: a zoom goes into what is there, and reads nothing.

    Parameters
    ----------
    read : callable
        Reads some columns of rows ``first <= row < stop``.
    """

    def __init__(self, read: Reader) -> None:
        self._read = read
        self._lock = threading.Lock()
        self._held: tuple[int, int, Array, dict[str, Array]] | None = None

    def rows(self, first: int, stop: int, names: Sequence[str]) -> tuple[Array, Table]:
        """Return the times, and the columns by name."""
        with self._lock:
            held = self._held
            if held is None or first < held[0] or stop > held[1] or any(name not in held[3] for name in names):
                t, table = self._read(first, stop, names)
                columns = {name: np.ascontiguousarray(table[name]) for name in names}
                held = self._held = (first, stop, np.ascontiguousarray(t), columns)
        part = slice(first - held[0], stop - held[0])
        return held[2][part], {name: held[3][name][part] for name in names}


class Traces:
    """The columns of one log over time; a context manager that removes its copy of a text file.

    Parameters
    ----------
    log : LogSource
        The log.

    Attributes
    ----------
    log : LogSource
        The log.
    channels : tuple of Channel
        Columns that can be drawn.
    """

    def __init__(self, log: LogSource) -> None:
        self.log = log
        self._again: Log | LogStream | None = log if _seeks(log) else None
        self._copy: tempfile.TemporaryDirectory[str] | None = None
        samples = list(_samples(log))
        self.channels = _channels(samples[0])
        names = [channel.name for channel in self.channels]
        self._columns = _Columns(gaps_of(samples, names), BLOCK)
        self._read_again = _RowsRead(self._read)
        self._around: dict[tuple[int, int, int], Chunk] = {}
        self.built = False

    @property
    def rows(self) -> int:
        """Rows that can be drawn so far."""
        return self._columns.pyramid.rows

    @property
    def span(self) -> tuple[float, float] | None:
        """Times of the first and the last row that can be drawn so far, s; None before the first one."""
        return self._columns.pyramid.span

    @property
    def bytes(self) -> int:
        """Bytes that the pyramid takes."""
        return self._columns.pyramid.bytes

    def build(self, progress: Progress = silent) -> None:
        """Make the pass over the log; windows can be asked for meanwhile, of the rows so far.

        Rows of a text file cannot be found again without reading all rows before them: such a log is copied to a
        Parquet file in the temporary directory in the same pass.

        Parameters
        ----------
        progress : callable
            Called with (rows done, rows in all, what is being done).
        """
        if self.built:
            return
        parts = self._fed(progress)
        if self._again is None:
            self._copy = tempfile.TemporaryDirectory(prefix="imufit-studio-", ignore_cleanup_errors=True)
            path = Path(self._copy.name) / "log.parquet"
            write_rows(path, self.log.metadata, (part.table() for part in parts))
            self._again = LogStream(path)
        else:
            for _ in parts:
                pass
        self.built = True

    def _fed(self, progress: Progress) -> Iterator[Log]:
        # The next rows are read while these are taken: both leave the interpreter to the other one.
        with ThreadPoolExecutor(1) as feeder:
            fed: Future[None] | None = None
            for chunk in self.log.chunks(BLOCK_ROWS):
                if fed is not None:
                    fed.result()
                    progress(self.rows, self.log.n, "drawing")
                fed = feeder.submit(self._columns.feed, chunk.core.t, chunk.core.table())
                yield chunk.core
            if fed is not None:
                fed.result()
                progress(self.rows, self.log.n, "drawing")

    def window(self, names: Sequence[str], begin: float, end: float, pixels: int) -> dict[str, Points]:
        """Return the points of some columns in a window of time.

        Parameters
        ----------
        names : sequence of str
            Names of channels.
        begin, end : float
            The window, s of the log.
        pixels : int
            Width of the panel.

        Raises
        ------
        KeyError
            A name is not a channel's.
        """
        first, stop = self.rows_between(begin, end)
        if stop - first > BLOCK * pixels or self._again is None:
            return self._columns.window(names, begin, end, pixels)
        rows = self._read_again.rows(first, stop, names)
        return self._columns.of_rows(rows, names, begin, end, pixels)

    def rows_between(self, begin: float, end: float) -> tuple[int, int]:
        """Return the first row, and the row after the last one, that a window is drawn from.

        Parameters
        ----------
        begin, end : float
            The window, s of the log.
        """
        return self._columns.pyramid.rows_between(begin, end)

    def rows_around(self, first: int, stop: int, margin: int = 0, columns: Sequence[str] | None = None) -> Chunk:
        """Read rows of the log with a margin on either side, without a pass over the log.

        Parameters
        ----------
        first, stop : int
            Core rows, ``first <= row < stop``.
        margin : int
            Rows more on either side, fewer at the ends of the log.
        columns : sequence of str, optional
            Columns that are wanted.

        Raises
        ------
        InputError
            The log is a text file of which the pass has not been made.
        """
        log = self._again
        if log is None:
            raise InputError("the rows of this log are found once it has been read", file=self.log.path)
        low, high = max(first - margin, 0), min(stop + margin, self.log.n)
        rows = log.rows(low, high) if isinstance(log, Log) else log.rows(low, high, columns)
        return Chunk(rows, first, first - low, min(stop, self.log.n) - low)

    def rows_for_models(self, first: int, stop: int, margin: int) -> Chunk:
        """Read rows with all columns; those of one picture are read once for all of its models.

        Parameters
        ----------
        first, stop, margin : int
            As for `rows_around`.
        """
        place = (first, stop, margin)
        chunk = self._around.get(place)
        if chunk is None:
            chunk = self.rows_around(first, stop, margin)
            if len(self._around) >= STRETCHES:
                self._around = {}
            self._around[place] = chunk
        return chunk

    def _read(self, first: int, stop: int, names: Sequence[str]) -> tuple[Array, Table]:
        core = self.rows_around(first, stop, columns=names).core
        return core.t, core.table()

    def close(self) -> None:
        """Remove the copy of a text file, if there is one."""
        if self._copy is not None:
            self._again = None
            self._copy.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class ModelTraces:
    """Residual and predicted readings of one model over time.

    Parameters
    ----------
    traces : Traces
        The log.
    evidence : LogEvidence
        Evidence of the log, such as ``fit.analysis.logs[0]``.
    step : ndarray
        (p,) step of every parameter of the evidence, such as ``fit.analysis.own_step(0, fit.estimate.step)``; that of
        another stack of effects gives its residual to first order.

    Raises
    ------
    InputError
        The log has no reference attitude.
    """

    def __init__(self, traces: Traces, evidence: LogEvidence, step: Array) -> None:
        check_reference(evidence)
        self._traces, self._evidence, self._step = traces, evidence, step
        self._margin = evidence.passes.margin(evidence.facts)
        self.sensors = tuple(sensor for sensor in SENSORS if sensor in evidence.facts.sensors)
        judged = [channel for channel in CHANNELS if channel[:3] in self.sensors]
        gaps = gaps_of(list(_samples(evidence.passes.log)), judged)
        self.channels = tuple(Channel(name, Kind.MEASURED, UNITS[name[:3]]) for name in judged)
        both = {f"{kind}:{name}": gap for kind in ("residual", "predicted") for name, gap in gaps.items()}
        self._columns = _Columns(both, EVALUATED_BLOCK)
        self._read_again = _RowsRead(self._read)
        self.built = False

    def build(self) -> None:
        """Make the pass over the judged rows, which wide windows are drawn from.

        Of a log of more than 2 million rows those of its excerpt are judged: a wide window shows the stretches. Where
        a window has too few of them, rows all over the window are evaluated.
        """
        if self.built:
            return
        for arrays, residuals in residual_chunks(self._evidence, self._step, "drawing the residual"):
            core = slice(arrays["begin"], arrays["end"])
            table: dict[str, Array] = {}
            for channel, residual in zip(CHANNELS, residuals, strict=True):
                if residual is not None and channel[:3] in self.sensors:
                    table |= _both(channel, residual, arrays[channel[:3]][core, "xyz".index(channel[-1])])
            self._columns.feed(arrays["t"][core], table)
        self.built = True

    def window(self, names: Sequence[str], begin: float, end: float, pixels: int) -> dict[str, tuple[Points, Points]]:
        """Return residual and predicted reading of some channels in a window of time.

        Parameters
        ----------
        names : sequence of str
            Channels such as ``acc_x``.
        begin, end : float
            The window, s of the log.
        pixels : int
            Width of the panel.

        Raises
        ------
        KeyError
            A channel is not judged.
        """
        wanted = [f"{kind}:{name}" for name in names for kind in ("residual", "predicted")]
        first, stop = self._traces.rows_between(begin, end)
        if self._traces.rows <= EVALUATED:
            first, stop = 0, self._traces.rows  # once for every window
        judged_first, judged_stop = self._columns.pyramid.rows_between(begin, end)
        if stop - first <= EVALUATED:
            rows = self._read_again.rows(first, stop, wanted)
            found = self._columns.of_rows(rows, wanted, begin, end, pixels)
        elif judged_stop - judged_first < EVALUATED:
            found = self._columns.of_rows(self._spread(first, stop), wanted, begin, end, pixels)
        else:
            found = self._columns.window(wanted, begin, end, pixels)
        return {name: (found[f"residual:{name}"], found[f"predicted:{name}"]) for name in names}

    def _spread(self, first: int, stop: int) -> tuple[Array, Table]:
        """Compute the model's readings of stretches all over some rows."""
        size = EVALUATED // 2 // STRETCHES
        starts = np.linspace(first, stop - size, STRETCHES).astype(int).tolist()
        parts = [self._read(start, start + size, ()) for start in starts]
        names = parts[0][1]
        return (
            np.concatenate([t for t, _ in parts]),
            {name: np.concatenate([table[name] for _, table in parts]) for name in names},
        )

    def _read(self, first: int, stop: int, _names: Sequence[str]) -> tuple[Array, Table]:
        """Compute the model's readings anew."""
        chunk = self._traces.rows_for_models(first, stop, self._margin)
        table: dict[str, Array] = {}
        for channel, residual in residuals_of_chunk(self._evidence, self._step, chunk).items():
            if channel[:3] in self.sensors:
                table |= _both(channel, residual, chunk.core.table()[channel])
        return chunk.core.t, table


def _both(channel: str, residual: Array, measured: Array) -> dict[str, Array]:
    return {f"residual:{channel}": residual, f"predicted:{channel}": measured - residual}


def _seeks(log: LogSource) -> TypeGuard[Log | LogStream]:
    """Return whether rows of a log are found without a pass over it."""
    return isinstance(log, Log) or (isinstance(log, LogStream) and log.seeks)


def _samples(log: LogSource) -> Iterator[Log]:
    """Give rows from the beginning, the middle and the end of a log, or from its beginning if the others are far."""
    if _seeks(log):
        for first in dict.fromkeys((0, max(0, (log.n - CHUNK_ROWS) // 2), max(0, log.n - CHUNK_ROWS))):
            yield log.rows(first, min(first + CHUNK_ROWS, log.n))
    else:
        yield next(iter(log.chunks(BLOCK_ROWS))).core


def gaps_of(samples: Sequence[Log], names: Sequence[str]) -> dict[str, float]:
    """Return the time between two samples of each column from which on a line is interrupted, s.

    Parameters
    ----------
    samples : sequence of Log
        Stretches of a log.
    names : sequence of str
        Columns.

    Returns
    -------
    dict of str to float
        Infinite for a column without two samples in any stretch.
    """
    steps: dict[str, list[Array]] = {name: [] for name in names}
    for part in samples:
        table = part.table()
        for name in names:
            steps[name].append(np.diff(part.t[np.isfinite(table[name])]))
    joined = {name: np.concatenate(found) for name, found in steps.items()}
    return {name: GAP_STEPS * float(np.median(found)) if found.size else np.inf for name, found in joined.items()}


def _channels(log: Log) -> tuple[Channel, ...]:
    """Return the numeric columns of a log."""
    sensors = {name for sensor in SENSORS for name in GROUPS[sensor]}
    found = []
    for name, values in log.table().items():
        if name == "t" or values.dtype == object:
            continue
        reference = name.startswith("ref_") and name in COLUMN_UNITS
        kind = Kind.MEASURED if name in sensors else Kind.REFERENCE if reference else Kind.COVARIATE
        found.append(Channel(name, kind, COLUMN_UNITS.get(name, "")))
    return tuple(found)
