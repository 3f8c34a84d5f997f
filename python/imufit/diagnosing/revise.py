"""Exchanges and drops: whether a stack near the one that was climbed to is likelier, by a fit of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from imufit.diagnosing.curved import Tried, as_low, tried
from imufit.results import Revision

if TYPE_CHECKING:
    from imufit.fitting import FittedStack
    from imufit.model import EffectStack

MORE = 1.0
"""Log odds by which another stack must be likelier: less is within what the iteration leaves open."""
SETTLED = 2.0
"""Log odds by which an effect must be likelier than each rival that it had when it was added: seven to one."""


def revise(fit: FittedStack, added: Sequence[str], start: float, seen: set[frozenset[str]]) -> list[Revision]:
    """Return how to get from a stack to the likeliest of those near it; empty if none is likelier.

    Each differs by one effect that is not there or stands in the place of another, and then lacks what this made
    needless. The columns propose, to first order; the marginal likelihood of the fits decides, every effect with the
    odds against it. The held-out error must agree: that of the likelier stack is as low, but for what does not count.

    Parameters
    ----------
    fit : FittedStack
        The model with all that was added.
    added : sequence of str
        Effects that may be taken out again: what the user began with stays.
    start : float
        Held-out error before anything was added.
    seen : set of frozenset of str
        Stacks that were tried before; those tried now are put in.
    """
    analysis = fit.analysis
    ids = analysis.slots
    members = [slot for slot in analysis.fitted_slots if ids[slot] in added]
    if len(members) < 2:
        return []
    search = _Search(fit, frozenset(added), start, seen)
    for slot, other in analysis.problem.revisions(analysis.fitted_slots, members, analysis.candidate_slots):
        search.ask(ids[slot], None if other is None else ids[other])
    return search.way


def unsettled_rivals(fit: FittedStack, effect: str, rivals: Sequence[str]) -> list[str]:
    """Return the rivals of an effect of a model that are nearly as likely in its place, by a fit of each.

    Parameters
    ----------
    fit : FittedStack
        The model.
    effect : str
        One of its effects.
    rivals : sequence of str
        Its rivals when it was added.
    """
    others = fit.model.without_effect(effect)
    models = {rival: others.with_effect(rival) for rival in rivals if rival not in fit.model.effects}
    if not models:
        return []
    least = _likelihood(fit, fit.model, tried(fit, fit.model)) - SETTLED
    return [rival for rival, model in models.items() if _likelihood(fit, model, tried(fit, model)) > least]


def _likelihood(fit: FittedStack, model: EffectStack, found: Tried) -> float:
    """Log of the probability of a stack, up to a constant; a loss of the reference may be there in any."""
    analysis = fit.analysis
    known = analysis.candidates
    named = [key for key in model.effects if key not in known or known[key].reference_part != "bandwidth"]
    return found.ln_evidence - analysis.problem.threshold(len(known)) * len(named)


class _Search:
    """The likeliest stack so far, and the way there."""

    def __init__(self, fit: FittedStack, free: frozenset[str], start: float, seen: set[frozenset[str]]) -> None:
        self.fit, self.free, self.start, self.seen = fit, free, start, seen
        self.first = tried(fit, fit.model)
        self.most = _likelihood(fit, fit.model, self.first) + MORE
        self.way: list[Revision] = []
        seen.add(frozenset(fit.model.effects))

    def ask(self, removed: str, by: str | None) -> None:
        """Try the stack with an effect in the place of another, or without it, then without what is needless there."""
        model = self.fit.model.without_effect(removed)
        model = model if by is None else model.with_effect(by)
        way = [(removed, by)]
        while frozenset(model.effects) not in self.seen:
            self.seen.add(frozenset(model.effects))
            found = tried(self.fit, model)
            likelihood = _likelihood(self.fit, model, found)
            if likelihood > self.most and as_low(found, self.first, self.start):
                self.most = likelihood
                errors = self.first.held_out, found.held_out
                self.way = [Revision(effect, instead, *errors) for effect, instead in way]
            ids = found.analysis.slots
            members = [slot for slot in found.analysis.fitted_slots if ids[slot] in self.free - {by}]
            needless = found.analysis.problem.needless(found.analysis.fitted_slots, members)
            if needless is None:
                return
            model = model.without_effect(ids[needless])
            way.append((ids[needless], None))
