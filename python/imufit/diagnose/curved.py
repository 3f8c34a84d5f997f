"""Effects whose columns say little of their full size: a fit of each decides among them.

A late sensor and a sluggish one have the same column, and columns taken at one point say little of a delay as long as
a turn takes, or of play in a drive.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from imufit._imufit import Status, Verdict
from imufit.model.catalogue import find_effect

if TYPE_CHECKING:
    from imufit.fit import FittedStack
    from imufit.fit.analysis import Analysis
    from imufit.model import EffectStack

NEAR = 0.7
"""Share of an effect's log Bayes factor from which on a fit may show that another candidate explains more (0.74 for a
reference that is 85 ms late, on a robot's arm; columns say that the accelerometer is)."""
MATTERS = 0.002
"""Share of the held-out error that counts: a smaller gain does not justify a swap, or keeping an effect."""
LESS = 0.01
"""Part of what the best fit takes off the square of the held-out error by which another may take off less: a late
reference and a gyroscope that would have to be early and sluggish differ by 0.1 % where smoothing the reference's noise
pays, a delay and a low-pass of a gyroscope by 0.3 %."""


def fitted(fit: FittedStack, result: Verdict) -> list[tuple[int, float]]:
    """Log Bayes factors of the best candidate and others like it, from fits beside all that is there, by slot.

    Candidates whose columns differ by far need no fit, unless these columns depend on a search. That of a fit that
    leaves a higher held-out error than another one is minus infinity; rivals whose columns say all count alike.

    Parameters
    ----------
    fit : FittedStack
        The model.
    result : Verdict
        The answer of the columns alone.
    """
    analysis = fit.analysis
    ids = analysis.slots
    best = result.best
    if best is None or not (result.rivals or _curved(analysis, best)):
        return []
    items = {item.slot: item for item in result.candidates}
    alike = {second for _, second, _ in result.correlations}
    near = {slot for slot in alike if items[slot].ln_bayes >= NEAR * items[best].ln_bayes}
    named = {best, *result.rivals}
    in_its_place = {*named, *near, *(slot for slot in items if ids[slot] in analysis.found)}
    close = [
        slot
        for slot, item in items.items()
        if slot in in_its_place and item.status != Status.NOT_TESTABLE and (slot in named or _curved(analysis, slot))
    ]
    if len(close) < 2:
        return []
    # What else is missing would be charged to the one that stands in for it best.
    others = fit.model
    for slot, item in items.items():
        if item.status == Status.PASSED and slot not in in_its_place:
            others = others.with_effect(ids[slot])
    without = evidence_of(fit, others)
    evidence = _guarded(without, {slot: evidence_of(fit, others.with_effect(ids[slot])) for slot in close})
    most = max(evidence.values())
    # Where columns say all, a fit tells by the error alone: freedom alone does not tell one cause from another.
    equal = {slot for slot in close if np.isfinite(evidence[slot]) and not _curved(analysis, slot)}
    return [(slot, (most if slot in equal else ln) - without[0]) for slot, ln in evidence.items()]


def likelier(fit: FittedStack, slot: int) -> str | None:
    """Return the effect that explains more in the place of one of the model, by a fit of each; None if none does.

    Parameters
    ----------
    fit : FittedStack
        The model.
    slot : int
        Slot of the effect.
    """
    analysis = fit.analysis
    ids = analysis.slots
    if not _curved(analysis, slot):
        return None
    candidates = [other for other in analysis.candidate_slots if _curved(analysis, other)]
    near = analysis.problem.alike(analysis.fitted_slots, slot, candidates, NEAR)
    if not near:
        return None
    others = fit.model.without_effect(ids[slot])
    fits = {other: evidence_of(fit, others.with_effect(ids[other])) for other in [*near, slot]}
    evidence = _guarded(evidence_of(fit, others), fits)
    best = max(evidence, key=lambda other: evidence[other])
    more = evidence[best] - evidence[slot]
    return ids[best] if more > analysis.problem.threshold(len(analysis.candidates)) else None


def _guarded(without: tuple[float, float], fits: dict[int, tuple[float, float]]) -> dict[int, float]:
    """Return log evidences by slot, minus infinity where another fit takes off more of the error by what counts.

    The evidence of a large log rests on the noise at frequencies that hold little of the error; where the error is not
    the same, it decides. Noise of the reference is no part of what a fit takes off.
    """
    lowest = min(error for _, error in fits.values())
    least = lowest**2 + LESS * max(without[1] ** 2 - lowest**2, 0.0)
    return {slot: ln if error**2 <= least else -np.inf for slot, (ln, error) in fits.items()}


def matters(before: float, after: float) -> bool:
    """Return whether a held-out error falls by enough to count.

    Parameters
    ----------
    before, after : float
        Held-out errors.
    """
    return before - after >= MATTERS * before


def evidence_of(fit: FittedStack, model: EffectStack) -> tuple[float, float]:
    """Return the log evidence of a model around its best parameters, and its held-out error.

    The reference may have lost fast motion or not: such a loss equals the difference, of second order, between a late
    sensor and a sluggish one.

    Parameters
    ----------
    fit : FittedStack
        Where to start from.
    model : EffectStack
        The model.
    """
    known = fit.analysis.candidates
    lost = [key for key, effect in known.items() if effect.reference_part == "bandwidth" and key not in model.effects]
    analysis, estimate = fit.analysis.solved_for(model, fit.own, only=lost)
    return fit.analysis.ln_likelihood(analysis), estimate.held_out


def _curved(analysis: Analysis, slot: int) -> bool:
    key = analysis.slots[slot]
    effect = analysis.candidates.get(key) or find_effect(key)
    return effect.strongly_curved
