"""A mapping in terms of the log: what it does not name is read as it would be without it.

A mapping may take a column from a column of the log, which the file has under another name: ``gyr_x=-gyr_y`` where the
file has ``GyroY (deg/s)``. Its source is then the log's column as it is read without a mapping, in its SI unit.
"""

from __future__ import annotations

from collections.abc import Mapping

from imufit.errors import InputError
from imufit.log.columns import CONTRACT, GROUPS
from imufit.log.foreign import bracket, signed
from imufit.log.place import Place
from imufit.log.recognise import Readable, recognise
from imufit.log.units import conversion


def completed(mapping: Mapping[str, str] | None, source: Readable, place: Place) -> Mapping[str, str] | None:
    """Return a mapping that names columns of the file alone, and all columns of the sensors that it touches.

    Parameters
    ----------
    mapping : mapping or None
        As the user wrote it.
    source : Readable
        The file.
    place : Place
        To name the file in errors.
    """
    if not mapping:
        return mapping
    names = frozenset(source.names)
    strange = {target for target, text in mapping.items() if _of_the_log(text) - names}
    touched = {each for group in GROUPS.values() if mapping.keys() & set(group) for each in group}
    left = touched - mapping.keys() - names
    if not (strange or left):
        return mapping
    try:
        own = recognise(source, None, place).mapping
    except InputError:
        return mapping  # what is asked there, the mapping may answer
    words = {target: _in_the_file(target, text, own) if target in strange else text for target, text in mapping.items()}
    return {**words, **{column: own[column] for column in CONTRACT if column in left and column in own}}


def _of_the_log(text: str) -> frozenset[str]:
    """Column of a log that a source text names, if it names one."""
    name = signed(bracket(text)[0])[-1][1]
    return frozenset({name} & set(CONTRACT))


def _in_the_file(target: str, text: str, own: Mapping[str, str]) -> str:
    """Write a source in terms of the file; as it was, where that cannot be said."""
    named, unit = bracket(text)
    turned, column = signed(named)[-1]
    if column not in own:
        return text
    source, own_unit = bracket(own[column])
    if not unit:
        return own[column] if turned > 0.0 else _opposite(own[column])
    try:
        first, then = conversion(column, own_unit), conversion(target, unit)
    except InputError:
        return text  # dates have no factor
    if first.offset or then.offset:
        return text
    words = f"{source}[{unit}]" if first.factor == 1.0 else f"{source}[*{first.factor * then.factor!r}]"
    return words if turned > 0.0 else _opposite(words)


def _opposite(text: str) -> str:
    """Write the source of the opposite sign."""
    return text[1:].lstrip() if text.startswith("-") else f"-{text}"
