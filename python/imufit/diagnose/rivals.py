"""Rivals that are named beside the best candidate for reasons that its columns do not tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any


def is_named(result: Mapping[str, Any]) -> bool:
    """Return whether a diagnosis names an effect.

    Parameters
    ----------
    result : mapping
        What `_imufit.Problem.diagnose` found.
    """
    return result["best"] is not None and result["verdict"] in ("missing", "ambiguous")


def correlations_with_best(result: Mapping[str, Any]) -> dict[int, float]:
    """Return how much passing candidates look like the best one, by their slots.

    Parameters
    ----------
    result : mapping
        What `_imufit.Problem.diagnose` found.
    """
    best = result["best"]
    return {
        first if second == best else second: correlation
        for first, second, correlation in result["correlations"]
        if best in (first, second)
    }


def with_rivals(result: Mapping[str, Any], more: Sequence[int]) -> Mapping[str, Any]:
    """Return the result with some more rivals, which make it ambiguous.

    Parameters
    ----------
    result : mapping
        What `_imufit.Problem.diagnose` found.
    more : sequence of int
        Slots of candidates.
    """
    new = [slot for slot in more if slot not in result["rivals"]]
    if not new:
        return result
    return {**result, "rivals": [*result["rivals"], *new], "verdict": "ambiguous"}
