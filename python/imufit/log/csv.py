"""Logs as CSV: read in blocks with any separator, written with every digit."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log.arrow_numbers import numbers_of
from imufit.log.check import is_truth, number_from_text
from imufit.log.csv_layout import NOT_DATA, is_comment, lines_in, read_layout, split_line, text_of, too_long
from imufit.log.each_once import check_each_once
from imufit.log.metadata import Metadata
from imufit.log.place import Place
from imufit.log.size import LONGEST_LINE
from imufit.log.text_cells import cells_of

_BLOCK: Final = 4 << 20
_EMPTY: Final = ["", "nan", "NaN", "NAN", "NA", "N/A", "#N/A", "null", "NULL", "None"]
_FAILED: Final = re.compile(r"CSV column #(\d+)")


class CsvSource:
    """A text table as a source of blocks.

    A column is numbers when every cell is a number, a truth value or empty, else text. That takes one pass over the
    file, which `scan` makes; `n` is known after it.
    """

    embedded: Mapping[str, Any] = {}

    def __init__(self, path: Path) -> None:
        self._path = path
        self._layout = read_layout(path)
        self.names = self._layout.names
        check_each_once(self.names, Place(path))
        self.notes = (*self._layout.notes, *self._open_end())
        self.clues = (path.name, *self._layout.before, *self.names)
        self._end = self._last_value()
        self.n = 0
        # "number": read as such; "word": numbers that need the slow way (True, blanks); "text": not numbers
        self._kinds = dict.fromkeys(self.names, "number")
        self.truths: dict[str, tuple[int | None, str]] = {}

    def scan(self, columns: Sequence[str]) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """Find out what each column holds, and give the named columns block by block."""
        start = 0
        for data in self._data():
            table = self._parse_learning(data, start)
            if table.num_rows:
                yield start, table.num_rows, {name: self._array(table, name) for name in columns}
            start += table.num_rows
        self.n = start

    def blocks(self, columns: Sequence[str]) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """Give the named columns block by block."""
        start = 0
        for data in self._data():
            table = self._parse(data, list(columns))
            if table.num_rows:
                yield start, table.num_rows, {name: self._array(table, name) for name in columns}
            start += table.num_rows

    def _open_end(self) -> Iterator[str]:
        """Note that the last line has no end: a cut inside its last number cannot be seen otherwise."""
        with self._path.open("rb") as file:
            file.seek(-1, 2)
            if file.read(1) != b"\n":
                note = "the last line has no line end; if the file was cut off, its last value is wrong"
                yield f"{self._path.name}: {note}"

    def _last_value(self) -> int:
        """Find the byte at which the rows without a single value at the end begin, as spreadsheets leave them.

        Such a row between others is a sample that was lost.
        """
        size = self._path.stat().st_size
        with self._path.open("rb") as file:
            file.seek(max(size - _BLOCK, self._layout.data_offset))
            tail = file.read()
        last = tail.rstrip(b' \t\r\n"' + self._layout.separator.encode())
        end = tail.find(b"\n", len(last))
        return size if end < 0 else size - len(tail) + end + 1

    def _data(self) -> Iterator[bytes]:
        """Whole data lines in blocks, without comments, in UTF-8, blanks reduced to one."""
        with self._path.open("rb") as file:
            file.seek(self._layout.data_offset)
            if self._layout.data_offset == 0 and file.read(3) != b"\xef\xbb\xbf":
                file.seek(0)
            rest = b""
            while block := file.read(min(_BLOCK, max(self._end - file.tell(), 0))):
                block = rest + block
                cut = block.rfind(b"\n") + 1
                rest = block[cut:]
                if len(rest) > LONGEST_LINE:
                    raise too_long(self._path)
                if cut:
                    yield self._clean(block[:cut])
            if rest:
                yield self._clean(rest + b"\n")

    def _clean(self, block: bytes) -> bytes:
        if not block.isascii():
            block = text_of(block).encode()
        if NOT_DATA.search(b"\n" + block[:4096]) or NOT_DATA.search(block):
            lines = block.split(b"\n")
            block = b"".join(line + b"\n" for line in lines if line and not NOT_DATA.match(b"\n" + line + b"\n"))
        if self._layout.separator == " ":
            block = re.sub(rb"(?m)^ | (?=\r?$)", b"", re.sub(rb"[ \t]+", b" ", block))
        return block

    def _parse(self, data: bytes, columns: list[str]) -> Any:
        """Parse a block with the kinds known so far."""
        if not data.strip():
            return pa.table({name: pa.array([], pa.float64()) for name in columns})
        types = {name: pa.float64() if kind == "number" else pa.string() for name, kind in self._kinds.items()}
        ragged: list[Any] = []

        def skip(row: Any) -> str:
            ragged.append(row)
            return "skip"

        table = pacsv.read_csv(
            pa.BufferReader(data),
            # Ragged rows call back into Python: from this thread, not from one that may outlive the interpreter.
            read_options=pacsv.ReadOptions(
                column_names=list(self.names), block_size=_BLOCK + (1 << 20), use_threads=False
            ),
            parse_options=pacsv.ParseOptions(delimiter=self._layout.separator, invalid_row_handler=skip),
            convert_options=pacsv.ConvertOptions(
                column_types=types,
                include_columns=columns or [self.names[0]],
                null_values=_EMPTY,
                strings_can_be_null=False,
                decimal_point=self._layout.decimal,
            ),
        )
        if ragged:
            raise self._ragged()
        if table.num_rows != data.count(b"\n"):
            raise self._unclosed()
        return table

    def _parse_learning(self, data: bytes, start: int) -> Any:
        """Parse the block from row `start` on; a column that turns out not to be plain numbers changes its kind."""
        while True:
            try:
                table = self._parse(data, list(self.names))
            except pa.ArrowInvalid as error:
                failed = _FAILED.search(str(error))
                if not failed:
                    raise InputError(f"the table cannot be parsed ({error})", file=self._path) from None
                self._kinds[self.names[int(failed[1])]] = "word"
                continue
            for name, kind in self._kinds.items():
                if kind != "word":
                    continue
                cells = table.column(name).to_pylist()
                if not _all_numbers(cells):
                    self._kinds[name] = "text"
                elif name not in self.truths:
                    found = next(((start + k, cell.strip()) for k, cell in enumerate(cells) if is_truth(cell)), None)
                    self.truths |= {} if found is None else {name: found}
            return table

    def _array(self, table: Any, name: str) -> NDArray[Any]:
        column = table.column(name)
        kind = self._kinds[name]
        if pa.types.is_floating(column.type):
            return numbers_of(column.cast(pa.float64()))
        if kind == "word":
            return np.array([number_from_text(cell, truth=True) for cell in column.to_pylist()], dtype=np.float64)
        return cells_of(column)

    @property
    def text(self) -> frozenset[str]:
        """Columns that hold text, once `scan` has been through."""
        return frozenset(name for name, kind in self._kinds.items() if kind == "text")

    def _rows(self) -> Iterator[tuple[int, str]]:
        """Line number, from 1, and text of every data row."""
        with self._path.open("rb") as file:
            file.seek(self._layout.data_offset)
            for line, data in enumerate(lines_in(file, self._path), self._layout.data_line + 1):
                text = text_of(data)
                if not is_comment(text):
                    yield line, text.rstrip("\r\n")

    def _ragged(self) -> InputError:
        """Error for the first line with another number of fields; the last line indicates a cut-off file."""
        width, row, line, fields, last = len(self.names), 0, 0, 0, False
        for row, (line, text) in enumerate(rows := self._rows()):  # noqa: B007 - used after the loop
            fields = len(split_line(text, self._layout.separator))
            if fields != width:
                last = next(rows, None) is None
                break
        if fields == width:
            return InputError("the table cannot be parsed: look for unbalanced quotes", file=self._path)
        if last and fields < width:
            problem, remedy = f"the last line has {fields} of {width} fields: the file was cut off", "Delete that line."
        else:
            problem = f"the line has {fields} fields, the header has {width}"
            remedy = "Correct or delete that line."
        return InputError(problem, file=self._path, row=row, line=line, remedy=remedy)

    def _unclosed(self) -> InputError:
        """Error for the first line whose quotes do not close in it."""
        for row, (line, text) in enumerate(self._rows()):
            if text.count('"') % 2:
                return InputError(
                    "a quote is not closed in this line",
                    file=self._path,
                    row=row,
                    line=line,
                    remedy="Close it; text must not go on in the next line.",
                )
        return InputError("the table cannot be parsed: rows and lines do not agree", file=self._path)

    def line_of(self, row: int) -> int | None:
        """Line of the file, from 1, of a data row."""
        return next((line for k, (line, _) in enumerate(self._rows()) if k == row), None)


def _all_numbers(cells: Iterable[str | None]) -> bool:
    try:
        for cell in cells:
            number_from_text(cell, truth=True)
    except ValueError:
        return False
    return True


class CsvRows:
    """Writes columns as CSV.

    Numbers have as many digits as it takes to read the same number back; missing ones are empty cells. Text that reads
    as a number comes back as one.

    Parameters
    ----------
    file : file
        Open for writing bytes.
    path : Path
        Its place.
    metadata : Metadata
        Goes to the sidecar alone.
    """

    def __init__(self, file: IO[bytes], path: Path, metadata: Metadata) -> None:
        self._file = file
        self._begun = False

    def add(self, table: Mapping[str, NDArray[Any]]) -> None:
        """Write rows.

        Parameters
        ----------
        table : mapping
            Columns: (n,) float64, or (n,) object for text with None where there is none; the same every time.
        """
        if not self._begun:
            header = io.StringIO()
            csv.writer(header, lineterminator="\n").writerow(table)
            self._file.write(header.getvalue().encode())
            self._begun = True
        arrays = [
            pa.array(column, pa.string())
            if column.dtype == object
            else pa.array(column, pa.float64(), mask=np.isnan(column))
            for column in table.values()
        ]
        rows = pa.Table.from_arrays(arrays, list(table))
        pacsv.write_csv(rows, self._file, pacsv.WriteOptions(include_header=False))

    def finish(self) -> None:
        """Nothing stands behind the rows."""

    abandon = finish
