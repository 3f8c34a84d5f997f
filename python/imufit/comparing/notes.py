"""Notes on the figures of a log: its evidence, its noise, and its limits."""

from __future__ import annotations

import numpy as np

from imufit.fitting.log_evidence import LogEvidence
from imufit.fitting.passes import CHANNELS, UNITS
from imufit.fitting.rest_passes import NEEDS_REFERENCE, RestPasses
from imufit.log.attitude_columns import attitude_offered
from imufit.log.columns import SENSOR_NAMES

OFF_FLOOR = 1.2
"""Stated noise is doubted where what nothing explains differs from it by this factor."""


def notes(evidence: LogEvidence) -> tuple[str, ...]:
    """Return what the reader should know about the figures of a log.

    Parameters
    ----------
    evidence : LogEvidence
        Evidence of the log.
    """
    passes = evidence.passes
    own = _of_rests(evidence, passes) if isinstance(passes, RestPasses) else _of_rows(evidence)
    return (*evidence.surveyed.log.notes, *own)


def _of_rows(evidence: LogEvidence) -> list[str]:
    """Return notes on a log with a reference."""
    log, facts = evidence.surveyed.log, evidence.facts
    out = [*evidence.passes.empty]
    stated = log.metadata.noise
    for index, (floor, variance) in enumerate(zip(evidence.floors, evidence.raw_variance, strict=True)):
        if index % 3 == 0 and CHANNELS[index][:3] in stated and np.isfinite(variance):
            group = np.sqrt(np.mean(evidence.raw_variance[index : index + 3]))
            if not 1 / OFF_FLOOR < group / floor < OFF_FLOOR:
                sensor = CHANNELS[index][:3]
                out.append(
                    f"The stated noise of {sensor} is {stated[sensor]:.3g} {UNITS[sensor]}; the residual that "
                    f"no effect explains is {group:.3g} {UNITS[sensor]}."
                )
    for sensor, steps in zip(SENSOR_NAMES, facts.steps, strict=True):
        if any(steps):
            out.append(
                f"Readings of {sensor} come in steps of {max(steps):.3g} {UNITS[sensor]}, coarse against the noise; "
                "in motion the rounding is fitted beside the model."
            )
    if facts.field_estimated and "mag" in facts.sensors:
        out.append("The reference field was estimated from this log, beside the model.")
    if evidence.passes.commanded is not None:
        out.append("The reference is the attitude at ref_angle: ref_q differs from it only by noise.")
    coloured = sorted({CHANNELS[k][:3] for k, taps in enumerate(evidence.filters) if taps})
    if coloured:
        out.append(
            f"The noise of {', '.join(coloured)} carries over from sample to sample; the fit allows for this, so that "
            "the standard errors hold."
        )
    return out


def _of_rests(evidence: LogEvidence, passes: RestPasses) -> list[str]:
    """Return the evidence of a log without a reference, and its limits."""
    rests = passes.rests
    told = []
    if rests.rests:
        zero = " and the rate is zero" if "gyr" in rests.sensors else ""
        told.append(
            f"{rests.rests} rests in {rests.attitudes} attitudes, at which the specific force is as long as "
            f"gravity{zero}"
        )
    if rests.labels:
        told.append(
            f"{rests.labels} labelled poses, whose axis points up to within {np.degrees(rests.placement):.1f} deg"
        )
    if rests.turns:
        told.append(f"{rests.turns} turns from rest to rest, along which the rate carries the direction of gravity")
    if "mag" in rests.sensors:
        told.append("the length of the magnetic field, which is the same everywhere and is estimated beside the model")
    out = [f"The log has no reference attitude. It is judged by {'; '.join(told)}."]
    if offered := str(attitude_offered(evidence.surveyed.log)).strip():
        out.append(offered + ".")
    limits = []
    if "acc" in rests.sensors and not rests.labels:
        limits.append(
            "Of acc.misalignment only the change of the angles between the axes shows at rest; the mount of the "
            "sensor and the level of the table do not."
        )
    if rests.rests and "gyr" in rests.sensors and not rests.turns:
        limits.append("Without turns between rests the gyroscope's scale and axes are not determined.")
    if "mag" in rests.sensors:
        limits.append("Of mag.soft_iron only the symmetric part shows, without a scale common to all axes.")
    untold = sorted(key for key, reason in evidence.surveyed.refused.items() if reason == NEEDS_REFERENCE)
    if untold:
        limits.append(f"Only a reference attitude would show {', '.join(untold)}.")
    return [*out, *limits, *rests.notes]
