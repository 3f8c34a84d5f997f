"""One function, and the list of forms."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from imufit.errors import InputError
from imufit.exporting.affine import Affine, affine
from imufit.exporting.ahrs import ahrs
from imufit.exporting.arduino import arduino
from imufit.exporting.c_header import c_header
from imufit.exporting.imufusion import imufusion
from imufit.exporting.json_text import json_text
from imufit.loop import SensorModel

FORMS: Mapping[str, Callable[[Affine], str]] = {
    "c-header": c_header,
    "arduino": arduino,
    "imufusion": imufusion,
    "ahrs": ahrs,
    "json": json_text,
}
"""The writer of each form."""


def export(model: SensorModel, form: str) -> str:
    """Write the constant part of a model, gain and offset of each sensor, for use elsewhere.

    Parameters
    ----------
    model : SensorModel
        Of its effects bias, scale, misalignment, hard and soft iron are exported. Their drift with temperature is
        exported at the reference temperature, the coefficients as comments; other effects are named as left out.
    form : str
        One of ``c-header``, ``arduino``, ``imufusion``, ``ahrs``, ``json``.

    Returns
    -------
    str
        Text of the file.

    Raises
    ------
    InputError
        The form is unknown, nothing is to be exported, or a gain cannot be inverted.
    """
    if form not in FORMS:
        raise InputError(f"the form {form!r} is unknown", remedy=f"Use one of {', '.join(FORMS)}.")
    return FORMS[form](affine(model))
