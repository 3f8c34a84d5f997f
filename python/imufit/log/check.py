"""Values that no log may hold, row by row: bad quaternions, unknown poses, text for numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log.columns import GROUPS, POSES
from imufit.log.place import Place
from imufit.printable import NAME, printable

UNIT_TOLERANCE: Final = 1e-3
_EXACT: Final = 1e-12
_MISSING: Final = frozenset({"", "nan", "na", "n/a", "null", "none", "#n/a", "-", "--"})
_BOOLEAN: Final = {"true": 1.0, "false": 0.0}


def number_from_text(cell: Any, *, truth: bool = False) -> float:
    """Read one cell; empty and the usual words for a missing value give NaN.

    Parameters
    ----------
    cell : object
        Text, or None where nothing stands.
    truth : bool
        Whether true and false are read as 1 and 0: so they are of a switch, but a sensor measures neither.

    Raises
    ------
    ValueError
        The cell is not a number.
    """
    if cell is None:
        return float("nan")
    text = str(cell).strip()
    folded = text.lower()
    if folded in _MISSING:
        return float("nan")
    if truth and folded in _BOOLEAN:
        return _BOOLEAN[folded]
    if "_" in text:
        raise ValueError(text)
    return float(text)


def is_truth(cell: Any) -> bool:
    """Whether a cell states true or false."""
    return str(cell).strip().lower() in _BOOLEAN


def truth_value(text: str, column: str, row: int | None, place: Place) -> InputError:
    """Make the error for a truth value, or without row for a column of them, where a measurement is wanted."""
    return place.error(
        "the column holds truth values, no measurements"
        if row is None
        else f"{text!r} is a truth value, not a measurement",
        row=row,
        column=column,
        remedy="Write a number, or leave the cell empty for a missing sample.",
    )


def numbers_from_text(cells: NDArray[np.object_], column: str, start: int, place: Place) -> NDArray[np.float64]:
    """Read a text column that has to hold numbers; (n,) float64."""
    values = np.empty(len(cells))
    for i, cell in enumerate(cells):
        try:
            values[i] = number_from_text(cell)
        except ValueError:
            text = str(cell).strip()
            shown = text if len(text) <= 40 else text[:37] + "..."
            remedy = "Write a number, or leave the cell empty for a missing sample."
            if text.count(",") == 1 and "." not in text:
                remedy = "Write a decimal point, not a comma."
            if text.lower() in _BOOLEAN:
                raise truth_value(text, column, start + i, place) from None
            raise place.error(f"{shown!r} is not a number", row=start + i, column=column, remedy=remedy) from None
    return values


def first_of(faults: Iterable[InputError]) -> InputError | None:
    """Return the fault that stands first in the file, of one row in the first column; None without faults.

    Parameters
    ----------
    faults : iterable of InputError
        One for each column, in the order of the file.
    """
    return min(faults, key=lambda fault: fault.row or 0, default=None)


def text_for_number(cells: Mapping[str, NDArray[Any]], start: int, place: Place) -> InputError | None:
    """Return the error for the first cell of some columns that is not a number; None where all are.

    Parameters
    ----------
    cells : mapping
        Rows of the columns, each (n,), in the order of the file.
    start : int
        Row of the log at which they begin.
    place : Place
        To name the file in the error.
    """
    faults = []
    for column, values in cells.items():
        if values.dtype == object:
            try:
                numbers_from_text(values, column, start, place)
            except InputError as error:
                faults.append(error)
    return first_of(faults)


def checked_attitude(q: NDArray[np.float64], start: int, place: Place) -> NDArray[np.float64]:
    """Check reference quaternions and take away rounding of their norm.

    Parameters
    ----------
    q : (n, 4) array
        Scalar first; a row of NaN is a missing reference.
    start : int
        Row of the log at which the block begins.
    place : Place
        To name the file in errors.

    Returns
    -------
    (n, 4) array
        Unit quaternions. Norms up to 1e-3 off one are corrected; beyond, it is an error.
    """
    missing = np.isnan(q)
    half = np.flatnonzero(missing.any(axis=1) & ~missing.all(axis=1))
    if half.size:
        column = GROUPS["ref_q"][int(np.flatnonzero(missing[half[0]])[0])]
        raise place.error(
            "NaN in one part of a quaternion whose other parts are there",
            row=start + int(half[0]),
            column=column,
            remedy="A missing reference needs NaN in all of ref_qw ref_qx ref_qy ref_qz.",
        )
    norm = np.linalg.norm(q, axis=1)
    off = np.abs(norm - 1.0)
    bad = np.flatnonzero(off > UNIT_TOLERANCE)
    if bad.size:
        # Euler angles of a body at rest in these columns are zero: the rows in which they are not show what they are.
        i = int(bad[np.argmax(norm[bad] > 0.0)])
        if norm[i] == 0.0:
            problem, remedy = "the quaternion is all zero", "Write NaN in all four parts for a missing reference."
        else:
            problem = f"the quaternion has norm {norm[i]:.6g}, not 1"
            remedy = "Reference attitudes are unit quaternions, scalar first: normalise them."
        raise place.error(problem, row=start + i, column="ref_qw", remedy=remedy)
    rounded = off > _EXACT
    if rounded.any():
        q = q.copy()
        q[rounded] /= norm[rounded, None]
    return q


def checked_labels(cells: NDArray[np.object_]) -> NDArray[np.object_]:
    """Text column with None where the text is missing."""
    labels = np.empty(len(cells), dtype=object)
    labels[:] = [None if _absent(cell) else str(cell) for cell in cells]
    return labels


def _absent(cell: Any) -> bool:
    return cell is None or cell == "" or cell is np.ma.masked or (isinstance(cell, float) and np.isnan(cell))


def check_poses(poses: NDArray[np.object_], start: int, place: Place) -> None:
    """Refuse pose labels other than the six."""
    for i, pose in enumerate(poses):
        if pose is not None and pose not in POSES:
            raise place.error(
                f"{printable(pose, NAME)!r} is not a pose",
                row=start + i,
                column="pose",
                remedy=f"Write one of {' '.join(POSES)} (that body axis points up), or nothing.",
            )
