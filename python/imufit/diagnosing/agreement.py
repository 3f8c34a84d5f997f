"""Which of several logs disagrees with the others, and what the answer is without it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np

from imufit import _imufit
from imufit.fitting.analysis import Analysis
from imufit.log.several import name_of
from imufit.model.catalogue import find_effect
from imufit.results import Diagnosis, Disagreement, Parameter, Without

if TYPE_CHECKING:
    from imufit.fitting import FittedStack


def disagreements(analysis: Analysis, found: Sequence[_imufit.Disagreement]) -> tuple[Disagreement, ...]:
    """Name logs and effects of the disagreements in the evidence.

    Parameters
    ----------
    analysis : Analysis
        The evidence.
    found : sequence of _imufit.Disagreement
        The disagreements: slot, log, parameters by that log and by the others.
    """
    out = []
    for item in found:
        key = analysis.slots[item.slot]
        log = item.log
        out.append(
            Disagreement(
                name_of(analysis.logs[log].surveyed.log, log),
                key,
                _named(analysis, key, item.own),
                _named(analysis, key, item.others),
                float(np.exp(-item.ln_bayes)),
                item.wild,
            )
        )
    return tuple(out)


def _named(analysis: Analysis, key: str, steps: Sequence[tuple[float, float]]) -> tuple[Parameter, ...]:
    """Parameters of an effect from steps from where the evidence was taken, with their errors."""
    parameters = find_effect(key).parameters
    present = analysis.model.parameters[key].values() if key in analysis.model.effects else [0.0] * len(parameters)
    return tuple(
        Parameter(key, name, start + step, error, unit, typical)
        for (name, unit, typical), start, (step, error) in zip(parameters, present, steps, strict=True)
    )


def answers_without(
    fit: FittedStack, spoiling: Collection[int], diagnose: Callable[[FittedStack], Diagnosis]
) -> tuple[Without, ...]:
    """Ask again without the logs that spoil the answer; of logs that all do, ask each alone.

    Parameters
    ----------
    fit : FittedStack
        To all logs.
    spoiling : collection of int
        Numbers of the logs.
    diagnose : callable
        Asks the question of a fit.
    """
    everything = range(len(fit.logs))
    rest = [log for log in everything if log not in spoiling]
    names = [name_of(log, k) for k, log in enumerate(fit.logs)]
    out = []
    for chosen in [rest] if rest else [[log] for log in everything]:
        answer = diagnose(fit.of_logs(chosen))
        left_out = tuple(names[log] for log in everything if log not in chosen)
        out.append(Without(left_out, answer.verdict, answer.best, answer.sentence))
    return tuple(out)
