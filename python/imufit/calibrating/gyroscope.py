"""Gyroscope: bias at rest; scale and misalignment by turning it between rests, against gravity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.calibrating.calibration import AXES, SensorCalibration, named, off_diagonal, rms
from imufit.calibrating.temperature import ENOUGH
from imufit.rests.poses import UP, Pose
from imufit.rests.turns import Turns

if TYPE_CHECKING:
    from imufit._imufit import _Span

Array = NDArray[np.float64]

LEAST_WAY = np.radians(20.0)
"""Turns shorter than this (rad) are less informative than the rests' own noise."""
TOLD = 0.03
"""Standard error of A's elements beyond which the turns did not determine them."""


def fit_gyroscope(turns: Sequence[Turns], poses: Sequence[Pose]) -> SensorCalibration | None:
    """Calibrate the gyro: bias from the rests, scale and misalignment from the turns where they determine both.

    Parameters
    ----------
    turns : sequence of Turns
        One for each log.
    poses : sequence of Pose
        Usable poses of all logs.

    Returns
    -------
    SensorCalibration or None
        None without a gyro reading at rest.
    """
    rests = [pose for pose in poses if pose.rate is not None]
    if not rests:
        return None
    bias, bias_error, slope = _bias(rests)
    remarks = [text for turn in turns for text in turn.left_out]
    t, gyr, spans = _joined(turns)
    told = None
    if spans:
        trial = _imufit.turn_calibration(t, gyr, spans, bias)
        far = [span for span, way in zip(spans, trial["way"], strict=True) if way > LEAST_WAY]
        if len(far) >= 3:
            told = _imufit.turn_calibration(t, gyr, far, bias)
    effects: dict[str, dict[str, float]] = {"gyr.bias": named(bias)}
    errors: dict[str, dict[str, float]] = {"gyr.bias": named(bias_error)}
    if slope is not None:
        effects["gyr.bias_temperature"] = named(slope[0])
        errors["gyr.bias_temperature"] = named(slope[1])
    nothing = np.zeros((3, 3))
    if told is None:
        remarks.append("Fewer than three turns between rests: the gyro's scale and misalignment stay unchanged.")
        return SensorCalibration(
            "gyr", "rest", np.eye(3), np.ones(3), -bias, nothing, np.zeros(3), bias_error, "rad/s",
            np.nan, np.nan, np.nan, "rad", np.zeros(0), 1.0, np.eye(3), 0.0, len(rests), effects, errors,
            tuple(remarks),
        )  # fmt: skip
    gain, gain_error = np.array(told["model_gain"]), np.array(told["model_gain_error"])
    unsure = [AXES[i] for i in range(3) if gain_error[i, i] > TOLD]
    open_elements = gain_error > TOLD
    # A parameter that the turns leave open keeps its nominal value: a guess must not get into the model.
    gain[open_elements], gain_error[open_elements] = 0.0, 0.0
    matrix = np.linalg.inv(np.eye(3) + gain)
    scale = np.diag(matrix)
    misalignment_error = np.array(told["misalignment_error"])
    misalignment_error[open_elements] = 0.0
    scale_error = np.where(np.diag(open_elements), 0.0, told["scale_error"])
    loose = [name for name, left_open in off_diagonal(open_elements.astype(np.float64)).items() if left_open]
    if unsure:
        remarks.append(
            f"The turns do not determine the gyro's scale of {', '.join(unsure)}: turn it about that axis while "
            "the axis is level."
        )
    if loose:
        remarks.append(f"The turns do not determine the gyro's misalignment {' '.join(loose)}.")
    remarks += [f"Negative scale: gyro axis {AXES[i]} is flipped." for i in range(3) if scale[i] < 0.0]
    held_out = rms(told["held_out"][:, 0])
    bias_alone, after = rms(told["before"]), rms(told["residuals"][:, 0])
    worse = held_out > bias_alone
    if told["freedom"] < 1.0:
        remarks.append(f"{len(told['before'])} turns are just enough: the gyro's calibration cannot be checked.")
    if worse:
        remarks.append("The turns do not support a scale or misalignment of the gyro: only its bias is kept.")
    else:
        effects["gyr.scale"] = named(np.diag(gain))
        errors["gyr.scale"] = named(np.diag(gain_error))
        effects["gyr.misalignment"] = off_diagonal(gain)
        errors["gyr.misalignment"] = off_diagonal(gain_error)
    return SensorCalibration(
        sensor="gyr",
        cost="rest" if worse else "turns",
        misalignment=np.eye(3) if worse else matrix / scale,
        scale=np.ones(3) if worse else scale,
        bias=-bias if worse else -matrix @ bias,
        misalignment_error=nothing if worse else misalignment_error,
        scale_error=np.zeros(3) if worse else scale_error,
        bias_error=bias_error,
        unit="rad/s",
        before=rms(told["as_read"]),
        after=bias_alone if worse else after,
        held_out=bias_alone if worse else held_out,
        error_unit="rad",
        residuals=told["before"] if worse else told["residuals"][:, 0],
        condition=told["condition"],
        correlation=told["correlation"],
        excess=told["excess"],
        items=len(told["before"]),
        effects=effects,
        standard_errors=errors,
        remarks=tuple(remarks),
        extras={"rests": len(rests)},
    )


def _joined(turns: Sequence[Turns]) -> tuple[Array, Array, list[_Span]]:
    """Rows of all logs one after the other, and their turns with rows counted on."""
    spans: list[_Span] = []
    rows = 0
    for turn in turns:
        spans += [(s[0] + rows, s[1] + rows, *s[2:]) for s in turn.spans if s is not None]
        rows += turn.log.n
    t = np.concatenate([turn.log.t for turn in turns]) if turns else np.zeros(0)
    gyr = np.concatenate([turn.log.gyr for turn in turns if turn.log.gyr is not None]) if turns else np.zeros((0, 3))
    return np.ascontiguousarray(t), np.ascontiguousarray(gyr), spans


def _bias(rests: Sequence[Pose]) -> tuple[Array, Array, tuple[Array, Array] | None]:
    """Mean rate at rest and its error; slope against temperature and its error where that stands out."""
    rates = np.array([pose.rate for pose in rests])
    variances = np.array([pose.rate_variance for pose in rests])
    temperature = np.array([pose.temperature for pose in rests])
    count = len(rests)
    # Rests weigh by their noise and by the random walk of the bias from rest to rest.
    wander = np.zeros(3)
    if count > 2:
        wander = np.maximum(np.var(rates, axis=0, ddof=1) - variances.mean(axis=0), 0.0)
    weights = 1.0 / np.maximum(variances + wander, 1e-30)
    bias = np.sum(weights * rates, axis=0) / np.sum(weights, axis=0)
    error = 1.0 / np.sqrt(np.sum(weights, axis=0))
    if count < 5 or np.any(np.isnan(temperature)) or float(np.ptp(temperature)) < ENOUGH:
        return bias, error, None
    warmth = temperature - temperature.mean()
    slope, slope_error = np.zeros(3), np.zeros(3)
    for axis in range(3):
        fit, covariance = np.polyfit(warmth, rates[:, axis], 1, cov=True)
        slope[axis], slope_error[axis] = fit[0], np.sqrt(covariance[0, 0])
    if not np.any(np.abs(slope) > 4.0 * slope_error):
        return bias, error, None
    return rates.mean(axis=0), error, (slope, slope_error)


def table_attitudes(turns: Turns, poses: Sequence[Pose], matrix: Array) -> Array | None:
    """Attitudes (n, 3, 3), body to table, of poses whose headings follow from the turns between them; None else.

    Parameters
    ----------
    turns : Turns
        Of the one log that the poses are from.
    poses : sequence of Pose
        In the order of time.
    matrix : (3, 3) array
        The gyro's correction A.
    """
    if turns.log.gyr is None or any(span is None for span in turns.spans):
        return None
    ups = np.array([UP[pose.name] for pose in poses])
    found = _imufit.table_attitudes(turns.log.t, turns.log.gyr, list(turns.spans), ups, matrix.tolist())
    return None if found is None else found.reshape(-1, 3, 3)
