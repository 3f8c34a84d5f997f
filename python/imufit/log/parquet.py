"""Logs as Parquet: read by batches, written with the metadata in the schema."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log.metadata import Metadata, mapping_from_json, sidecar_path, write_sidecar
from imufit.whole_file import whole_file

_KEY: Final = b"imufit"
_BATCH: Final = 65_536
_ROW_GROUP: Final = 131_072
_BROKEN: Final = (pa.ArrowException, OSError, ValueError, OverflowError, MemoryError)
"""What the reader raises about damaged bytes; a schema's size may be anything."""
_DAMAGED: Final = "Copy or record it again; imufit recover saves what a crash left."


class ParquetSource:
    """A Parquet file as a source of blocks."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            with pq.ParquetFile(path) as file:
                self._schema = file.schema_arrow
                self.n: int = file.metadata.num_rows
        except UnicodeDecodeError:
            raise InputError(
                "a name in the file's schema is no UTF-8", file=path, remedy="Rename the column and write it again."
            ) from None
        except _BROKEN as error:
            raise self._unreadable(error) from None
        truths = [name for name in self._schema.names if pa.types.is_boolean(_value_type(self._schema, name))]
        self.truths: dict[str, tuple[int | None, str]] = dict.fromkeys(truths, (None, ""))
        listed = [name for name in self._schema.names if pa.types.is_nested(_value_type(self._schema, name))]
        self.names: tuple[str, ...] = tuple(name for name in self._schema.names if name not in listed)
        self.notes: tuple[str, ...] = tuple(f"{path.name}: column {name} left out: it holds lists" for name in listed)
        text = (self._schema.metadata or {}).get(_KEY)
        self.embedded: Mapping[str, Any] = mapping_from_json(text, path) if text else {}

    def _unreadable(self, error: Exception) -> InputError:
        with self._path.open("rb") as file:
            start = file.read(4)
        if start == b"PAR1":
            return InputError("the file is cut off or damaged: its end is missing", file=self._path, remedy=_DAMAGED)
        return InputError("this is not a Parquet file", file=self._path, remedy="Check the suffix.")

    def scan(self, columns: Sequence[str]) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """Give the named columns block by block."""
        yield from self.blocks(columns)

    def blocks(self, columns: Sequence[str]) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """Give the named columns block by block."""
        start = 0
        try:
            with pq.ParquetFile(
                self._path, pre_buffer=False, buffer_size=1 << 16, page_checksum_verification=True
            ) as file:
                wanted = list(columns) or None
                for batch in file.iter_batches(batch_size=_BATCH, columns=wanted, use_threads=False):
                    yield start, batch.num_rows, {name: _array(batch.column(name)) for name in columns}
                    start += batch.num_rows
        except _BROKEN as error:
            raise InputError(
                f"the file is damaged after row {start} ({str(error).splitlines()[0]})",
                file=self._path,
                remedy=_DAMAGED,
            ) from None

    def line_of(self, row: int) -> int | None:
        """Binary files have no lines."""
        return None


def _value_type(schema: pa.Schema, name: str) -> Any:
    """Type of a column; of its values for dictionary-encoded text."""
    kind = schema.types[schema.names.index(name)]
    return kind.value_type if pa.types.is_dictionary(kind) else kind


def _array(column: Any) -> NDArray[Any]:
    """Make float64 of anything numeric, objects of everything else."""
    kind = column.type
    if pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind):
        return _numbers(pc.cast(column, pa.float64(), safe=False))
    if pa.types.is_boolean(kind):
        return _array(pc.cast(column, pa.uint8()))
    cells = np.empty(len(column), dtype=object)
    cells[:] = column.to_pylist()
    return cells


def _numbers(values: Any) -> NDArray[np.float64]:
    """Give (n,) float64 from Arrow's memory, NaN for null; `to_numpy` would load pandas, 40 MB."""
    if not len(values):
        return np.empty(0)
    known, memory = values.buffers()
    numbers = np.frombuffer(memory, np.float64, len(values), 8 * values.offset)
    if not values.null_count:
        return numbers
    bits = np.unpackbits(np.frombuffer(known, np.uint8), bitorder="little")
    return np.where(bits[values.offset : values.offset + len(values)], numbers, np.nan)


def write_parquet(path: Path, table: Mapping[str, NDArray[Any]], metadata: Metadata) -> None:
    """Write columns as Parquet.

    Parameters
    ----------
    path : Path
        File to write. An existing sidecar beside it is rewritten, since it would overrule the file.
    table : mapping
        Columns: (n,) float64, or (n,) object for text with None where there is none.
    metadata : Metadata
        Goes to the schema as JSON.
    """
    arrays = [pa.array(column, pa.string() if column.dtype == object else pa.float64()) for column in table.values()]
    schema = pa.schema(
        [pa.field(name, array.type) for name, array in zip(table, arrays, strict=True)],
        metadata={_KEY: metadata.to_json().encode()},
    )
    with whole_file(path) as file:
        pq.write_table(
            pa.Table.from_arrays(arrays, schema=schema), file, row_group_size=_ROW_GROUP, write_page_checksum=True
        )
        if sidecar_path(path).exists():
            file.flush()
            write_sidecar(path, metadata)  # only when all rows found room
