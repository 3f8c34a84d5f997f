"""Which columns of a foreign file are the time and the sensors, by their names, their maker and their values."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log.check import text_for_number
from imufit.log.clock import Clock, clocks_of
from imufit.log.clock_text import ORDERS, seconds_from_cells
from imufit.log.columns import CONTRACT, EULER, GROUPS, LARGEST_COVARIATE, SENSOR_NAMES, SENSORS, WHOLE_TURN
from imufit.log.foreign import ROW, PlannedColumn, bracket, resolve
from imufit.log.makers import Maker, maker_of
from imufit.log.metadata import STANDARD_GRAVITY, Metadata
from imufit.log.place import Place
from imufit.log.time_order import counted_on
from imufit.log.time_unit import time_unit
from imufit.log.unit_by_data import acc_unit, gyr_unit, likely_acc_unit, mag_unit, turned
from imufit.log.unit_check import (
    GYR_UNITS,
    HEAD,
    OtherUnitError,
    check_rate,
    check_steps,
    check_units,
    rate_unit_by_size,
    units_of_force,
    without_gravity,
)
from imufit.log.units import Conversion, conversion, lookup
from imufit.log.words import Words, meant, sensor_of, strange, time_columns, unit_of, words_of
from imufit.printable import NAME, printable
from imufit.remedy import Option, Remedy, mapped, option, reading

Array = NDArray[np.float64]

_LIKELY_GYR: Final = {"m/s^2": "rad/s", "g": "deg/s", "mg": "mdps"}
"""Unit in which a maker who gives the accelerometer in the former usually gives the gyroscope; else counts."""
COUNTS: Final = "131 LSB/(deg/s)"
"""Counts of the usual sensor in its smallest range (InvenSense, MPU-6050 product specification)."""
ROW_RATE: Final = "row[100Hz]"
"""Time by row number, with the rate that is most usual."""
_ROW_STEP: Final = 0.01
"""The same as a step, s."""
_USUAL_FIELD: Final = 50.0
"""Magnitude of the earth's field in the middle latitudes, uT (World Magnetic Model)."""
_TEMPERATURES: Final = (-40.0, 55.0)
"""Median of a temperature in degC whose unit is not stated: the cold end of these sensors' range of operation (TDK
InvenSense, ICM-42688-P data sheet DS-000347), and the heat of a warm board, below 13 degC in degF."""
_SHOWN: Final = 6
"""Sensors that are left out of which a message names the columns: two lines of a terminal."""
_NUMBERED: Final = re.compile(r"(?:(?P<table>.*)\.)?c(?P<number>\d+)")
"""Name of a column of a table without a header."""


class Readable(Protocol):
    """The part of a source that recognising needs."""

    @property
    def names(self) -> tuple[str, ...]:
        """Columns of the file."""
        ...

    @property
    def clues(self) -> tuple[str, ...]:
        """Marks of its maker."""
        ...

    def scan(self, columns: Sequence[str]) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """First pass over the file, with the named columns only."""
        ...


@dataclass(frozen=True)
class Recognised:
    """The recognised layout of a file.

    Parameters
    ----------
    mapping : dict
        Source text for target columns, the user's own included.
    notes : tuple of str
        What the file was taken for.
    computed : tuple of str
        Columns that are named as a sensor but were computed from its readings.
    """

    mapping: dict[str, str]
    notes: tuple[str, ...] = ()
    computed: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Candidate:
    """Columns that may be one sensor, or the time; an arbitrary unit is a scale of the maker's own."""

    columns: tuple[str, ...]
    unit: str | None
    strange: int
    arbitrary: bool = False


def recognise(source: Readable, mapping: Mapping[str, str] | None, place: Place, bare: bool = False) -> Recognised:
    """Find the time and the sensors that neither the file's names nor the user's mapping already give.

    Parameters
    ----------
    source : Readable
        The file.
    mapping : mapping, optional
        The user's own mapping, which stands above what is found.
    place : Place
        To name the file in errors.
    bare : bool
        True if the file needs neither a sensor nor a reference: its time is found nevertheless.

    Raises
    ------
    InputError
        Sensors are there, but the unit of one is neither stated nor shown by the readings, or two columns may be the
        same sensor: all of it is asked in one sentence, with one mapping for the whole file.
    """
    names = source.names
    angles = _angles(source, names, mapping or {})
    given = {**angles, **(mapping or {})}
    told = (f"{place.name}: reference attitude from {', '.join(angles.values())}",) if angles else ()
    wanted = [group for group in ("t", *SENSORS) if not _has(group, names, given)]
    maker = maker_of(source.clues)
    parsed = [_parsed(name, names) for name in names if name not in CONTRACT and name not in given.values()]
    stem = place.file.stem if place.file is not None else ""
    warm = _temperature(source, parsed, given)
    if maker is not None:
        parsed = [words for words in parsed if maker.takes(_table(words.column, stem), words.column)]
    found = _found(wanted, parsed, maker, stem)
    if not found.keys() & set(SENSORS) and stem:
        # a file of one sensor has the sensor's name in its own
        parsed = [replace(words, words=(*words_of(stem).words, *words.words)) for words in parsed]
        found |= {group: each for group, each in _found(wanted, parsed, maker, stem).items() if group != "t"}
    if names and not mapping and not found and all(_NUMBERED.fullmatch(name) for name in names):
        raise _without_names(source, place)
    lacking = _lacking([group for group in wanted if group not in found], parsed)
    clocks = _clocks(source, found.pop("t", []), maker)
    counted = {} if clocks or "t" not in wanted else _counted(source, maker)
    given = {**given, **counted}
    if (
        not lacking
        and not found.keys() & set(SENSORS)
        and not ((clocks or counted) and (bare or _has_any(names, given)))
    ):
        if "t" in wanted and not counted and not mapping:
            _ask_time_and_units(source, place)
        return Recognised({**warm, **given}, (*told, *_notes(place, None, {}, {}, {}, warm)))
    clock = clocks[0] if clocks else None
    found, computed = _with_gravity(source, found)
    chosen = {group: candidates[0] for group, candidates in found.items()}
    several = ["t"] if len(clocks) > 1 else []
    several += [group for group, candidates in found.items() if len(candidates) > 1 and _alike(candidates)]
    readings = _Readings.of(source, clock, chosen, given, place)
    units = readings.units()
    asked = ["t"] if clock is not None and clock.unit is None else []
    asked += [group for group in chosen if units[group] is None]
    if "gyr" in asked:
        readings.check_clock(place)
    told = (*told, *_without_gravity(computed, place))
    timed = {"t": f"{clock.source}[{clock.unit or clock.likely}]"} if clock is not None else {}
    complete = {**given, **timed, **warm, **_mapping(chosen, readings.proposed(units), maker)}
    others = _left_out(found, several, stem)
    timeless = "t" in wanted and clock is None and not counted
    left_open = _Open(lacking, tuple(asked), tuple(several), timeless, others, readings.possible(units))
    if left_open:
        at = {group: each.columns[0] for group, each in chosen.items()} | ({"t": clock.column} if clock else {})
        raise _with_text(
            left_open.error(complete, at, bool(chosen) or _has_any(names, given), place), source, chosen, place
        )
    second = {group: candidates[0] for group, candidates in others.items()}
    if second:
        theirs = _Readings.of(source, clock, {**chosen, **second}, given, place)
        told = (*told, _instead(others, _mapping(second, theirs.proposed(theirs.units()), maker), mapping, place))
    notes = (*told, *_notes(place, maker, timed or counted, chosen, units, warm))
    return Recognised(complete, notes, tuple(column for each in computed for column in each.columns))


def _with_text(question: InputError, source: Readable, chosen: Mapping[str, _Candidate], place: Place) -> InputError:
    """Say before a question which cell of the sensors is not a number: an answer would only lead to that cell.

    The first block is looked at. Who brings a file of gigabytes is asked at once.
    """
    wanted = [name for name in source.names if any(name in each.columns for each in chosen.values())]
    blocks = islice(source.scan(wanted), 1)
    faults = (text_for_number({name: block[name] for name in wanted}, start, place) for start, _, block in blocks)
    fault = next(faults, None)
    if fault is None:
        return question
    problem = f"{fault.problem}; {question.where}: {question.problem}"
    remedy = f"{fault.remedy} " + (question.advice or Remedy.of(""))
    return place.error(problem, row=fault.row, column=fault.column, remedy=remedy)


def _without_gravity(computed: Sequence[_Candidate], place: Place) -> Iterator[str]:
    """Note what was not taken for the accelerometer."""
    for each in computed:
        yield (
            f"{place.name}: {' '.join(each.columns)} not taken for the accelerometer: at rest hardly anything is left "
            "of gravity, so that it was taken off"
        )


def _left_out(found: Mapping[str, list[_Candidate]], several: Sequence[str], stem: str) -> dict[str, list[_Candidate]]:
    """Candidates beside the first that are as likely as it, or that stand in another table, whose rows are not read."""
    left = {
        group: [
            each
            for each in others
            if group in several or _table(each.columns[0], stem) != _table(first.columns[0], stem)
        ]
        for group, (first, *others) in found.items()
    }
    return {group: candidates for group, candidates in left.items() if candidates}


def _also(others: Mapping[str, Sequence[_Candidate]]) -> str:
    """Say which columns are left out that may be a sensor as well as those that are taken."""
    columns = [each for candidates in others.values() for each in candidates]
    more = f" and {len(columns) - _SHOWN} more" if len(columns) > _SHOWN else ""
    return f"{_shown(columns[:_SHOWN])}{more} are left out, which may be {_named(list(others))} too"


def _instead(
    others: Mapping[str, Sequence[_Candidate]], theirs: Mapping[str, str], given: Mapping[str, str] | None, place: Place
) -> str:
    """Note which columns are left out, and the mapping that takes the first of them for each sensor."""
    first = _shown(candidates[0] for candidates in others.values())
    return f"{place.name}: {_also(others)}; to take {first} instead, use {place.mapped({**(given or {}), **theirs})}"


def _shown(candidates: Iterable[_Candidate]) -> str:
    return ", ".join(" ".join(printable(column, NAME) for column in each.columns) for each in candidates)


def _ask_time_and_units(source: Readable, place: Place) -> None:
    """Ask for the time of a log together with the units that its sensors are in, where these are not a log's.

    Raises
    ------
    InputError
        The time is missing, and a sensor is unmistakably in another unit.
    """
    there = [group for group in SENSORS if all(column in source.names for column in GROUPS[group])]
    rows = _first_rows(source, [column for group in there for column in GROUPS[group]])
    sensors: dict[str, Array | None] = {
        group: np.stack([rows[column] for column in GROUPS[group]], axis=1) for group in there
    }
    count = max((len(values) for values in rows.values()), default=0)
    units: dict[str, str] = {}
    try:
        check_units(np.arange(count, dtype=np.float64) * _ROW_STEP, sensors, Metadata(), place, clock="stated")
    except OtherUnitError as other:
        units = other.units
    except InputError:
        return  # said once there is a time
    if units:
        mapping = {column: f"{column}[{unit}]" for column, unit in units.items()}
        groups = [group for group in SENSORS if units.keys() & set(GROUPS[group])]
        raise place.error(
            f"column t is missing, and {_named(groups)} is not in SI units",
            column="t",
            remedy=_remedy({"t": ROW_RATE, **mapping}, place),
        )


def _table(column: str, stem: str) -> str:
    """Table that a column stands in: of a single one it is the file."""
    return column.rpartition(".")[0] or stem


def _clocks(source: Readable, candidates: Sequence[_Candidate], maker: Maker | None) -> list[Clock]:
    """Columns that are the time; several where none is likelier."""
    if not candidates:
        return []
    named = [(each.columns[0], each.unit, each.strange) for each in candidates]
    ticks = maker.ticks if maker is not None else ()
    return clocks_of(named, _first_cells(source, [name for name, _, _ in named]), None, ticks)


def _counted(source: Readable, maker: Maker | None) -> dict[str, str]:
    """Time by the number of the sample, where the lines before the header state its rate."""
    rate = maker.rate_in(source.clues) if maker is not None else None
    if maker is None or rate is None:
        return {}
    by_row = {"t": f"row[{rate:g}Hz]"}
    if maker.counter not in source.names:
        return by_row
    counts = counted_on(_first_rows(source, [maker.counter]).get(maker.counter, np.empty(0)))
    one_by_one = counts.size > 1 and float(np.median(np.diff(counts))) == 1.0
    return {"t": f"{maker.counter}[{rate:g}Hz]"} if one_by_one else by_row


def _with_gravity(
    source: Readable, found: Mapping[str, list[_Candidate]]
) -> tuple[dict[str, list[_Candidate]], list[_Candidate]]:
    """Candidates without those that are said to be an accelerometer but have no gravity at rest; and these."""
    computed = []
    for each in found.get("acc", []):
        if each.unit is None:
            continue
        rows = _first_rows(source, each.columns)
        acc = np.stack([rows[column] for column in each.columns], axis=1) * conversion("acc_x", each.unit).factor
        if acc.size and not units_of_force(acc) and without_gravity(acc, STANDARD_GRAVITY):
            computed.append(each)
    kept = {group: [each for each in candidates if each not in computed] for group, candidates in found.items()}
    return {group: candidates for group, candidates in kept.items() if candidates}, computed


def _angles(source: Readable, names: Sequence[str], given: Mapping[str, str]) -> dict[str, str]:
    """Find a reference attitude in angles, and whether they are in degrees: what turns by more than a turn is."""
    if _has("ref_q", names, given) or any(target in given for target in EULER):
        return {}
    found: dict[str, tuple[str, str]] = {}
    for name in names:
        words = words_of(name)
        for target in EULER:
            if {"ref", "reference"} & set(words.words) and target[4:] in words.words:
                unit = next((unit for unit in ("deg", "rad") if unit in (words.bracket, *words.words)), "")
                found[target] = name, unit
    if set(found) != set(EULER):
        return {}
    unit = next((unit for _, unit in found.values() if unit), "")
    if not unit:
        rows = _first_rows(source, [name for name, _ in found.values()])
        largest = max((float(np.nan_to_num(np.abs(values)).max(initial=0.0)) for values in rows.values()), default=0.0)
        unit = "deg" if largest > WHOLE_TURN else "rad"
    return {target: f"{name}[{unit}]" for target, (name, _) in found.items()}


def _temperature(source: Readable, parsed: Sequence[Words], given: Mapping[str, str]) -> dict[str, str]:
    """Find the one column that is a temperature in a stated unit; else the one that reads as degC."""
    if _has("temp", source.names, given):
        return {}
    stated, plain = [], []
    for words in parsed:
        rest = tuple(word for word in words.words if word not in ("temp", "temperature", "temperatur"))
        if len(rest) == len(words.words):
            continue
        unit, rest = unit_of("temp", rest, words.bracket)
        if unit is not None:
            stated.append(f"{words.column}[{unit}]")
        elif not (words.bracket or words.axis or strange(rest)):
            plain.append(words.column)
    if stated or len(plain) != 1:
        return {"temp": stated[0]} if len(stated) == 1 else {}
    readings = _first_rows(source, plain)[plain[0]]
    usual = float(np.median(readings[np.isfinite(readings)])) if np.isfinite(readings).any() else np.nan
    return {"temp": f"{plain[0]}[degC]"} if _TEMPERATURES[0] <= usual < _TEMPERATURES[1] else {}


def _remedy(mapping: Mapping[str, str], place: Place) -> Remedy:
    """Word the one mapping of a file."""
    return "If this is right, use " + place.mapped(mapping)


def _without_names(source: Readable, place: Place) -> InputError:
    """Ask about a table without a header, with what its numbers look like."""
    names = source.names
    rows = _first_rows(source, names)
    complete, free = {"t": ROW_RATE}, list(names)
    first = counted_on(rows.get(names[0], np.empty(0)))
    if first.size > 1 and np.all(np.diff(first) > 0.0):
        complete["t"] = f"{names[0]}[{time_unit(first) or 's'}]"
        free = free[1:]
    triples = [tuple(free[k : k + 3]) for k in range(0, len(free) - 2, 3)]
    fitting = [acc_unit(np.stack([rows[name] for name in triple], axis=1)) for triple in triples] if rows else []
    if any(fitting):
        k = next(k for k, unit in enumerate(fitting) if unit)
        unit = fitting[k] or ""
        others = [triple for i, triple in enumerate(triples) if i != k]
        named = [("acc", triples[k], unit), *(("gyr", triple, _LIKELY_GYR.get(unit, COUNTS)) for triple in others[:1])]
        for group, triple, each in named:
            complete |= {target: f"{name}[{each}]" for target, name in zip(GROUPS[group], triple, strict=True)}
    return place.error(
        f"the columns {names[0]} to {names[-1]} have no names", column=names[0], remedy=_remedy(complete, place)
    )


def _found(
    wanted: Sequence[str], parsed: Sequence[Words], maker: Maker | None, stem: str
) -> dict[str, list[_Candidate]]:
    """Columns that may be each of the groups, without the groups that have none."""
    found = {group: _candidates(group, parsed, maker, stem) for group in wanted}
    return {group: candidates for group, candidates in found.items() if candidates}


def _lacking(absent: Sequence[str], parsed: Sequence[Words]) -> dict[str, dict[str, str]]:
    """Find the sensors that have columns for some of their axes alone, and the column of each of these axes."""
    found: dict[str, dict[str, str]] = {}
    for words in parsed:
        target = meant(words.column)
        group = next((each for each in absent if each in SENSORS and target in GROUPS[each]), None)
        if group is not None and target is not None:
            found.setdefault(group, {})[target[-1]] = words.column
    return {group: there for group, there in found.items() if set(there) != set("xyz")}


@dataclass(frozen=True)
class _Open:
    """Everything about a file that has to be asked.

    Parameters
    ----------
    lacking : dict
        Columns of the sensors that lack an axis, by their axes.
    asked : tuple of str
        Groups whose unit is open.
    several : tuple of str
        Groups that several columns may be.
    timeless : bool
        Whether the time is missing.
    others : dict
        Other candidates for each group, which the proposed mapping leaves out.
    rates : tuple of str
        Units that the gyroscope may be in where that is open, the proposed one first.
    """

    lacking: dict[str, dict[str, str]]
    asked: tuple[str, ...]
    several: tuple[str, ...]
    timeless: bool
    others: dict[str, list[_Candidate]]
    rates: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.lacking) or self._mappable

    @property
    def _mappable(self) -> bool:
        """Whether a mapping can answer a part of it."""
        return bool(self.asked or self.several or self.timeless)

    def error(self, complete: Mapping[str, str], at: Mapping[str, str], sound: bool, place: Place) -> InputError:
        """Ask all of it at once, first for the missing columns.

        Parameters
        ----------
        complete : mapping
            The one mapping for the whole file.
        at : mapping
            Column to be named for each group.
        sound : bool
            Whether the file has a sensor with all of its axes.
        place : Place
            To name the file.
        """
        mapping = {**({"t": ROW_RATE} if self.timeless else {}), **complete} if self._mappable else {}
        if self.lacking:
            column = next(iter(next(iter(self.lacking.values())).values()))
            remedy = self._without(mapping, place) if sound else "Add the missing columns."
        else:
            column = "t" if self.timeless else at[(self.asked or self.several)[0]]
            remedy = replace(_remedy(mapping, place), options=self._options(mapping))
        more = []
        if mapping and len(self.rates) > 1:
            units = " or ".join(f"[{unit}]" for unit in self.rates[1:])
            more.append(f"If the gyroscope is in another unit, write {units} behind its columns.")
        if mapping and self.others:
            more.append(f"So {_also(self.others)}: to take them instead, write them in the mapping.")
        if more:
            remedy = Remedy.of(remedy) + f"{' ' if self.lacking else '. '}{' '.join(more)}"
        return place.error(self._question(), column=column, remedy=remedy)

    def _options(self, mapping: Mapping[str, str]) -> tuple[Option, ...]:
        """List the answers to what is asked: one for each unit that the gyroscope may be in, of its columns alone."""
        groups = [*self.asked, *self.several, *(["t"] if self.timeless else [])]
        wanted = {column for group in groups for column in GROUPS.get(group, (group,))}
        asked = {target: source for target, source in mapping.items() if target in wanted}
        return tuple(
            (
                "mapping",
                {
                    target: source.replace(f"[{self.rates[0]}]", f"[{unit}]") if target in GROUPS["gyr"] else source
                    for target, source in asked.items()
                },
            )
            for unit in self.rates
        ) or (("mapping", asked),)

    def _without(self, mapping: Mapping[str, str], place: Place) -> Remedy:
        """Say how the file is read without the sensors that lack an axis."""
        dropped = option("drop", ",".join(self.lacking))
        how = dropped + Remedy(", ", " ") + mapped(mapping) if mapping else dropped
        return "Add the missing columns, or leave the others of that sensor out with " + reading(place.file, how) + "."

    def _question(self) -> str:
        parts = [
            f"the {SENSOR_NAMES[group]} lacks a column for {' and '.join(axis for axis in 'xyz' if axis not in there)}"
            f" although {' and '.join(there.values())} {'is' if len(there) == 1 else 'are'} there"
            for group, there in self.lacking.items()
        ]
        parts += ["column t is missing"] if self.timeless else []
        if self.asked:
            parts.append(f"the file does not state the unit of {_named(self.asked)}, and the readings do not show it")
        if self.several:
            parts.append(f"several columns may be {_named(self.several)}")
        return "; ".join(parts)


def _has(group: str, names: Sequence[str], given: Mapping[str, str]) -> bool:
    columns = GROUPS.get(group, (group,))
    return any(column in names or column in given for column in columns)


def _has_any(names: Sequence[str], given: Mapping[str, str]) -> bool:
    return any(_has(group, names, given) for group in (*SENSORS, "ref_q", "ref_angle"))


def _parsed(name: str, names: Sequence[str]) -> Words:
    """Take a name apart; of three columns without names behind a time the axes follow from the table's name."""
    found = _NUMBERED.fullmatch(name)
    if found and found["table"] and 2 <= int(found["number"]) <= 4 and f"{found['table']}.c4" in names:
        return words_of(name, {name: "xyz"[int(found["number"]) - 2]})
    return words_of(name)


def _candidates(group: str, parsed: Sequence[Words], maker: Maker | None, stem: str) -> list[_Candidate]:
    """Columns that may be the group, the likeliest first."""

    def fixed(column: str) -> str | None:
        return maker.unit(group, _table(column, stem)) if maker is not None else None

    made: list[_Candidate] = []
    if group == "t":
        made += [_Candidate((column,), unit or fixed(column), odd) for column, unit, odd in time_columns(parsed)]
    else:
        triples: dict[tuple[str, ...], dict[str, Words]] = {}
        for words in parsed:
            if words.axis:
                triples.setdefault(words.triple, {})[words.axis] = words
        for axes in triples.values():
            if set(axes) != set("xyz"):
                continue
            known = maker.sensor(axes["x"].column) if maker is not None else None
            named = sensor_of(axes["x"].words) if known is None else (known, ())
            if named is not None and named[0] == group:
                unit, rest = unit_of(group, named[1], axes["x"].bracket)
                if unit is None and _measures_something_else(group, axes["x"].bracket):
                    continue
                own = unit is None and axes["x"].bracket != "" and lookup(axes["x"].bracket) is None
                own |= maker is not None and group in maker.arbitrary
                columns = tuple(axes[axis].column for axis in "xyz")
                made.append(_Candidate(columns, unit or fixed(columns[0]), strange(rest), own))
    return sorted(made, key=lambda each: (each.strange, each.unit is None))


def _measures_something_else(group: str, bracket: str) -> bool:
    """Whether the unit in brackets is one of another quantity; a rate may be named by its angle."""
    known = lookup(bracket) if bracket else None
    return known is not None and not (group == "gyr" and known[0] == "angle")


def _alike(candidates: Sequence[_Candidate]) -> bool:
    """Whether the second candidate is as likely as the first."""
    first, second = candidates[:2]
    return (first.strange, first.unit is None) == (second.strange, second.unit is None)


@dataclass(frozen=True)
class _Readings:
    """The first rows of what was found, as they stand in the file."""

    chosen: Mapping[str, _Candidate]
    rows: Mapping[str, Array]
    own: Mapping[str, PlannedColumn] = field(default_factory=dict)
    t: Array | None = None

    @classmethod
    def of(
        cls,
        source: Readable,
        clock: Clock | None,
        chosen: Mapping[str, _Candidate],
        given: Mapping[str, str],
        place: Place,
    ) -> _Readings:
        """Read them and the columns that are known already, where a unit has to be found in them.

        Raises
        ------
        InputError
            The rows are closer together than any such sensor samples: the time is asked about before the units.
        """
        if all(each.unit is not None for each in chosen.values()):
            return cls(chosen, {})
        columns = [column for each in chosen.values() for column in each.columns]
        own = _known(source.names, given, place)
        own_clock = clock.columns if clock is not None else ()
        cells = _first_cells(source, [*columns, *own_clock, *(name for each in own.values() for name in each.names)])
        rows = {column: _numbers(values) for column, values in cells.items()}
        time = clock.times(cells) if clock is not None else _times(own.get("t"), cells)
        if time is None:
            return cls(chosen, rows, own)
        turns = "gyr" in chosen or GROUPS["gyr"][0] in own
        if clock is None:
            check_rate(time, abs(own["t"].conversion.factor), own["t"].origin, place, turns)
        elif clock.unit is not None:
            tick = 1.0 if clock.unit in ORDERS else conversion("t", clock.unit).factor
            check_rate(time, tick, clock.source, place, turns)
        known = np.isfinite(time)
        return cls(chosen, {name: values[known] for name, values in rows.items()}, own, time[known])

    def check_clock(self, place: Place) -> None:
        """Refuse a time given by the user whose steps are so long that no turning shows the gyroscope's unit."""
        if self.t is not None and "t" in self.own:
            column = self.own["t"]
            check_steps(self.t, abs(column.conversion.factor), column.origin, place, stated=True)

    def _stacked(self, group: str) -> Array | None:
        """Stack the readings of a sensor: as they stand in the file, or in SI where their unit is known already."""
        if group in self.chosen:
            return np.stack([self.rows[column] for column in self.chosen[group].columns], axis=1)
        known = [self.own[column] for column in GROUPS[group] if column in self.own]
        if len(known) < len(GROUPS[group]) or any(each.name is None for each in known):
            return None
        return np.stack([each.conversion.apply(self.rows[each.name]) for each in known if each.name], axis=1)

    def units(self) -> dict[str, str | None]:
        """Find the unit of each group: as its names state, else as the readings show."""
        units = {group: each.unit for group, each in self.chosen.items()}
        if not self.rows:
            return units
        t = self.t
        acc, gyr, mag = (self._stacked(group) for group in SENSORS)
        if "acc" in units and units["acc"] is None and acc is not None:
            units["acc"] = acc_unit(acc)
        if "gyr" in units and units["gyr"] is None and gyr is not None and t is not None:
            fields = [(_filled(t, each), each is mag) for each in (acc, mag) if each is not None]
            units["gyr"] = gyr_unit(t, gyr, fields, self._stacked("ref_q"))
        if "mag" in units and units["mag"] is None and mag is not None and not self.chosen["mag"].arbitrary:
            rate = units.get("gyr", "rad/s")
            moves = t is not None and gyr is not None and rate is not None
            units["mag"] = mag_unit(mag, moves and turned(t, gyr * conversion("gyr_x", rate).factor))  # type: ignore
        return units

    def proposed(self, units: Mapping[str, str | None]) -> dict[str, str]:
        """Propose a unit for each group: the one that was found, or the likeliest where nothing shows it."""
        return {group: unit or self.likely(group, units) for group, unit in units.items()}

    def possible(self, units: Mapping[str, str | None]) -> tuple[str, ...]:
        """List the units that a gyroscope may be in whose unit nothing shows, the proposed one first; else none."""
        rates = self._stacked("gyr") if "gyr" in units and units["gyr"] is None else None
        if rates is None:
            return ()
        first = self.likely("gyr", units)
        if "LSB" in first:
            alike = [unit for _, _, unit in GYR_UNITS if "LSB" in unit]
        else:
            # A rate that no sensor reaches in rad/s shows that it is in a smaller unit.
            alike = ["deg/s"] if rate_unit_by_size(rates)[1] is not None else ["rad/s", "deg/s"]
        return tuple(dict.fromkeys([first, *alike]))

    def likely(self, group: str, units: Mapping[str, str | None]) -> str:
        """Propose a unit where nothing shows it."""
        if group == "gyr":
            rates = self._stacked("gyr") if units.get("acc") is None and self.rows else None
            by_size = None if rates is None else rate_unit_by_size(rates)[1]
            return by_size[2] if by_size is not None else _LIKELY_GYR.get(units.get("acc") or "m/s^2", COUNTS)
        if group == "mag":
            field = self._stacked("mag")
            size = np.empty(0) if field is None else np.linalg.norm(field, axis=1)
            size = size[np.isfinite(size) & (size > 0.0)]
            return f"*{_USUAL_FIELD / float(np.median(size)):.3g}" if size.size else "uT"
        acc = self._stacked("acc")
        return "g" if acc is None else likely_acc_unit(acc)


def _known(names: Sequence[str], given: Mapping[str, str], place: Place) -> dict[str, PlannedColumn]:
    """Find the time, the sensors and the reference that a mapping names, or that bear a log's own names."""
    wanted = {"t", *(column for group in (*SENSORS, "ref_q") for column in GROUPS[group])}
    known = {name: PlannedColumn(name, name, Conversion()) for name in names if name in wanted}
    for target in wanted & given.keys():
        try:
            known[target] = resolve(target, given[target], names, place)
        except InputError:
            known.pop(target, None)  # said once all columns are planned
    return known


def _times(column: PlannedColumn | None, cells: Mapping[str, NDArray[Any]]) -> Array | None:
    """Read the times of the first rows by a column that is known to be the time, s; None without it."""
    if column is None:
        return None
    if not isinstance(column.source, str):
        return column.conversion.apply(column.source.numbers(0, max(map(len, cells.values()), default=0)))
    clock = Clock(column.source, column.order or None, "s", column.day, np.empty(0))
    return column.conversion.apply(clock.times(cells))


def _first_cells(source: Readable, columns: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Columns of the first rows as they stand in the file; a column with text is text throughout."""
    wanted = list(dict.fromkeys(columns))
    pieces: dict[str, list[NDArray[Any]]] = {column: [] for column in wanted}
    count = 0
    for _, rows, block in source.scan(wanted):
        for column in wanted:
            pieces[column].append(block[column])
        count += rows
        if count >= HEAD:
            break
    return {column: np.concatenate(parts)[:HEAD] if parts else np.empty(0) for column, parts in pieces.items()}


def _first_rows(source: Readable, columns: Sequence[str]) -> dict[str, Array]:
    """Columns of the first rows as numbers."""
    return {column: _numbers(cells) for column, cells in _first_cells(source, columns).items()}


def _numbers(cells: NDArray[Any]) -> Array:
    """Cells as numbers; the squares of readings and their sums have room in a float64."""
    values = seconds_from_cells(cells) if cells.dtype == object else cells
    return np.where(np.abs(values) <= LARGEST_COVARIATE, values, np.nan)


def _filled(t: Array, values: Array) -> Array:
    """Fill the rows without a sample on a straight line between their neighbours."""
    known = np.isfinite(values).all(axis=1) & np.isfinite(t)
    if known.sum() < 2 or known.all():
        return values
    return np.stack([np.interp(t, t[known], values[known, k]) for k in range(values.shape[1])], axis=1)


def _mapping(chosen: Mapping[str, _Candidate], units: Mapping[str, str | None], maker: Maker | None) -> dict[str, str]:
    opposite = maker.opposite if maker is not None else {}
    turned_over = {group for group, unit in opposite.items() if units.get(group) == unit}
    return {
        target: f"{'-' if group in turned_over else ''}{column}[{units[group]}]"
        for group, each in chosen.items()
        for target, column in zip(GROUPS.get(group, (group,)), each.columns, strict=True)
    }


def _named(groups: Sequence[str]) -> str:
    return " and ".join("the time" if group == "t" else f"the {SENSOR_NAMES[group]}" for group in groups)


def _notes(
    place: Place,
    maker: Maker | None,
    timed: Mapping[str, str],
    chosen: Mapping[str, _Candidate],
    units: Mapping[str, str | None],
    warm: Mapping[str, str],
) -> tuple[str, ...]:
    parts = [f"t from {_source(text)}" for text in timed.values()]
    parts += [f"{group} from {_quoted(each.columns)} in {units[group]}" for group, each in chosen.items()]
    parts += [f"temp from {_source(text)}" for text in warm.values()]
    taken = ", ".join(parts)
    if not taken:
        return ()
    layout = f"taken for {maker.name}: " if maker is not None else "taken "
    return (f"{place.name}: {layout}{taken}",)


def _source(text: str) -> str:
    """Word a source with its unit behind it; a rate in hertz counts rows."""
    name, unit = bracket(text)
    return f"{'the row number' if name == ROW else _quoted([name])} {'at' if unit.endswith('Hz') else 'in'} {unit}"


def _quoted(columns: Iterable[str]) -> str:
    """Quote names of columns: they may hold blanks and units, and the quotes show where each one ends."""
    return " ".join(f"'{column}'" for column in columns)
