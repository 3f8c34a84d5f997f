"""A sensor model the other way round: readings of a log with the model's effects taken out."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

from imufit import _imufit
from imufit.errors import InputError
from imufit.fitting.passes import chunk_arrays, covariate_names
from imufit.log import Log, LogSource, whole

if TYPE_CHECKING:
    from imufit.model.effect_stack import EffectStack

SENSORS = ("acc", "gyr", "mag")


def apply(model: EffectStack, log: LogSource) -> Log:
    """Return the log with corrected readings; see :meth:`imufit.SensorModel.apply`.

    Parameters
    ----------
    model : EffectStack
        Effects and parameters.
    log : Log or LogStream
        Readings; a reference is not needed.
    """
    recorded = whole(log)
    if not recorded.n:
        return recorded
    (chunk,) = recorded.chunks(recorded.n)
    covariates = covariate_names(recorded)
    means = model.constants.get("covariate_means", {})
    kept = [(effect, values) for effect, values in model.stack() if effect.reference_part is None]
    try:
        readings, lost = _imufit.correct_readings(
            chunk_arrays(chunk, covariates),
            kept,
            recorded.metadata.frame,
            covariates,
            [means.get(name) for name in covariates],
            model.constants.get("temperature_mean"),
        )
    except InputError as error:
        wrong = "Add it to the log, or take the effect out of the model." if error.row is None else "Check the model."
        remedy = error.advice or wrong
        raise InputError(error.problem, file=log.path, row=error.row, remedy=remedy) from None
    notes = [*_left_alone(model, recorded), *_lost(dict(zip(SENSORS, lost, strict=True)))]
    acc, gyr, mag = (
        getattr(recorded, name) if values is None else values for name, values in zip(SENSORS, readings, strict=True)
    )
    for turned in (effect.id for effect, _ in model.stack() if effect.reference_part == "mount"):
        mount = Rotation.from_rotvec([model.parameters[turned][axis] for axis in "xyz"])
        acc, gyr, mag = (None if x is None else np.ascontiguousarray(mount.apply(x)) for x in (acc, gyr, mag))
        notes.append(f"{turned}: readings turned into the axes of the body that the reference describes")
    return recorded.with_fields(acc=acc, gyr=gyr, mag=mag, notes=(*recorded.notes, *notes))


def _left_alone(model: EffectStack, log: Log) -> list[str]:
    """Say which effects of the model did nothing to the readings, and which means had to be taken from the log."""
    notes = []
    of_reference = [effect.id for effect, _ in model.stack() if effect.reference_part not in (None, "mount")]
    if of_reference:
        notes.append(f"{' and '.join(of_reference)} left unchanged: an effect of the reference, not of the readings")
    for sensor in SENSORS:
        of_sensor = [e.id for e, _ in model.stack() if e.sensors == [sensor] and e.reference_part is None]
        if of_sensor and getattr(log, sensor) is None:
            notes.append(f"{' and '.join(of_sensor)} left unchanged: the log has no {sensor}")
    on_temperature = [effect.id for effect, _ in model.stack() if "temp" in effect.centred_columns]
    if on_temperature and "temperature_mean" not in model.constants and log.temp is not None:
        notes.append(f"{' and '.join(on_temperature)}: the model has no temperature_mean, the log's own mean was used")
    return notes


def _lost(lost: dict[str, int]) -> list[str]:
    """Say how many samples could not be corrected."""
    return [
        f"{count} samples of {sensor} are NaN now: what an effect reads besides is not known there"
        for sensor, count in lost.items()
        if count
    ]
