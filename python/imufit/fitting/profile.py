"""Profile search: parameters inside an effect (a period, a width) are tried on a grid before its columns are taken."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from imufit import _imufit
from imufit.fitting.surveyed_log import SurveyedLog
from imufit.model.catalogue import find_effect

CHANCE = 20.0
"""Drop of the sum of squares, in units of the noise, below which the best of a grid is not worth a finer one."""

COARSE = 0.5
"""Share of what a size explains that its nearest trial explains at least. Trials are 41 % apart, so that the nearest
one is off by 19 % at most. It leaves 4 % of what slow motion makes, and a seventh where the body turns by two radians
in that time."""


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
    tellers = {
        key: [k for k, each in enumerate(logs) if each.refusal(effect) is None] for key, effect in candidates.items()
    }
    # The longest log limits the longest times.
    guides = {key: logs[max(known, key=lambda k: _duration(logs[k]))].facts for key, known in tellers.items() if known}
    at_first = {key: candidates[key].search(guides[key]) for key in guides}
    sized = {key: grid for key, grid in at_first.items() if grid and steps_lead_on(candidates[key])}
    found = _sized(logs, fitted, candidates, tellers, guides, sized)
    finer = 0
    if around is None:
        grids = {key: grid for key, grid in at_first.items() if grid and key not in sized}
    else:
        grids = {key: candidates[key].search(guides[key], around[key], finer) for key in guides if key not in sized}
        finer += 1
    grids = {key: grid for key, grid in grids.items() if grid}
    while grids:
        for key, searches in _filled(logs, fitted, candidates, tellers, grids).items():
            best = _imufit.best_trial(searches)
            grid = grids.pop(key)
            if best is not None:
                number, step, spread, gain, *_ = best
                steps = _steps(grid)
                found[key] = _found(candidates[key], grid[number], step, spread, steps)
                if gain > CHANCE and not any(s > h for s, h in zip(spread, steps, strict=True)):
                    grids[key] = candidates[key].search(guides[key], found[key].trial, finer)
        grids = {key: grid for key, grid in grids.items() if grid}
        finer += 1
    return found


def steps_lead_on(effect: _imufit.Effect) -> bool:
    """Return whether a size is tried only as a place to start from: columns and steps lead on from there.

    Parameters
    ----------
    effect : Effect
        The effect.
    """
    return effect.tried_at_full_size and not effect.jumps


def _sized(
    logs: Sequence[SurveyedLog],
    fitted: Sequence[Mapping[str, list[float]]],
    candidates: Mapping[str, _imufit.Effect],
    tellers: Mapping[str, list[int]],
    guides: Mapping[str, _imufit.Facts],
    grids: Mapping[str, list[list[float]]],
) -> dict[str, Found]:
    """Find sizes of effects that change readings by more than their noise; a smaller one is left to its slope.

    A difference of two ideal readings has the noise of the reference in common with the residual, a slope has not.
    Noise has no direction of time: what a sensor that knows what comes would explain as well is noise.
    """
    zero = _filled(logs, fitted, candidates, tellers, {key: [[0.0]] for key in grids})
    furthest = {key: _imufit.furthest_trial(searches) for key, searches in zero.items()}
    near = {key: [at for at in grid if abs(at[0]) <= furthest[key]] for key, grid in grids.items()}
    # A single trial leaves nothing to choose.
    near = {key: grid for key, grid in near.items() if len(grid) > 1}
    finer: dict[str, list[list[float]]] = {}
    for key, searches in _filled(logs, fitted, candidates, tellers, near).items():
        best = _imufit.best_trial(searches)
        if best is None:
            continue
        _, size, _, gain, _, samples = best
        if gain >= COARSE * samples:
            finer[key] = candidates[key].search(guides[key], size, 0)
    found: dict[str, Found] = {}
    finer = {key: grid for key, grid in finer.items() if grid}
    for key, searches in _filled(logs, fitted, candidates, tellers, finer).items():
        best = _imufit.best_trial(searches)
        if best is not None:
            _, size, spread, gain, mirrored, samples = best
            if gain - max(mirrored, 0.0) >= samples:
                found[key] = Found(size, size, spread)
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
    start = [
        searched if name in effect.searched else moved
        for (name, _, _), searched, moved in zip(effect.parameters, trial, step, strict=True)
    ]
    return Found(trial, start, spread)
