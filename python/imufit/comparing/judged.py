"""Which sensors of the logs were judged, and why the others were not."""

from __future__ import annotations

import numpy as np

from imufit.fitting.analysis import Analysis
from imufit.fitting.log_evidence import LogEvidence
from imufit.fitting.passes import CHANNELS
from imufit.fitting.rest_passes import RestPasses
from imufit.results import Judged


def judged(analysis: Analysis) -> tuple[Judged, ...]:
    """Say of each sensor that any log has whether its readings were compared with the reference.

    Parameters
    ----------
    analysis : Analysis
        Evidence of the logs.
    """
    recorded = {column[:3] for each in analysis.logs for column in each.surveyed.log.columns}
    sensors = [sensor for sensor in ("acc", "gyr", "mag") if sensor in recorded]
    reasons = {sensor: _reason(analysis, sensor) for sensor in sensors}
    return tuple(
        Judged(sensor, reason is None, reason, "" if reason is None else _advice(analysis, sensor))
        for sensor, reason in reasons.items()
    )


def _advice(analysis: Analysis, sensor: str) -> str:
    """Return what the first log that could say so lacks."""
    lacking = (
        each.passes.rests.lacking
        for each in analysis.logs
        if isinstance(each.passes, RestPasses) and sensor in ("acc", "gyr")
    )
    return next(lacking, "")


def _reason(analysis: Analysis, sensor: str) -> str | None:
    reasons = [_of_log(each, sensor) for each in analysis.logs]
    return None if None in reasons else reasons[0]


def _of_log(evidence: LogEvidence, sensor: str) -> str | None:
    channels = [k for k, name in enumerate(CHANNELS) if name[:3] == sensor]
    if sensor not in evidence.facts.sensors:
        if isinstance(evidence.passes, RestPasses):
            return "the log has no reference, and too few rests to do without one"
        return "no sample has a reference beside it"
    if not any(np.isfinite(evidence.raw_variance[k]) for k in channels):
        return "too few samples have a reference around them"
    if not any(evidence.floors[k] > 0.0 for k in channels if np.isfinite(evidence.floors[k])):
        return "the readings never change"
    return None
