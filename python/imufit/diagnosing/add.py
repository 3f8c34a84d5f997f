"""Add an effect: error before, expected and after."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from imufit.errors import InputError
from imufit.model.catalogue import find_effect
from imufit.model.effect import id_of
from imufit.results import Addition

if TYPE_CHECKING:
    from imufit.fitting import FittedStack
    from imufit.model.user_function import Function


def add(
    fit: FittedStack, effect: str | Function, expected: float | None = None, only: Collection[str] | None = None
) -> Addition:
    """Add an effect to a fitted model and refit.

    Parameters
    ----------
    fit : FittedStack
        Where to start from.
    effect : str or callable
        The effect: its id, or the function of one of your own.
    expected : float, optional
        Held-out error expected; asked of the evidence if not given.
    only : collection of str, optional
        Effects about which the new fit will be asked; by default all that the log can show.

    Raises
    ------
    InputError
        The effect is unknown, in the model already, or cannot be tested on this log.
    """
    effect_id = id_of(effect)
    find_effect(effect_id)
    analysis = fit.analysis
    model = fit.model.with_effect(effect_id)
    if effect_id not in analysis.candidates:
        reason = analysis.refusal(find_effect(effect_id)) or "it is fitted along already"
        raise InputError(f"effect {effect_id} cannot be added: {reason}", file=fit.logs[0].path)
    expected = expected_error(fit, effect_id) if expected is None else expected
    better = fit.moved(model, only)
    return Addition(
        effect=effect_id,
        before=fit.ratio,
        expected=expected,
        after=better.ratio,
        held_out=True,
        parameters=tuple(p for p in better.parameters if p.effect == effect_id),
        model=better.model.effects,
        fit=better,
    )


def expected_error(fit: FittedStack, effect: str) -> float:
    """Return the held-out error that an effect would leave beside a model, by its columns.

    Parameters
    ----------
    fit : FittedStack
        The model.
    effect : str
        Id of one of its candidates.
    """
    analysis = fit.analysis
    return analysis.problem.estimate([*analysis.fitted_slots, analysis.slots.index(effect)])["held_out"]
