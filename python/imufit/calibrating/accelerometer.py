"""Accelerometer: paper A's vector cost and magnitude cost on the poses of one or several logs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.calibrating.calibration import AXES, SensorCalibration, named, off_diagonal, rms
from imufit.calibrating.temperature import Temperature
from imufit.errors import InputError
from imufit.remedy import option
from imufit.rests.poses import SAME_DIRECTION, UP, Pose

if TYPE_CHECKING:
    from imufit._imufit import _Solution

Array = NDArray[np.float64]

MOTION_ERROR = 0.04
"""Standard error of the bias (m/s^2) beyond which a motion is not informative."""
MOTION_TIME = 30.0
"""Shortest motion (s) from which scale and bias are determined."""
MOTION_SHARE = 0.1
"""Share of the motion's accelerations that may pass for a bias."""
MOTION_GROUPS = 20
"""Stretches of time that are left out in turn if poses are missing."""
ENTANGLED = 0.9
"""Correlation beyond which two parameters are named."""
ASTRAY = 0.02
"""Placement scatter (share of g, about 1 degree) beyond which poses were not laid on a table."""


@dataclass(frozen=True)
class Targets:
    """Ideal reading of each pose.

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
    return Targets(gravity * np.array([UP[pose.name] for pose in poses]), None, "sides")


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
        The poses do not determine the parameters.
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
                f"The poses are too few to show how well they were laid: {extras['placement_deg']:.1f} deg is "
                "assumed in the standard errors. Record all six sides."
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
    if rms(lengths - gravity) > 1.5 * rms(np.linalg.norm(readings, axis=1) - gravity) + 0.01:
        remarks.append(
            "The error of the lengths grew: a tilted table or a crooked side is mistaken for misalignment. Record one "
            f"log with the gyro, so that headings are known, or nine attitudes for {option('cost', 'magnitude')}."
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
        The poses do not determine the parameters.
    """
    readings, variances = _stack(poses)
    directions = readings / np.linalg.norm(readings, axis=1)[:, None]
    # Poses that repeat a direction are left out together: else each would vouch for the other.
    groups = np.array([np.argmax(directions @ d > np.cos(SAME_DIRECTION)) for d in directions], dtype=np.float64)
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
            "The poses are just enough: the standard errors contain the sensor's noise only, and no pose could be "
            "left out."
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
        raise InputError("accelerations of the motion exceed gravity")
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
            "Accelerations of the motion make this fit weaker than rests; record six sides at rest."
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
    for axis in AXES:
        have = [side for side in (f"+{axis}", f"-{axis}") if side in sides]
        if len(have) == 1:
            missing = "-" if have[0][0] == "+" else "+"
            remarks.append(f"{missing}{axis} never pointed up: only the other poses separate scale and bias of {axis}.")
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
    effects = {"acc.bias": named(solution["model_bias"]), "acc.scale": named(np.diag(gain))}
    errors = {"acc.bias": named(solution["model_bias_error"]), "acc.scale": named(np.diag(gain_error))}
    if extras.pop("misaligned", True):
        effects["acc.misalignment"] = off_diagonal(gain)
        errors["acc.misalignment"] = off_diagonal(gain_error)
    if temperature[0]:
        effects["acc.bias_temperature"] = named(solution["model_bias_temperature"])
        errors["acc.bias_temperature"] = named(solution["model_bias_temperature_error"])
    if temperature[1]:
        effects["acc.scale_temperature"] = named(solution["model_scale_temperature"])
        errors["acc.scale_temperature"] = named(solution["model_scale_temperature_error"])
    scale = np.array(solution["scale"])
    for axis, value in zip(AXES, scale, strict=True):
        if abs(value - 1.0) > 0.2 and value > 0.0:
            remarks.append(f"The scale of {axis} is {value:.3f}: no data sheet allows that; check unit and range.")
    elements = 9 if cost == "vector" else 6 if "acc.misalignment" in effects else 3
    remarks += _entangled(solution["correlation"], elements)
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
        before=rms(np.linalg.norm(readings, axis=1) - gravity),
        after=rms(lengths - gravity),
        held_out=rms(solution["held_out_length"] - gravity),
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
        f"Scale and bias of {axis} are hardly separated here (correlation {share:+.2f}): add poses with {axis} "
        "up and down."
        for axis, share in zip(AXES, shares, strict=True)
        if abs(share) > ENTANGLED
    ]
