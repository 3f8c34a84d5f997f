"""Diagnose and add, again and again, until nothing is missing; then swap and drop what later effects made needless."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace

from imufit.comparing import attitude_comparison, comparison
from imufit.diagnosing.add import add, expected_error
from imufit.diagnosing.diagnose import diagnose
from imufit.diagnosing.revise import revise, unsettled_rivals
from imufit.figures import quantity
from imufit.fitting import FittedStack
from imufit.model.catalogue import find_effect
from imufit.progress import Progress, silent
from imufit.results import Addition, Diagnosis, Ladder, Revision, Step
from imufit.results.diagnosis import SIGNIFICANT

MAX_STEPS = 12


def ladder(start: FittedStack, progress: Progress | None = None) -> Ladder:
    """Repeat diagnose and add until nothing is missing, or until the log does not determine the missing effect.

    Parameters
    ----------
    start : FittedStack
        Where to start from: of logs with reference attitude, or with rests that stand in for one.
    progress : callable, optional
        Called with (rows done, rows in all, what is being done).

    Returns
    -------
    Ladder
        Every step with the held-out error before, expected and after, the final model and verdict.

    Raises
    ------
    InputError
        The log has no usable reference.
    """
    climb = Climb(start, progress=progress or silent)
    climb.up()
    seen: set[frozenset[str]] = set()
    revisions: list[Revision] = []
    while way := revise(climb.fit, [step.effect for step in climb.steps], start.ratio, seen):
        revisions += way
        climb = climb.again([(revision.removed, revision.by) for revision in way])
        climb.up()
    climb, diagnosis = climb.end()
    fit, worst = climb.fit, start.worst
    return Ladder(
        steps=tuple(climb.steps),
        model=fit.model.effects,
        verdict=diagnosis.verdict,
        ratio_start=start.ratio,
        ratio_end=fit.ratio,
        attitude=attitude_comparison(fit.model_of(worst), fit.logs[worst], progress=progress or silent),
        diagnosis=diagnosis,
        comparison_start=comparison(start.analysis, start.estimate.step, worst),
        comparison_end=comparison(fit.analysis, fit.estimate.step, worst),
        first=climb.first,
        fit=fit,
        sentence=_sentence(start.ratio, fit.ratio, climb.steps, diagnosis),
        revisions=tuple(revisions),
        start=start,
    )


class Climb:
    """A model on its way up, an effect at a time.

    Parameters
    ----------
    start : FittedStack
        Where it starts from.
    first : Diagnosis, optional
        What is missing there, if that is known.
    progress : callable, optional
        Called at every step.

    Attributes
    ----------
    fit : FittedStack
        The model so far.
    steps : list of Step
        Effects added so far.
    diagnosis : Diagnosis
        What is missing from it.
    first : Diagnosis
        What was missing at the start.
    tied : dict
        Rivals of each effect that was added at `ambiguous`. An effect that is found later may separate them.
    """

    def __init__(self, start: FittedStack, first: Diagnosis | None = None, progress: Progress = silent) -> None:
        self.start = self.fit = start
        self.steps: list[Step] = []
        self._progress = progress
        self.first = self.diagnosis = first or self._diagnose()
        self.tied: dict[str, tuple[str, ...]] = {}

    def up(self) -> None:
        """Add what is missing, until nothing is missing or the log does not determine it."""
        futile: set[str] = set()
        while len(self.steps) < MAX_STEPS:
            effect = next_effect(self.fit, self.diagnosis, futile)
            if effect is None:
                break
            expected = next(c.held_out_after for c in self.diagnosis.candidates if c.effect == effect)
            addition = self._add(effect, expected)
            if not _foretells(addition.fit, self.fit):
                # The fit did not confirm the evidence: the next one may.
                futile.add(effect)
                continue
            futile.clear()
            alike = self.diagnosis.named
            if effect in alike and len(alike) > 1:
                self.tied[effect] = tuple(other for other in alike if other != effect)
            self._take(addition)
            self.diagnosis = self._diagnose()

    def end(self) -> tuple[Climb, Diagnosis]:
        """Return the way without what the log does not determine, and what is missing there.

        Of an effect that rivals explain as well nothing is known but that one of them is there: in another log each has
        other consequences. Rivals of the same column, such as a delay and a low-pass, lower the error everywhere: one
        stays in the model, and the answer is that of the model without it.
        """
        unsettled = {effect: unsettled_rivals(self.fit, effect, rivals) for effect, rivals in self.tied.items()}
        unsettled = {effect: rivals for effect, rivals in unsettled.items() if rivals}
        held = {e: rivals for e, rivals in unsettled.items() if all(_same_column(e, other) for other in rivals)}
        lost = [effect for effect in unsettled if effect not in held]
        climb = self.again([(effect, None) for effect in lost]) if lost else self
        answer = climb.diagnosis
        if held and answer.verdict == "adequate":
            without = climb.again([(effect, None) for effect in held]).diagnosis
            if without.verdict != "ambiguous":
                return climb, answer
            answer = replace(without, sentence="")
        alike = (
            f"{' and '.join((effect, *rivals))} explain this log equally well, and the model holds {effect}."
            for effect, rivals in held.items()
        )
        return climb, replace(answer, sentence=" ".join(filter(None, (answer.sentence, *alike))))

    def again(self, changes: Sequence[tuple[str, str | None]]) -> Climb:
        """Return a way from the same start with effects replaced by others, or left out (None).

        Of those that are left each step adds the one that lowers the error most.
        """
        effects = [step.effect for step in self.steps]
        other = Climb(self.start, self.first, self._progress)
        other.tied = dict(self.tied)
        for removed, by in changes:
            at = effects.index(removed)
            effects[at : at + 1] = [] if by is None else [by]
            rivals = other.tied.pop(removed, ())
            if rivals and by is not None:
                other.tied[by] = tuple(rival for rival in (*rivals, removed) if rival != by)
        while effects:
            errors = {effect: other._error_with(effect) for effect in effects}
            effect = min(effects, key=errors.__getitem__)
            effects.remove(effect)
            # Only the last fit is asked what else is missing.
            other._take(other._add(effect, errors[effect], effects or None))
        other.diagnosis = other._diagnose()
        return other

    def _diagnose(self) -> Diagnosis:
        """Ask what is missing from the model so far."""
        on_top = self.steps[-1].effect if self.steps else "the model it starts from"
        self._progress(0, 1, f"step {len(self.steps) + 1}: looking for effects missing in {on_top}")
        return diagnose(self.fit)

    def _add(self, effect: str, expected: float | None = None, only: Collection[str] | None = None) -> Addition:
        """Add an effect to the model so far; see :func:`imufit.diagnosing.add.add`."""
        others = sum(item.effect != effect for item in self.diagnosis.candidates)
        self._progress(0, 1, f"step {len(self.steps) + 1}: {effect} against {others} candidates")
        return add(self.fit, effect, expected, only)

    def _error_with(self, effect: str) -> float:
        """Held-out error of the model so far with an effect beside it, by its columns."""
        return expected_error(self.fit, effect) if effect in self.fit.analysis.candidates else math.inf

    def _take(self, addition: Addition) -> None:
        self.fit = addition.fit
        step = Step(addition.effect, addition.before, addition.expected, addition.after, self.fit.training_ratio)
        self.steps.append(step)


def _same_column(effect: str, other: str) -> bool:
    """Return whether two effects act alike in any log, but for what is small of second order."""
    first, second = find_effect(effect), find_effect(other)
    curved = first.strongly_curved and second.strongly_curved
    return curved and (first.stage, first.sensors) == (second.stage, second.sensors)


def next_effect(fit: FittedStack, diagnosis: Diagnosis, futile: Collection[str] = ()) -> str | None:
    """Return the effect to add next: the significant one that lowers the error most.

    Where others explain as much as the best one, an effect that stands out whichever of them is there comes first if it
    lowers the error more. A large effect that is left out would be charged to small ones.

    Parameters
    ----------
    fit : FittedStack
        The model so far.
    diagnosis : Diagnosis
        What was found on top of it.
    futile : collection of str
        Effects that were tried and did not lower the held-out error.
    """
    if diagnosis.verdict in ("adequate", "unknown") or diagnosis.without:
        return None
    if diagnosis.verdict == "ambiguous":
        after = {item.effect: item.held_out_after for item in diagnosis.candidates}
        first = filter(None, (_beside_the_unsure(fit), diagnosis.best))
        offered = (*sorted(first, key=lambda effect: after.get(effect, math.inf)), *diagnosis.ambiguous_with)
        return next((effect for effect in offered if effect not in futile), None)
    significant = [c for c in diagnosis.candidates if c.status == SIGNIFICANT and c.effect not in futile]
    return min(significant, key=lambda c: c.held_out_after).effect if significant else None


def _beside_the_unsure(fit: FittedStack) -> str | None:
    """Return what stands out once one of the tied effects is in the model, whichever it is."""
    analysis = fit.analysis
    model, candidates = list(analysis.fitted_slots), list(analysis.candidate_slots)
    while True:
        result = analysis.problem.diagnose(model, candidates)
        best, rivals = result.best, result.rivals
        if best is None or not rivals:
            return None if best is None else analysis.slots[best]
        model.append(best)
        candidates = [slot for slot in candidates if slot != best and slot not in rivals]


def _foretells(fit: FittedStack, before: FittedStack) -> bool:
    """Return whether a fit foretells data that it did not use better than the fit before.

    Each channel counts in units of its own noise: a sensor that is shaken does not hide what an effect takes off
    another one.
    """
    return float(fit.estimate.folds.sum()) < float(before.estimate.folds.sum())


def _sentence(start: float, end: float, steps: list[Step], diagnosis: Diagnosis) -> str:
    if not steps:
        return diagnosis.sentence
    names = ", ".join(step.effect for step in steps)
    return f"Adding {names} cut the held-out error {quantity.fall(start, end)}. {diagnosis.sentence}"
