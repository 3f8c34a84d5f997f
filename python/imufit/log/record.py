"""The record of a serial transcript: the kind of line that holds its data."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

from imufit.log.named_values import (
    LONGEST_LINE,
    Item,
    is_table_line,
    lead_of,
    named_values,
    names_in,
    skeleton,
)

_FORMS: Final = 100
_EXAMPLES: Final = 10_000
_NAN: Final = float("nan")
_OFTEN: Final = 0.5  # share of the records from which on another kind of line is worth a word

Shape = tuple[str, str, str, tuple[str, ...]]
"""Name, name as written, unit and columns of an item."""


@dataclass(frozen=True)
class Found:
    """The content of one line.

    Parameters
    ----------
    values : tuple of float
        One number for each column of the record, NaN where it is missing.
    missing : tuple of str
        Columns without a number although their line is a record.
    twice : bool
        Whether a name stands in the line more often than in a record: two lines that ran into one.
    more : tuple of str
        Names with values that are not part of the record.
    truths : dict of str to str
        Columns that say true or false, and which.
    """

    values: tuple[float, ...]
    missing: tuple[str, ...] = ()
    twice: bool = False
    more: tuple[str, ...] = ()
    truths: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Record:
    """Words before the first name, and the names with their numbers of values.

    Parameters
    ----------
    lead : str
        What stands before the first name, with ``#`` for numbers.
    lead_names : tuple of str
        Columns of those numbers.
    shapes : tuple
        Name, name as written, unit and columns of each item.
    others : tuple of (str, int)
        Other kinds of line that are nearly as frequent: their names, and how many lines there are.
    """

    lead: str
    lead_names: tuple[str, ...]
    shapes: tuple[Shape, ...]
    others: tuple[tuple[str, int], ...] = ()

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns; a repeated one is numbered."""
        names: list[str] = []
        for name in (*self.lead_names, *(column for shape in self.shapes for column in shape[3])):
            count = 1
            new = name
            while new in names:
                count += 1
                new = f"{name}_{count}"
            names.append(new)
        return tuple(names)

    @property
    def words(self) -> str:
        """Names of the items, for messages."""
        return ", ".join(shape[0] for shape in self.shapes)

    def find(self, line: str, *, first: bool) -> Found | str | None:
        """Look for the record in a line.

        Parameters
        ----------
        line : str
            A line without colour codes.
        first : bool
            Whether it is the first line of the file, which may lack its begin.

        Returns
        -------
        Found, str or None
            The values; or the lead of a line that holds such values after other words; or nothing.
        """
        begin = self._begin.search(line)
        form, plain = skeleton(line[begin.start() :]) if begin else ("", [])
        if begin and form in self._forms and len(line) <= LONGEST_LINE:
            lead, numbers = lead_of(line[: begin.start()])
            if lead == self.lead:
                return Found((*(value for _, value in numbers), *map(float, plain)))
        items = named_values(line)
        if items:
            lead, numbers = lead_of(line[: items[0].start])
            if lead == self.lead and tuple(_shape(item) for item in items) == self.shapes:
                values = tuple(value for item in items for value in item.values)
                # only where the plain numbers are the values, in that order, and nothing else is
                if begin and begin.start() == items[0].start and values == tuple(map(float, plain)):
                    self._remember(form)
                truths = self._truths(dict(enumerate(items)))
                return Found((*(value for _, value in numbers), *values), truths=truths)
        return self._incomplete(line, items, first=first)

    @cached_property
    def _begin(self) -> re.Pattern[str]:
        return re.compile(rf"(?<![\w.]){re.escape(self.shapes[0][1])}(?!\w)")

    @cached_property
    def _forms(self) -> set[str]:
        return set()

    def _remember(self, form: str) -> None:
        """Keep the skeleton of a complete record, for a few that vary."""
        if len(self._forms) < _FORMS:
            self._forms.add(form)

    @cached_property
    def _written(self) -> Counter[str]:
        return Counter(shape[1] for shape in self.shapes)

    def _incomplete(self, line: str, items: Sequence[Item], *, first: bool) -> Found | str | None:
        """Look for a record with values missing, or with more than its values."""
        there = [(name, start) for name, start in names_in(line) if name in self._written]
        if not there:
            return None
        lead, numbers = lead_of(line[: there[0][1]])
        matched = self._match(items)
        begins = lead == self.lead
        if not begins and not (first and self._is_end(matched)):
            return lead if 2 * len(matched) >= len(self.shapes) else None
        values = [value for _, value in numbers] if begins else [_NAN] * len(self.lead_names)
        used = [id(item) for item in matched.values()]
        # the end of the last value is uncertain; any other that ends its line is the end of what was cut off
        last = len(self.shapes) - 1
        matched = {place: item for place, item in matched.items() if place == last or not _may_be_cut(item, line)}
        for place, shape in enumerate(self.shapes):
            values += matched[place].values if place in matched else [_NAN] * len(shape[3])
        known = {shape[0] for shape in self.shapes}
        counts = Counter(name for name, _ in there)
        return Found(
            tuple(values),
            missing=self._columns_but(matched, begins),
            twice=any(counts[name] > times for name, times in self._written.items()),
            more=tuple(item.name for item in items if id(item) not in used and item.name not in known),
            truths=self._truths(matched),
        )

    def _truths(self, matched: Mapping[int, Item]) -> dict[str, str]:
        """Columns of the places whose values are true or false, and which."""
        said = [""] * len(self.lead_names)
        for place, shape in enumerate(self.shapes):
            said += [matched[place].truth if place in matched else ""] * len(shape[3])
        return {column: text for column, text in zip(self.columns, said, strict=True) if text}

    def _columns_but(self, matched: Mapping[int, Item], begins: bool) -> tuple[str, ...]:
        """Columns of the places that are not matched."""
        there = [begins] * len(self.lead_names)
        for place, shape in enumerate(self.shapes):
            there += [place in matched] * len(shape[3])
        return tuple(column for column, is_there in zip(self.columns, there, strict=True) if not is_there)

    def _match(self, items: Sequence[Item]) -> dict[int, Item]:
        """Item of the line for each place of the record, as far as there is one of the same name and width."""
        matched: dict[int, Item] = {}
        free = list(items)
        for place, shape in enumerate(self.shapes):
            item = next((item for item in free if _shape(item) == shape), None)
            if item is not None:
                matched[place] = item
                free.remove(item)
        return matched

    def _is_end(self, matched: Mapping[int, Item]) -> bool:
        """Whether the places that are there are the last ones of the record, and not all."""
        places = range(len(self.shapes) - len(matched), len(self.shapes))
        return 0 < len(matched) < len(self.shapes) and sorted(matched) == list(places)


def _may_be_cut(item: Item, line: str) -> bool:
    """Whether a number without bracket ends the line, so that its last digits may be lost."""
    return not item.closed and item.end == len(line.rstrip())


def find_record(lines: Iterable[str]) -> Record | None:
    """Find the kind of line that holds the data of a transcript.

    That is the kind with most numbers in all its lines together, so that a frequent but short line of diagnostics does
    not win against the data.

    Parameters
    ----------
    lines : iterable of str
        All lines, without colour codes.

    Returns
    -------
    Record or None
        None where no kind of line with named values occurs twice, or rows of a table are more frequent.
    """
    kinds: Counter[tuple[str, tuple[str, ...], tuple[Shape, ...]]] = Counter()
    rows = 0
    for line, times in _examples(lines):
        items = named_values(line)
        if items:
            lead, numbers = lead_of(line[: items[0].start])
            kinds[lead, tuple(name for name, _ in numbers), tuple(_shape(item) for item in items)] += times
        if is_table_line(line):
            rows += times
    if not kinds:
        return None
    best = max(kinds, key=lambda kind: kinds[kind] * sum(len(shape[3]) for shape in kind[2]))
    count = kinds[best]
    if count < 2 or rows > count:
        return None
    written = {shape[1] for shape in best[2]}
    others = tuple(
        (", ".join(shape[0] for shape in kind[2]), times)
        for kind, times in kinds.most_common(5)
        if times >= max(2.0, _OFTEN * count) and not written & {shape[1] for shape in kind[2]}
    )
    return Record(*best, others)


def _examples(lines: Iterable[str]) -> Iterator[tuple[str, int]]:
    """One line of each form, and how many there are; forms that come when many are known stand for themselves."""
    counts: Counter[str] = Counter()
    example: dict[str, str] = {}
    for line in lines:
        form, _ = skeleton(line[:LONGEST_LINE])
        if form in example or len(example) < _EXAMPLES:
            counts[form] += 1
            example.setdefault(form, line)
        else:
            yield line, 1
    yield from ((line, counts[form]) for form, line in example.items())


def _shape(item: Item) -> Shape:
    return item.name, item.written, item.unit, item.columns
