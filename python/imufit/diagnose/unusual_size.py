"""Effects of a size that sensors hardly have, but that explain everything."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from imufit.fit.analysis import Analysis

LIKELY = 1e-6
"""p-value up to which such an effect counts."""


def with_unusual_size(analysis: Analysis, result: Mapping[str, Any], slots: Sequence[int]) -> Mapping[str, Any]:
    """Name an effect far beyond its typical size, if nothing else is significant and nothing at all is left beside it.

    Something outside the catalogue looks like such an effect only in part; a part that is broken is like it in all.

    Parameters
    ----------
    analysis : Analysis
        Evidence of the logs.
    result : mapping
        What `_imufit.Problem.diagnose` found.
    slots : sequence of int
        Candidates.
    """
    if result["verdict"] != "unknown" or result["best"] is not None or result["spoilt"]:
        return result

    def explains(item: Mapping[str, Any]) -> bool:
        slot = item["slot"]
        beyond = item["testable"] and item["too_large"] and item["stable"] and item["agreed"]
        if not beyond or item["gain"] <= 0.0 or item["p_value"] > LIKELY:
            return False
        others = [other for other in slots if other != slot]
        beside = analysis.problem.diagnose([*analysis.fitted_slots, slot], others, analysis.probe_slots)
        return bool(beside["verdict"] == "adequate")

    found = [item for item in result["screened"] if explains(item)]
    if not found:
        return result
    best, *rivals = (item["slot"] for item in sorted(found, key=lambda item: -item["gain"]))
    first = [item | {"passed": True} for item in found]
    rest = [item for item in result["screened"] if item["slot"] not in (best, *rivals)]
    return {
        **result,
        "best": best,
        "rivals": rivals,
        "screened": [*first, *rest],
        "verdict": "ambiguous" if rivals else "missing",
        "unexplained": [],
    }
