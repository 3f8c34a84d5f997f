"""Checks of poses before a fit: labels, and whether they determine the parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.calibrating.calibration import AXES
from imufit.errors import InputError
from imufit.remedy import Remedy, mapped, option, when_read
from imufit.rests.poses import SIDES, Pose, distinct, repeated

if TYPE_CHECKING:
    from imufit.log import Log

UNKNOWNS = {"vector": 12, "magnitude": 9}


def check_labels(poses: Sequence[Pose], log: Log) -> tuple[list[Pose], list[str]]:
    """Compare labels with the side that is up by the readings.

    An axis of which both sides read the wrong way round is flipped: that is kept, and calibrated as a negative scale.

    Parameters
    ----------
    poses : sequence of Pose
        All of them.
    log : Log
        The remedy names the columns of its file.

    Returns
    -------
    poses : list of Pose
        Those that contradict their label are left out.
    remarks : list of str
        Axes that are flipped.

    Raises
    ------
    InputError
        The labels name the axes in another order than the readings.
    """
    used = [pose for pose in poses if pose.used and pose.label]
    seen = {side: {pose.side for pose in used if pose.label == side} for side in SIDES}
    remarks, flipped = [], set()
    for axis in AXES:
        plus, minus = seen[f"+{axis}"], seen[f"-{axis}"]
        if plus == {f"-{axis}"} and minus == {f"+{axis}"}:
            flipped.add(axis)
            remarks.append(
                f"Negative scale: axis {axis} is flipped (labelled +{axis}, it reads -{axis}, and the other way round)."
            )
    turned = {axis: {side[1] for sign in "+-" for side in seen[sign + axis]} - {axis} for axis in AXES}
    swapped = [axis for axis in AXES if turned[axis] and not any(f"{s}{axis}" in seen[f"{s}{axis}"] for s in "+-")]
    if len(swapped) >= 2:
        pairs = ", ".join(f"{axis} up reads on {' and '.join(sorted(turned[axis]))}" for axis in swapped)
        remedy: str | Remedy = "The axes are swapped: correct the labels."
        reads = {axis: min(turned[axis]) for axis in swapped}
        if set(reads.values()) == set(swapped):
            columns = {f"acc_{axis}": f"acc_{other}" for axis, other in reads.items()}
            remedy = "The axes are swapped: correct the labels, or map the columns with " + when_read(
                mapped(log.origin.mapping(columns))
            )
        raise InputError(
            f"the labels name other axes than the readings: {pairs}",
            file=str(log.path or "log"),
            column="pose",
            remedy=remedy,
        )
    judged = []
    for pose in poses:
        wrong = pose.used and pose.label is not None and pose.side != pose.label and pose.label[1] not in flipped
        judged.append(pose.without(f"labelled {pose.label}, but {pose.side} points up") if wrong else pose)
    return judged, remarks


def check_poses(poses: Sequence[Pose], cost: str, file: object) -> None:
    """Refuse poses that do not determine the parameters of a cost.

    Parameters
    ----------
    poses : sequence of Pose
        The usable ones.
    cost : str
        ``vector`` or ``magnitude``.
    file : object
        To name in the error.

    Raises
    ------
    InputError
        States what is missing.
    """
    count = distinct(np.array([pose.direction for pose in poses]))
    same = [f"{a.number} and {b.number} ({a.name})" for a, b in repeated(poses)]
    doubled = f"; poses {', '.join(same[:3])} are the same" if same else ""
    if count == 1:
        every = {1: f"pose {poses[0].number} ({poses[0].name} up) is the only one", 2: "both poses are the same"}
        which = every.get(len(poses), f"all {len(poses)} poses are the same ({poses[0].name} up)")
        problem = f"{which}: bias and tilt can't be separated"
        raise InputError(problem, file=str(file), remedy="Record at least six: each of the six sides up for 3 s.")
    if cost == "magnitude" and count < UNKNOWNS["magnitude"]:
        raise InputError(
            "the magnitude cost has 9 unknowns (scale 3, non-orthogonality 3, bias 3) and each pose gives one "
            f"equation: {count} different poses are too few{doubled}",
            file=str(file),
            remedy="Record at least nine attitudes, some of them oblique, or use "
            + option("cost", "vector")
            + " with the six sides up.",
        )
    sides = {pose.name for pose in poses}
    axes = {side[1] for side in sides}
    if cost == "vector" and (len(axes) < 3 or len(sides) < 4):
        missing = [side for side in SIDES if side not in sides]
        raise InputError(
            f"12 unknowns cannot be found from the sides {' '.join(s for s in SIDES if s in sides)}{doubled}",
            file=str(file),
            remedy=f"Record also {' '.join(missing)} up.",
        )


@dataclass(frozen=True)
class Unshown:
    """Unknowns of the magnitude cost that do not show in the directions of the poses.

    Attributes
    ----------
    angles : tuple of (str, str)
        Pairs of axes whose angle does not show.
    axes : tuple of str
        Axes whose scale and bias do not show.
    """

    angles: tuple[tuple[str, str], ...]
    axes: tuple[str, ...]

    def __bool__(self) -> bool:
        return bool(self.angles or self.axes)

    def problem(self) -> str:
        """Name the unknowns, as the end of a sentence."""
        parts = [f"the angle between the axes {a} and {b}" for a, b in self.angles]
        parts += [f"scale and bias of {axis}" for axis in self.axes]
        return " and ".join(parts)

    def remedy(self) -> str:
        """Name the poses to record, as the end of a sentence."""
        parts = [f"one with {a} and {b} both about 45 deg from the vertical" for a, b in self.angles]
        parts += [f"+{axis} up and -{axis} up" for axis in self.axes]
        return " and ".join(parts)


def unshown(directions: NDArray[np.float64]) -> Unshown:
    """Find the unknowns of the magnitude cost that poses do not show, each by its share in what they leave open.

    Parameters
    ----------
    directions : (n, 3) array
        Unit vectors of the poses.
    """
    # The length of a corrected reading changes with the scales as u_i^2, with the bias as u_i, with the angle between
    # two axes as 2 u_i u_j.
    pairs = [(0, 1), (0, 2), (1, 2)]
    mixed = np.stack([2.0 * directions[:, i] * directions[:, j] for i, j in pairs], axis=1)
    design = np.hstack([directions**2, directions, mixed])
    information, combinations = np.linalg.eigh(design.T @ design / len(directions))
    largest = [int(np.abs(combinations[:, k]).argmax()) for k in np.flatnonzero(information <= _imufit.NORM_SEEN)]
    angles = {(AXES[i], AXES[j]) for i, j in (pairs[place - 6] for place in largest if place >= 6)}
    axes = {AXES[place % 3] for place in largest if place < 6}
    return Unshown(tuple(sorted(angles)), tuple(sorted(axes)))


def too_few_positions(poses: Sequence[Pose], error: InputError, file: object, cost: str | None = None) -> InputError:
    """Make the error for poses whose equations do not determine the unknowns.

    Parameters
    ----------
    poses : sequence of Pose
        The usable ones.
    error : InputError
        What the fit said: unknowns and equations.
    file : object
        To name in the error.
    cost : str, optional
        ``vector`` or ``magnitude``, if it was asked for.
    """
    directions = np.array([pose.direction for pose in poses])
    count = distinct(directions)
    sides = {pose.name for pose in poses}
    seen, missing = ([side for side in SIDES if (side in sides) == there] for there in (True, False))
    never = f"; {' '.join(missing)} never pointed up" if missing else ""
    positions = f"{count} different position{'' if count == 1 else 's'}"
    lacking = unshown(directions)
    if cost == "magnitude" and lacking and not missing:
        return InputError(
            f"the {len(poses)} poses show {positions}, but not {lacking.problem()}: nine unknowns need nine poses "
            "that are independent",
            file=str(file),
            remedy=f"Record also {lacking.remedy()}, for 3 s.",
        )
    remedy = f"Record also {' '.join(missing)} up" if missing else "Record each of the six sides up"
    return InputError(
        f"{error.problem}: the {len(poses)} poses show {positions} (nearest sides {' '.join(seen)} up{never})",
        file=str(file),
        remedy=f"{remedy}, on a level table for 3 s each, or at least nine attitudes, some of them oblique.",
    )
