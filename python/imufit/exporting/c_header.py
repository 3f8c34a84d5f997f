"""A C99 header."""

from __future__ import annotations

import numpy as np

from imufit.exporting.affine import Affine, Array, SensorAffine
from imufit.log.columns import SENSOR_NAMES


def c_float(value: float) -> str:
    """Return a number as a C literal of type float."""
    text = f"{np.float32(value):.9g}"
    return f"{text}f" if "." in text or "e" in text else f"{text}.0f"


def c_matrix(matrix: Array) -> str:
    """Return a (3, 3) matrix as a C initialiser."""
    rows = [", ".join(c_float(value) for value in row) for row in matrix]
    return "{\n" + ",\n".join(f"    {{{row}}}" for row in rows) + "}"


def c_vector(vector: Array) -> str:
    """Return a (3,) vector as a C initialiser."""
    return "{" + ", ".join(c_float(value) for value in vector) + "}"


def c_header(model: Affine) -> str:
    """Write the header.

    Parameters
    ----------
    model : Affine
        Gain and offset of each sensor.
    """
    remarks = "\n".join(f" * {line}" for line in model.remarks())
    parts = [_sensor(sensor) for sensor in model.sensors.values()]
    return (
        f"/*\n{remarks}\n */\n#ifndef IMUFIT_CALIBRATION_H\n#define IMUFIT_CALIBRATION_H\n\n"
        + "\n".join(parts)
        + "\n#endif\n"
    )


def _sensor(sensor: SensorAffine) -> str:
    name = sensor.name
    said = sensor.parameters or ("nothing in the model: readings pass as they are",)
    comment = "\n".join(f" * {line}" for line in (f"{SENSOR_NAMES[name]}, {sensor.unit}", *said))
    terms = [
        " + ".join(f"imufit_{name}_matrix[{i}][{j}] * {axis}" for j, axis in enumerate("xyz"))
        + f" + imufit_{name}_offset[{i}]"
        for i in range(3)
    ]
    lines = "\n".join(f"    corrected[{i}] = {term};" for i, term in enumerate(terms))
    return f"""/*
{comment}
 */
static const float imufit_{name}_matrix[3][3] = {c_matrix(sensor.matrix)};
static const float imufit_{name}_offset[3] = {c_vector(sensor.offset)};

/* raw and corrected in {sensor.unit}; they may be the same array. */
static inline void imufit_correct_{name}(const float raw[3], float corrected[3])
{{
    const float x = raw[0], y = raw[1], z = raw[2];
{lines}
}}
"""
