"""Gain and offset of each sensor of a model: corrected = A raw + b, with A = C diag(K).

The model states raw = (I + E) x + bias, hence A = (I + E)^-1 and b = -A bias.
C has ones on its diagonal, K is the diagonal of A.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.errors import InputError
from imufit.loop import SensorModel
from imufit.model.catalogue import effects

Array = NDArray[np.float64]

UNITS = {"acc": "m/s^2", "gyr": "rad/s", "mag": "uT"}


@dataclass(frozen=True)
class SensorAffine:
    """Gain and offset of one sensor.

    Attributes
    ----------
    name : str
        ``acc``, ``gyr`` or ``mag``.
    matrix : ndarray
        (3, 3) A.
    bias : ndarray
        (3,) what the sensor reads too much, in its unit: corrected = A (raw - bias).
    parameters : tuple of str
        Lines that say which parameters of the model these are, with standard errors where there are some.
    """

    name: str
    matrix: Array
    bias: Array
    parameters: tuple[str, ...]

    @property
    def unit(self) -> str:
        """SI unit of the readings."""
        return UNITS[self.name]

    @property
    def offset(self) -> Array:
        """(3,) b, in the sensor's unit."""
        return -self.matrix @ self.bias

    @property
    def scale(self) -> Array:
        """(3,) K; ones where an axis of A has no part in its own reading, so that the form does not exist."""
        diagonal = np.diag(self.matrix)
        return diagonal.copy() if np.all(diagonal != 0.0) else np.ones(3)

    @property
    def misalignment(self) -> Array:
        """(3, 3) C, so that A = C diag(K)."""
        return np.asarray(self.matrix / self.scale)


@dataclass(frozen=True)
class Affine:
    """Gain and offset of all three sensors, and what a reader has to know besides.

    Attributes
    ----------
    sensors : dict of str to SensorAffine
        ``acc``, ``gyr``, ``mag``; identity without such effects in the model.
    on_temperature : tuple of str
        Lines on the drift with temperature, which is left out.
    left_out : tuple of str
        Ids of effects that are not a constant gain or offset.
    standard_errors : dict
        By effect and parameter, SI units.
    """

    sensors: dict[str, SensorAffine]
    on_temperature: tuple[str, ...]
    left_out: tuple[str, ...]
    standard_errors: dict[str, dict[str, float]]

    def remarks(self) -> list[str]:
        """Lines for the head of a file."""
        lines = ["corrected = A raw + b for each sensor, from the sensor model of imufit."]
        lines += self.on_temperature
        if self.left_out:
            lines.append(f"Not exported, since they are not a constant gain or offset: {', '.join(self.left_out)}.")
        # The id of a column's effect is whatever the column is called: it must not end the comment it stands in.
        return [" ".join(line.replace("*/", "* /").split()) for line in lines]


def affine(model: SensorModel) -> Affine:
    """Take gain and offset out of a model.

    Parameters
    ----------
    model : SensorModel
        With at least one effect that is a gain or an offset.

    Raises
    ------
    InputError
        There is none, or a gain has no inverse.
    """
    if not any(_is_constant(effect) or _is_on_temperature(effect) for effect, _ in model.stack()):
        known = [effect for effect in effects().values() if _is_constant(effect)]
        named = ", ".join(effect.id for effect in sorted(known, key=lambda effect: effect.affine != "offset"))
        raise InputError(
            "the model has no constant gain or offset to export", remedy=f"One of these is needed: {named}."
        )
    left_out = tuple(e.id for e, _ in model.stack() if not (_is_constant(e) or _is_on_temperature(e)))
    errors = {e: v for e, v in model.standard_errors.items() if e not in left_out}
    return Affine({name: _sensor(model, name) for name in UNITS}, tuple(_on_temperature(model)), left_out, errors)


def _is_constant(effect: _imufit.Effect) -> bool:
    return effect.affine is not None and effect.column is None


def _is_on_temperature(effect: _imufit.Effect) -> bool:
    return effect.affine is not None and effect.column == "temp"


def _sensor(model: SensorModel, name: str) -> SensorAffine:
    gain, bias = np.eye(3), np.zeros(3)
    of_sensor = [effect for effect, _ in model.stack() if _is_constant(effect) and effect.sensors == [name]]
    gains = [effect.id for effect in of_sensor if effect.affine != "offset"]
    for effect in gains:
        for element, value in model.parameters[effect].items():
            # Scale names its elements x, y, z; matrices xx, xy, ...
            gain["xyz".index(element[0]), "xyz".index(element[-1])] += value
    for offset in (effect.id for effect in of_sensor if effect.affine == "offset"):
        bias += [model.parameters[offset][axis] for axis in "xyz"]
    if abs(np.linalg.det(gain)) <= 1e-9 * np.abs(gain).max() ** 3:
        raise InputError(f"{' and '.join(gains)} cannot be undone: the gain has no inverse", remedy="Check the model.")
    lines = [_line(model, effect.id) for effect in of_sensor]
    found = SensorAffine(name, np.asarray(np.linalg.inv(gain), dtype=np.float64), bias, tuple(lines))
    with np.errstate(over="ignore", invalid="ignore"):
        if not all(np.isfinite(part).all() for part in (found.offset, found.scale, found.misalignment)):
            named = " and ".join(effect.id for effect in of_sensor)
            raise InputError(f"{named} cannot be written as gain and offset: too large", remedy="Check the model.")
    return found


def _line(model: SensorModel, effect: str) -> str:
    """Parameters of an effect with their standard errors."""
    errors = model.standard_errors.get(effect, {})
    parts = []
    for parameter in model.listed():
        if parameter.effect == effect:
            error = errors.get(parameter.name)
            spread = "" if error is None else f" +- {error:.2g}"
            parts.append(f"{parameter.name} {parameter.value:.9g}{spread}")
            unit = parameter.unit
    return f"{effect}, {'without unit' if unit == '1' else unit}: {', '.join(parts)}"


def _on_temperature(model: SensorModel) -> list[str]:
    drifts = [effect.id for effect, _ in model.stack() if _is_on_temperature(effect)]
    if not drifts:
        return []
    mean = model.constants.get("temperature_mean")
    at = "the mean temperature of the fitted log" if mean is None else f"T_ref = {mean:.6g} degC"
    return [f"Holds at {at}; away from it the model adds, per K:", *(_line(model, drift) for drift in drifts)]
