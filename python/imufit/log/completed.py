"""A mapping in terms of the log: what it does not name is read as it would be without it.

A mapping may take a column from a column of the log, which the file has under another name: ``gyr_x=-gyr_y`` where the
file has ``GyroY (deg/s)``. Its source is then the log's column as it is read without a mapping, in its SI unit.
"""

from __future__ import annotations

from collections.abc import Mapping

from imufit.errors import InputError
from imufit.log.columns import CONTRACT, GROUPS
from imufit.log.foreign import bracket, signed
from imufit.log.origin import in_the_file
from imufit.log.place import Place
from imufit.log.recognise import Readable, recognise


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
    words = {target: in_the_file(target, text, own) if target in strange else text for target, text in mapping.items()}
    return {**words, **{column: own[column] for column in CONTRACT if column in left and column in own}}


def _of_the_log(text: str) -> frozenset[str]:
    """Column of a log that a source text names, if it names one."""
    name = signed(bracket(text)[0])[-1][1]
    return frozenset({name} & set(CONTRACT))
