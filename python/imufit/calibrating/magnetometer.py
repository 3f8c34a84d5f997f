"""Magnetometer: hard and soft iron from free rotation, by the field's constant length and its constant dip."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.calibrating.calibration import AXES, SensorCalibration, named, rms
from imufit.errors import InputError

if TYPE_CHECKING:
    from imufit._imufit import _Solution
    from imufit.log import Log

Array = NDArray[np.float64]

GROUPS = 20
"""Stretches of time that are left out in turn."""
MOST = 6000
"""Readings beyond which nothing is learnt any more."""
NEW = 0.03
"""Share of the field by which a reading has to differ from the last one taken: dwelling must not weigh."""
QUIET = 0.05
"""The specific force points up where its length is gravity's within this share."""
_NINE = tuple(row + column for row in AXES for column in AXES)


def fit_magnetometer(logs: Sequence[Log], acc: SensorCalibration | None, gravity: float) -> SensorCalibration:
    """Calibrate the magnetometer on all logs together.

    Parameters
    ----------
    logs : sequence of Log
        With `mag`, turned through all attitudes far from iron.
    acc : SensorCalibration, optional
        Corrects the direction of gravity.
    gravity : float
        m/s^2.

    Raises
    ------
    InputError
        The magnetometer was not turned far enough.
    """
    readings, ups = _chosen(logs, acc, gravity)
    name = str(logs[0].path or "log")
    remedy = "Turn the sensor slowly through all attitudes, each side up and down, for a minute."
    found = _imufit.sphere(readings) if len(readings) >= 30 else None
    if found is None:
        raise InputError(
            f"the magnetometer was hardly turned: {len(readings)} of its readings differ",
            file=name,
            column="mag_x",
            remedy=remedy,
        )
    given = [log.metadata.mag_reference for log in logs if log.metadata.mag_reference is not None]
    radius = found[1]
    field = float(np.linalg.norm(given[0])) if given else radius
    groups = np.floor(np.arange(len(readings)) * GROUPS / len(readings))
    remarks = []
    if not given:
        remarks.append(
            f"The field's strength is not known (metadata mag_reference): lengths are scaled to their mean, "
            f"{field:.1f} µT, and the scale common to the three axes is not calibrated."
        )
    try:
        solution = _imufit.magnitude_calibration(readings, groups, field)
    except InputError as error:
        raise InputError(
            f"the magnetometer was not turned through enough attitudes ({error.problem})",
            file=name,
            column="mag_x",
            remedy=remedy,
        ) from None
    extras: dict[str, object] = {"field": field}
    quiet = ~np.isnan(ups[:, 0])
    if np.count_nonzero(quiet) >= 100:
        try:
            with_dip = _imufit.magnitude_calibration(readings, groups, field, up=ups)
        except InputError:
            remarks.append(
                "The dip could not be determined: the magnetometer's rotation against the accelerometer is open."
            )
        else:
            missed = {key: rms(fit["held_out"][:, 0]) for key, fit in (("length", solution), ("dip", with_dip))}
            # The dip may cost the length a little; much means that "up" was not up.
            if missed["dip"] < 1.15 * missed["length"]:
                solution = with_dip
                dip = np.arcsin(np.clip(-solution["extra"][0] / field, -1.0, 1.0))
                extras["dip"] = float(dip)
                extras["dip_error_deg"] = _dip_errors(readings[quiet], ups[quiet], solution)
                remarks.append(
                    f"The field dips by {np.degrees(dip):.1f} deg; the constant dip also determines the "
                    "mount of the magnetometer against the accelerometer."
                )
    gain, gain_error = np.array(solution["model_gain"]), np.array(solution["model_gain_error"])
    before = np.linalg.norm(readings, axis=1)
    expected = field if given else float(before.mean())
    held_out = solution["held_out_length"] - field
    bias_error = np.array(solution["bias_error"])
    if np.any(bias_error > 0.1 * field):
        remarks.append("Some attitudes are missing: the hard iron is uncertain by a tenth of the field or more.")
    return SensorCalibration(
        sensor="mag",
        cost="magnitude",
        misalignment=np.array(solution["misalignment"]),
        scale=np.array(solution["scale"]),
        bias=np.array(solution["bias"]),
        misalignment_error=np.array(solution["misalignment_error"]),
        scale_error=np.array(solution["scale_error"]),
        bias_error=bias_error,
        unit="uT",
        before=rms(before - expected),
        after=rms(solution["residuals"][:, 0]),
        held_out=rms(held_out),
        error_unit="uT",
        residuals=solution["residuals"][:, 0],
        condition=solution["condition"],
        correlation=solution["correlation"],
        excess=solution["excess"],
        items=len(readings),
        effects={
            "mag.hard_iron": named(solution["model_bias"]),
            "mag.soft_iron": dict(zip(_NINE, gain.ravel().tolist(), strict=True)),
        },
        standard_errors={
            "mag.hard_iron": named(solution["model_bias_error"]),
            "mag.soft_iron": dict(zip(_NINE, gain_error.ravel().tolist(), strict=True)),
        },
        remarks=tuple(remarks),
        extras=extras,
    )


def _chosen(logs: Sequence[Log], acc: SensorCalibration | None, gravity: float) -> tuple[Array, Array]:
    """Return readings (n, 3) that differ from the one before, and up (n, 3) beside them, NaN where it accelerates."""
    readings: list[Array] = []
    ups: list[Array] = []
    sampled = [(log, np.flatnonzero(~np.isnan(log.mag).any(axis=1))) for log in logs if log.mag is not None]
    # A log at rest has no size of its own: the sensor that was turned furthest decides what counts as new.
    size = max((_reach(log.mag[rows]) for log, rows in sampled if log.mag is not None and len(rows)), default=0.0)
    for log, rows in sampled:
        if log.mag is None or not len(rows):
            continue
        field = log.mag[rows]
        kept = _new(field, NEW * size)
        readings.append(field[kept])
        up = np.full((len(kept), 3), np.nan)
        if log.acc is not None:
            force = log.acc[rows[kept]]
            force = force if acc is None else acc.correct(force)
            length = np.linalg.norm(force, axis=1)
            quiet = np.abs(length - gravity) < QUIET * gravity
            up[quiet] = force[quiet] / length[quiet, None]
        ups.append(up)
    if not readings:
        return np.zeros((0, 3)), np.zeros((0, 3))
    stacked, up = np.concatenate(readings), np.concatenate(ups)
    stride = -(-len(stacked) // MOST)
    return np.ascontiguousarray(stacked[::stride]), np.ascontiguousarray(up[::stride])


def _reach(field: Array) -> float:
    """Return how far readings (n, 3) lie from their middle, as a rule."""
    return float(np.median(np.linalg.norm(field - np.median(field, axis=0), axis=1)))


def _new(field: Array, least: float) -> NDArray[np.intp]:
    """Rows whose reading differs from the last one taken by more than `least`."""
    kept = [0]
    last = field[0]
    for row in range(1, len(field)):
        d = field[row] - last
        if d @ d > least * least:
            kept.append(row)
            last = field[row]
    return np.array(kept)


def _dip_errors(readings: Array, ups: Array, solution: _Solution) -> dict[str, float]:
    """Return the standard deviation of the dip angle before and after, degrees."""
    matrix, bias = np.array(solution["matrix"]), np.array(solution["bias"])

    def spread(field: Array) -> float:
        sine = np.sum(field * ups, axis=1) / np.linalg.norm(field, axis=1)
        return float(np.degrees(np.std(np.arcsin(np.clip(sine, -1.0, 1.0)))))

    return {"before": spread(readings), "after": spread(readings @ matrix.T + bias)}
