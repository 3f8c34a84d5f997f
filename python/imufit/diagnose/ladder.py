"""Diagnose and add, again and again, until nothing is missing."""

from __future__ import annotations

from collections.abc import Collection

from imufit.diagnose.add import add
from imufit.diagnose.attitude import attitude_comparison
from imufit.diagnose.compare import comparison
from imufit.diagnose.diagnose import diagnose
from imufit.diagnose.without_reference import refuse_rests
from imufit.fit import Fit
from imufit.log.several import Logs
from imufit.model import SensorModel
from imufit.progress import Progress, silent
from imufit.results import Addition, Diagnosis, Ladder, Step

MAX_STEPS = 12
MATTERS = 0.002
"""Share of the held-out error that an effect must take away to be added beside something unknown, or untold."""
TOLD = 2.0
"""Standard errors that at least one parameter of an addition must be away from zero."""
IRON = frozenset({"mag.hard_iron", "mag.soft_iron"})
FIELD_VARIES = "the field varies in space"


def ladder(log: Logs, model: SensorModel | None = None, progress: Progress | None = None) -> Ladder:
    """Repeat diagnose and add until nothing is missing, or until the log cannot tell what is.

    Parameters
    ----------
    log : Log, LogStream or a sequence of them
        With reference attitude; several logs are of one sensor.
    model : SensorModel, optional
        Where to start from; default: the ideal sensor.
    progress : callable, optional
        Called with (rows done, rows in all, what is being done).

    Returns
    -------
    Ladder
        Every step with the held-out error before, expected and after, the final model and verdict.

    Raises
    ------
    InputError
        The log has no usable reference, or an effect of the model cannot be tested on it.
    """
    fit = Fit.of(model or SensorModel(), log, progress)
    refuse_rests(fit.analysis, "the ladder")
    start, first_fit = fit.ratio, fit
    steps: list[Step] = []
    first: Diagnosis | None = None
    diagnosis = diagnose(fit)
    futile: set[str] = set()
    while len(steps) < MAX_STEPS:
        first = first or diagnosis
        effect = next_effect(fit, diagnosis, futile)
        if effect is None:
            break
        expected = next(c.held_out_after for c in diagnosis.candidates if c.effect == effect)
        addition = add(fit, effect, expected)
        if not (addition.after < addition.before and (_told(addition) or _matters(addition.before, addition.after))):
            # What the evidence promised, the fit did not keep: the next one may.
            futile.add(effect)
            continue
        fit = addition.fit
        futile.clear()
        steps.append(Step(effect, addition.before, expected, addition.after, fit.training_ratio))
        diagnosis = diagnose(fit)
    worst = first_fit.worst
    return Ladder(
        steps=tuple(steps),
        model=fit.model.effects,
        verdict=diagnosis.verdict,
        ratio_start=start,
        ratio_end=fit.ratio,
        attitude=attitude_comparison(fit.model_of(worst), fit.logs[worst], progress=progress or silent),
        diagnosis=diagnosis,
        comparison_start=comparison(first_fit.analysis, first_fit.estimate.step, worst),
        comparison_end=comparison(fit.analysis, fit.estimate.step, worst),
        first=first,
        fit=fit,
        sentence=_sentence(start, fit.ratio, steps, diagnosis),
    )


def next_effect(fit: Fit, diagnosis: Diagnosis, futile: Collection[str] = ()) -> str | None:
    """Return the effect to add next: the best that passed and that nothing else in the catalogue explains as well.

    Parameters
    ----------
    fit : Fit
        The model so far.
    diagnosis : Diagnosis
        What was found on top of it.
    futile : collection of str
        Effects that were tried and did not lower the held-out error.
    """
    if diagnosis.verdict == "adequate" or diagnosis.without:
        return None
    if diagnosis.verdict == "ambiguous":
        effect = _beside_the_unsure(fit)
        return None if effect in futile else effect
    passed = [c for c in diagnosis.candidates if c.status == "passed" and c.effect not in futile]
    if diagnosis.verdict == "unknown":
        # Beside what nothing explains, only effects that matter are taken up, and no iron of the sensor where the field
        # itself is another from place to place.
        varies = any(u.shape == FIELD_VARIES for u in diagnosis.unexplained)
        passed = [
            c for c in passed if _matters(c.held_out_before, c.held_out_after) and not (varies and c.effect in IRON)
        ]
    return passed[0].effect if passed else None


def _beside_the_unsure(fit: Fit) -> str | None:
    """Return what stands out once one of the effects that cannot be told apart is in the model, whichever it is."""
    analysis = fit.analysis
    model, candidates = list(analysis.fitted_slots), list(analysis.candidate_slots)
    while True:
        result = analysis.problem.diagnose(model, candidates)
        best, rivals = result["best"], result["rivals"]
        if best is None or not rivals:
            return None if best is None else analysis.slots[best]
        model.append(best)
        candidates = [slot for slot in candidates if slot != best and slot not in rivals]


def _told(addition: Addition) -> bool:
    """Return whether the fit tells any parameter of what was added from zero."""
    return any(not abs(p.value) <= TOLD * p.standard_error for p in addition.parameters)


def _matters(before: float, after: float) -> bool:
    return before - after >= MATTERS * before


def _sentence(start: float, end: float, steps: list[Step], diagnosis: Diagnosis) -> str:
    if not steps:
        return diagnosis.sentence
    names = ", ".join(step.effect for step in steps)
    return (
        f"Adding {names} cut the held-out error from {start:.3f} to {end:.3f} of the noise floor. {diagnosis.sentence}"
    )
