"""A sensor model taken out of live rows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.log import Log
from imufit.log.columns import GROUPS

if TYPE_CHECKING:
    from imufit.model.sensor_model import SensorModel

Array = NDArray[np.float64]
Batch = dict[str, Array]

NOW: Final = frozenset(
    {
        "bias",
        "scale",
        "misalignment",
        "bias_temperature",
        "scale_temperature",
        "quadratic",
        "cubic",
        "scale_asymmetry",
        "g_sensitivity",
        "hard_iron",
        "soft_iron",
        "current",
    }
)
"""Effects of a sensor that depend on nothing but the present row; the others need the rows around it."""


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
        for effect in model.effects:
            sensor, _, kind = effect.partition(".")
            if sensor in ("ref", "rig") or kind in NOW or kind.startswith("column:"):
                continue
            raise InputError(
                f"{effect} needs the rows around a row, which live rows do not have",
                remedy="Take a model without it here, or record and use imufit apply.",
            )
        of_temperature = [effect for effect in model.effects if effect.endswith("_temperature")]
        if of_temperature and "temperature_mean" not in model.constants:
            raise InputError(
                f"{of_temperature[0]} needs temperature_mean, which the model does not hold", remedy="Fit it anew."
            )
        known = model.constants.get("covariate_means", {})
        for effect in model.effects:
            column = "motor_current" if effect == "mag.current" else effect.partition(".column:")[2]
            if effect.partition(".column:")[1] and column not in known:
                raise InputError(
                    f"{effect} needs the mean of {column}, which the model does not hold", remedy="Fit it anew."
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
        log = Log(t=t, temp=rest.get("temp"), covariates={k: v for k, v in rest.items() if k != "temp"}, **groups)
        corrected = self._model.apply(log)
        out = dict(batch)
        for name in groups:
            readings = getattr(corrected, name)
            out |= {axis: readings[:, k] for k, axis in enumerate(GROUPS[name])}
        return out
