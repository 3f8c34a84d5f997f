"""Whether specific forces at rest are in m/s^2."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from imufit.errors import InputError
from imufit.remedy import mapped, template, when_read
from imufit.rests.poses import Pose

if TYPE_CHECKING:
    from imufit.log import Log


def check_unit(poses: Sequence[Pose], log: Log) -> None:
    """Refuse readings that cannot be m/s^2.

    Parameters
    ----------
    poses : sequence of Pose
        At least one.
    log : Log
        Its gravity holds, and the remedy names the columns of its file.

    Raises
    ------
    InputError
        The length at rest is far from gravity's.
    """
    gravity = float(log.metadata.gravity)
    length = float(np.median([np.linalg.norm(pose.mean) for pose in poses]))
    if 0.5 * gravity < length < 2.0 * gravity:
        return
    unit = "g" if 0.5 < length < 2.0 else "mg" if 900.0 < length < 1100.0 else ""
    counts = next((c for c in (16384, 8192, 4096, 2048, 1024) if abs(length / c - 1.0) < 0.2), None)
    looks = unit
    if counts is not None:
        looks = f"{unit} or raw counts of {counts}LSB/g" if unit else f"raw counts of {counts}LSB/g"
        unit = unit or f"{counts}LSB/g"
    remedy = "Give the unit in the mapping, such as " + when_read(template("acc")) + "."
    if unit:
        columns = {f"acc_{axis}": f"acc_{axis}[{unit}]" for axis in "xyz"}
        remedy = f"It looks like {looks}: map it with " + when_read(mapped(log.origin.mapping(columns))) + "."
    raise InputError(
        f"the accelerometer reads {length:.4g} at rest where gravity is {gravity:.4g} m/s²",
        file=str(log.path or "log"),
        column="acc_x",
        remedy=remedy,
    )
