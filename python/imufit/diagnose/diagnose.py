"""Which effect is missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit._imufit import Kind, Status, Verdict
from imufit.diagnose import sentences, without_reference
from imufit.diagnose.agreement import answers_without, answers_without_faulty, disagreements
from imufit.diagnose.column_noise import column_noise
from imufit.diagnose.compare import notes
from imufit.diagnose.fast_changes import Seen, fast_changes
from imufit.diagnose.judged import above_stated_noise, judged
from imufit.diagnose.noise_budget import noise_budget
from imufit.fit.analysis import Analysis, pooled
from imufit.fit.log_evidence import LogEvidence
from imufit.fit.passes import CHANNELS
from imufit.fit.rest_passes import RestPasses
from imufit.log.several import name_of
from imufit.model.catalogue import card_of, each_log_has_its_own
from imufit.results import Candidate, DataFault, Diagnosis, LogParameters, Parameter, Rival, Unexplained
from imufit.results.diagnosis import PASSED

if TYPE_CHECKING:
    from imufit.fit import FittedStack

Array = NDArray[np.float64]

MIN_CORRELATION = 0.3
"""Below this, two effects are not worth naming together."""
NEAR = 0.8
"""Share of the best one's log Bayes factor from which on a fit may show that another candidate explains more."""
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
    largest = max((c.gain for c in candidates if c.status == PASSED), default=0.0)
    # A fault is one log's, an effect explains something in all of them.
    largest /= len(analysis.logs)
    faults = tuple(replace(fault, spoils=fault.gain * BESIDE > largest) for fault in analysis.faults)
    if any(fault.spoils for fault in faults):
        return _spoilt(fit, faults)
    by_id = {candidate.effect: candidate for candidate in candidates}
    cards = {key: card_of(analysis.candidates[key]) for key in by_id}
    best = None if result.best is None else ids[result.best]
    rivals = tuple(ids[slot] for slot in result.rivals)
    word = result.kind.word
    unexplained = _unexplained(analysis, fit.estimate.step, result.findings)
    disagrees = disagreements(analysis, result.disagreements)
    without = answers_without(fit, result.disagreements, diagnose) if result.spoilt else ()
    doubtful = next((candidate for candidate in candidates if candidate.status in sentences.DOUBTS), None)
    sentence = sentences.verdict(
        word, by_id[best] if best else None, cards[best] if best else None, rivals, unexplained, doubtful
    )
    unshown = without_reference.untold(fit)
    if result.kind == Kind.ADEQUATE and "rests" in without_reference.evidence_of(analysis):
        sentence = without_reference.adequate(fit.ratio, [candidate.effect for candidate in unshown])
    elif result.kind == Kind.ADEQUATE and fit.ratio > sentences.OFF_FLOOR:
        sentence = sentences.above_floor(fit.ratio)
    sentence = sentences.with_disagreements(sentence, disagrees, spoilt=result.spoilt)
    sensors = judged(analysis)
    sentence = sentences.with_judged(sentence, sensors, adequate=result.kind == Kind.ADEQUATE)
    experiment = None
    if result.kind == Kind.AMBIGUOUS and best is not None:
        experiment = sentences.experiment(cards[best], [cards[rival] for rival in rivals])
    return Diagnosis(
        verdict=word,
        best=best if result.kind in (Kind.MISSING, Kind.AMBIGUOUS) else None,
        ambiguous_with=rivals if result.kind == Kind.AMBIGUOUS else (),
        candidates=(*candidates, *unshown),
        unexplained=unexplained,
        model=analysis.model.effects,
        experiment=experiment,
        sentence=sentence,
        notes=_notes(analysis),
        logs=fit.by_log,
        disagrees=disagrees,
        without=without,
        data_faults=faults,
        evidence=without_reference.evidence_of(analysis),
        judged=sensors,
        noise=noise_budget(analysis),
    )


def _decided(fit: FittedStack, excluded: Sequence[str]) -> Verdict:
    """Ask the evidence; where rows or fits have more to say, ask again with what these say."""
    analysis = fit.analysis
    slots = [slot for slot in analysis.candidate_slots if analysis.slots[slot] not in excluded]
    asked = analysis.fitted_slots, slots, analysis.probe_slots
    noise = column_noise(analysis)
    result = analysis.problem.diagnose(*asked, column_noise=noise)
    fitted = _fitted_alone(fit, result)
    seen = _above_stated(analysis)
    if result.best is None:
        seen += fast_changes(analysis, fit.estimate.step)
    if fitted or seen:
        result = analysis.problem.diagnose(*asked, fitted=fitted, column_noise=noise, seen=seen)
    return result


def _above_stated(analysis: Analysis) -> list[Seen]:
    """Name the channels that stand far above their stated noise, whatever that goes with."""
    several = len(analysis.logs) > 1
    return [
        (log if several else None, index, 0.5 * ratio**2, f"it stands at {ratio:.1f} times its stated noise")
        for log, evidence in enumerate(analysis.logs)
        if not isinstance(evidence.passes, RestPasses)
        for index, ratio in above_stated_noise(evidence).items()
    ]


def _fitted_alone(fit: FittedStack, result: Verdict) -> list[tuple[int, float]]:
    """Log evidences of the best candidate and others like it, each from a fit of its own, by slot.

    Columns taken at one point say little of a delay as long as a turn takes, or of play in a drive; a late sensor and
    a sluggish one have the same column. What the columns set apart by far needs no fit, unless they depend on a search.
    """
    analysis = fit.analysis
    ids = analysis.slots
    best = result.best
    if best is None or not analysis.candidates[ids[best]].strongly_curved:
        return []
    items = {item.slot: item for item in result.candidates}
    alike = {second for _, second, correlation in result.correlations if correlation >= MIN_CORRELATION}
    near = {slot for slot in alike if items[slot].ln_bayes >= NEAR * items[best].ln_bayes}
    close = [
        slot
        for slot, item in items.items()
        if item.status != Status.NOT_TESTABLE
        and analysis.candidates[ids[slot]].strongly_curved
        and (slot == best or slot in result.rivals or slot in near or ids[slot] in analysis.found)
    ]
    if len(close) < 2:
        return []
    return [(slot, _evidence_of(fit, ids[slot])) for slot in close]


def _evidence_of(fit: FittedStack, effect: str) -> float:
    """Return the log evidence of the model with one more effect, around its best parameters."""
    analysis, _ = fit.analysis.solved_for(fit.model.with_effect(effect), fit.own, only=())
    return analysis.problem.ln_evidence(analysis.fitted_slots)


def _spoilt(fit: FittedStack, faults: tuple[DataFault, ...]) -> Diagnosis:
    """Name the faults of the data that explain what is missing, and no effect."""
    spoiling = [fault for fault in faults if fault.spoils]
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
        without=answers_without_faulty(fit, {fault.file for fault in spoiling if fault.file is not None}, diagnose),
        data_faults=faults,
        evidence=without_reference.evidence_of(fit.analysis),
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
        p_value=float(np.exp(-max(item.ln_bayes, 0.0))),
        probability=item.probability,
        ln_bayes=item.ln_bayes,
        expected_ratio=item.held_out_after,
        held_out_before=item.held_out_before,
        held_out_after=item.held_out_after,
        gain=item.gain,
        gain_error=item.gain_error,
        parameters=parameters,
        confounded_with=tuple(sorted(rivals, key=lambda rival: -rival.correlation)),
        explanation="",
        status=item.status.words,
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


def _unexplained(analysis: Analysis, step: Any, found: Sequence[_imufit.Finding]) -> tuple[Unexplained, ...]:
    """Dependences that nothing in the catalogue explains, with their share of the excess and where in time it lies."""
    if not found:
        return ()
    residuals = [analysis.problem.residual(step, log) for log in range(len(analysis.logs))]
    return tuple(_dependence(analysis, residuals, item) for item in found)


def _dependence(analysis: Analysis, residuals: Sequence[Mapping[str, Any]], item: _imufit.Finding) -> Unexplained:
    """Say what one dependence is worth in the log where it is worth most."""

    def share(log: int) -> float:
        panels = residuals[log]["panels"]
        same = (p["share"] for p in panels if (p["channel"], p["covariate"]) == (item.channel, item.covariate))
        return max(float(next(same, 0.0)), _share(analysis.logs[log], residuals[log], item))

    concerned = range(len(residuals)) if item.log is None else [item.log]
    having = [log for log in concerned if any(c["channel"] == item.channel for c in residuals[log]["channels"])]
    log = max(having, key=share)
    facts = analysis.logs[log].facts
    first, last = next(c["stretch"] for c in residuals[log]["channels"] if c["channel"] == item.channel)
    spans = analysis.logs[log].passes.spans(facts)[first:last]
    begin, end = float(spans[:, 0].min()), float(spans[:, 1].max())
    return Unexplained(item.channel, item.covariate, share(log), item.shape, begin, end)


def _share(evidence: LogEvidence, residual: Mapping[str, Any], item: _imufit.Finding) -> float:
    """Return what a dependence explains of the excess of its channels in a log."""
    excess = {
        each["index"]: each["n"] * (each["rms"] ** 2 - evidence.floors[each["index"]] ** 2)
        for each in residual["channels"]
        if each["index"] in item.channels and evidence.floors[each["index"]] > 0.0
    }
    if item.channel not in CHANNELS or not excess:
        return 0.0
    # The drop is one of the whitened residual; what changes slowly passes whitening with its gain at zero frequency.
    k = CHANNELS.index(item.channel)
    drop = item.drop * evidence.variance[k] / max(evidence.slow_gain(k), 1e-9)
    total = sum(excess.values())
    return float(np.clip(drop / total, 0.0, 1.0)) if total > 0.0 else 0.0


def _notes(analysis: Analysis) -> tuple[str, ...]:
    """Return what the reader should know of the logs; of several each note tells which of them it is about."""
    found = [
        (each.surveyed.log, without_reference.notes(each) if isinstance(each.passes, RestPasses) else notes(each))
        for each in analysis.logs
    ]
    if len(found) == 1:
        return found[0][1]
    return tuple(f"{name_of(log, k)}: {note}" for k, (log, own) in enumerate(found) for note in own)
