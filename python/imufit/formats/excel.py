"""Excel's workbooks (``.xlsx``), read by openpyxl: a table a sheet."""

from __future__ import annotations

import datetime
import zipfile
from pathlib import Path
from typing import Any, Final

from imufit.errors import InputError
from imufit.formats.guard import library
from imufit.formats.limits import PARSED, TEXT, check_expansion, check_size
from imufit.formats.recording import Recording, Table
from imufit.formats.rows import Rows

FORM: Final = "Excel workbook"
_ZIP: Final = b"PK\x03\x04"
_BEFORE: Final = 100
"""Rows in which a header is looked for; measuring instruments write up to some 40 lines of settings above."""
_WIDTH: Final = 1024
"""Cells of a row; a sheet may have 16 384, and one cell in the last would make a row of them."""
_HEIGHT: Final = 1_100_000
"""Rows, empty ones included; a sheet has 1 048 576."""
_UNPACKED: Final = 1_000_000_000
"""Bytes of a workbook's text, of which a part at a time is in memory: a full sheet of 20 columns has 600 MB."""
_EPOCH: Final = datetime.datetime(1970, 1, 1)


def recognises(head: bytes, path: Path) -> bool:
    """Return whether this is an archive with a workbook inside."""
    if not head.startswith(_ZIP) or not path.is_file():
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            return any(name.startswith("xl/") for name in archive.namelist())
    except Exception:  # an archive whose directory is damaged is not known to be a workbook
        return False


def read(path: Path) -> Recording:
    """Read every sheet that has a row of numbers; dates become s since 1970."""
    openpyxl = library("openpyxl", "excel", path, FORM)
    size = check_size(path, PARSED * 4)
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        check_expansion(path, size, sum(member.file_size for member in members), _UNPACKED)
        shared = sum(member.file_size for member in members if not member.filename.startswith("xl/worksheets/"))
        check_expansion(path, size, shared, PARSED)
    tables: list[Table] = []
    notes: list[str] = []
    with path.open("rb") as file:  # of a path the library asks for its own suffixes
        book = openpyxl.load_workbook(file, read_only=True, data_only=True, keep_links=False)
        for sheet in book.worksheets:
            made, said = _sheet(path, sheet)
            tables += made
            notes += said
        book.close()
    if len(tables) == 1:
        tables = [Table("", tables[0].columns, tables[0].time)]
    return Recording(FORM, tuple(tables), tuple(notes))


def _sheet(path: Path, sheet: Any) -> tuple[list[Table], list[str]]:
    sheet.reset_dimensions()  # the size that the sheet states may be wrong
    above: list[tuple[Any, ...]] = []
    names: list[str] | None = None
    dates: set[str] = set()
    texts: dict[str, int] = {}
    rows = Rows(path)
    for count, cells in enumerate(sheet.iter_rows(values_only=True)):
        if count > _HEIGHT:
            raise InputError(f"the sheet has more than {_HEIGHT} rows", file=path)
        if len(cells) > _WIDTH and any(cell is not None for cell in cells[_WIDTH:]):
            raise InputError(f"a row of the sheet has more than {_WIDTH} cells", file=path)
        if all(cell is None or cell == "" for cell in cells):
            continue
        if names is None:
            if not _is_data(cells):
                if len(above) == _BEFORE:
                    break
                above.append(cells)
                continue
            names = _names(above, len(cells))
        names += [f"c{index + 1}" for index in range(len(names), min(len(cells), _WIDTH))]
        values = {}
        for name, cell in zip(names, cells, strict=False):
            values[name], date = _value(cell)
            if date:
                dates.add(name)
            elif isinstance(values[name], str):
                texts[name] = texts.get(name, 0) + 1
        rows.append(sheet.title, values)
    tables = rows.tables()
    if not tables:
        return [], []
    table = tables[0]
    lost = sum(count for name, count in texts.items() if table.columns[name].dtype == float)
    time = next(iter(dates)) if len(dates) == 1 else None
    if time is not None and (time not in table.columns or table.columns[time].dtype == object):
        time = None
    notes = [f"{lost} texts in columns of numbers of the sheet {sheet.title} are taken as missing."] if lost else []
    return [Table(table.name, table.columns, time)], notes


def _is_data(cells: tuple[Any, ...]) -> bool:
    """Return whether at least half of a row's filled cells are numbers or times."""
    filled = [cell for cell in cells if cell is not None and cell != ""]
    numbers = [cell for cell in filled if not isinstance(_value(cell)[0], str)]
    return len(filled) >= 2 and 2 * len(numbers) >= len(filled)


def _names(above: list[tuple[Any, ...]], width: int) -> list[str]:
    """Return names for the columns: the last row of texts above, with the units where a row of them follows."""
    wide = [row for row in above[-2:] if sum(cell not in (None, "") for cell in row) >= min(2, width)]
    header = wide[0] if len(wide) == 2 and _are_units(wide[0], wide[1]) else wide[-1] if wide else ()
    units = wide[1] if wide and header is not wide[-1] else ()
    names: list[str] = []
    for index in range(max(width, len(header))):
        text = " ".join(str(header[index]).split())[:TEXT] if index < len(header) and header[index] is not None else ""
        name = text or f"c{index + 1}"
        if index < len(units) and units[index] not in (None, ""):
            name = f"{name} ({str(units[index]).strip().strip('()[]')[:TEXT]})"
        while name in names:
            name += "_"
        names.append(name)
    return names


def _are_units(names: tuple[Any, ...], units: tuple[Any, ...]) -> bool:
    """Return whether of two rows of texts the second has the units of the first: shorter, and under a name each."""
    filled = [(names[index] if index < len(names) else None, unit) for index, unit in enumerate(units) if unit]
    return all(name for name, _ in filled) and sum(len(str(unit)) for _, unit in filled) <= 8 * len(filled)


def _value(cell: Any) -> tuple[float | str | None, bool]:
    """Return the value of a cell, and whether it is a date."""
    value: float | str | None = None
    date = False
    if isinstance(cell, bool | int | float):
        value = float(cell)
    elif isinstance(cell, datetime.datetime):
        value, date = (cell.replace(tzinfo=None) - _EPOCH).total_seconds(), True
    elif isinstance(cell, datetime.date):
        value, date = (datetime.datetime(cell.year, cell.month, cell.day) - _EPOCH).total_seconds(), True
    elif isinstance(cell, datetime.time):
        value = cell.hour * 3600 + cell.minute * 60 + cell.second + cell.microsecond * 1e-6
        date = True
    elif isinstance(cell, datetime.timedelta):
        value, date = cell.total_seconds(), True
    elif isinstance(cell, str) and cell.strip():
        text = cell.strip()
        try:
            value = float(text.replace(",", ".") if text.count(",") == 1 and "." not in text else text)
        except ValueError:
            value = text[:TEXT]
    return value, date
