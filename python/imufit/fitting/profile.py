"""Profile search: parameters inside an effect (a period, a width) are tried on a grid before its columns are taken."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from imufit import _imufit
from imufit.fitting.surveyed_log import SurveyedLog
from imufit.model.catalogue import find_effect

CHANCE = 20.0
"""Drop of the sum of squares, in units of the noise, below which the best of a grid is not worth a finer one. A
lateness that changes readings by less than their noise is left to its slope, which has no noise of the reference in
common with the residual. Noise has no direction of time: what a sensor that knows what comes explains as well is
noise."""


@dataclass(frozen=True)
class Found:
    """The best values of a search for one effect.

    Attributes
    ----------
    trial : list of float
        Values of all its parameters that its columns are taken for.
    start : list of float
        Values to start a fit from.
    spread : list of float
        Standard deviation of these where the search decides them for good; else zero.
    """

    trial: list[float]
    start: list[float]
    spread: list[float]


def search(
    logs: Sequence[SurveyedLog],
    fitted: Sequence[Mapping[str, list[float]]],
    candidates: Mapping[str, _imufit.Effect],
    around: Mapping[str, list[float]] | None = None,
) -> dict[str, Found]:
    """Search for those candidates that have something to search for, each alone on top of a model, in all logs at once.

    Parameters
    ----------
    logs : sequence of SurveyedLog
        The logs.
    fitted : sequence of mapping
        For each log the effects of its model with their parameters, which move along.
    candidates : mapping
        Effects by id.
    around : mapping, optional
        By id values of all parameters near which is to be searched; without it everywhere.

    Returns
    -------
    dict of str to Found
        By id, for those of the candidates that have a grid.
    """
    found: dict[str, Found] = {}
    tellers = {
        key: [k for k, each in enumerate(logs) if each.refusal(effect) is None] for key, effect in candidates.items()
    }
    # The longest log limits the longest times.
    guides = {key: logs[max(known, key=lambda k: _duration(logs[k]))].facts for key, known in tellers.items() if known}
    # An effect that steps move from any trial is tried only as far as it may explain something.
    moved = {key: [[0.0]] for key in guides if candidates[key].tried_at_full_size and not candidates[key].jumps}
    moved = {key: zero for key, zero in moved.items() if candidates[key].search(guides[key])}
    furthest = {
        key: _imufit.furthest_trial(searches)
        for key, searches in _filled(logs, fitted, candidates, tellers, moved).items()
    }
    finer = 0

    def grids_of(found: Mapping[str, list[float]] | None, keys: Iterable[str]) -> dict[str, list[list[float]]]:
        every = {
            key: candidates[key].search(guides[key], *(() if found is None else (found[key], finer))) for key in keys
        }
        near = {
            key: [at for at in grid if key not in furthest or abs(at[0]) <= furthest[key]]
            for key, grid in every.items()
        }
        # A single trial leaves nothing to choose.
        return {key: grid for key, grid in near.items() if len(grid) > (key in furthest)}

    grids = grids_of(around, guides)
    finer += around is not None
    while grids:
        for key, searches in _filled(logs, fitted, candidates, tellers, grids).items():
            best = _imufit.best_trial(searches)
            grid = grids.pop(key)
            if best is not None:
                number, step, spread, gain, mirrored, samples = best
                steps = _steps(grid)
                found[key] = _found(candidates[key], grid[number], step, spread, steps)
                if gain > CHANCE and not any(s > h for s, h in zip(spread, steps, strict=True)):
                    grids |= grids_of({key: found[key].trial}, [key])
                if key in furthest and key not in grids and gain - max(mirrored, 0.0) < samples:
                    del found[key]
        finer += 1
    return found


def _filled(
    logs: Sequence[SurveyedLog],
    fitted: Sequence[Mapping[str, list[float]]],
    candidates: Mapping[str, _imufit.Effect],
    tellers: Mapping[str, list[int]],
    grids: Mapping[str, list[list[float]]],
) -> dict[str, list[_imufit.Profile]]:
    """Try the values of each grid on the logs that can show the effect (`tellers`)."""
    profiles: dict[str, list[_imufit.Profile]] = {key: [] for key in grids}
    for k, (each, values) in enumerate(zip(logs, fitted, strict=True)):
        stack = [(find_effect(key), at) for key, at in values.items()]
        asked = [key for key in grids if k in tellers[key]]
        own = [_imufit.Profile(each.facts, stack, candidates[key], grids[key]) for key in asked]
        each.passes.fill(own, each.facts)
        for key, profile in zip(asked, own, strict=True):
            profiles[key].append(profile)
    return profiles


def _duration(each: SurveyedLog) -> float:
    return each.facts.t_end - each.facts.t_start


def _steps(grid: list[list[float]]) -> list[float]:
    """Return the smallest distance of two trials in each parameter; zero where all are the same."""
    apart = np.diff(np.sort(grid, axis=0), axis=0)
    return [float(min(column[column > 0.0], default=0.0)) for column in apart.T]


def _found(
    effect: _imufit.Effect, trial: list[float], step: list[float], spread: list[float], steps: list[float]
) -> Found:
    if effect.jumps:
        # A grid does not resolve more than its own step.
        return Found(step, step, [max(s, h / np.sqrt(12.0)) for s, h in zip(spread, steps, strict=True)])
    if effect.tried_at_full_size:
        return Found(step, step, spread)
    start = [
        searched if name in effect.searched else moved
        for (name, _, _), searched, moved in zip(effect.parameters, trial, step, strict=True)
    ]
    return Found(trial, start, spread)
