"""From a block of file columns to the checked fields of a log."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log.check import (
    check_poses,
    checked_attitude,
    checked_labels,
    first_of,
    numbers_from_text,
    truth_value,
)
from imufit.log.clock_text import joined, seconds_from_cells
from imufit.log.columns import EULER, GROUPS, NUMERIC
from imufit.log.foreign import Plan, PlannedColumn
from imufit.log.metadata import Metadata
from imufit.log.place import Place
from imufit.log.scalar_first import quaternions_from_rotation
from imufit.log.time_order import TimeRepair
from imufit.log.units import Conversion
from imufit.log.unmeasured import Unmeasured

RawBlock = Mapping[str, NDArray[Any]]
"""File columns by name: (n,) float64 for numbers, (n,) object for text."""


def time_of(plan: Plan, block: RawBlock, start: int, rows: int, place: Place) -> NDArray[np.float64]:
    """Time stamps of one block in s, (n,), before any repair."""
    column = plan.time
    raw = block[column.source] if isinstance(column.source, str) else None
    if raw is None or raw.dtype != object:
        return _numbers(column, block, start, rows, place)
    times = seconds_from_cells(raw if column.day is None else joined(block[column.day], raw), column.order)
    if np.isnan(times).any():
        return _numbers(column, block, start, rows, place)  # names the row
    return column.conversion.apply(times)


def check_truth_values(plan: Plan, truths: Mapping[str, tuple[int | None, str]], place: Place) -> None:
    """Refuse truth values where a measurement is wanted; of a covariate, such as a switch, they are 1 and 0.

    Parameters
    ----------
    plan : Plan
        Which file column becomes which column of the log.
    truths : mapping
        First row with a truth value, and that value, of each file column that has one.
    place : Place
        To name the file in errors.
    """
    for column in plan.columns:
        if column.target in NUMERIC and column.name is not None and column.name in truths:
            row, text = truths[column.name]
            raise truth_value(text, column.name, row, place)


def fields_of(
    plan: Plan,
    block: RawBlock,
    start: int,
    rows: int,
    *,
    repair: TimeRepair,
    metadata: Metadata,
    place: Place,
    unmeasured: Unmeasured,
) -> dict[str, Any]:
    """Check one block and group its columns into the fields of a log.

    Parameters
    ----------
    plan : Plan
        Which file column becomes which column of the log.
    block : mapping
        File columns, each (n,).
    start, rows : int
        First row of the block in the log, and its number of rows n.
    repair : TimeRepair
        New time stamps from the pass over `t`.
    metadata : Metadata
        Its rig axis turns `ref_angle` into an attitude.
    place : Place
        To name the file in errors.
    unmeasured : Unmeasured
        Leaves out what nothing can have measured.

    Returns
    -------
    dict
        Fields as in `imufit.log.Log`, without metadata, path and notes.
    """
    numbers: dict[str, NDArray[np.float64]] = {}
    text: dict[str, NDArray[np.object_]] = {}
    faults = []
    for column in plan.columns:
        if column.target == "t":
            continue
        raw = block[column.name] if column.name is not None else None
        if column.target == "pose":
            text["pose"] = _poses(raw, rows, start, place)
        elif (
            raw is not None
            and raw.dtype == object
            and column.target not in NUMERIC
            and column.conversion == Conversion()
        ):
            text[column.target] = checked_labels(raw)
        else:
            try:
                numbers[column.target] = _numbers(column, block, start, rows, place)
            except InputError as error:
                faults.append(error)
    if (fault := first_of(faults)) is not None:
        raise fault
    names = {column.target: column.name or column.target for column in plan.columns}
    numbers = unmeasured.left_out(numbers, names, start)
    t = repair.apply(time_of(plan, block, start, rows, place), start)
    return group_fields(t, numbers, text, start=start, metadata=metadata, place=place)


def group_fields(
    t: NDArray[np.float64],
    numbers: dict[str, NDArray[np.float64]],
    text: dict[str, NDArray[np.object_]],
    *,
    start: int,
    metadata: Metadata,
    place: Place,
) -> dict[str, Any]:
    """Group checked columns into fields; what has no fixed meaning becomes covariates and labels."""
    fields: dict[str, Any] = {"t": t}
    for name, columns in GROUPS.items():
        if columns[0] in numbers:
            fields[name] = np.stack([numbers.pop(column) for column in columns], axis=1)
    for name in ("temp", "ref_angle"):
        if name in numbers:
            fields[name] = numbers.pop(name)
    if "ref_q" not in fields and all(name in numbers for name in EULER):
        fields["ref_q"] = attitude_of_angles(*(numbers.pop(name) for name in EULER))
    if "ref_q" in fields:
        fields["ref_q"] = checked_attitude(fields["ref_q"], start, place)
    elif "ref_angle" in fields and metadata.rig_axis is not None:
        fields["ref_q"] = attitude_of_rig(fields["ref_angle"], metadata.rig_axis)
    if "pose" in text:
        fields["pose"] = text.pop("pose")
    return {**fields, "covariates": numbers, "labels": text}


def attitude_of_angles(
    roll: NDArray[np.float64], pitch: NDArray[np.float64], yaw: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Attitude of a body turned by yaw about z, then by pitch about its y, then by roll about its x.

    Parameters
    ----------
    roll, pitch, yaw : (n,) arrays
        rad; NaN is missing.

    Returns
    -------
    (n, 4) array
        Unit quaternions, scalar first, body to reference frame.
    """
    angles = np.stack([yaw, pitch, roll], axis=1)
    known = np.isfinite(angles).all(axis=1)
    q = np.full((roll.size, 4), np.nan)
    if known.any():
        from scipy.spatial.transform import Rotation  # noqa: PLC0415 - costs a fifth of a second that many do not need

        q[known] = quaternions_from_rotation(Rotation.from_euler("ZYX", angles[known]))
    return q


def attitude_of_rig(angle: NDArray[np.float64], axis: str) -> NDArray[np.float64]:
    """Attitude of a one-axis rig that is the identity at angle 0.

    Parameters
    ----------
    angle : (n,) array
        Rotation about the body axis, rad; NaN is missing.
    axis : {"x", "y", "z"}
        Body axis of the rig.

    Returns
    -------
    (n, 4) array
        Unit quaternions, scalar first.
    """
    q = np.zeros((angle.size, 4))
    q[:, 0] = np.cos(0.5 * angle)
    q[:, 1 + "xyz".index(axis)] = np.sin(0.5 * angle)
    q[np.isnan(angle)] = np.nan
    return q


def _numbers(column: PlannedColumn, block: RawBlock, start: int, rows: int, place: Place) -> NDArray[np.float64]:
    if not isinstance(column.source, str):
        return column.conversion.apply(column.source.numbers(start, rows))
    raw = block[column.source]
    if raw.dtype == object:
        raw = numbers_from_text(raw, column.source, start, place)
    return column.conversion.apply(raw)


def _poses(raw: NDArray[Any] | None, rows: int, start: int, place: Place) -> NDArray[np.object_]:
    cells = np.full(rows, None) if raw is None else raw
    if cells.dtype != object:
        found = np.flatnonzero(~np.isnan(cells))
        if found.size:
            check_poses(np.array([str(cells[found[0]])], dtype=object), start + int(found[0]), place)
        cells = np.full(rows, None)
    poses = checked_labels(cells)
    check_poses(poses, start, place)
    return poses
