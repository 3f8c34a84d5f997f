"""Accelerometer: paper A's vector cost and magnitude cost on the poses of one or several logs."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.calibrate.calibration import SensorCalibration
from imufit.calibrate.poses import SIDES, Pose, distinct, repeated
from imufit.calibrate.temperature import Temperature
from imufit.errors import InputError

if TYPE_CHECKING:
    from imufit._imufit import _Solution

Array = NDArray[np.float64]

UNKNOWNS = {"vector": 12, "magnitude": 9}
MOTION_ERROR = 0.04
"""Standard error of the bias (m/s^2) beyond which a motion told nothing."""
MOTION_TIME = 30.0
"""Shortest motion (s) from which scale and bias are told."""
MOTION_SHARE = 0.1
"""Share of the motion's accelerations that may pass for a bias."""
MOTION_GROUPS = 20
"""Stretches of time that are left out in turn where there are no poses."""
ENTANGLED = 0.9
"""Correlation beyond which two parameters are named."""
ASTRAY = 0.02
"""Placement scatter (share of g, about 1 degree) beyond which poses were not laid on a table."""
_AXES = ("x", "y", "z")
_OFF = ("xy", "xz", "yx", "yz", "zx", "zy")
_DIRECTION = {side: np.eye(3)[k // 2] * (1.0 if k % 2 == 0 else -1.0) for k, side in enumerate(SIDES)}


@dataclass(frozen=True)
class Targets:
    """What the ideal sensor reads in each pose.

    Attributes
    ----------
    readings : (n, 3) array
        m/s^2, body frame.
    tilt : (n, 6) array or None
        Their change by a tilt (rad) of the table about its x and y axis; None where headings are not known.
    source : str
        Where they come from, for the remarks.
    """

    readings: Array
    tilt: Array | None
    source: str

    def tilted(self, tilt: Array) -> Array:
        """Return what the tilt (2,), rad, adds to the readings by their derivative, (n, 3).

        Parameters
        ----------
        tilt : (2,) array
            rad.
        """
        return (
            np.zeros_like(self.readings)
            if self.tilt is None
            else self.tilt[:, :3] * tilt[0] + self.tilt[:, 3:] * tilt[1]
        )

    def about(self, tilt: Array, gravity: float) -> Targets:
        """Return the targets linearised about this tilt: gravity keeps its length.

        Parameters
        ----------
        tilt : (2,) array
            rad.
        gravity : float
            m/s^2.
        """
        if self.tilt is None:
            return self
        up = self.readings + self.tilted(tilt)
        up /= np.linalg.norm(up, axis=1)[:, None]
        change = self.tilt.reshape(-1, 2, 3)
        change = change - np.einsum("nkj,nj->nk", change, up)[:, :, None] * up[:, None, :]
        level = gravity * up - np.einsum("nkj,k->nj", change, tilt)
        return Targets(level, np.ascontiguousarray(change.reshape(-1, 6)), self.source)


def nominal(poses: Sequence[Pose], gravity: float) -> Targets:
    """Targets of poses on a level table: the named axis points up.

    Parameters
    ----------
    poses : sequence of Pose
        With a label, or else judged by the nearest axis.
    gravity : float
        m/s^2.
    """
    return Targets(gravity * np.array([_DIRECTION[pose.name] for pose in poses]), None, "sides")


def referenced(attitudes: Array, up: Array, gravity: float, source: str) -> Targets:
    """Targets of poses with a known attitude.

    Parameters
    ----------
    attitudes : (n, 3, 3) array
        Body to reference (or table) frame.
    up : (3,) array
        Up in that frame.
    gravity : float
        m/s^2.
    source : str
        Where the attitudes come from.
    """
    to_body = np.swapaxes(attitudes, 1, 2)
    tilts = [-gravity * (to_body @ np.cross(axis, up)) for axis in np.eye(3)[:2]]
    # R_true = exp([theta]x) R_ref, so that R_true^T up = R_ref^T (up - theta x up).
    return Targets(gravity * (to_body @ up), np.ascontiguousarray(np.hstack(tilts)), source)


def check_unit(poses: Sequence[Pose], gravity: float, file: object) -> None:
    """Refuse readings that cannot be m/s^2.

    Parameters
    ----------
    poses : sequence of Pose
        At least one.
    gravity : float
        m/s^2.
    file : object
        To name in the error.

    Raises
    ------
    InputError
        The length at rest is far from gravity's.
    """
    length = float(np.median([np.linalg.norm(pose.mean) for pose in poses]))
    if 0.5 * gravity < length < 2.0 * gravity:
        return
    unit = "g" if 0.5 < length < 2.0 else "mg" if 900.0 < length < 1100.0 else ""
    counts = next((c for c in (16384, 8192, 4096, 2048, 1024) if abs(length / c - 1.0) < 0.2), None)
    looks = unit
    if counts is not None:
        looks = f"{unit} or raw counts of {counts}LSB/g" if unit else f"raw counts of {counts}LSB/g"
        unit = unit or f"{counts}LSB/g"
    axes = ",".join(f"acc_{axis}=acc_{axis}[{unit}]" for axis in _AXES)
    remedy = (
        f"It looks like {looks}: map it, e.g. --map {axes}."
        if unit
        else "Give the unit in the mapping, e.g. --map acc_x=NAME[g]."
    )
    raise InputError(
        f"the accelerometer reads {length:.4g} at rest where gravity is {gravity:.4g} m/s²",
        file=str(file),
        column="acc_x",
        remedy=remedy,
    )


def check_labels(poses: Sequence[Pose], file: object) -> tuple[list[Pose], list[str]]:
    """Compare labels with the side that is up by the readings.

    An axis of which both sides read the wrong way round is flipped: that is kept, and calibrated as a negative scale.

    Parameters
    ----------
    poses : sequence of Pose
        All of them.
    file : object
        To name in the error.

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
    for axis in _AXES:
        plus, minus = seen[f"+{axis}"], seen[f"-{axis}"]
        if plus == {f"-{axis}"} and minus == {f"+{axis}"}:
            flipped.add(axis)
            remarks.append(
                f"Negative scale: axis {axis} is flipped (labelled +{axis}, it reads -{axis}, and the other way round)."
            )
    turned = {axis: {side[1] for sign in "+-" for side in seen[sign + axis]} - {axis} for axis in _AXES}
    swapped = [axis for axis in _AXES if turned[axis] and not any(f"{s}{axis}" in seen[f"{s}{axis}"] for s in "+-")]
    if len(swapped) >= 2:
        pairs = ", ".join(f"{axis} up reads on {' and '.join(sorted(turned[axis]))}" for axis in swapped)
        raise InputError(
            f"the labels name other axes than the readings: {pairs}",
            file=str(file),
            column="pose",
            remedy="The axes are swapped: correct the labels, or map the columns, e.g. --map acc_x=acc_y,acc_y=acc_x.",
        )
    judged = []
    for pose in poses:
        wrong = pose.used and pose.label is not None and pose.side != pose.label and pose.label[1] not in flipped
        judged.append(pose.without(f"labelled {pose.label}, but {pose.side} points up") if wrong else pose)
    return judged, remarks


def check_poses(poses: Sequence[Pose], cost: str, file: object) -> None:
    """Refuse poses that cannot tell the parameters of a cost.

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
        Says what is missing.
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
            remedy="Record at least nine attitudes, some of them oblique, or use --cost vector with the six sides up.",
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


def fit_vector(poses: Sequence[Pose], targets: Targets, gravity: float, temperature: Temperature) -> SensorCalibration:
    """Paper A's vector cost: the direction of gravity in the body frame is known in every pose.

    Parameters
    ----------
    poses : sequence of Pose
        The usable ones, n of them.
    targets : Targets
        What they should read.
    gravity : float
        m/s^2.
    temperature : Temperature
        Of the poses.

    Raises
    ------
    InputError
        The poses do not tell the parameters.
    """
    readings, variances = _stack(poses)
    aims = targets

    def solve(tilted: bool, bias: bool, scale: bool) -> _Solution:
        return _imufit.vector_calibration(
            readings,
            variances,
            aims.readings,
            gravity,
            aims.tilt if tilted else None,
            temperature.values if bias else None,
            scale,
        )

    remarks: list[str] = []
    extras: dict[str, Any] = {}
    tilted, tilt = False, None
    if targets.tilt is not None and 3 * len(poses) > 14:
        trial = solve(True, False, False)
        aims = targets.about(np.array(trial["extra"]), gravity)
        trial = solve(True, False, False)
        tilt, error = np.array(trial["extra"]), np.array(trial["extra_error"])
        determined = bool(np.all(error < np.radians(1.0))) and trial["condition"] < 30.0
        tilted = determined and bool(np.any(np.abs(tilt) > 3.0 * error))
        aims = aims if tilted else targets
        if determined:
            extras["table_tilt"] = {"x": tilt[0], "y": tilt[1], "standard_errors": {"x": error[0], "y": error[1]}}
            shown = ", ".join(
                f"{axis} {np.degrees(v):+.3f} ± {np.degrees(e):.3f} deg"
                for axis, v, e in zip("xy", tilt, error, strict=True)
            )
            frame = "table" if targets.source == "sides" else "reference frame"
            remarks.append(f"The {frame} is {'tilted' if tilted else 'level within the error'}: {shown}.")
    chosen, more = temperature.choose(lambda bias, scale: solve(tilted, bias, scale), 3 * len(poses) - 12 - 2 * tilted)
    remarks += more
    solution = solve(tilted, *chosen)
    if targets.source == "sides":
        extras["placement_deg"] = float(np.degrees(solution["excess"] / gravity))
        if solution["freedom"] < 1:
            remarks.append(
                f"No pose is to spare that would show how well they were laid: {extras['placement_deg']:.1f} deg is "
                "taken for the standard errors. Record all six sides."
            )
        elif extras["placement_deg"] > 0.3:
            remarks.append(
                f"The poses scatter by {extras['placement_deg']:.1f} deg about the axes (placement, more than the "
                "noise): the standard errors contain it."
            )
    residuals = np.linalg.norm(solution["residuals"], axis=1)
    ideal = aims.readings + (aims.tilted(np.array(solution["extra"])) if tilted else 0.0)
    lengths = np.linalg.norm(ideal + solution["residuals"], axis=1)
    remarks += _weak_axes(poses)
    if _rms(lengths - gravity) > 1.5 * _rms(np.linalg.norm(readings, axis=1) - gravity) + 0.01:
        remarks.append(
            "The lengths got worse: a tilted table or a crooked side passes for misalignment. Record one log with the "
            "gyro, so that headings are known, or nine attitudes for --cost magnitude."
        )
    return _result("vector", readings, solution, gravity, lengths, residuals, remarks, extras, chosen)


def fit_magnitude(
    poses: Sequence[Pose], gravity: float, temperature: Temperature, misalignment: bool = True
) -> SensorCalibration:
    """Paper A's magnitude cost: only the length of the corrected reading is known.

    Parameters
    ----------
    poses : sequence of Pose
        The usable ones, at least nine different ones (seven without misalignment).
    gravity : float
        m/s^2.
    temperature : Temperature
        Of the poses.
    misalignment : bool
        Whether non-orthogonality is fitted along with scale and bias.

    Raises
    ------
    InputError
        The poses do not tell the parameters.
    """
    readings, variances = _stack(poses)
    directions = readings / np.linalg.norm(readings, axis=1)[:, None]
    # Poses that repeat a direction are left out together: else each would vouch for the other.
    groups = np.array([np.argmax(directions @ d > np.cos(np.radians(8.0))) for d in directions], dtype=np.float64)
    along = np.sum(variances * directions**2, axis=1)

    def solve(bias: bool, scale: bool) -> _Solution:
        return _imufit.magnitude_calibration(
            readings,
            groups,
            gravity,
            variances=along,
            temperature=temperature.values if bias else None,
            scale_temperature=scale,
            misalignment=misalignment,
        )

    chosen, remarks = temperature.choose(solve, len(poses) - (9 if misalignment else 6))
    solution = solve(*chosen)
    if solution["freedom"] < 1:
        remarks.append(
            "No pose is to spare: the standard errors know the sensor's noise only, and nothing could be left out."
        )
    residuals = np.abs(solution["residuals"][:, 0])
    lengths = gravity + solution["residuals"][:, 0]
    return _result(
        "magnitude", readings, solution, gravity, lengths, residuals, remarks, {"misaligned": misalignment}, chosen
    )


def fit_motion(acc: Array, gravity: float) -> SensorCalibration:
    """Magnitude cost on a sensor that is turned by hand and never rests: weaker, since a hand accelerates.

    Parameters
    ----------
    acc : (n, 3) array
        Specific force, m/s^2, without missing rows.
    gravity : float
        m/s^2.

    Raises
    ------
    InputError
        The motion does not show gravity from enough sides.
    """
    groups = np.floor(np.arange(len(acc)) * MOTION_GROUPS / len(acc))
    solution = _imufit.magnitude_calibration(np.ascontiguousarray(acc), groups, gravity, misalignment=False)
    if max(solution["bias_error"]) > MOTION_ERROR:
        raise InputError("the motion's accelerations hide gravity")
    lengths = gravity + solution["residuals"][:, 0]
    result = _result(
        "magnitude",
        acc,
        solution,
        gravity,
        lengths,
        np.zeros(0),
        [
            "The sensor never rested: scale and bias come from the length of the specific force while it was turned. "
            "A hand's accelerations make that weaker than rests; record six sides at rest."
        ],
        {"misaligned": False, "from_motion": True},
        (False, False),
    )
    # Accelerations go with the turning: a part of them looks like a bias, and those across gravity lengthen the
    # specific force by their square.
    taken = MOTION_SHARE * result.after
    bias_errors = {axis: float(np.hypot(e, taken)) for axis, e in result.standard_errors["acc.bias"].items()}
    lengthened = (result.after / gravity) ** 2
    scale_errors = {axis: float(np.hypot(e, lengthened)) for axis, e in result.standard_errors["acc.scale"].items()}
    return replace(
        result,
        scale_error=np.hypot(result.scale_error, lengthened),
        bias_error=np.hypot(result.bias_error, taken),
        standard_errors={**result.standard_errors, "acc.scale": scale_errors, "acc.bias": bias_errors},
    )


def _stack(poses: Sequence[Pose]) -> tuple[Array, Array]:
    return np.array([pose.mean for pose in poses]), np.array([pose.variance for pose in poses])


def _weak_axes(poses: Sequence[Pose]) -> list[str]:
    """Say which axes rest on few poses."""
    sides = [pose.name for pose in poses]
    remarks = []
    for axis in _AXES:
        have = [side for side in (f"+{axis}", f"-{axis}") if side in sides]
        if len(have) == 1:
            missing = "-" if have[0][0] == "+" else "+"
            remarks.append(
                f"{missing}{axis} never pointed up: scale and bias of {axis} are told apart by the other poses only."
            )
        elif len(have) == 2 and sides.count(have[0]) == sides.count(have[1]) == 1:
            remarks.append(f"The scale of {axis} rests on two poses.")
    if len(remarks) == 3 and all("rests on two" in remark for remark in remarks):
        return ["The scale of each axis rests on two poses."]
    return remarks


def _result(
    cost: str,
    readings: Array,
    solution: _Solution,
    gravity: float,
    lengths: Array,
    residuals: Array,
    remarks: list[str],
    extras: dict[str, Any],
    temperature: tuple[bool, bool],
) -> SensorCalibration:
    gain, gain_error = np.array(solution["model_gain"]), np.array(solution["model_gain_error"])
    effects: dict[str, dict[str, float]] = {
        "acc.bias": dict(zip(_AXES, solution["model_bias"], strict=True)),
        "acc.scale": dict(zip(_AXES, np.diag(gain).tolist(), strict=True)),
    }
    errors: dict[str, dict[str, float]] = {
        "acc.bias": dict(zip(_AXES, solution["model_bias_error"], strict=True)),
        "acc.scale": dict(zip(_AXES, np.diag(gain_error).tolist(), strict=True)),
    }
    if extras.pop("misaligned", True):
        off = list(itertools.permutations(range(3), 2))
        effects["acc.misalignment"] = {name: float(gain[k]) for name, k in zip(_OFF, off, strict=True)}
        errors["acc.misalignment"] = {name: float(gain_error[k]) for name, k in zip(_OFF, off, strict=True)}
    if temperature[0]:
        effects["acc.bias_temperature"] = dict(zip(_AXES, solution["model_bias_temperature"], strict=True))
        errors["acc.bias_temperature"] = dict(zip(_AXES, solution["model_bias_temperature_error"], strict=True))
    if temperature[1]:
        effects["acc.scale_temperature"] = dict(zip(_AXES, solution["model_scale_temperature"], strict=True))
        errors["acc.scale_temperature"] = dict(zip(_AXES, solution["model_scale_temperature_error"], strict=True))
    scale = np.array(solution["scale"])
    for axis, value in zip(_AXES, scale, strict=True):
        if abs(value - 1.0) > 0.2 and value > 0.0:
            remarks.append(f"The scale of {axis} is {value:.3f}: no data sheet allows that; check unit and range.")
    elements = 9 if cost == "vector" else 6 if "acc.misalignment" in effects else 3
    remarks += _entangled(solution["correlation"], elements)
    held_out = solution["held_out_length"] - gravity
    left_out = held_out[np.isfinite(held_out)]
    return SensorCalibration(
        sensor="acc",
        cost=cost,
        misalignment=np.array(solution["misalignment"]),
        scale=scale,
        bias=np.array(solution["bias"]),
        misalignment_error=np.array(solution["misalignment_error"]),
        scale_error=np.array(solution["scale_error"]),
        bias_error=np.array(solution["bias_error"]),
        unit="m/s^2",
        before=_rms(np.linalg.norm(readings, axis=1) - gravity),
        after=_rms(lengths - gravity),
        held_out=_rms(left_out) if left_out.size else np.nan,
        error_unit="m/s^2",
        residuals=residuals,
        condition=solution["condition"],
        correlation=solution["correlation"],
        excess=solution["excess"],
        items=len(readings),
        effects=effects,
        standard_errors=errors,
        remarks=tuple(remarks),
        extras=extras,
    )


def _entangled(correlation: Array, elements: int) -> list[str]:
    """Say which axes' scale and bias move together: one error would pass for the other."""
    scales = (0, 4, 8) if elements == 9 else (0, 1, 2)
    shares = [float(correlation[scale, elements + k]) for k, scale in enumerate(scales)]
    return [
        f"Scale and bias of {axis} are hard to tell apart here (correlation {share:+.2f}): add poses with {axis} "
        "up and down."
        for axis, share in zip(_AXES, shares, strict=True)
        if abs(share) > ENTANGLED
    ]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else float("nan")
