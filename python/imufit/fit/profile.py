"""Profile search: parameters inside an effect (a period, a width) are tried on a grid before its columns are taken."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from imufit import _imufit
from imufit.fit.passes import Passes

CHANCE = 20.0
"""Drop of the sum of squares, in units of the noise, below which the best of a grid is not worth a finer one."""

Stack = Sequence[tuple[_imufit.Effect, list[float]]]


@dataclass(frozen=True)
class Found:
    """What a search found best for one effect.

    Attributes
    ----------
    trial : list of float
        Values of all its parameters that its columns are taken for.
    start : list of float
        Values to start a fit from.
    """

    trial: list[float]
    start: list[float]


def search(
    passes: Passes, facts: _imufit.Facts, stack: Stack, candidates: Mapping[str, _imufit.Effect]
) -> dict[str, Found]:
    """Search for those candidates that have something to search for, each alone on top of a model.

    Parameters
    ----------
    passes : Passes
        Over the log.
    facts : Facts
        Of the log.
    stack : sequence of (Effect, list of float)
        Effects of the model with their parameters, which move along.
    candidates : mapping
        Effects by id.

    Returns
    -------
    dict of str to Found
        By id, for those of the candidates that have a grid.
    """
    found: dict[str, Found] = {}
    grids = {key: effect.search(facts) for key, effect in candidates.items()}
    grids = {key: grid for key, grid in grids.items() if grid}
    finer = 0
    while grids:
        profiles = {key: _imufit.Profile(facts, stack, candidates[key], grid) for key, grid in grids.items()}
        for arrays in passes.chunks(facts.margin, "searching periods and widths"):
            for profile in profiles.values():
                profile.add(arrays)
        for key, profile in profiles.items():
            best = profile.best()
            grid = grids.pop(key)
            if best is not None:
                number, step, gain = best
                found[key] = _found(candidates[key], grid[number], step)
                if gain > CHANCE:
                    grids[key] = candidates[key].search(facts, found[key].trial, finer)
        grids = {key: grid for key, grid in grids.items() if grid}
        finer += 1
    return found


def _found(effect: _imufit.Effect, trial: list[float], step: list[float]) -> Found:
    start = [
        searched if name in effect.searched else moved
        for (name, _, _), searched, moved in zip(effect.parameters, trial, step, strict=True)
    ]
    return Found(trial, start)
