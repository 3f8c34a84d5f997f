"""Which columns of a foreign file are the time and the sensors, by their names, their maker and their values."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from imufit.log.clock_text import seconds_from_cells
from imufit.log.columns import CONTRACT, GROUPS, SENSOR_NAMES, SENSORS
from imufit.log.makers import Maker, maker_of
from imufit.log.place import Place
from imufit.log.unit_by_data import acc_unit, gyr_unit, mag_unit, time_unit
from imufit.log.unit_check import HEAD
from imufit.log.units import conversion
from imufit.log.words import Words, names_time, sensor_of, strange, unit_of, words_of

Array = NDArray[np.float64]

_LIKELY_GYR: Final = {"m/s^2": "rad/s", "g": "deg/s", "mg": "mdps"}
"""Unit in which a maker who gives the accelerometer in the former usually gives the gyroscope; else counts."""
_NUMBERED: Final = re.compile(r"(?:(?P<table>.*)\.)?c(?P<number>\d+)")
"""Name of a column of a table without a header."""


class Readable(Protocol):
    """The part of a source that recognising needs."""

    @property
    def names(self) -> tuple[str, ...]:
        """Columns of the file."""
        ...

    def scan(self, columns: Sequence[str]) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """First pass over the file, with the named columns only."""
        ...


@dataclass(frozen=True)
class Recognised:
    """What a file was taken for.

    Parameters
    ----------
    mapping : dict
        Source text for target columns, the user's own included.
    notes : tuple of str
        What the file was taken for.
    """

    mapping: dict[str, str]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Candidate:
    """Columns that may be one sensor, or the time."""

    columns: tuple[str, ...]
    unit: str | None
    strange: int


def recognise(source: Readable, mapping: Mapping[str, str] | None, place: Place) -> Recognised:
    """Find the time and the sensors that neither the file's names nor the user's mapping already give.

    Parameters
    ----------
    source : Readable
        The file.
    mapping : mapping, optional
        The user's own mapping, which stands above what is found.
    place : Place
        To name the file in errors.

    Raises
    ------
    InputError
        Sensors are there, but the unit of one is neither stated nor shown by the readings, or two columns may be the
        same sensor: all of it is asked in one sentence, with one mapping for the whole file.
    """
    names, given = source.names, dict(mapping or {})
    taken = {text for text in given.values()}
    wanted = [group for group in ("t", *SENSORS) if not _has(group, names, given)]
    maker = maker_of(names)
    parsed = [_parsed(name, names) for name in names if name not in CONTRACT and name not in taken]
    if maker is not None:
        parsed = [words for words in parsed if not re.search(maker.left_out, words.column)]
    found = {group: _candidates(group, parsed, maker) for group in wanted}
    found = {group: candidates for group, candidates in found.items() if candidates}
    if not any(group in found for group in SENSORS) and not ("t" in found and _has_any(names, given)):
        return Recognised(given)
    chosen = {group: candidates[0] for group, candidates in found.items()}
    several = [group for group, candidates in found.items() if len(candidates) > 1 and _alike(candidates)]
    units = _units(source, chosen, names, given)
    asked = [group for group in chosen if units[group] is None]
    complete = {**_mapping(chosen, {g: units[g] or _likely(g, units) for g in chosen}), **given}
    if given and (asked or several):
        chosen = {group: each for group, each in chosen.items() if group not in (*asked, *several)}
        return Recognised({**_mapping(chosen, units), **given}, _notes(place, maker, chosen, units))
    if asked or several:
        raise place.error(
            _question(asked, several, chosen),
            column=chosen[(asked or several)[0]].columns[0],
            remedy=f"If this is right: --map {shlex.quote(','.join(f'{k}={v}' for k, v in complete.items()))}",
        )
    return Recognised(complete, _notes(place, maker, chosen, units))


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


def _candidates(group: str, parsed: Sequence[Words], maker: Maker | None) -> list[_Candidate]:
    """Columns that may be the group, the likeliest first."""
    fixed = maker.units.get(group) if maker is not None else None
    made: list[_Candidate] = []
    if group == "t":
        for words in parsed:
            if not words.axis and names_time(words.words):
                unit, rest = unit_of("t", words.words, words.bracket)
                made.append(_Candidate((words.column,), unit or fixed, strange(rest)))
    else:
        triples: dict[tuple[str, ...], dict[str, Words]] = {}
        for words in parsed:
            if words.axis:
                triples.setdefault(words.triple, {})[words.axis] = words
        for axes in triples.values():
            named = sensor_of(axes["x"].words) if set(axes) == set("xyz") else None
            if named is not None and named[0] == group:
                unit, rest = unit_of(group, named[1], axes["x"].bracket)
                made.append(_Candidate(tuple(axes[axis].column for axis in "xyz"), unit or fixed, strange(rest)))
    return sorted(made, key=lambda each: (each.strange, each.unit is None))


def _alike(candidates: Sequence[_Candidate]) -> bool:
    """Whether the second candidate is as likely as the first."""
    first, second = candidates[:2]
    return (first.strange, first.unit is None) == (second.strange, second.unit is None)


def _units(
    source: Readable, chosen: Mapping[str, _Candidate], names: Sequence[str], given: Mapping[str, str]
) -> dict[str, str | None]:
    """Unit of each group: as its names state, else as the first rows show."""
    units = {group: each.unit for group, each in chosen.items()}
    if None not in units.values():
        return units
    columns = [column for each in chosen.values() for column in each.columns]
    beside = [column for column in ("t", *GROUPS["acc"], *GROUPS["ref_q"]) if column in names and column not in given]
    rows = _first_rows(source, [*columns, *beside])

    def stacked(group: str) -> Array | None:
        wanted = chosen[group].columns if group in chosen else GROUPS[group]
        return np.stack([rows[column] for column in wanted], axis=1) if all(c in rows for c in wanted) else None

    raw_t = rows.get(chosen["t"].columns[0] if "t" in chosen else "t")
    if raw_t is not None and "t" in chosen and units["t"] is None:
        units["t"] = time_unit(raw_t)
    acc, gyr, mag = (stacked(group) for group in SENSORS)
    if "acc" in chosen and units["acc"] is None and acc is not None:
        units["acc"] = acc_unit(acc)
    if "mag" in chosen and units["mag"] is None and mag is not None:
        units["mag"] = mag_unit(mag)
    t = None if raw_t is None else raw_t * conversion("t", (units["t"] if "t" in chosen else None) or "s").factor
    if "gyr" in chosen and units["gyr"] is None and gyr is not None and t is not None:
        units["gyr"] = gyr_unit(t, gyr, [each for each in (acc, mag) if each is not None], stacked("ref_q"))
    return units


def _first_rows(source: Readable, columns: Sequence[str]) -> dict[str, Array]:
    """Columns of the first rows, as numbers; without those that hold text."""
    pieces: dict[str, list[Array]] = {column: [] for column in columns}
    count = 0
    for _, rows, block in source.scan(list(dict.fromkeys(columns))):
        for column in columns:
            cells = block[column]
            pieces[column].append(seconds_from_cells(cells) if cells.dtype == object else cells)
        count += rows
        if count >= HEAD:
            break
    return {column: np.concatenate(parts)[:HEAD] for column, parts in pieces.items() if parts}


def _likely(group: str, units: Mapping[str, str | None]) -> str:
    """Unit that is proposed where nothing shows it."""
    if group == "gyr":
        return _LIKELY_GYR.get(units.get("acc") or "m/s^2", "131 LSB/(deg/s)")
    return {"t": "ms", "acc": "g", "mag": "uT"}[group]


def _mapping(chosen: Mapping[str, _Candidate], units: Mapping[str, str | None]) -> dict[str, str]:
    return {
        target: f"{column}[{units[group]}]"
        for group, each in chosen.items()
        for target, column in zip(GROUPS.get(group, (group,)), each.columns, strict=True)
    }


def _question(asked: Sequence[str], several: Sequence[str], chosen: Mapping[str, _Candidate]) -> str:
    parts = []
    if asked:
        which = " and ".join("the time" if group == "t" else f"the {SENSOR_NAMES[group]}" for group in asked)
        parts.append(f"the file does not state the unit of {which}, and the readings do not show it")
    if several:
        which = " and ".join("the time" if group == "t" else f"the {SENSOR_NAMES[group]}" for group in several)
        parts.append(f"several columns may be {which}")
    return "; ".join(parts)


def _notes(
    place: Place, maker: Maker | None, chosen: Mapping[str, _Candidate], units: Mapping[str, str | None]
) -> tuple[str, ...]:
    taken = ", ".join(f"{group} from {' '.join(each.columns)} in {units[group]}" for group, each in chosen.items())
    if not taken:
        return ()
    layout = f"taken for {maker.name}: " if maker is not None else "taken "
    return (f"{place.name}: {layout}{taken}",)
