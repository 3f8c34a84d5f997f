"""A sensor model taken out of live rows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log import Log
from imufit.log.columns import GROUPS
from imufit.remedy import command

if TYPE_CHECKING:
    from imufit.loop import SensorModel

Array = NDArray[np.float64]
Batch = dict[str, Array]

LACKING: Final = {
    "reference": "the reference attitude",
    "neighbours": "the rows around a row",
    "history": "all rows since the start",
}
"""Rows that live rows lack, by the reach of an effect that needs it."""


class LiveCorrection:
    """Takes a model's effects out of the readings of live rows.

    Parameters
    ----------
    model : SensorModel
        Its effects need nothing but the present row.

    Raises
    ------
    InputError
        An effect needs rows before or after, or a mean that the model does not hold.
    """

    def __init__(self, model: SensorModel) -> None:
        means = model.constants.get("covariate_means", {})
        self._warmth_known = "temperature_mean" in model.constants
        for effect, _ in model.stack():
            # Errors of the reference are not removed from readings; a mount turns each row by itself.
            if effect.reference_part is None and effect.reach != "row":
                raise InputError(
                    f"{effect.id} needs {LACKING[effect.reach]}, which live rows do not have",
                    remedy="Take a model without it here, or record and use "
                    + command("apply", "SensorModel.apply")
                    + ".",
                )
            if "temp" in effect.centred_columns and not self._warmth_known:
                raise InputError(
                    f"{effect.id} needs temperature_mean, which the model does not hold", remedy="Fit it anew."
                )
            for column in sorted({*effect.centred_columns} - {"temp", *means}):
                raise InputError(
                    f"{effect.id} needs the mean of {column}, which the model does not hold", remedy="Fit it anew."
                )
        self._model = model

    def __call__(self, batch: Batch) -> Batch:
        """Return the batch with corrected readings.

        Parameters
        ----------
        batch : dict of (n,) arrays
            `t` and the columns, SI units.
        """
        if not batch["t"].size:
            return batch
        rest = dict(batch)
        t = rest.pop("t")
        groups: dict[str, Any] = {
            name: np.stack([rest.pop(axis) for axis in GROUPS[name]], axis=1)
            for name in ("acc", "gyr", "mag")
            if all(axis in rest for axis in GROUPS[name])
        }
        # Without the mean of the fitted log a temperature would count from the mean of this batch.
        temp = rest.get("temp") if self._warmth_known else None
        log = Log.of_fields(t=t, temp=temp, covariates={k: v for k, v in rest.items() if k != "temp"}, **groups)
        corrected = self._model.apply(log)
        out = dict(batch)
        for name in groups:
            readings = getattr(corrected, name)
            out |= {axis: readings[:, k] for k, axis in enumerate(GROUPS[name])}
        return out
