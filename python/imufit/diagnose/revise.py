"""Swaps and drops: effects that later ones made needless, or less apt than another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from imufit.diagnose.curved import likelier, matters
from imufit.results import Revision

if TYPE_CHECKING:
    from imufit.fit import FittedStack

Swap = tuple[str | None, str | None]
"""An effect and what takes its place, if anything."""


def revise(fit: FittedStack, added: Sequence[str], tried: set[Swap]) -> Revision | None:
    """Return the first swap or drop that a fit confirms.

    The evidence proposes, to first order; the fit of the other stack decides: a swap must lower the held-out error, a
    drop must not raise it. Where columns say little of an effect's full size, the marginal likelihood of the fits
    proposes and decides.

    Parameters
    ----------
    fit : FittedStack
        The model with all that was added.
    added : sequence of str
        Effects that may be taken out again: what the user began with stays.
    tried : set of tuple
        What was proposed before; what is proposed now is put in.
    """
    analysis = fit.analysis
    ids = analysis.slots
    members = [slot for slot in analysis.fitted_slots if ids[slot] in added]
    if len(members) < 2:
        return None
    for slot, better in analysis.problem.revisions(analysis.fitted_slots, members, analysis.candidate_slots):
        removed, by = ids[slot], None if better is None else ids[better]
        if (removed, by) in tried:
            continue
        tried |= {(removed, by), (by, removed)}
        model = fit.model.without_effect(removed)
        other = fit.moved(model if by is None else model.with_effect(by))
        if matters(fit.ratio, other.ratio) if by else not matters(other.ratio, fit.ratio):
            return Revision(removed, by, fit.ratio, other.ratio)
    for slot in members:
        removed = ids[slot]
        if (removed, removed) in tried:
            continue
        tried.add((removed, removed))
        by = likelier(fit, slot)
        if by is not None:
            tried.add((by, by))
            other = fit.moved(fit.model.without_effect(removed).with_effect(by))
            return Revision(removed, by, fit.ratio, other.ratio)
    return None
