"""Which columns of a file the columns of a log were made of, in the words of a mapping."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from imufit.errors import InputError
from imufit.log.foreign import bracket, signed
from imufit.log.units import conversion, unit_in_header


@dataclass(frozen=True)
class Origin:
    """How a log was read from its file.

    Parameters
    ----------
    read : mapping
        Source text for each column of the log that has another name, sign or unit in the file; empty for a log that
        was not read from a file, or from one that is a log itself.
    stated : mapping
        The part of `read` that the user gave; the reader finds the rest by itself.
    """

    read: Mapping[str, str] = field(default_factory=dict)
    stated: Mapping[str, str] = field(default_factory=dict)

    def mapping(self, columns: Mapping[str, str]) -> dict[str, str]:
        """Return the mapping of the file with which the log has other columns than now.

        Parameters
        ----------
        columns : mapping
            Source text for each column that changes, in terms of the log: ``{"gyr_x": "-gyr_y"}``.

        Returns
        -------
        dict
            The user's own mapping with these columns changed, in terms of the file: ``{"gyr_x": "-GyroY[deg/s]"}``.
        """
        return {**self.stated, **{target: in_the_file(target, text, self.read) for target, text in columns.items()}}


def in_the_file(target: str, text: str, read: Mapping[str, str]) -> str:
    """Write a source in terms of the file; as it was, where that cannot be said.

    Parameters
    ----------
    target : str
        Column of the log that is made.
    text : str
        Its source in terms of the log, such as ``-gyr_y``.
    read : mapping
        Source text in terms of the file for each column of the log, as for `Origin`.
    """
    named, unit = bracket(text)
    turned, column = signed(named)[-1]
    if column not in read:
        return text
    source, own_unit = bracket(read[column])
    if not unit:
        return read[column] if turned > 0.0 else _opposite(read[column])
    try:
        first, then = conversion(column, own_unit or unit_in_header(source, column)), conversion(target, unit)
    except InputError:
        return text  # dates have no factor
    words = f"{source}[{unit}]"
    if first.factor != 1.0 or first.offset:
        if first.offset or then.offset:
            return text
        words = f"{source}[*{first.factor * then.factor!r}]"
    return words if turned > 0.0 else _opposite(words)


def _opposite(text: str) -> str:
    """Write the source of the opposite sign."""
    return text[1:].lstrip() if text.startswith("-") else f"-{text}"
