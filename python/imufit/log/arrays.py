"""From arrays in memory to the checked fields of a log."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imufit.errors import InputError
from imufit.log.assemble import group_fields
from imufit.log.check import check_poses, checked_labels, truth_value
from imufit.log.columns import CONTRACT, GROUPS
from imufit.log.metadata import ALIKE, KNOWN, Metadata
from imufit.log.place import Place
from imufit.log.time_order import TimeScan
from imufit.log.unmeasured import Unmeasured
from imufit.log.words import meant
from imufit.printable import NAME, printable

if TYPE_CHECKING:
    pass

Array = NDArray[np.float64]

ARGUMENTS: Final = ("reference", "ref_p", "ref_angle", "pose", "temp", "covariates", "labels")
"""Keywords under which columns are given to a log besides its sensors."""
_LIKELY: Final = 0.6
"""Share of letters in common (difflib, and its default) from which a name is offered for an array that no log has:
`magref` and `mag_reference` have 0.63."""


def contiguous(values: ArrayLike, name: str, shape: tuple[int, ...] | None = None) -> Array:
    """Make a C-contiguous float64 array, without a copy where it is one; refuse another shape."""
    try:
        array = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("the array does not hold numbers", file="log", column=name) from None
    if shape is not None and array.shape != shape:
        raise InputError(
            f"the array has shape {array.shape}, but {shape} is required: rows are samples", file="log", column=name
        )
    return array


def check_keywords(metadata: Mapping[str, Any]) -> None:
    """Refuse an array or columns among the metadata: they came under a name that a log does not know.

    Parameters
    ----------
    metadata : mapping
        Keywords that do not name a column.

    Raises
    ------
    InputError
        The column is named, with the nearest that there is.
    """
    for key, value in metadata.items():
        if key in KNOWN:
            continue
        if isinstance(value, Mapping):
            close = difflib.get_close_matches(key.lower(), ARGUMENTS, n=1, cutoff=ALIKE)
            if close:
                raise InputError(
                    f"a log has no {printable(key, NAME)}", file="log", column=key, remedy=f"Did you mean {close[0]}?"
                )
        elif np.ndim(value) > 0 and np.size(value) > 1:
            column = meant(f"{key}_x")
            group = next((group for group, columns in GROUPS.items() if column in columns), "")
            known = [*ARGUMENTS, *sorted(KNOWN)]
            close = [group] if group else difflib.get_close_matches(key.lower(), known, n=1, cutoff=_LIKELY)
            remedy = (
                f"Did you mean {close[0]}?" if close else "Columns without a fixed meaning go into covariates={...}."
            )
            raise InputError("a log has no array of this name", file="log", column=key, remedy=remedy)


def fields_from_arrays(
    t: ArrayLike,
    given: Mapping[str, ArrayLike | None],
    covariates: Mapping[str, ArrayLike],
    text: Mapping[str, Any],
    metadata: Metadata,
) -> dict[str, Any]:
    """Check arrays as if they had been read, and make the fields of a log.

    Parameters
    ----------
    t : (n,) array
        Time, s.
    given : mapping
        ``acc``, ``gyr``, ``mag``, ``ref_p`` (n, 3), ``ref_q`` (n, 4), ``temp``, ``ref_angle`` (n,), or None.
    covariates : mapping
        Other numeric columns, (n,).
    text : mapping
        Text columns, (n,), the pose among them.
    metadata : Metadata
        Its rig axis turns `ref_angle` into an attitude.

    Returns
    -------
    dict
        Fields as in `imufit.log.Log`.
    """
    place = Place()
    for name, values in {"t": t, **given}.items():
        if values is not None and np.asarray(values).dtype == np.bool_:
            raise truth_value("", name, None, place)
    time = contiguous(t, "t")
    if time.ndim != 1:
        raise InputError(f"the array has shape {time.shape}, but (n,) is required", file="log", column="t")
    scan = TimeScan(place)
    scan.add(time)
    numbers: dict[str, Array] = {}
    for name, values in given.items():
        if values is not None:
            numbers |= _split(name, values, time.size)
    for name, values in covariates.items():
        if name in CONTRACT:
            raise place.error("a covariate cannot have the name of a log column", column=name, remedy="Rename it.")
        numbers[name] = contiguous(values, name, (time.size,))
    unmeasured = Unmeasured(place)
    numbers = unmeasured.left_out(numbers, {column: column for column in numbers}, 0)
    unmeasured.check()
    cells = {name: checked_labels(np.array(column, dtype=object)) for name, column in text.items()}
    check_poses(cells.get("pose", np.empty(0, object)), 0, place)
    repair = scan.finish()
    fields = group_fields(repair.apply(time, 0), numbers, cells, start=0, metadata=metadata, place=place)
    notes = (*([repair.note] if repair.note else []), *unmeasured.notes)
    return {**fields, "metadata": metadata, "notes": notes}


def _split(name: str, values: ArrayLike, n: int) -> dict[str, Array]:
    """Take a group apart into its columns."""
    columns = GROUPS.get(name)
    array = contiguous(values, name, (n,) if columns is None else (n, len(columns)))
    return {name: array} if columns is None else {column: array[:, i] for i, column in enumerate(columns)}
