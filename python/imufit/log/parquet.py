"""Logs as Parquet: read by batches, written with the metadata in the schema."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from typing import IO, Any, Final

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log.arrow_numbers import numbers_of
from imufit.log.each_once import check_each_once
from imufit.log.metadata import Metadata, mapping_from_json
from imufit.log.place import Place
from imufit.log.size import NUMBER, TEXT_CELL, TEXT_GROUP, rows_at_once, size_in_words
from imufit.log.text_cells import cells_of
from imufit.remedy import command

_KEY: Final = b"imufit"
ROW_GROUP: Final = 32_768
"""Rows of a row group that is written: what a reader has to hold at least, and unpacks to find a row."""
SKIPPED: Final = 4_096
"""Rows of a row group that are unpacked at once to find a row within it."""
SOUGHT: Final = 1 << 20
"""Rows of a row group up to which a row within it is found fast enough to be drawn: pyarrow's groups have as many."""
_BROKEN: Final = (pa.ArrowException, OSError, ValueError, OverflowError, MemoryError)
"""Errors of the reader about damaged bytes; a schema's size may be anything."""
_DAMAGED: Final = (
    "Copy or record it again; " + command("recover", "imufit.devices.record.recover") + " saves what a crash left."
)


class ParquetSource:
    """A Parquet file as a source of blocks."""

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            with pq.ParquetFile(path) as file:
                self._schema = file.schema_arrow
                # Read once: that of 600 row groups takes 14 ms.
                self._footer = file.metadata
                self.n: int = file.metadata.num_rows
                self._check_text(file)
                sizes = [file.metadata.row_group(k).num_rows for k in range(file.metadata.num_row_groups)]
                self._groups = [0, *accumulate(sizes)][: len(sizes)]
                self._largest_group = max(sizes, default=0)
        except InputError:
            raise
        except UnicodeDecodeError:
            raise InputError(
                "a name in the file's schema is not UTF-8", file=path, remedy="Rename the column and write it again."
            ) from None
        except _BROKEN as error:
            raise self._unreadable(error) from None
        check_each_once(self._schema.names, Place(path))
        truths = [name for name in self._schema.names if pa.types.is_boolean(_value_type(self._schema, name))]
        self.truths: dict[str, tuple[int | None, str]] = dict.fromkeys(truths, (None, ""))
        listed = [name for name in self._schema.names if pa.types.is_nested(_value_type(self._schema, name))]
        self.names: tuple[str, ...] = tuple(name for name in self._schema.names if name not in listed)
        self.clues = (path.name, *self.names)
        self.notes: tuple[str, ...] = tuple(f"{path.name}: column {name} left out: it holds lists" for name in listed)
        text = (self._schema.metadata or {}).get(_KEY)
        self.embedded: Mapping[str, Any] = mapping_from_json(text, path) if text else {}

    def _check_text(self, file: pq.ParquetFile) -> None:
        """Refuse a column of text that cannot be labels, before anything of it is unpacked.

        A column is looked at only where its row group is large enough: pyarrow 26 ends the process, and raises
        nothing, where the description of a column is damaged.
        """
        texts = [k for k in range(len(file.schema.names)) if file.schema.column(k).physical_type == "BYTE_ARRAY"]
        groups = [file.metadata.row_group(k) for k in range(file.metadata.num_row_groups)] if texts else []
        for group in groups:
            if group.total_byte_size <= TEXT_GROUP:
                continue
            for column in map(group.column, texts):
                if column.total_uncompressed_size > TEXT_GROUP:
                    size = size_in_words(column.total_uncompressed_size)
                    raise InputError(
                        f"the column holds {size} of text in {group.num_rows} rows: too much to be labels",
                        file=self._path,
                        column=column.path_in_schema,
                        remedy="Write the log without this column.",
                    )

    @cached_property
    def text(self) -> frozenset[str]:
        """Columns that hold text."""
        return frozenset(
            name
            for name in self.names
            if not (_is_number(kind := _value_type(self._schema, name)) or pa.types.is_boolean(kind))
        )

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
        text = [name for name in columns if name in self.text]
        rows = rows_at_once(NUMBER * (len(columns) - len(text)) + TEXT_CELL * len(text))
        for start, batch in self._batches(columns, 0, rows):
            yield start, batch.num_rows, {name: _array(batch.column(name)) for name in columns}

    @property
    def seeks(self) -> bool:
        """Whether any row is found without reading many others."""
        return self._largest_group <= SOUGHT

    def blocks_between(
        self, columns: Sequence[str], first: int, stop: int
    ) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """Give rows ``first <= row < stop`` of the named columns block by block; the rest of their group is skipped."""
        for start, batch in self._batches(columns, first, SKIPPED):
            if start >= stop:
                return
            low, high = max(first - start, 0), min(stop - start, batch.num_rows)
            if low < high:
                part = batch.slice(low, high - low)
                yield start + low, part.num_rows, {name: _array(part.column(name)) for name in columns}

    def _batches(self, columns: Sequence[str], row: int, rows: int) -> Iterator[tuple[int, pa.RecordBatch]]:
        """Read the named columns by so many rows, from the row group that holds a row; first row and values of each."""
        group = max(bisect_right(self._groups, row) - 1, 0)
        start = self._groups[group] if self._groups else 0
        try:
            with pq.ParquetFile(
                self._path,
                metadata=self._footer,
                pre_buffer=False,
                buffer_size=1 << 16,
                page_checksum_verification=True,
                read_dictionary=[name for name in columns if name in self.text],
            ) as file:
                wanted = list(columns) or None
                groups = range(group, len(self._groups))
                for batch in file.iter_batches(rows, groups, columns=wanted, use_threads=False):
                    # Its reader does not check whether text is UTF-8.
                    for name in self.text.intersection(columns):
                        batch.column(name).validate(full=True)
                    yield start, batch
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
    if _is_number(kind):
        return numbers_of(pc.cast(column, pa.float64(), safe=False))
    if pa.types.is_boolean(kind):
        return _array(pc.cast(column, pa.uint8()))
    return cells_of(column)


def _is_number(kind: Any) -> bool:
    return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind))


class ParquetRows:
    """Writes columns as Parquet, a row group at a time.

    Parameters
    ----------
    file : file
        Open for writing bytes.
    path : Path
        Its place.
    metadata : Metadata
        Goes to the schema as JSON.
    """

    def __init__(self, file: IO[bytes], path: Path, metadata: Metadata) -> None:
        self._file = file
        self._metadata = {_KEY: metadata.to_json().encode()}
        self._writer: Any = None

    def add(self, table: Mapping[str, NDArray[Any]]) -> None:
        """Write rows.

        Parameters
        ----------
        table : mapping
            Columns: (n,) float64, or (n,) object for text with None where there is none; the same every time.
        """
        kinds = [pa.string() if column.dtype == object else pa.float64() for column in table.values()]
        arrays = [pa.array(column, kind) for column, kind in zip(table.values(), kinds, strict=True)]
        if self._writer is None:
            schema = pa.schema(list(zip(table, kinds, strict=True)), metadata=self._metadata)
            self._writer = pq.ParquetWriter(self._file, schema, write_page_checksum=True)
        rows = pa.Table.from_arrays(arrays, schema=self._writer.schema)
        self._writer.write_table(rows, row_group_size=ROW_GROUP)

    def finish(self) -> None:
        """Write the end of the file."""
        self._writer.close()

    def abandon(self) -> None:
        """Close what is open."""
        if self._writer is not None:
            self._writer.close()
