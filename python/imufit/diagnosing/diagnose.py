"""Which effect is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit._imufit import Kind, Status, Verdict
from imufit.comparing import judged, noise_budget, notes, unexplained
from imufit.diagnosing.agreement import answers_without, disagreements
from imufit.diagnosing.column_noise import column_noise
from imufit.diagnosing.curved import fitted
from imufit.diagnosing.fast_changes import fast_changes
from imufit.diagnosing.fixed_values import contradicted
from imufit.diagnosing.seen_in_rows import seen_in_rows
from imufit.fitting.analysis import Analysis, pooled
from imufit.fitting.rest_passes import NEEDS_REFERENCE
from imufit.log.several import name_of
from imufit.model.catalogue import card_of, each_log_has_its_own, effects
from imufit.results import Candidate, DataFault, Diagnosis, LogParameters, Parameter, Rival, sentences
from imufit.results.diagnosis import NOT_TESTABLE, SIGNIFICANT

if TYPE_CHECKING:
    from imufit.fitting import FittedStack

Array = NDArray[np.float64]
_Seen = tuple[int | None, int, float, str]

MIN_CORRELATION = 0.3
"""Below this, two effects are not worth naming together."""
BESIDE = 10.0
"""An effect is named beside a fault of the data only if it explains this many times more."""
POWER = 0.84
"""Standard errors beyond the size that is seen as often as not at which an effect is seen with 80 % power."""


def diagnose(fit: FittedStack, excluded: Sequence[str] = ()) -> Diagnosis:
    """Rank every effect that is not in the model by its evidence, and decide.

    Parameters
    ----------
    fit : FittedStack
        The model and the evidence of its log.
    excluded : sequence of str
        Candidates that are not to be considered.
    """
    analysis = fit.analysis
    if any(fault.spoils for fault in analysis.faults):
        return _spoilt(fit, analysis.faults)
    ids = analysis.slots
    result = _decided(fit, excluded)
    confounded: dict[str, list[Rival]] = {}
    for first, second, correlation in result.correlations:
        if correlation < MIN_CORRELATION:
            continue
        confounded.setdefault(ids[first], []).append(Rival(ids[second], correlation))
        confounded.setdefault(ids[second], []).append(Rival(ids[first], correlation))
    candidates = [
        _candidate(item, analysis.candidates[ids[item.slot]], confounded.get(ids[item.slot], []), analysis)
        for item in result.candidates
    ]
    largest = max((c.gain for c in candidates if c.status == SIGNIFICANT), default=0.0)
    # A fault is one log's, an effect explains something in all of them.
    largest /= len(analysis.logs)
    faults = tuple(replace(fault, spoils=fault.gain * BESIDE > largest) for fault in analysis.faults)
    if any(fault.spoils for fault in faults):
        return _spoilt(fit, faults)
    best = next((c for c in candidates if result.best is not None and c.effect == ids[result.best]), None)
    named = best.effect if best is not None and result.kind in (Kind.MISSING, Kind.AMBIGUOUS) else None
    # A filter of a sensor's own readings is evidence neither for nor against this sensor.
    open_to = {sensor for fault in faults for sensor in fault.spoils_sensors}
    adequate = result.kind == Kind.ADEQUATE
    if open_to and (adequate or (named is not None and open_to & set(analysis.candidates[named].sensors))):
        return _spoilt(fit, tuple(replace(fault, spoils=bool(fault.spoils_sensors)) for fault in faults))
    rivals = tuple(ids[slot] for slot in result.rivals) if result.kind == Kind.AMBIGUOUS else ()
    cards = [card_of(analysis.candidates[key]) for key in (named, *rivals) if key is not None]
    unshown = _needing_reference(fit)
    wild = {item.log for item in result.disagreements if item.wild}
    found = Diagnosis(
        verdict=result.kind.word,
        best=named,
        ambiguous_with=rivals,
        candidates=(*candidates, *unshown),
        unexplained=unexplained(analysis, fit.estimate.step, result.findings),
        model=analysis.model.effects,
        experiment=sentences.experiment(cards) if result.kind == Kind.AMBIGUOUS else None,
        sentence="",
        notes=_notes(analysis),
        logs=fit.by_log,
        disagrees=disagreements(analysis, result.disagreements),
        without=answers_without(fit, wild, diagnose) if result.spoilt else (),
        data_faults=faults,
        evidence=analysis.judged_by,
        judged=judged(analysis),
        noise=noise_budget(analysis),
        ratio=fit.ratio,
    )
    if wrong := tuple(contradicted(fit)):
        # The residual follows the wrong value, and names no other cause.
        sentence = " ".join(sentences.contradicted(held, given) for held, given in wrong)
        return replace(found, sentence=sentence, unexplained=(), contradicted=tuple(held for held, _ in wrong))
    return replace(found, sentence=sentences.answer(found, best, untold=len(unshown), spoilt=result.spoilt))


def _decided(fit: FittedStack, excluded: Sequence[str]) -> Verdict:
    """Ask the evidence; where rows or fits have more to say, ask again with what these say."""
    analysis = fit.analysis
    slots = [slot for slot in analysis.candidate_slots if analysis.slots[slot] not in excluded]
    asked = analysis.fitted_slots, slots, analysis.probe_slots
    noise = column_noise(analysis)
    refuted: list[int] = []
    decided: list[list[tuple[int, float]]] = []

    def answer(seen: Sequence[_Seen] = (), again: Verdict | None = None) -> Verdict:
        return analysis.problem.diagnose(
            *asked, fitted=decided, refuted=refuted, column_noise=noise, seen=seen, again=again
        )

    result = answer()
    odds = analysis.problem.threshold(len(analysis.candidates))
    # A fit may put an effect in the place of the best one that lowers the error less than a third effect does: this
    # one comes first then, and is asked about as well.
    while fits := fitted(fit, result, {slot for each in decided for slot, _ in each}):
        if all(ln < odds for _, ln in fits):
            refuted += [slot for slot, _ in fits]
            decided.clear()
            result = answer()
        else:
            decided.append(fits)
            result = answer(again=result)
    seen = seen_in_rows(analysis)
    if result.best is None:
        seen += fast_changes(analysis, fit.estimate.step)
    return answer(seen, result) if seen else result


def _spoilt(fit: FittedStack, faults: tuple[DataFault, ...]) -> Diagnosis:
    """Name the faults of the data that explain what is missing, and no effect."""
    spoiling = [fault for fault in faults if fault.spoils]
    files = {fault.file for fault in spoiling}
    faulty = {k for k, log in enumerate(fit.logs) if name_of(log, k) in files}
    return Diagnosis(
        verdict="unknown",
        best=None,
        ambiguous_with=(),
        candidates=(),
        unexplained=(),
        model=fit.analysis.model.effects,
        experiment=None,
        sentence=sentences.spoilt(spoiling),
        notes=_notes(fit.analysis),
        logs=fit.by_log,
        without=answers_without(fit, faulty, diagnose) if 0 < len(faulty) < len(fit.logs) else (),
        data_faults=faults,
        evidence=fit.analysis.judged_by,
    )


def _candidate(item: _imufit.Candidate, effect: _imufit.Effect, rivals: list[Rival], analysis: Analysis) -> Candidate:
    found = analysis.found.get(effect.id)
    searched = {} if found is None else dict(zip((name for name, _, _ in effect.parameters), found.trial, strict=True))
    grid = {name: searched[name] for name in effect.searched if name in searched}

    def named(values: Array, errors: Array) -> tuple[Parameter, ...]:
        return tuple(
            Parameter(effect.id, name, grid.get(name, float(value)), 0.0 if name in grid else float(error), unit, size)
            for (name, unit, size), value, error in zip(effect.parameters, values, errors, strict=True)
        )

    # Of one log after the other, where each has its own.
    by_log = np.asarray(item.parameters).reshape(-1, len(effect.parameters), 2)
    parameters = named(*pooled(by_log[..., 0], by_log[..., 1]))
    # Of logs that have their own, the one that would show it first.
    sizes = np.asarray(item.detectable).reshape(-1, len(effect.parameters)).min(axis=0)
    detectable = {
        p.name: (float(size) + POWER * p.standard_error, p.unit)
        for p, size in zip(parameters, sizes, strict=True)
        if item.status != Status.NOT_TESTABLE and np.isfinite(size) and p.standard_error > 0.0
    }
    candidate = Candidate(
        effect=effect.id,
        status=item.status.words,
        probability=item.probability,
        ln_bayes=item.ln_bayes,
        held_out_before=item.held_out_before,
        held_out_after=item.held_out_after,
        gain=item.gain,
        gain_error=item.gain_error,
        parameters=parameters,
        confounded_with=tuple(sorted(rivals, key=lambda rival: -rival.correlation)),
        minimal_detectable=detectable,
        logs=_own_parameters(analysis, effect.id, [named(at[:, 0], at[:, 1]) for at in by_log]),
    )
    return replace(candidate, explanation=sentences.explanation(card_of(effect), candidate))


def _own_parameters(
    analysis: Analysis, effect_id: str, values: Sequence[tuple[Parameter, ...]]
) -> tuple[LogParameters, ...]:
    """Parameters of an effect by log, where there are several logs and each has its own."""
    if len(analysis.logs) == 1 or not each_log_has_its_own(effect_id):
        return ()
    logs = analysis.having(effect_id)
    return tuple(
        LogParameters(name_of(analysis.logs[k].surveyed.log, k), own) for k, own in zip(logs, values, strict=True)
    )


def _needing_reference(fit: FittedStack) -> tuple[Candidate, ...]:
    """Return the effects that only a reference would show, as candidates that cannot be tested."""
    analysis = fit.analysis
    refused = [each.surveyed.refused for each in analysis.logs]
    lacking = [
        key
        for key in effects()
        if key not in analysis.slots and any(reasons.get(key) == NEEDS_REFERENCE for reasons in refused)
    ]
    ratio, explained = fit.ratio, sentences.unshown
    return tuple(Candidate(key, NOT_TESTABLE, ratio, ratio, explained(key, NEEDS_REFERENCE)) for key in lacking)


def _notes(analysis: Analysis) -> tuple[str, ...]:
    """Return the notes on the logs; of several logs each note names its log."""
    if len(analysis.logs) == 1:
        return notes(analysis.logs[0])
    named = ((name_of(each.surveyed.log, k), each) for k, each in enumerate(analysis.logs))
    return tuple(f"{name}: {note}" for name, each in named for note in notes(each))
