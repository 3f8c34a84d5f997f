"""Python for imufusion, the Python package of xio's Fusion.

Its FusionModelInertial (FusionCalibrationInertial in older versions) states, in g and deg/s,
calibrated = misalignment diag(sensitivity) (uncalibrated - offset), and its FusionModelMagnetic
calibrated = soft_iron (uncalibrated - hard_iron).
"""

from __future__ import annotations

import numpy as np

from imufit.exporting.affine import Affine
from imufit.exporting.python_text import array, head

PER_UNIT = {"acc": 1.0 / 9.80665, "gyr": 180.0 / np.pi}
"""From SI units to the g and deg/s of imufusion."""


def imufusion(model: Affine) -> str:
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
            "Arrays are those of imufusion: acc in g (at rest up), gyr in deg/s, mag in uT.",
            "inertial: misalignment @ (sensitivity * (raw - offset)); magnetic: soft_iron @ (raw - hard_iron).",
        ),
        "import numpy as np",
        "",
    ]
    for name, factor in PER_UNIT.items():
        sensor = model.sensors[name]
        lines += [
            f"{name}_misalignment = {array(sensor.misalignment)}",
            f"{name}_sensitivity = {array(sensor.scale)}",
            f"{name}_offset = {array(factor * sensor.bias)}",
        ]
    mag = model.sensors["mag"]
    lines += [f"soft_iron_matrix = {array(mag.matrix)}", f"hard_iron_offset = {array(mag.bias)}"]
    return "\n".join(lines) + FUNCTIONS


FUNCTIONS = '''


def correct(acc, gyr, mag=None):
    """Corrected readings in g, deg/s and uT; each (3,) or (n, 3)."""
    acc = (acc_sensitivity * (np.asarray(acc) - acc_offset)) @ acc_misalignment.T
    gyr = (gyr_sensitivity * (np.asarray(gyr) - gyr_offset)) @ gyr_misalignment.T
    return acc, gyr, None if mag is None else (np.asarray(mag) - hard_iron_offset) @ soft_iron_matrix.T


def correct_with_imufusion(acc, gyr, mag):
    """The same for one sample (3,) each, by imufusion 1.3 itself."""
    import imufusion

    return (
        imufusion.model_inertial(acc, acc_misalignment, acc_sensitivity, acc_offset),
        imufusion.model_inertial(gyr, gyr_misalignment, gyr_sensitivity, gyr_offset),
        imufusion.model_magnetic(mag, soft_iron_matrix, hard_iron_offset),
    )
'''
