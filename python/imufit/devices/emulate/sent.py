"""The sent samples with their truth: the truth against which a recording is checked."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from imufit.devices.emulate.device import Device

Array = NDArray[np.float64]

GROUP = 1 << 16
"""Samples that are written at a time."""


class Sent:
    """Samples of a device with what became of them, kept in memory, in a Parquet file, or not at all.

    Columns: ``start`` and ``sequence`` of the frame, ``stamp`` (ticks), ``t`` (true time since the device was switched
    on, s), ``t_host`` (that on the host's clock, s since 1970; NaN at full speed), ``intact`` (whether all of it
    stood on the line, unaltered, while somebody read), and the readings before they became counts, SI units.

    Parameters
    ----------
    device : Device
        Whose columns are sent.
    keep : Path or bool
        The file; True for memory, False for nowhere.
    """

    def __init__(self, device: Device, keep: Path | bool) -> None:
        whole = [("start", pa.uint8()), ("sequence", pa.uint16()), ("stamp", pa.uint32())]
        times = [("t", pa.float64()), ("t_host", pa.float64()), ("intact", pa.bool_())]
        self._schema = pa.schema([*whole, *times, *((name, pa.float64()) for name in device.columns)])
        self._batches: list[pa.RecordBatch] = []
        self._held = 0
        self._keep = keep
        self._writer: pq.ParquetWriter | None = None

    def __enter__(self) -> Sent:
        if isinstance(self._keep, Path):
            self._writer = pq.ParquetWriter(self._keep, self._schema)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._writer is not None:
            self._flush()
            self._writer.close()
            self._writer = None

    def add(
        self,
        head: tuple[int, NDArray[np.uint16], NDArray[np.uint32]],
        t: Array,
        t_host: Array,
        intact: NDArray[np.bool_],
        values: Array,
    ) -> None:
        """Add samples.

        Parameters
        ----------
        head : tuple
            Number of the start, sequence (n,), stamps (n,).
        t, t_host : (n,) array
            Times, s.
        intact : (n,) array of bool
            What became of them.
        values : (n, columns) array
            Readings, SI units.
        """
        if self._keep is False:
            return
        start, sequence, stamps = head
        columns = [np.full(len(t), start, np.uint8), sequence, stamps, t, t_host, intact, *values.T]
        arrays = [pa.array(np.ascontiguousarray(column)) for column in columns]
        self._batches.append(pa.RecordBatch.from_arrays(arrays, schema=self._schema))
        self._held += len(t)
        if self._writer is not None and self._held >= GROUP:
            self._flush()

    def _flush(self) -> None:
        if self._writer is not None and self._batches:
            self._writer.write_table(self.table())
            self._batches.clear()
            self._held = 0

    def table(self) -> pa.Table:
        """Return what is held in memory."""
        return pa.Table.from_batches(self._batches, self._schema)
