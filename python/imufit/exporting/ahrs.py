"""Python for the package ahrs, whose filters take m/s^2, rad/s and mT."""

from __future__ import annotations

from imufit.exporting.affine import Affine
from imufit.exporting.python_text import array, head


def ahrs(model: Affine) -> str:
    """Write the text.

    Parameters
    ----------
    model : Affine
        Gain and offset of each sensor.
    """
    lines = [
        head(
            model,
            "",
            "Use: ahrs.filters.Mahony(**correct(acc, gyr, mag), frequency=100.0).Q",
            "ahrs reads an accelerometer as imufit does: at rest it points up. Mahony's attitude then turns body",
            "vectors into a frame with z up and y to magnetic north. Leave out rows with NaN beforehand.",
        ),
        "import numpy as np",
        "",
    ]
    for sensor in model.sensors.values():
        lines += [f"{sensor.name}_matrix = {array(sensor.matrix)}", f"{sensor.name}_offset = {array(sensor.offset)}"]
    return "\n".join(lines) + FUNCTION


FUNCTION = '''


def correct(acc, gyr, mag=None):
    """Corrected arrays by the names of ahrs' arguments.

    acc (n, 3) in m/s^2, gyr (n, 3) in rad/s and mag (n, 3) in uT; the field comes out in mT, the unit of ahrs.
    """
    corrected = {
        "acc": np.asarray(acc, dtype=float) @ acc_matrix.T + acc_offset,
        "gyr": np.asarray(gyr, dtype=float) @ gyr_matrix.T + gyr_offset,
    }
    if mag is not None:
        corrected["mag"] = (np.asarray(mag, dtype=float) @ mag_matrix.T + mag_offset) / 1000.0
    return corrected
'''
