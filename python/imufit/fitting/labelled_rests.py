"""Rests whose label states which body axis points up: how they were laid, and labels that cannot be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from imufit import _imufit
from imufit.errors import InputError
from imufit.remedy import mapped, when_read
from imufit.rests import SIDES, UP, Pose, side_numbers

if TYPE_CHECKING:
    from imufit.log import Log


def labelled(log: Log, rests: Sequence[Pose]) -> list[Pose]:
    """Return rests with the one label that their rows have, if any.

    Parameters
    ----------
    log : Log
        With or without pose labels.
    rests : sequence of Pose
        Where the sensor lies still, n of them.

    Raises
    ------
    InputError
        A label names no side, two labels stand within one rest, or a label contradicts the readings.
    """
    numbers = side_numbers(log)
    return list(rests) if numbers is None else [_labelled(log, rest, numbers) for rest in rests]


def _labelled(log: Log, rest: Pose, numbers: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Pose:
    first, last = rest.rows
    rows = first + np.flatnonzero(numbers[first : last + 1] >= 0.0)
    if not rows.size:
        return replace(rest, label=None)
    file = log.path or "log"
    sides = [SIDES[int(number)] for number in numbers[rows]]
    change = next((k for k, side in enumerate(sides) if side != sides[0]), None)
    if change is not None:
        raise InputError(
            f"the label changes from {sides[0]} to {sides[change]}, but the sensor lies still all the while",
            file=file,
            row=int(rows[change]),
            column="pose",
            remedy="Correct the label, or leave it empty where it is not known.",
        )
    if sides[0] != rest.side:
        raise InputError(
            f"the label {sides[0]} contradicts the accelerometer, by which {rest.side} points up",
            file=file,
            row=int(rows[0]),
            column="pose",
            remedy="Correct the label; or, if every pose is so, the axes (at rest acc points up), such as "
            + when_read(mapped({f"acc_{axis}": f"-acc_{axis}" for axis in "xyz"}))
            + ".",
        )
    return replace(rest, label=sides[0])


def all_sides(rests: Sequence[Pose]) -> bool:
    """Return whether each of the six sides was laid up and labelled: then labels stand in for a reference attitude.

    Parameters
    ----------
    rests : sequence of Pose
        With their labels.
    """
    return {rest.label for rest in rests} >= set(SIDES)


def placement(rests: Sequence[Pose], gravity: float) -> float:
    """Return how far labelled rests are off their side, rad, root mean square in each direction across it.

    As `imufit calibrate` finds it: what bias, scale and misalignment together leave.

    Parameters
    ----------
    rests : sequence of Pose
        Labelled ones, each side among them.
    gravity : float
        m/s^2.
    """
    solution = _imufit.vector_calibration(
        np.array([rest.mean for rest in rests]),
        np.array([rest.variance for rest in rests]),
        gravity * np.array([UP[str(rest.label)] for rest in rests]),
        gravity,
        leave_out=False,
    )
    return solution["excess"] / gravity
