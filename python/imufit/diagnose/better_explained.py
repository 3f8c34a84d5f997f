"""Candidates that explain more than the best one, though not for certain."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from imufit.diagnose.rivals import is_named, with_rivals
from imufit.diagnose.without_reference import evidence_of
from imufit.fit.analysis import Analysis

UNSURE = 0.2
"""p-value up to which a candidate that is not significant still counts, where every sample is judged."""


def with_better_explained(analysis: Analysis, result: Mapping[str, Any]) -> Mapping[str, Any]:
    """Name beside the best candidate those that explain more than it, though not for certain.

    An effect that several sensors see may be lost in the wandering zero of one of them, while a rival that concerns
    only another sensor is significant: rests are few, and drives with play or flexure show in specific force and
    angular rate. Such a candidate counts if nothing of the best one is left beside it.

    Parameters
    ----------
    analysis : Analysis
        Evidence of the logs.
    result : mapping
        What `_imufit.Problem.diagnose` found.
    """
    if not is_named(result):
        return result
    best = result["best"]
    items = {item["slot"]: item for item in result["screened"]}
    least_sure = UNSURE if evidence_of(analysis) == "reference" else 1.0

    def sensors(slot: int) -> set[str]:
        return set(analysis.candidates[analysis.slots[slot]].sensors)

    def better(slot: int) -> bool:
        item = items[slot]
        unsure = item["testable"] and item["plausible"] and not item["passed"] and item["p_value"] <= least_sure
        if not unsure or item["gain"] <= items[best]["gain"] or not sensors(slot) & sensors(best):
            return False
        return analysis.problem.diagnose([*analysis.fitted_slots, slot], [best])["best"] is None

    return with_rivals(result, [slot for slot in items if slot != best and better(slot)])
