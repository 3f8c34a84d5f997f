"""Lines that name their values, such as ``RAW 0x68: accel=(1, 2, 3) temp=21``: what stands in one such line."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Final

from imufit.log.check import is_truth, number_from_text
from imufit.log.units import lookup

LONGEST_LINE: Final = 4096
"""Characters of a line; a longer line is not a record but noise or a binary dump."""

_COLOUR: Final = re.compile(r"\x1b(?:\[[0-9;?]*[ -/]*[@-~]?|[@-Z\\-_])")
_NUMBER: Final = r"(?:[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?|(?i:nan|[-+]?inf|true|false)\b)"
# a unit may stick to a number; 0x70 is none with the unit x70
_UNIT: Final = r"(?:[A-WYZa-wyz°%µ][\w°%µ/^²]*)?(?![\w.:])"
_VALUE: Final = _NUMBER + _UNIT
_VALUES: Final = rf"{_VALUE}(?:(?:\s*[,;]\s*|[ \t]+){_VALUE})*"
_NAME: Final = r"(?<![\w.])(?P<name>[A-Za-z_][\w.]*)[\"']?(?:\s?(?P<unit>\([^()=:]{1,20}\)|\[[^\[\]=:]{1,20}\]))?"
_SIGN: Final = r"\s*(?::=|=|:)\s*"
_PLAIN: Final = re.compile(r"(?<![\w.])[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?")
_ITEM: Final = re.compile(rf"{_NAME}{_SIGN}(?:(?P<open>[(\[{{])\s*(?P<in>{_VALUES})\s*[)\]}}]|(?P<bare>{_VALUES}))")
_BEHIND: Final = re.compile(
    r"\s?(?P<unit>[^\s,;|=:()\[\]{}\d][^\s,;|=:()\[\]{}]{0,11})(?=\s*(?:[,;|)]|$)|\s+[A-Za-z_#])"
)
"""A possible unit behind the values, as in ``9.81 m/s^2,``."""
_MARK: Final = re.compile(rf"{_NAME}{_SIGN}")
_ONE: Final = re.compile(f"({_NUMBER})({_UNIT})")
_MEASURED: Final = ("time", "specific force", "angular rate", "magnetic flux density")
"""Quantities whose units behind a value count; a temperature or an angle has its usual one."""
_WORD_BEFORE: Final = re.compile(r"(?<!\w)([A-Za-z_]\w*)[\s:=(\[{\"']*$")
_LEAD: Final = re.compile(
    r"(?P<clock>(?:\d{4}-\d\d-\d\d[T ])?(?<!\d)\d{1,2}:\d\d:\d\d(?:[.,]\d+)?Z?)"
    r"|(?P<number>(?<![\w.])\d+(?:\.\d+)?(?![\w.]))"
)


@dataclass(frozen=True)
class Item:
    """One name with its values.

    Parameters
    ----------
    name : str
        Name; an axis letter alone has the word before it in front, as in ``Accel_X``.
    written : str
        The name as it stands in the line.
    unit : str
        Unit in brackets behind the name, with the brackets; so is one behind the values. Of three values with the names
        of the axes that behind the last one counts for all. Empty without.
    values : tuple of float
        One number, or those of a list.
    start, end : int
        Where name and values stand in the line.
    closed : bool
        Whether a bracket ends the values, so that a cut line cannot have shortened the last one.
    truth : str
        The first value that is true or false instead of a number, which it is read as; empty without.
    """

    name: str
    written: str
    unit: str
    values: tuple[float, ...]
    start: int
    end: int
    closed: bool
    truth: str = ""

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns: three values are x, y and z, any other list is numbered from 1."""
        width = len(self.values)
        ends = ("",) if width == 1 else ("_x", "_y", "_z") if width == 3 else tuple(f"_{k + 1}" for k in range(width))
        return tuple(f"{self.name}{end}" + (f" {self.unit}" if self.unit else "") for end in ends)


def without_colour(text: str) -> str:
    """Take terminal colour codes and zero bytes out of a line."""
    if "\x1b" in text:
        text = _COLOUR.sub("", text)
    return text.replace("\0", "")


def named_values(line: str) -> list[Item]:
    """Find the names with numbers in a line, in their order.

    Parameters
    ----------
    line : str
        A line without colour codes.
    """
    if len(line) > LONGEST_LINE or ("=" not in line and ":" not in line):
        return []
    items: list[Item] = []
    group, end = "", 0
    for found in _ITEM.finditer(line):
        text = found["in"] or found["bare"]
        name, unit = found["name"], found["unit"] or ""
        if unit[1:-1].isdigit():
            name, unit = f"{name}_{unit[1:-1]}", ""
        if name.lower() in ("x", "y", "z"):
            if name.lower() == "x":
                before = _WORD_BEFORE.search(line[end : found.start()])
                group = before[1] if before else ""
            name = f"{group}_{name}" if group else name
        else:
            group = ""
        unit = unit or _unit_behind(line, found, text)
        written = [one[1] for one in _ONE.finditer(text)]
        values = tuple(number_from_text(one, truth=True) for one in written)
        truth = next(filter(is_truth, written), "")
        closed = found["open"] is not None
        items.append(Item(name, found["name"], unit, values, found.start(), found.end(), closed, truth))
        end = found.end()
    return _with_axes(items)


def _unit_behind(line: str, found: re.Match[str], values: str) -> str:
    """Find the unit behind the values of a name, in brackets; empty where nothing there is a sensor's unit."""
    stuck = [word[2] for word in _ONE.finditer(values)]
    text = stuck[-1] if stuck and stuck[-1] else ""
    if not text and (behind := _BEHIND.match(line, found.end())) is not None:
        text = behind["unit"]
    known = lookup(text) if text else None
    return f"({text})" if known is not None and known[0] in _MEASURED else ""


def _with_axes(items: list[Item]) -> list[Item]:
    """Give the axes of one sensor the unit that stands behind the last of them alone."""
    given = list(items)
    for k in range(len(items) - 2):
        three = items[k : k + 3]
        stems = {item.name.rpartition("_")[0] for item in three}
        axes = "".join(item.name[-1:].lower() for item in three)
        if axes == "xyz" and len(stems) == 1 and three[2].unit and not three[0].unit and not three[1].unit:
            given[k] = replace(items[k], unit=three[2].unit)
            given[k + 1] = replace(items[k + 1], unit=three[2].unit)
    return given


def skeleton(text: str) -> tuple[str, list[str]]:
    """Take the plain numbers out of a text.

    Lines with one skeleton are read alike, which spares looking closely at each of them.

    Returns
    -------
    form : str
        The text with a zero byte for each number.
    numbers : list of str
        The numbers. Digits within words or behind a point are none.
    """
    return _PLAIN.sub("\0", text), _PLAIN.findall(text)


def names_in(line: str) -> list[tuple[str, int]]:
    """Find the names that something follows, number or not, and where each stands."""
    return [(found["name"], found.start()) for found in _MARK.finditer(line)] if len(line) <= LONGEST_LINE else []


def lead_of(text: str) -> tuple[str, tuple[tuple[str, float], ...]]:
    """Take what stands before the first name apart into words and numbers.

    Parameters
    ----------
    text : str
        Begin of a line, such as ``I (1234) imu:``.

    Returns
    -------
    words : str
        The text with ``#`` for each number, by which lines of one kind are recognised. Numbers within words, as in
        ``imu2`` or ``0x68``, stay: they separate sensors.
    numbers : tuple of (str, float)
        ``clock``, s (since midnight, or since 1970 with a date), and the other numbers as ``c1``, ``c2``, ...
    """
    numbers: list[tuple[str, float]] = []

    def replace(found: re.Match[str]) -> str:
        if found["clock"] is not None:
            numbers.append(("clock", _seconds(found["clock"])))
            return "{clock}"
        numbers.append((f"c{1 + sum(name != 'clock' for name, _ in numbers)}", float(found["number"])))
        return "#"

    words = _LEAD.sub(replace, text)
    return " ".join(words.split()), tuple(numbers)


def _seconds(clock: str) -> float:
    """Time of day, or since 1970 with a date, s; NaN where such a time is missing."""
    date, _, time = clock.rstrip("Z").replace(",", ".").replace("T", " ").rpartition(" ")
    hours, minutes, seconds = (float(part) for part in time.split(":"))
    if hours > 24.0 or minutes > 59.0 or seconds >= 61.0:
        return float("nan")
    try:
        day = datetime.fromisoformat(date).replace(tzinfo=UTC).timestamp() if date else 0.0
    except ValueError:
        return float("nan")
    return day + 3600.0 * hours + 60.0 * minutes + seconds


def is_table_line(line: str) -> bool:
    """Whether a line holds more numbers by themselves than numbers with a name, as the row of a table does."""
    items = named_values(line)
    rest, end = [], 0
    for item in items:
        rest.append(line[end : item.start])
        end = item.end
    rest.append(line[end:])
    alone = sum(_is_number(field.strip("\"'")) for field in re.split(r"[\s,;]+", " ".join(rest)))
    return alone > sum(len(item.values) for item in items)


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True
