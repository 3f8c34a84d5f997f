"""Which columns of a file become which columns of the log, and in which unit they stand."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log.clock import BETWEEN
from imufit.log.clock_text import ORDERS
from imufit.log.columns import CONTRACT, GROUPS, SENSORS, without_unit
from imufit.log.place import Place
from imufit.log.units import Conversion, conversion, unit_in_header
from imufit.log.words import meant, nearest
from imufit.printable import NAME, printable
from imufit.remedy import Remedy, reading, template

ROW: Final = "row"
"""Name that stands for the row number in a mapping, when the file has no column of that name."""
NUMBER: Final = re.compile(r"[+-]?\s*(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
"""The text of a constant in a mapping, when the file has no column of that name."""


@dataclass(frozen=True)
class RowNumber:
    """The number of the row, from 0, instead of a column of the file."""

    text: str = ROW

    def numbers(self, start: int, rows: int) -> NDArray[np.float64]:
        """Values of some rows from `start` on, (rows,)."""
        return np.arange(start, start + rows, dtype=np.float64)


@dataclass(frozen=True)
class Constant:
    """One number for every row, instead of a column of the file.

    Parameters
    ----------
    value : float
        In the unit that the mapping names.
    text : str
        As the mapping writes it.
    """

    value: float
    text: str

    def numbers(self, start: int, rows: int) -> NDArray[np.float64]:
        """Values of some rows from `start` on, (rows,)."""
        return np.full(rows, self.value)


@dataclass(frozen=True)
class PlannedColumn:
    """One column of the log to be made.

    Parameters
    ----------
    target : str
        Column of the log.
    source : str, RowNumber or Constant
        Column of the file, or what stands for one.
    conversion : Conversion
        To SI.
    day : str, optional
        Column of dates, where `source` has the times of day: of the time alone.
    order : str
        Order of the numbers of dates with slashes, one of `imufit.log.clock_text.ORDERS`; of the time alone.
    """

    target: str
    source: str | RowNumber | Constant
    conversion: Conversion
    day: str | None = None
    order: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Columns of the file that it is made from."""
        return tuple(each for each in (self.day, self.name) if each is not None)

    @property
    def name(self) -> str | None:
        """Column of the file; None if the values do not come from one."""
        return self.source if isinstance(self.source, str) else None

    @property
    def origin(self) -> str:
        """Text that stands for the source in a mapping."""
        source = self.source if isinstance(self.source, str) else self.source.text
        return source if self.day is None else f"{self.day}{BETWEEN}{source}"


@dataclass(frozen=True)
class Plan:
    """All columns of the log to be made, from the columns of a file.

    Parameters
    ----------
    columns : tuple of PlannedColumn
        In the order of the file.
    notes : tuple of str
        What the plan leaves out.
    """

    columns: tuple[PlannedColumn, ...]
    notes: tuple[str, ...] = ()

    @property
    def sources(self) -> tuple[str, ...]:
        """Columns of the file that are read, each once."""
        return tuple(dict.fromkeys(name for column in self.columns for name in column.names))

    @property
    def origin(self) -> dict[str, str]:
        """Column of the file for each column of the log."""
        return {column.target: column.origin for column in self.columns}

    @property
    def time(self) -> PlannedColumn:
        """The column that becomes `t`."""
        return next(column for column in self.columns if column.target == "t")


def plan_columns(
    names: Sequence[str],
    mapping: Mapping[str, str] | None,
    place: Place,
    bare: bool = False,
    rest: bool = True,
    dropped: Collection[str] = (),
    computed: Collection[str] = (),
) -> Plan:
    """Decide which columns of the file become which columns of the log.

    Parameters
    ----------
    names : sequence of str
        Columns of the file.
    mapping : mapping, optional
        Source text for target columns, such as ``{"acc_x": "-AccX[g]", "temp": "21"}``.
    place : Place
        To name the file in errors.
    bare : bool
        True if the file needs neither a sensor nor a reference: what it has becomes covariates.
    rest : bool
        Whether columns that are neither mapped nor a log's own become covariates.
    dropped : collection of str
        Columns to leave out, of the file and of the log.
    computed : collection of str
        Columns that are named as a sensor but are none: they mean no column of the log.

    Raises
    ------
    InputError
        A column is missing, misspelt, given twice, or mapped from a column that is not there.
    """
    shown = {name: printable(name, NAME) for name in names}
    resolved = [resolve(target, text, names, place) for target, text in (mapping or {}).items()]
    mapped = [column for column in resolved if column.target not in dropped]
    for column in mapped:
        if column.name in dropped:
            raise place.error(
                f"column {column.name} is to be left out, but the mapping takes {column.target} from it",
                column=column.name,
                remedy="Choose one of them.",
            )
    # A column read only for a dropped column is not a covariate either.
    dropped = {*dropped, *(column.origin for column in resolved if column.target in dropped)}
    targets = {column.target for column in mapped}
    used = {name for column in mapped for name in column.names}
    kept = [PlannedColumn(shown[name], name, Conversion()) for name in names if name not in {*targets, *used, *dropped}]
    for column in mapped:
        if column.target not in CONTRACT and column.target != column.name and (close := meant(column.target)):
            raise place.error(
                f"the mapping makes a column {column.target}; did you mean {close}?", column=column.target
            )
    lost = [shown[name] for name in names if name in targets - used and name not in dropped]
    changed = [column.target for column in kept if column.target != column.name]
    for index, name in enumerate(changed):
        if name in changed[:index] or name in names or name in targets:
            raise place.error(f"column {name} is there twice", column=name, remedy="Give these columns other names.")
    unused = [shown[n] for n in names if n not in {*used, *dropped, *computed}]
    if not rest:
        kept = [column for column in kept if column.target in CONTRACT]
    at = {name: k for k, name in enumerate(names)}
    columns = sorted([*mapped, *kept], key=lambda column: at.get(column.name or "", -1))
    _check_complete([column.target for column in columns], unused, place, bare)
    notes = tuple(f"{place.name}: column {name} left out: the mapping gives that name to another" for name in lost)
    notes += tuple(
        f"{place.name}: column {name} has another name in the file, which is too long or cannot be printed"
        for name in changed
    )
    return Plan(tuple(columns), notes)


def resolve(target: str, text: str, names: Sequence[str], place: Place) -> PlannedColumn:
    """Find the column, sign and unit, or the constant, that a mapping's source text means.

    Parameters
    ----------
    target : str
        Column of the log.
    text : str
        Its source, such as ``-AccX[g]``.
    names : sequence of str
        Columns of the file.
    place : Place
        To name the file in errors.

    Raises
    ------
    InputError
        The column is not in the file, or the unit is not one of the target.
    """
    bare, unit = bracket(text)
    if target == "t":
        for name, order in ((text.strip(), ""), (bare, unit)):
            day, _, clock = name.partition(BETWEEN)
            if day in names and clock in names and order in ("", "s", *ORDERS):
                return PlannedColumn("t", clock, Conversion(), day, order if order in ORDERS else "")
        if unit in ORDERS and bare in names:
            return PlannedColumn("t", bare, Conversion(), order=unit)
    for name, given in ((text.strip(), None), (bare, unit)):
        for sign, given_name in signed(name):
            column = given_name
            if column not in names:
                column = _named_otherwise(given_name, names) or column
            if column in names or (column == ROW and ROW not in names):
                return _planned(target, column, sign=sign, unit=given, names=names, place=place)
    if NUMBER.fullmatch(bare):
        return _constant(target, bare, unit, names=names, place=place)
    wanted = bare.lstrip("+-").strip()
    names = [printable(name, NAME) for name in names]
    close = nearest(wanted, names, n=3)
    raise place.error(
        f"column {wanted} is not in the file, but the mapping takes {target} from it",
        column=wanted,
        remedy=f"Nearest are {', '.join(close)}." if close else f"The columns are {', '.join(names)}.",
    )


def _named_otherwise(given: str, names: Sequence[str]) -> str | None:
    """Column that a mapping names as it is shown in messages, or without the unit behind its name."""
    shown = next((name for name in names if printable(name, NAME) == given), None)
    plain = [name for name in names if without_unit(name) == given]
    return shown or (plain[0] if len(plain) == 1 else None)


def _constant(target: str, text: str, unit: str, *, names: Sequence[str], place: Place) -> PlannedColumn:
    """Plan a column that is the same number in every row."""
    value = float("".join(text.split()))
    if target in ("t", "pose") or not math.isfinite(value):
        listed = ", ".join(printable(name, NAME) for name in names[:12])
        problem = f"{target} cannot be a number that is the same in every row"
        raise place.error(
            problem if math.isfinite(value) else f"{text} is too large a number",
            column=target,
            remedy=f"The columns are {listed}.",
        )
    return PlannedColumn(target, Constant(value, text), _to_si(target, unit, place))


def _to_si(target: str, unit: str, place: Place) -> Conversion:
    try:
        return conversion(target, unit)
    except InputError as error:
        raise place.error(error.problem, column=error.column, remedy=error.advice) from None


def _planned(
    target: str, column: str, *, sign: float, unit: str | None, names: Sequence[str], place: Place
) -> PlannedColumn:
    to_si = _to_si(target, unit if unit is not None else unit_in_header(column, target), place)
    if sign < 0.0:
        to_si = Conversion(-to_si.factor, -to_si.offset)
    return PlannedColumn(target, column if column in names else RowNumber(), to_si)


def bracket(text: str) -> tuple[str, str]:
    """Split ``AccX[g]`` into the name and the unit.

    Parameters
    ----------
    text : str
        Source of a column in a mapping.
    """
    found = re.fullmatch(r"(.*?)\s*\[([^\[\]]*)\]\s*", text)
    return (found[1].strip(), found[2]) if found else (text.strip(), "")


def signed(name: str) -> list[tuple[float, str]]:
    """Return every sign and name that a source without its unit may mean: a name may begin with a sign.

    Parameters
    ----------
    name : str
        Source of a column in a mapping, without its unit.
    """
    if name[:1] in "+-" and name[1:]:
        return [(1.0, name), (-1.0 if name[0] == "-" else 1.0, name[1:].strip())]
    return [(1.0, name)]


def _check_complete(targets: Sequence[str], unused: Sequence[str], place: Place, bare: bool) -> None:
    """Refuse a log with a missing or misspelt column, and name the nearest."""
    free = [name for name in unused if name not in CONTRACT]
    missing: dict[str, str] = {}
    for name in free:
        column = meant(name) if name in targets else None
        if column is not None and column not in targets:
            missing.setdefault(column, name)
    for group in GROUPS.values():
        if any(column in targets for column in group):
            for column in group:
                if column not in targets and column not in missing:
                    missing[column] = next(iter(nearest(column, free)), "")
    if "t" not in targets and "t" not in missing:
        missing["t"] = ""
    sensors = {column for group in (*SENSORS, "ref_q") for column in GROUPS[group]} | {"ref_angle"}
    if missing and (bare or sensors & {*targets, *missing}):
        raise _missing(missing, targets, place)
    complete = [group for group in (*SENSORS, "ref_q") if all(column in targets for column in GROUPS[group])]
    if not complete and "ref_angle" not in targets and not bare:
        raise place.error(
            "the file has no sensor: neither acc_x acc_y acc_z nor gyr_* nor mag_* nor a reference ref_q*",
            remedy=naming(place.file, free),
        )


def naming(file: str | Path | None, free: Sequence[str]) -> Remedy:
    """Return the remedy for a file without a sensor: a mapping of its columns.

    Parameters
    ----------
    file : str, Path or None
        Of the log; None for a table in memory.
    free : sequence of str
        Columns without a meaning, as printed.
    """
    return "Name the columns with " + reading(file, template("acc")) + "." + _listing(free)


def _missing(missing: dict[str, str], targets: Sequence[str], place: Place) -> InputError:
    """Error for all missing columns, with the mapping for those that have a likely source."""
    named = {column: missing[column] for column in sorted(missing, key=CONTRACT.index)}
    pairs = {column: name for column, name in named.items() if name}
    first = next((column for column in named if column not in pairs), next(iter(named)))
    touched = [group for group in GROUPS.values() if any(column in named for column in group)]
    problems, others = ["column t is missing"] if "t" in named and "t" not in pairs else [], []
    for group in touched:
        absent = [column for column in group if column in named and column not in pairs]
        if absent:
            there = [column for column in group if column in targets or column in pairs]
            beside = f" although {' and '.join(there)} {'is' if len(there) == 1 else 'are'} there" if there else ""
            problems.append(f"{_these(absent)} missing{beside}")
            others.append(", ".join(group))
    if not problems:
        problem = f"column {first} is missing; did you mean {pairs[first]}?"
        return place.error(problem, column=first, remedy="Use " + place.mapped(pairs))
    remedy = Remedy.of(
        f"Add {'it' if len(problems) == 1 else 'them'}, or leave out the others of {' and '.join(others)}."
    )
    if first == "t":
        remedy = "Give time in s, for a fixed rate with " + place.mapped({"t": "row[100Hz]", **pairs}) + "."
        remedy += f" Add the others, or leave out {' and '.join(others)}." if others else ""
        remedy += "" if pairs or set(targets) & set(CONTRACT) else _listing(targets)
    return place.error("; ".join(problems), column=first, remedy=remedy)


def _these(columns: Sequence[str]) -> str:
    """Name columns, as the subject of a sentence."""
    return f"column {columns[0]} is" if len(columns) == 1 else f"columns {' and '.join(columns)} are"


def _listing(names: Sequence[str]) -> str:
    if not names:
        return ""
    return " The columns are " + ", ".join(names[:12]) + (", ..." if len(names) > 12 else ".")
