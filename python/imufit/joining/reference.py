"""A reference attitude from the columns in which others write it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from imufit import _imufit
from imufit.errors import InputError
from imufit.joining.course import CONJUGATE
from imufit.log import Log
from imufit.log.scalar_first import quaternions_from_rotation

Array = NDArray[np.float64]

KINDS: Final = "quaternion:W,X,Y,Z  matrix:XX,XY,...,ZZ  euler-SEQUENCE:A,B,C  angle-AXIS:A  angle:A"
_SEQUENCE: Final = re.compile(r"euler-([XYZ]{3}|[xyz]{3})")
_ANGLE: Final = re.compile(r"angle(-[xyz])?")
_DEGREES: Final = "[deg]"
_RADIANS: Final = "[rad]"
NOT_UNIT: Final = 1e-2
"""A quaternion this far from unit length, or a matrix this far from a rotation, holds something else."""


def declared_attitude(text: str) -> tuple[str, tuple[str, ...]]:
    """Take kind and columns of an attitude apart.

    Parameters
    ----------
    text : str
        Such as ``euler-ZYX:yaw[deg],pitch[deg],roll[deg]``.

    Raises
    ------
    InputError
        The text names no columns.
    """
    kind, colon, columns = text.partition(":")
    names = tuple(name.strip() for name in columns.split(","))
    if not colon or not all(names):
        raise InputError(f"{text!r} names no columns", remedy="Write KIND:COLUMN,COLUMN,...")
    return kind, names


def with_attitude(log: Log, kind: str, columns: Sequence[str], inverse: bool = False) -> Log:
    """Make the reference attitude of other columns.

    Parameters
    ----------
    log : Log
        With the columns among its covariates.
    kind : str
        "quaternion" (columns: scalar, x, y, z); "matrix" (nine, row by row); "euler-SEQUENCE", the sequence as in
        scipy's `Rotation`: capitals about the turned axes, small letters about the fixed ones ("euler-ZYX": yaw, pitch,
        roll); "angle-AXIS" with the one angle about a body axis "x", "y" or "z"; "angle" with the one angle about an
        axis that is not known.
    columns : sequence of str
        Their names; angles are in radians unless ``[deg]`` stands behind the name.
    inverse : bool
        True if the attitude turns vectors of the reference frame into the body.

    Returns
    -------
    Log
        With `ref_q`, body to reference frame, or for "angle" with `ref_angle`; rows in which a column is missing have
        none.

    Raises
    ------
    InputError
        The kind is unknown, a column is missing, or the numbers are not an attitude.
    """
    values = np.stack([_column(log, name, kind) for name in columns], axis=1)
    used = {name.removesuffix(_DEGREES).removesuffix(_RADIANS) for name in columns}
    covariates = {name: column for name, column in log.covariates.items() if name not in used}
    if kind == "angle":
        _check_number(log, kind, columns, 1)
        return log.with_fields(ref_angle=-values[:, 0] if inverse else values[:, 0], covariates=covariates)
    q = np.full((log.n, 4), np.nan)
    there = np.isfinite(values).all(axis=1)
    q[there] = _attitudes(log, kind, columns, values[there])
    if inverse:
        q = q * CONJUGATE
    return log.with_fields(ref_q=q, covariates=covariates)


def _attitudes(log: Log, kind: str, columns: Sequence[str], values: Array) -> Array:
    sequence, angle = _SEQUENCE.fullmatch(kind), _ANGLE.fullmatch(kind)
    wanted = 4 if kind == "quaternion" else 9 if kind == "matrix" else 3 if sequence else 1 if angle else 0
    file = log.path or "reference"
    if wanted == 0:
        raise InputError(f"{kind!r} is not a kind of attitude", file=file, remedy=f"Write one of {KINDS}.")
    _check_number(log, kind, columns, wanted)
    if kind == "quaternion":
        size = np.linalg.norm(values, axis=1)
        _check(np.abs(size - 1.0) <= NOT_UNIT, "the quaternion does not have unit length", log, columns)
        return np.asarray(values / size[:, None])
    if kind == "matrix":
        matrix = values.reshape(-1, 3, 3)
        off = np.abs(matrix @ matrix.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        right = (off <= NOT_UNIT) & (np.linalg.det(matrix) > 0.0)
        _check(right, "the matrix is not a rotation", log, columns)
        return _imufit.quaternion_from_matrix_rows(values)
    axes = sequence.group(1) if sequence else kind[-1]
    angles = values if sequence else values[:, :1]
    return quaternions_from_rotation(Rotation.from_euler(axes, angles))


def _check_number(log: Log, kind: str, columns: Sequence[str], wanted: int) -> None:
    """Refuse too few columns, or too many."""
    if len(columns) != wanted:
        problem = f"{kind} has {wanted} column{'s' if wanted > 1 else ''}, {len(columns)} were named"
        raise InputError(problem, file=log.path or "reference", remedy=f"Write {KINDS}.")


def _check(right: NDArray[np.bool_], problem: str, log: Log, columns: Sequence[str]) -> None:
    """Refuse what is not an attitude."""
    wrong = np.flatnonzero(~right)
    if wrong.size:
        raise InputError(
            f"{problem} in {wrong.size} of {right.size} rows",
            file=log.path or "reference",
            row=int(wrong[0]),
            column=columns[0],
            remedy="Are these the columns, in this order?",
        )


def _column(log: Log, name: str, kind: str) -> Array:
    plain = name.removesuffix(_DEGREES).removesuffix(_RADIANS)
    values = log.covariates.get(plain)
    if values is None:
        held = ", ".join(list(log.covariates)[:20]) or "none"
        raise InputError(
            "the file has no such column of numbers",
            file=log.path or "reference",
            column=plain,
            remedy=f"Columns without a fixed meaning: {held}.",
        )
    angles = kind.startswith(("euler", "angle"))
    return np.deg2rad(values) if angles and name.endswith(_DEGREES) else values
