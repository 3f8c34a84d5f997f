"""JSON."""

from __future__ import annotations

import json
from math import isfinite

from imufit.exporting.affine import Affine


def json_text(model: Affine) -> str:
    """Write matrices, offsets and standard errors; corrected = misalignment diag(scale) raw + bias = matrix raw + bias.

    Parameters
    ----------
    model : Affine
        Gain and offset of each sensor.
    """
    sensors = {
        name: {
            "unit": sensor.unit,
            "matrix": sensor.matrix.tolist(),
            "bias": sensor.offset.tolist(),
            "scale": sensor.scale.tolist(),
            "misalignment": sensor.misalignment.tolist(),
        }
        for name, sensor in model.sensors.items()
    }
    value = {
        "form": "corrected = misalignment diag(scale) raw + bias = matrix raw + bias",
        "sensors": sensors,
        "standard_errors": {
            effect: {name: value if isfinite(value) else None for name, value in errors.items()}
            for effect, errors in model.standard_errors.items()
        },
        "temperature": list(model.on_temperature),
        "not_exported": list(model.left_out),
    }
    return json.dumps(value, indent=2, allow_nan=False) + "\n"
