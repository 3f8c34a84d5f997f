"""Effects whose columns say little of their full size: a fit of each decides among them.

A late sensor and a low-passed one have the same column, and columns at one point do not describe a delay as long as
a turn takes, or of play in a drive.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from imufit._imufit import Effect, Problem, Status, Verdict
from imufit.fitting.profile import steps_lead_on
from imufit.model.catalogue import each_log_has_its_own, find_effect

if TYPE_CHECKING:
    from imufit.fitting import FittedStack
    from imufit.fitting.analysis import Analysis
    from imufit.fitting.log_evidence import Values
    from imufit.model import EffectStack

LESS = 0.01
"""Part of what the best fit takes off the square of the held-out error by which another may take off less: a late
reference and a gyroscope that would have to be early and low-passed differ by 0.1 % where smoothing the noise of the
reference pays, a delay and a low-pass of a gyroscope by 0.3 %."""


def fitted(fit: FittedStack, result: Verdict, decided: Collection[int] = ()) -> list[tuple[int, float]]:
    """Log Bayes factors of the best candidate and others like it, from fits beside all that is there, by slot.

    Candidates whose columns differ by far need no fit, unless these columns depend on a search. Rivals whose columns
    say all, and that leave an error as low, count alike.

    Parameters
    ----------
    fit : FittedStack
        The model.
    result : Verdict
        The answer of the columns, and of the fits so far.
    decided : collection of int, optional
        Slots of candidates among which fits have decided.
    """
    analysis = fit.analysis
    ids = analysis.slots
    best = result.best
    if best is None or best in decided or not (result.rivals or _curved(analysis, best)):
        return []
    items = {item.slot: item for item in result.candidates}
    alike = {second for _, second, _ in result.correlations}
    near = {slot for slot in alike if items[slot].ln_bayes >= Problem.NEAR * items[best].ln_bayes}
    named = {best, *result.rivals}
    beside = [slot for slot, item in items.items() if item.status == Status.SIGNIFICANT and slot not in named]
    searched = {slot for slot in items if _found_by_search(analysis, slot)}
    in_its_place = {*named, *near, *searched}.difference(beside)
    close = [
        slot
        for slot, item in items.items()
        if slot in in_its_place and item.status != Status.NOT_TESTABLE and (slot in named or _curved(analysis, slot))
    ]
    if len(close) < 2:
        return []
    # Another missing effect would be charged to the effect that replaces it best.
    others = fit.model
    for slot in beside:
        others = others.with_effect(ids[slot])
    steady = [ids[slot] for slot in close if not _curved(analysis, slot)]
    without = tried(fit, others, steady)
    if not np.isfinite(without.ln_evidence):
        # Others that no sensor can have without one of these are not there without it.
        without = tried(fit, fit.model, steady)
    fits = {slot: without.with_effect(fit, ids[slot]) for slot in close}
    # If columns hold all information, a fit decides by the error alone: freedom alone does not separate one cause from
    # another.
    flat = {slot: each for slot, each in fits.items() if ids[slot] in steady}
    lowest = min(flat.values(), key=lambda each: each.held_out, default=None)
    equal = [slot for slot, each in flat.items() if lowest and as_low(each, lowest, without.held_out)]
    evidence = {slot: each.ln_evidence for slot, each in fits.items()}
    most = max((evidence[slot] for slot in equal), default=-np.inf)
    return [(slot, (most if slot in equal else ln) - without.ln_evidence) for slot, ln in evidence.items()]


def as_low(fit: Tried, lowest: Tried, start: float) -> bool:
    """Return whether a fit's held-out error is as low as the lowest one but for what does not count.

    The evidence of a large log rests on the noise at frequencies that hold little of the error; where the error is not
    the same, it decides. Only the fall of the error is compared, since the error holds noise of the reference as well.
    Of n samples of white noise a square smaller by 1/n makes the data likelier by the root of e.

    Parameters
    ----------
    fit, lowest : Tried
        The fit, and the one with the lowest error.
    start : float
        Held-out error without what lowers it.
    """
    square = lowest.held_out**2
    by_chance = 2.0 * Problem.ODDS / max(lowest.samples, 1.0) * square
    return fit.held_out**2 <= square + max(LESS * (start**2 - square), by_chance)


class Tried(NamedTuple):
    """A stack fitted in place of another one.

    Attributes
    ----------
    ln_evidence : float
        Log of its marginal likelihood.
    held_out : float
        Its held-out error.
    samples : float
        Number of samples that this is of.
    analysis : Analysis
        Its evidence, without columns of effects that are not in it.
    """

    ln_evidence: float
    held_out: float
    samples: float
    analysis: Analysis

    def with_effect(self, fit: FittedStack, effect: str) -> Tried:
        """Fit one effect more, from the best parameters of the others on.

        Parameters
        ----------
        fit : FittedStack
            The fit that this stack was tried in place of: its searches say where the effect starts.
        effect : str
            Id of the effect.
        """
        start = replace(self.analysis, found=fit.analysis.found | self.analysis.found)
        if effect not in start.candidates or each_log_has_its_own(effect):
            return _tried(fit, start, start.model.with_effect(effect), start.own)
        slot = start.slots.index(effect)
        estimate = start.estimate([slot])
        model, own = start.moved_to(estimate)
        return _tried(fit, start, model.with_effect(effect).starting_at({effect: [*estimate.values[slot]]}), own)


def tried(fit: FittedStack, model: EffectStack, also: Sequence[str] = ()) -> Tried:
    """Fit another stack, and return its log evidence around its best parameters.

    Parameters
    ----------
    fit : FittedStack
        Where to start from.
    model : EffectStack
        The stack.
    also : sequence of str, optional
        Effects whose columns its evidence has besides.
    """
    return _tried(fit, fit.analysis, model, fit.own, also)


def _tried(
    fit: FittedStack, start: Analysis, model: EffectStack, own: Sequence[Values], also: Sequence[str] = ()
) -> Tried:
    # The reference may have lost fast motion or not: such a loss equals the difference, of second order, between a
    # late sensor and a low-passed one.
    known = fit.analysis.candidates
    lost = [key for key, effect in known.items() if effect.reference_part == "bandwidth" and key not in model.effects]
    analysis, estimate = start.solved_for(model, own, only={*lost, *also})
    open_to = [slot for slot in analysis.candidate_slots if analysis.slots[slot] in lost]
    evidence = fit.analysis.ln_likelihood(analysis, estimate, open_to)
    return Tried(evidence, estimate.held_out, estimate.samples, analysis)


def _effect(analysis: Analysis, slot: int) -> Effect:
    key = analysis.slots[slot]
    return analysis.candidates.get(key) or find_effect(key)


def _curved(analysis: Analysis, slot: int) -> bool:
    return _effect(analysis, slot).strongly_curved


def _found_by_search(analysis: Analysis, slot: int) -> bool:
    """Return whether a search alone finds what steps do not lead to."""
    return analysis.slots[slot] in analysis.found and not steps_lead_on(_effect(analysis, slot))
