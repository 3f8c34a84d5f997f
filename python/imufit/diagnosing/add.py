"""Add an effect: error before, expected and after."""

from __future__ import annotations

from typing import TYPE_CHECKING

from imufit.errors import InputError
from imufit.model.catalogue import find_effect
from imufit.results import Addition

if TYPE_CHECKING:
    from imufit.fitting import FittedStack


def add(fit: FittedStack, effect_id: str, expected: float | None = None) -> Addition:
    """Add an effect to a fitted model and refit.

    Parameters
    ----------
    fit : FittedStack
        Where to start from.
    effect_id : str
        The effect.
    expected : float, optional
        Held-out error expected; asked of the evidence if not given.

    Raises
    ------
    InputError
        The effect is unknown, in the model already, or cannot be tested on this log.
    """
    find_effect(effect_id)
    analysis = fit.analysis
    model = fit.model.with_effect(effect_id)
    if effect_id not in analysis.candidates:
        reason = analysis.refusal(find_effect(effect_id)) or "it is fitted along already"
        raise InputError(f"effect {effect_id} cannot be added: {reason}", file=fit.logs[0].path)
    if expected is None:
        slot = analysis.slots.index(effect_id)
        expected = analysis.problem.estimate([*analysis.fitted_slots, slot])["held_out"]
    better = fit.moved(model)
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
