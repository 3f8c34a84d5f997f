"""A reference whose columns are not declared: every way to read them as an attitude is joined, and the rates decide."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from imufit.errors import InputError
from imufit.joining.gravity import UPRIGHT, mean_force
from imufit.joining.join import join
from imufit.joining.joined import Joined
from imufit.joining.reference import KINDS, with_attitude
from imufit.log import Log
from imufit.log.attitude_columns import quaternions_named
from imufit.log.columns import WHOLE_TURN
from imufit.remedy import Remedy, option

_NUMBERED: Final = re.compile(r"(?P<base>.*?)(?:\[(?P<index>\d)\]|_?(?P<digit>\d))")
_ATTITUDE: Final = re.compile(r"q|quat|orient|rot|att|dcm|\br$", re.IGNORECASE)
_ANGLE: Final = re.compile(r"(?P<base>.*?)(?P<part>roll|pitch|yaw).*", re.IGNORECASE)
_ENCODER: Final = re.compile(r"angle|encoder|theta|joint", re.IGNORECASE)
_WORSE: Final = 1.5
"""A way that leaves this many times as much of the rates (square) as the best one is another attitude: ways that are
the same but for constant turns leave the same."""
_MOST_WAYS: Final = 24
"""Ways that are tried at most: six bodies, each in four."""


@dataclass(frozen=True)
class Way:
    """One way to read columns as an attitude.

    Parameters
    ----------
    kind : str
        As for `with_attitude`.
    columns : tuple of str
        Their names.
    inverse : bool
        Whether the attitude turns vectors of the reference frame into the body.
    """

    kind: str
    columns: tuple[str, ...]
    inverse: bool

    @property
    def summary(self) -> str:
        """The way in a few words."""
        if self.kind == "angle":
            return f"one angle, {self.columns[0]}"
        between = " ... " if len(self.columns) > 2 else " "
        turned = ", reference to body" if self.inverse else ", body to reference"
        return f"{self.kind} of {self.columns[0]}{between}{self.columns[-1]}{turned}"

    @property
    def words(self) -> Remedy:
        """The keyword arguments, and the options, that say the same."""
        declared = option("attitude", f"{self.kind}:{','.join(self.columns)}")
        return declared + Remedy(", inverse=True", " --inverse") if self.inverse else declared


def join_as_found(log: Log, reference: Log, lag: float | None, skew: float | None) -> Joined:
    """Join a reference whose attitude stands in columns of any kind, in the way that agrees with the sensor's rates.

    Parameters
    ----------
    log : Log
        With a gyroscope.
    reference : Log
        With columns that can be read as an attitude among its covariates.
    lag, skew : float, optional
        As for `join`.

    Returns
    -------
    Joined
        Its log has a note on the way that was taken.

    Raises
    ------
    InputError
        No columns look like an attitude, none agrees with the sensor, or two ways agree equally well.
    """
    ways = list(_ways(reference))[:_MOST_WAYS]
    file = reference.path or "reference"
    if not ways and (reference.ref_p is not None or reference.ref_angle is not None):
        return join(log, reference, lag, skew)
    if not ways:
        held = ", ".join(list(reference.covariates)[:12]) or "none"
        raise InputError(
            f"no columns have the names of an attitude; the columns are {held}",
            file=file,
            remedy="Name them with " + Remedy("attitude=", "--attitude ") + f"KIND:COLUMNS, which is {KINDS}.",
        )
    found: list[tuple[Way, Joined]] = []
    refused: list[InputError] = []
    for way in ways:
        try:
            attitude = with_attitude(reference, way.kind, way.columns, way.inverse)
            found.append((way, join(log, attitude, lag, skew)))
        except InputError as error:
            refused.append(error)
    if not found:
        raise refused[0]
    least = min(joined.traces.left for _, joined in found)
    alike = [each for each in found if each[1].traces.left <= _WORSE * least]
    upright = [each for each in alike if _off_vertical(each[1].log) < UPRIGHT] if len(alike) > 1 else alike
    if len(upright) != 1:
        raise InputError(
            "rates and gravity do not show how the columns are to be read as an attitude",
            file=file,
            remedy="Say which holds: " + (upright or alike)[0][0].words + " or " + (upright or alike)[1][0].words + ".",
        )
    way, best = upright[0]
    note = f"{reference.path.name if reference.path else 'reference'}: attitude read as {way.summary}"
    return replace(best, log=best.log.with_fields(notes=(*best.log.notes, note)))


def _off_vertical(log: Log) -> float:
    """Angle between the mean specific force in the reference frame and its vertical axis, rad; NaN without any.

    A quaternion with its scalar misplaced is, up to constant turns of body and frame, the inverse of the right one (an
    orthogonal map of determinant -1): the rates are the same, and only gravity separates them.
    """
    force = mean_force(log)
    return float(np.arccos(np.clip(np.abs(force[2]) / np.linalg.norm(force), 0.0, 1.0)))


def _ways(reference: Log) -> Iterator[Way]:
    names = [name for name, values in reference.covariates.items() if np.isfinite(values).any()]
    whole = (*_quaternions(names), *_matrices(names), *_angles(reference, names))
    for kind, columns in whole:
        for inverse in (False, True):
            yield Way(kind, columns, inverse)
    if not whole:
        for name in names:
            if _ENCODER.search(name):
                # The rates show the direction of the axis, and so the sign.
                yield Way("angle", (f"{name}{_unit(reference, (name,))}",), False)


def _quaternions(names: Sequence[str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    for named in quaternions_named(names):
        yield "quaternion", named
    for base, numbered in _by_number(names).items():
        if _ATTITUDE.search(base) and set(numbered) == {0, 1, 2, 3}:
            yield "quaternion", tuple(numbered[k] for k in range(4))
            yield "quaternion", tuple(numbered[k] for k in (3, 0, 1, 2))


def _matrices(names: Sequence[str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    for base, numbered in _by_number(names).items():
        if _ATTITUDE.search(base) and set(numbered) == set(range(9)):
            yield "matrix", tuple(numbered[k] for k in range(9))


def _by_number(names: Sequence[str]) -> dict[str, dict[int, str]]:
    found: dict[str, dict[int, str]] = {}
    for name in names:
        if match := _NUMBERED.fullmatch(name):
            found.setdefault(match["base"], {})[int(match["index"] or match["digit"])] = name
    return found


def _angles(reference: Log, names: Sequence[str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    sets: dict[str, dict[str, str]] = {}
    for name in names:
        if match := _ANGLE.fullmatch(name):
            sets.setdefault(match["base"], {})[match["part"].lower()] = name
    for parts in sets.values():
        if set(parts) == {"roll", "pitch", "yaw"}:
            unit = _unit(reference, parts.values())
            yield "euler-ZYX", tuple(f"{parts[part]}{unit}" for part in ("yaw", "pitch", "roll"))


def _unit(reference: Log, names: Collection[str]) -> str:
    """Return the mark of degrees where a name states this, or an angle exceeds a whole turn in rad."""
    largest = max(float(np.nanmax(np.abs(reference.covariates[name]))) for name in names)
    return "[deg]" if largest > WHOLE_TURN or any("deg" in name.lower() for name in names) else ""
