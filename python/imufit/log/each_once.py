"""Names of a table's columns: each stands there once, or no reader knows which one is meant."""

from __future__ import annotations

from collections.abc import Sequence

from imufit.log.place import Place
from imufit.printable import NAME, printable


def check_each_once(names: Sequence[str], place: Place) -> None:
    """Refuse a table with two columns of the same name.

    Parameters
    ----------
    names : sequence of str
        Names as they stand in the file.
    place : Place
        To name the file in the error.

    Raises
    ------
    InputError
        A name stands there twice.
    """
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise place.error(
                f"column {printable(name, NAME)} is there twice", column=name, remedy="Rename or delete one of them."
            )
        seen.add(name)
