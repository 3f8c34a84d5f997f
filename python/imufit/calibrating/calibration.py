"""The result of a calibration: a sensor model, the residual of each pose, and a verdict in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.figures import quantity
from imufit.log.columns import SENSOR_NAMES
from imufit.loop import SensorModel
from imufit.rests.poses import Pose
from imufit.results.json_value import json_value
from imufit.results.parameter import by_effect, parameter_frame, parameter_table, stands_out
from imufit.results.part import Part
from imufit.results.result import Result
from imufit.results.table import Table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from imufit.figures.place import Place
    from imufit.log import Log

Array = NDArray[np.float64]


AXES = ("x", "y", "z")
_OFF_DIAGONAL = {row + column: (i, j) for i, row in enumerate(AXES) for j, column in enumerate(AXES) if i != j}


def rms(values: Array) -> float:
    """Return the root mean square of the numbers among the values; NaN without any.

    Parameters
    ----------
    values : ndarray
        Of any shape; NaN is left out.
    """
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(np.square(known)))) if known.size else float("nan")


def named(values: Sequence[float] | Array) -> dict[str, float]:
    """Return three numbers by their axis.

    Parameters
    ----------
    values : sequence of float
        x, y, z.
    """
    return {axis: float(value) for axis, value in zip(AXES, values, strict=True)}


def off_diagonal(matrix: Array) -> dict[str, float]:
    """Return the elements of a misalignment by row and column.

    Parameters
    ----------
    matrix : (3, 3) array
        Its diagonal is left out.
    """
    return {name: float(matrix[place]) for name, place in _OFF_DIAGONAL.items()}


@dataclass(frozen=True, repr=False)
class SensorCalibration(Part):
    """The correction of one sensor, ``corrected = C K reading + b`` (paper A, eq. 2).

    Attributes
    ----------
    sensor : str
        ``acc``, ``gyr`` or ``mag``.
    cost : str
        ``vector``, ``magnitude``, ``turns`` (gyro against gravity) or ``rest`` (gyro bias alone).
    misalignment : (3, 3) array
        C, ones on the diagonal.
    scale : (3,) array
        The diagonal of K.
    bias : (3,) array
        b, in `unit`.
    misalignment_error, scale_error, bias_error : array
        Standard errors.
    unit : str
        SI unit of the readings.
    before, after, held_out : float
        Root mean square of what should be zero, in `error_unit`: the length of the corrected reading less gravity's or
        the field's; for a gyro the angle by which a turn misses. `held_out` is on what the fit did not see; NaN where
        there is too little to leave anything out.
    error_unit : str
        Unit of these three.
    residuals : (k,) array
        The same for each pose, turn or group of readings, after the fit.
    condition : float
        Condition number of the design matrix, its columns scaled to unit length.
    correlation : (p, p) array
        Correlation of the parameters: A row by row (or its free elements), b, and further ones.
    excess : float
        Standard deviation beyond the noise that the residual shows: placement of the poses, variation of the field.
    items : int
        Poses, turns or readings that took part.
    effects : mapping
        Parameters of the sensor model by effect and name, SI.
    standard_errors : mapping
        In the same shape.
    remarks : tuple of str
        What is to be known about the result.
    extras : mapping
        Further results by name, such as ``table_tilt``, ``dip`` (rad), ``field`` (uT).
    """

    sensor: str
    cost: str
    misalignment: Array
    scale: Array
    bias: Array
    misalignment_error: Array
    scale_error: Array
    bias_error: Array
    unit: str
    before: float
    after: float
    held_out: float
    error_unit: str
    residuals: Array
    condition: float
    correlation: Array
    excess: float
    items: int
    effects: dict[str, dict[str, float]]
    standard_errors: dict[str, dict[str, float]]
    remarks: tuple[str, ...] = ()
    extras: dict[str, Any] = field(default_factory=dict)

    @property
    def matrix(self) -> Array:
        """A = C K, (3, 3)."""
        return self.misalignment * self.scale

    def correct(self, reading: Array, warmth: float = 0.0) -> Array:
        """Correct readings (n, 3) or (3,).

        Parameters
        ----------
        reading : ndarray
            In `unit`, body frame.
        warmth : float
            Temperature less the calibration's mean, K.
        """
        if warmth == 0.0:
            return np.asarray(reading @ self.matrix.T + self.bias, dtype=np.float64)
        gain = np.linalg.inv(self.matrix)
        bias = -gain @ self.bias
        gain = gain + warmth * np.diag(self._slopes("scale_temperature"))
        bias = bias + warmth * self._slopes("bias_temperature")
        return np.asarray((reading - bias) @ np.linalg.inv(gain).T, dtype=np.float64)

    def _slopes(self, name: str) -> Array:
        values = self.effects.get(f"{self.sensor}.{name}", {})
        return np.array([values.get(axis, 0.0) for axis in "xyz"])

    def to_dict(self) -> dict[str, Any]:
        """JSON of one sensor: paper A's form, errors, before and after."""
        return dict(
            json_value(
                {
                    "cost": self.cost,
                    "scale": self.scale,
                    "misalignment": self.misalignment,
                    "bias": self.bias,
                    "unit": self.unit,
                    "standard_errors": {
                        "scale": self.scale_error,
                        "misalignment": self.misalignment_error,
                        "bias": self.bias_error,
                    },
                    "error": {
                        "before": self.before,
                        "after": self.after,
                        "held_out": self.held_out,
                        "unit": self.error_unit,
                    },
                    "items": self.items,
                    "condition": self.condition,
                    "correlation": self.correlation,
                    "excess": self.excess,
                    "remarks": self.remarks,
                    **self.extras,
                }
            )
        )

    def sentence(self) -> str:
        """Before, after and held out in one line."""
        what = {
            "acc": "|f| at rest less g",
            "gyr": "angle missed after a turn",
            "mag": "|m| less the field",
        }[self.sensor]
        if self.extras.get("from_motion"):
            what = "|f| less g in motion"
        name = SENSOR_NAMES[self.sensor]
        if not np.isfinite(self.before):
            return f"{name}: bias from {self.items} rest{'s' if self.items != 1 else ''}."
        shown = [quantity.quantity(value, self.error_unit) for value in (self.before, self.after, self.held_out)]
        left_out = (
            f"{shown[2]} on what the fit did not see" if np.isfinite(self.held_out) else "nothing could be left out"
        )
        sentence = f"{name}: {what} {shown[0]} before, {shown[1]} after, {left_out} (RMS)."
        return sentence if self.lowers_error else f"{sentence} The calibration does not lower this error."

    @property
    def lowers_error(self) -> bool:
        """Whether the error is lower with it, where possible on what the fit did not see; true where none is known."""
        unseen = self.held_out if np.isfinite(self.held_out) else self.after
        return not np.isfinite(self.before) or unseen < self.before

    @property
    def shows_error(self) -> bool:
        """Whether a parameter lies so far from that of an ideal sensor that chance does not account for it."""
        return any(
            stands_out(value, self.standard_errors[effect][name])
            for effect, values in self.effects.items()
            for name, value in values.items()
        )


@dataclass(frozen=True, repr=False)
class Calibration(Result):
    """A calibrated sensor.

    Attributes
    ----------
    poses : tuple of Pose
        All poses of all logs, also those left out, with the reason.
    sensors : dict of str to SensorCalibration
        By ``acc``, ``gyr``, ``mag``: those that could be calibrated.
    model : SensorModel
        The same as effects, as the loop uses them.
    notes : tuple of str
        Left-out data and parameters that were not determined.
    gravity : float
        m/s^2.
    """

    poses: tuple[Pose, ...]
    sensors: dict[str, SensorCalibration]
    model: SensorModel
    notes: tuple[str, ...]
    gravity: float

    @property
    def verdict(self) -> str:
        """The verdict on the calibration, in words."""
        lines = [sensor.sentence() for sensor in self.sensors.values()]
        lines += [remark for sensor in self.sensors.values() for remark in sensor.remarks]
        return " ".join([*lines, *self.notes])

    @property
    def used(self) -> tuple[Pose, ...]:
        """The poses that took part."""
        return tuple(pose for pose in self.poses if pose.used)

    def apply(self, log: Log) -> Log:
        """Return a log with corrected readings.

        Parameters
        ----------
        log : Log
            Of the same sensor.
        """
        return self.model.apply(log)

    def save(self, path: str | Path) -> None:
        """Write the sensor model as a TOML file.

        Parameters
        ----------
        path : str or Path
            The file; one that exists is replaced.
        """
        self.model.save(path)

    def to_dict(self) -> dict[str, Any]:
        """JSON: the accelerometer's correction at the top, all sensors below ``sensors``, the poses, the verdict."""
        acc = self.sensors.get("acc")
        top = None if acc is None else acc.to_dict()
        keys = ("cost", "scale", "misalignment", "bias", "unit", "standard_errors", "condition")
        residuals = self._residuals()
        return {
            **{key: None if top is None else top[key] for key in keys},
            "poses": [
                {
                    "label": pose.name,
                    "log": pose.log,
                    "t_start": pose.t_start,
                    "t_end": pose.t_end,
                    "n": pose.n,
                    "residual": json_value(residuals.get(pose.number)),
                    "used": pose.used,
                    "reason": pose.reason,
                }
                for pose in self.poses
            ],
            "rest_norm_error": None
            if acc is None
            else json_value({"before": acc.before, "after": acc.after, "held_out": acc.held_out}),
            "sensors": {name: sensor.to_dict() for name, sensor in self.sensors.items()},
            "model": list(self.model.effects),
            "parameters": by_effect(self.model.listed()),
            "verdict": self.verdict,
        }

    def _residuals(self) -> dict[int, float]:
        """Return the accelerometer's residuals by the number of the pose; none where it was fitted in motion."""
        acc = self.sensors.get("acc")
        values = [] if acc is None else acc.residuals.tolist()
        return {pose.number: value for pose, value in zip(self.used, values, strict=False)}

    def pose_table(self) -> Table:
        """List the poses with their readings and residuals."""
        residuals = self._residuals()
        rows = tuple(
            (
                str(pose.number),
                pose.shown,
                f"{pose.t_start:.1f} to {pose.t_end:.1f} s",
                str(pose.n),
                f"{np.linalg.norm(pose.mean):.4f}",
                f"{residuals[pose.number]:.4f}" if pose.number in residuals else "-",
                pose.reason or (f"{len(pose.knocks)} knocks left out" if pose.knocks else ""),
            )
            for pose in self.poses
        )
        header = (">pose", "up", "time", ">readings", ">|f| (m/s²)", ">residual (m/s²)", "remark")
        return Table("Poses", header, rows)

    def correction_table(self) -> Table:
        """List scale, misalignment and bias in paper A's form."""
        rows = []
        for name, sensor in self.sensors.items():
            for i, axis in enumerate("xyz"):
                rows.append(
                    (
                        f"{name}_{axis}",
                        f"{sensor.scale[i]:.5f} ± {sensor.scale_error[i]:.5f}"
                        if sensor.scale_error[i] > 0.0
                        else "not determined",
                        "  ".join(
                            f"{'xyz'[j]} {sensor.misalignment[i, j]:+.5f} ± {sensor.misalignment_error[i, j]:.5f}"
                            for j in range(3)
                            if j != i and sensor.misalignment_error[i, j] > 0.0
                        )
                        or "not determined",
                        quantity.with_error(float(sensor.bias[i]), float(sensor.bias_error[i]), sensor.unit),
                    )
                )
        return Table("Corrected = C K reading + b", ("axis", "K: scale", "C: misalignment", "b"), tuple(rows))

    def tables(self) -> list[Table]:
        """Poses, correction, sensor model."""
        listed = parameter_table(self.model.listed(), "The same as effects of the sensor model")
        return [self.pose_table(), self.correction_table(), listed]

    def to_dataframe(self) -> pd.DataFrame:
        """One row per parameter of the sensor model."""
        return parameter_frame(self.model.listed())

    @overload
    def plot(self, logs: Log | list[Log] | None = None, *, ax: None = None) -> Figure: ...

    @overload
    def plot(self, logs: Log | list[Log] | None = None, *, ax: Place) -> Axes | list[Axes]: ...

    def plot(self, logs: Log | list[Log] | None = None, *, ax: Place | None = None) -> Figure | Axes | list[Axes]:
        """Draw the poses: readings with the poses found, and the error of each pose before and after.

        Parameters
        ----------
        logs : Log or list of Log, optional
            The logs, to draw the readings too.
        ax : Axes, sequence of Axes, Figure or SubFigure, optional
            As for the ``plot`` of any result.

        Returns
        -------
        Figure, Axes or list of Axes
            A new figure, which shows itself in a notebook; with `ax` the Axes that were drawn on.

        Raises
        ------
        InputError
            There is nothing to draw.
        """
        from imufit.figures.calibration import calibration_figure  # noqa: PLC0415

        if not self.poses and "mag" not in self.sensors:
            raise InputError("the calibration has no poses to draw")
        given = [] if logs is None else [logs] if not isinstance(logs, list) else logs
        return calibration_figure(
            [(log.t, log.acc, log.mag) for log in given],
            [
                (
                    pose.log,
                    pose.t_start,
                    pose.t_end,
                    pose.shown,
                    pose.used,
                    pose.reason,
                    float(np.linalg.norm(pose.mean)),
                )
                for pose in self.poses
            ],
            {name: (sensor.matrix, sensor.bias) for name, sensor in self.sensors.items()},
            [] if "acc" not in self.sensors else self.sensors["acc"].residuals.tolist(),
            self.gravity,
            float(self.sensors["mag"].extras["field"]) if "mag" in self.sensors else None,
            ax,
        ).result

    def sentences(self) -> list[str]:
        """Return the result as text, the answer first."""
        return [self.verdict]
