"""Which effect is missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from imufit import _imufit
from imufit.diagnose import sentences, without_reference
from imufit.diagnose.agreement import answers_without, answers_without_faulty, disagreements
from imufit.diagnose.better_explained import with_better_explained
from imufit.diagnose.compare import notes
from imufit.diagnose.fast_changes import with_fast_changes
from imufit.diagnose.measured_columns import with_measured_columns
from imufit.diagnose.rivals import correlations_with_best
from imufit.diagnose.unusual_size import with_unusual_size
from imufit.fit.analysis import OWN, Analysis, Estimate, pooled
from imufit.fit.log_evidence import LogEvidence
from imufit.fit.passes import CHANNELS
from imufit.fit.rest_passes import RestPasses
from imufit.log.several import name_of
from imufit.model.catalogue import card_of
from imufit.results import Candidate, DataFault, Diagnosis, LogParameters, Parameter, Rival, Unexplained
from imufit.results.diagnosis import NOT_TESTABLE

if TYPE_CHECKING:
    from imufit.fit import Fit

Array = NDArray[np.float64]

ALPHA = 0.003
MIN_CORRELATION = 0.3
"""Below this, two effects are not worth naming together."""
CLEARLY_WORSE = 0.1
"""Share of the drop in held-out error by which a fit must stay behind the best one to be out."""
TOLD = 12.0
"""... and sum of squares, in units of the noise. If the other one is true, a fit gains that much once in 3000 times."""
LEFT = 1.0
"""... or, if it stays behind in every part of the log, times what the best one leaves above the noise floor."""
NEVER_AHEAD = 4.0 * TOLD
"""In every part of the log is: in each, or by so much as a whole and in none ahead for certain."""
NEAR = 0.5
"""Share of the best one's gain from which on a fit may show that another candidate explains more."""
BESIDE = 10.0
"""An effect is named beside a fault of the data only if it explains this many times more."""
POWER = 0.84
"""Standard errors beyond the threshold at which an effect is seen with 80 % power."""


def diagnose(fit: Fit, excluded: Sequence[str] = ()) -> Diagnosis:
    """Rank every effect that is not in the model by held-out error, and decide.

    Parameters
    ----------
    fit : Fit
        The model and the evidence of its log.
    excluded : sequence of str
        Candidates that are not to be considered.
    """
    analysis = fit.analysis
    if any(fault.spoils for fault in analysis.faults):
        return _spoilt(fit, analysis.faults)
    ids = analysis.slots
    slots = [slot for slot in analysis.candidate_slots if ids[slot] not in excluded]
    result: Mapping[str, Any] = analysis.problem.diagnose(analysis.fitted_slots, slots, analysis.probe_slots)
    result = _decided_by_fits(fit, with_unusual_size(analysis, result, slots))
    result = with_measured_columns(analysis, result)
    result = with_better_explained(analysis, result)
    result = with_fast_changes(analysis, fit.estimate.step, fit.ratio, result)
    confounded: dict[str, list[Rival]] = {}
    for first, second, correlation in result["correlations"]:
        if correlation < MIN_CORRELATION:
            continue
        confounded.setdefault(ids[first], []).append(Rival(ids[second], correlation))
        confounded.setdefault(ids[second], []).append(Rival(ids[first], correlation))
    tested = max(sum(item["testable"] for item in result["screened"]), 1)
    candidates = [
        _candidate(
            item,
            analysis.candidates[ids[item["slot"]]],
            confounded.get(ids[item["slot"]], []),
            tested,
            analysis,
        )
        for item in result["screened"]
    ]
    largest = max((c.gain for c in candidates if c.status == "passed"), default=0.0)
    # A fault is one log's, an effect explains something in all of them.
    largest /= len(analysis.logs)
    faults = tuple(replace(fault, spoils=fault.gain * BESIDE > largest) for fault in analysis.faults)
    if any(fault.spoils for fault in faults):
        return _spoilt(fit, faults)
    by_id = {candidate.effect: candidate for candidate in candidates}
    cards = {key: card_of(analysis.candidates[key]) for key in by_id}
    best = None if result["best"] is None else ids[result["best"]]
    rivals = tuple(ids[slot] for slot in result["rivals"])
    word = result["verdict"]
    unexplained = _unexplained(analysis, fit.estimate.step, result["unexplained"])
    named = best if word in ("missing", "ambiguous") else None
    disagrees = disagreements(analysis, result["disagreements"])
    without = answers_without(fit, result["disagreements"], diagnose) if result["spoilt"] else ()
    doubtful = next((candidate for candidate in candidates if candidate.status in sentences.DOUBTS), None)
    sentence = sentences.verdict(
        word, by_id[best] if best else None, cards[best] if best else None, rivals, unexplained, doubtful
    )
    unshown = without_reference.untold(fit)
    if word == "adequate" and "rests" in without_reference.evidence_of(analysis):
        sentence = without_reference.adequate(fit.ratio, [candidate.effect for candidate in unshown])
    elif word == "adequate" and fit.ratio > sentences.OFF_FLOOR:
        sentence = sentences.above_floor(fit.ratio)
    sentence = sentences.with_disagreements(sentence, disagrees, spoilt=result["spoilt"])
    experiment = None
    if word == "ambiguous" and best is not None:
        experiment = sentences.experiment(cards[best], [cards[rival] for rival in rivals])
    return Diagnosis(
        verdict=word,
        best=named,
        ambiguous_with=rivals if word == "ambiguous" else (),
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
    )


def _spoilt(fit: Fit, faults: tuple[DataFault, ...]) -> Diagnosis:
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


def _decided_by_fits(fit: Fit, result: Mapping[str, Any]) -> Mapping[str, Any]:
    """Where columns taken at one point mislead, let fits decide between the best candidate and others of that kind.

    A drive with play and a late reference look alike while a rig goes back and forth at one speed, and their columns
    say little of how well they do at their full size. A late sensor and a sluggish one have the same column. One of
    them is out if its fit stays clearly behind, or leaves something that the best one explains. What the columns tell
    apart by far needs no fit, unless they depend on a search: of a delay as long as a turn takes they show only a part.
    """
    analysis = fit.analysis
    ids = analysis.slots
    best = result["best"]
    if best is None or not analysis.candidates[ids[best]].strongly_curved:
        return result
    items = {item["slot"]: dict(item) for item in result["screened"]}
    alike = [slot for slot, correlation in correlations_with_best(result).items() if correlation >= MIN_CORRELATION]
    near = [slot for slot in alike if items[slot]["passed"] and items[slot]["gain"] >= NEAR * items[best]["gain"]]
    close = [
        slot
        for slot, item in items.items()
        if item["testable"]
        and analysis.candidates[ids[slot]].strongly_curved
        and (slot == best or slot in result["rivals"] or slot in near or ids[slot] in analysis.found)
    ]
    if len(close) < 2:
        return result
    fits = {slot: _with(fit, ids[slot], [ids[other] for other in close if other != slot]) for slot in close}
    for slot in close:
        items[slot]["held_out_after"] = fits[slot][1].held_out
    won = min(close, key=lambda slot: fits[slot][1].held_out)
    best_fit = fits[won][1]
    lost = [
        slot
        for slot, (fitted, estimate) in fits.items()
        if slot != won and (_stays_behind(estimate, best_fit, fit.ratio) or _leaves(fitted, ids[won]))
    ]
    if best not in lost:
        won = best
    # Explaining more than a candidate that passed, by fits, is as significant.
    items[won] |= {"passed": True, "p_value": min(items[won]["p_value"], items[best]["p_value"])}
    rivals = [slot for slot in result["rivals"] if slot not in (won, *lost)]
    word = "missing" if result["verdict"] == "ambiguous" and not rivals else result["verdict"]
    rest = [items[item["slot"]] for item in result["screened"] if item["slot"] != won]
    return {**result, "best": won, "rivals": rivals, "screened": [items[won], *rest], "verdict": word}


def _with(fit: Fit, effect: str, others: Sequence[str]) -> tuple[Analysis, Estimate]:
    """Fit one candidate, with the columns of some others around it."""
    return fit.analysis.solved_for(fit.model.with_effect(effect), fit.own, only=others)


def _stays_behind(estimate: Estimate, best: Estimate, before: float) -> bool:
    """Return whether a fit is behind by more than chance, and clearly or everywhere: see the constants above."""
    behind = estimate.folds - best.folds
    # What one part alone tells may be its own doing: shaking that does not fit the filter, a reference that jumps.
    if np.sum(behind) - np.max(behind) < TOLD:
        return False
    worse = estimate.held_out - best.held_out
    # By so much the ratio of a whole model may stand above one; the sum of squares is about the number of samples.
    chance = 2.0 / np.sqrt(2.0 * np.sum(best.folds))
    never_ahead = np.all(behind > -TOLD) and np.sum(behind) >= NEVER_AHEAD
    everywhere = (np.all(behind > 0.0) or never_ahead) and worse >= LEFT * (best.held_out - 1.0 - chance)
    return bool(everywhere) or worse > CLEARLY_WORSE * (before - best.held_out)


def _leaves(analysis: Analysis, other: str) -> bool:
    """Return whether a fit of one candidate leaves something that another one explains."""
    return analysis.problem.diagnose(analysis.fitted_slots, [analysis.slots.index(other)])["best"] is not None


def _candidate(
    item: Mapping[str, Any], effect: _imufit.Effect, rivals: list[Rival], tested: int, analysis: Analysis
) -> Candidate:
    found = analysis.found.get(effect.id)
    searched = {} if found is None else dict(zip((name for name, _, _ in effect.parameters), found.trial, strict=True))
    grid = {name: searched[name] for name in effect.searched if name in searched}

    def named(values: Array, errors: Array) -> tuple[Parameter, ...]:
        return tuple(
            Parameter(effect.id, name, grid.get(name, float(value)), 0.0 if name in grid else float(error), unit, size)
            for (name, unit, size), value, error in zip(effect.parameters, values, errors, strict=True)
        )

    # Of one log after the other, where each has its own.
    by_log = np.asarray(item["parameters"]).reshape(-1, len(effect.parameters), 2)
    parameters = named(*pooled(by_log[..., 0], by_log[..., 1]))
    threshold = -float(stdtrit(analysis.problem.blocks - 1, ALPHA / tested / 2)) + POWER
    detectable = {
        p.name: (threshold * p.standard_error, p.unit)
        for p in parameters
        if item["testable"] and np.isfinite(p.standard_error) and p.standard_error > 0
    }
    candidate = Candidate(
        effect=effect.id,
        p_value=item["p_value"],
        expected_ratio=item["expected_ratio"],
        held_out_before=item["held_out_before"],
        held_out_after=item["held_out_after"],
        gain=item["gain"],
        gain_error=item["gain_error"],
        parameters=parameters,
        confounded_with=tuple(sorted(rivals, key=lambda rival: -rival.correlation)),
        explanation="",
        status=_status(item),
        minimal_detectable=detectable,
        logs=_own_parameters(analysis, effect.id, [named(at[:, 0], at[:, 1]) for at in by_log]),
    )
    return replace(candidate, explanation=sentences.explanation(card_of(effect), candidate))


def _own_parameters(
    analysis: Analysis, effect_id: str, values: Sequence[tuple[Parameter, ...]]
) -> tuple[LogParameters, ...]:
    """Parameters of an effect by log, where there are several logs and each has its own."""
    if len(analysis.logs) == 1 or effect_id not in OWN:
        return ()
    logs = analysis.having(effect_id)
    return tuple(
        LogParameters(name_of(analysis.logs[k].surveyed.log, k), own) for k, own in zip(logs, values, strict=True)
    )


def _status(item: Mapping[str, Any]) -> str:
    if not item["testable"]:
        return NOT_TESTABLE
    if item["passed"]:
        return "passed"
    if not item["agreed"]:
        return "logs disagree"
    if not item["stable"]:
        return "differs between halves"
    if item["other_sign"]:
        return "negative delay"
    return "not significant" if item["plausible"] else "implausible size"


def _unexplained(analysis: Analysis, step: Any, found: Sequence[Mapping[str, Any]]) -> tuple[Unexplained, ...]:
    """Dependences that nothing in the catalogue explains, with their share of the excess and where in time it lies."""
    if not found:
        return ()
    residuals = [analysis.problem.residual(step, log) for log in range(len(analysis.logs))]
    return tuple(_dependence(analysis, residuals, item) for item in found)


def _dependence(analysis: Analysis, residuals: Sequence[Mapping[str, Any]], item: Mapping[str, Any]) -> Unexplained:
    """Say what one dependence is worth in the log where it is worth most."""

    def share(log: int) -> float:
        panels = residuals[log]["panels"]
        same = (p["share"] for p in panels if (p["channel"], p["covariate"]) == (item["channel"], item["covariate"]))
        return max(float(next(same, 0.0)), _share(analysis.logs[log], residuals[log], item))

    concerned = range(len(residuals)) if item["log"] is None else [item["log"]]
    having = [log for log in concerned if any(c["channel"] == item["channel"] for c in residuals[log]["channels"])]
    log = max(having, key=share)
    facts = analysis.logs[log].facts
    edges = analysis.logs[log].passes.edges(facts)
    first, last = next(c["stretch"] for c in residuals[log]["channels"] if c["channel"] == item["channel"])
    return Unexplained(
        item["channel"], item["covariate"], share(log), item["shape"], float(edges[first]), float(edges[last])
    )


def _share(evidence: LogEvidence, residual: Mapping[str, Any], item: Mapping[str, Any]) -> float:
    """Return what a dependence explains of the excess of its channel in a log, bins or not.

    Of columns of their own the error with them tells, of all axes of the sensor together. Of block means the whitened
    gain does: what changes so slowly is whitened by the filter's gain at no frequency.
    """
    k = CHANNELS.index(item["channel"]) if item["channel"] in CHANNELS else None
    # A channel without any noise stands on one value.
    if k is None or evidence.floors[k] == 0.0:
        return 0.0
    excess = {
        each["index"]: each["n"] * ((each["rms"] / evidence.floors[each["index"]]) ** 2 - 1.0)
        for each in residual["channels"]
        if evidence.floors[each["index"]] > 0.0
    }
    if item["held_out"] is not None:
        before, after = item["held_out"]
        drop = (before**2 - after**2) * sum(each["n"] for each in residual["channels"])
        of = sum(excess.get(axis, 0.0) for axis in range(k - k % 3, k - k % 3 + 3))
    else:
        drop = item["gain"] * evidence.variance[k] / (evidence.slow_gain(k) * evidence.floors[k] ** 2)
        of = excess.get(k, 0.0)
    return float(np.clip(drop / of, 0.0, 1.0)) if of > 0.0 else 0.0


def _notes(analysis: Analysis) -> tuple[str, ...]:
    """Return what the reader should know of the logs; of several each note tells which of them it is about."""
    found = [
        (each.surveyed.log, without_reference.notes(each) if isinstance(each.passes, RestPasses) else notes(each))
        for each in analysis.logs
    ]
    if len(found) == 1:
        return found[0][1]
    return tuple(f"{name_of(log, k)}: {note}" for k, (log, own) in enumerate(found) for note in own)
