"""A sketch for Arduino."""

from __future__ import annotations

import numpy as np

from imufit.exporting.affine import Affine, SensorAffine
from imufit.exporting.c_header import c_matrix, c_vector
from imufit.log.columns import SENSOR_NAMES

GRAVITY = 9.80665
"""The g in which makers give accelerations, m/s^2."""


def arduino(model: Affine) -> str:
    """Write the sketch.

    Parameters
    ----------
    model : Affine
        Gain and offset of each sensor.
    """
    remarks = "\n".join(f"// {line}" for line in model.remarks())
    parts = "\n".join(_sensor(sensor) for sensor in model.sensors.values())
    return f"""{remarks}
//
// Paste this above setup(). After reading the sensor, in loop():
//   float acc[3] = {{ax, ay, az}};  // m/s^2: readings in g times 9.80665
//   float gyr[3] = {{gx, gy, gz}};  // rad/s: readings in deg/s times 0.01745329
//   float mag[3] = {{mx, my, mz}};  // uT: readings in gauss times 100
//   imufitCorrect(acc, gyr, mag);

{parts}
void imufitApply(const float matrix[3][3], const float offset[3], float v[3]) {{
  const float x = v[0], y = v[1], z = v[2];
  for (int i = 0; i < 3; i++) {{
    v[i] = matrix[i][0] * x + matrix[i][1] * y + matrix[i][2] * z + offset[i];
  }}
}}

// Corrects in place: acc in m/s^2, gyr in rad/s, mag in uT.
void imufitCorrect(float acc[3], float gyr[3], float mag[3]) {{
  imufitApply(IMUFIT_ACC_MATRIX, IMUFIT_ACC_OFFSET, acc);
  imufitApply(IMUFIT_GYR_MATRIX, IMUFIT_GYR_OFFSET, gyr);
  imufitApply(IMUFIT_MAG_MATRIX, IMUFIT_MAG_OFFSET, mag);
}}
"""


def _sensor(sensor: SensorAffine) -> str:
    upper = sensor.name.upper()
    said = sensor.parameters or ("nothing in the model: readings pass as they are",)
    comment = "\n".join(f"// {line}" for line in (f"{SENSOR_NAMES[sensor.name]}, {sensor.unit}", *said))
    shown = {"acc": (1.0 / GRAVITY, "g"), "gyr": (180.0 / np.pi, "deg/s"), "mag": (0.01, "gauss")}
    factor, unit = shown[sensor.name]
    offsets = ", ".join(f"{value:.6g}" for value in factor * sensor.offset)
    return f"""{comment}
// the offset in {unit}: {offsets}
const float IMUFIT_{upper}_MATRIX[3][3] = {c_matrix(sensor.matrix)};
const float IMUFIT_{upper}_OFFSET[3] = {c_vector(sensor.offset)};
"""
