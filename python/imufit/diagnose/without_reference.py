"""What a diagnosis rests on where a log has no reference attitude, and what such a log cannot tell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from imufit.diagnose.sentences import OFF_FLOOR
from imufit.errors import InputError
from imufit.fit.rest_passes import NEEDS_REFERENCE, RestPasses
from imufit.model.catalogue import effects
from imufit.results import Candidate
from imufit.results.diagnosis import NOT_TESTABLE

if TYPE_CHECKING:
    from imufit.fit import FittedStack
    from imufit.fit.analysis import Analysis
    from imufit.fit.log_evidence import LogEvidence


def evidence_of(analysis: Analysis) -> str:
    """Return what logs are judged by: ``reference``, ``rests``, or ``reference and rests``.

    Parameters
    ----------
    analysis : Analysis
        Evidence of the logs.
    """
    kinds = {"rests" if isinstance(each.passes, RestPasses) else "reference" for each in analysis.logs}
    return " and ".join(sorted(kinds))


def refuse_rests(analysis: Analysis, what: str) -> None:
    """Refuse logs without a reference where every sample is needed.

    Parameters
    ----------
    analysis : Analysis
        Evidence of the logs.
    what : str
        What is asked for.

    Raises
    ------
    InputError
        A log has no reference attitude.
    """
    for each in analysis.logs:
        if isinstance(each.passes, RestPasses):
            raise InputError(
                f"the log has no reference attitude (ref_qw ref_qx ref_qy ref_qz), which {what} needs",
                file=each.surveyed.log.path,
                remedy="Ask `imufit diagnose`, which judges the rests of such a log, or `imufit calibrate`.",
            )


def notes(evidence: LogEvidence) -> tuple[str, ...]:
    """Return what one log without a reference is judged by, and what it cannot tell.

    Parameters
    ----------
    evidence : LogEvidence
        Evidence of the log.
    """
    passes = evidence.passes
    if not isinstance(passes, RestPasses):
        raise ValueError("the log has a reference")
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
        told.append("the length of the magnetic field, which is the same everywhere and is fitted along")
    out = [f"The log has no reference attitude. It is judged by {'; '.join(told)}."]
    limits = []
    if "acc" in rests.sensors and not rests.labels:
        limits.append(
            "Of acc.misalignment only the change of the angles between the axes shows at rest; how the sensor sits on "
            "its body does not, nor whether the table is level."
        )
    if rests.rests and "gyr" in rests.sensors and not rests.turns:
        limits.append("Without turns between rests nothing is told of the gyroscope's scale and axes.")
    if "mag" in rests.sensors:
        limits.append("Of mag.soft_iron only the symmetric part shows, without a scale common to all axes.")
    untold = sorted(key for key, reason in evidence.surveyed.refused.items() if reason == NEEDS_REFERENCE)
    if untold:
        limits.append(f"Only a reference attitude would show {', '.join(untold)}.")
    return (*evidence.surveyed.log.notes, *out, *limits, *rests.notes)


def untold(fit: FittedStack) -> tuple[Candidate, ...]:
    """Return the effects that only a reference would show, as candidates that cannot be tested.

    Parameters
    ----------
    fit : FittedStack
        The model and the evidence of its logs.
    """
    analysis = fit.analysis
    reasons = [each.surveyed.refused for each in analysis.logs]
    known = [key for key in effects() if key not in analysis.slots]
    lacking = [key for key in known if any(refused.get(key) == NEEDS_REFERENCE for refused in reasons)]
    return tuple(_untold(key, fit.ratio) for key in lacking)


def _untold(effect_id: str, ratio: float) -> Candidate:
    return Candidate(
        effect=effect_id,
        p_value=1.0,
        probability=0.0,
        ln_bayes=0.0,
        expected_ratio=ratio,
        held_out_before=ratio,
        held_out_after=ratio,
        gain=0.0,
        gain_error=0.0,
        parameters=(),
        confounded_with=(),
        explanation=f"This log cannot show {effect_id}: {NEEDS_REFERENCE}.",
        status=NOT_TESTABLE,
        minimal_detectable={},
    )


def adequate(ratio: float, refused: Sequence[str]) -> str:
    """Say that nothing is missing as far as rests tell.

    Parameters
    ----------
    ratio : float
        Held-out residual over the noise.
    refused : sequence of str
        Effects that only a reference would show.
    """
    text = "Nothing that this log can show without a reference attitude is missing"
    if ratio > OFF_FLOOR:
        return f"{text}: what is left stands at {ratio:.1f} times the noise, but no effect lowers that for certain."
    if refused:
        return f"{text}; {len(refused)} effects it cannot show at all."
    return f"{text}."
