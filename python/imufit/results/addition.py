"""An effect added: the error before, expected and after."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from imufit.figures import quantity
from imufit.results.json_value import json_value
from imufit.results.parameter import Parameter, by_effect, by_name, drawn_parameters, parameter_frame, parameter_table
from imufit.results.plotted import Plotted
from imufit.results.result import Result
from imufit.results.table import Table

if TYPE_CHECKING:
    import pandas as pd

    from imufit.figures.place import Drawing, Place

SURPRISE = 0.2


def surprise(before: float, expected: float, after: float) -> str:
    """Sentence of warning where the realised drop differs from the expected one by more than 20 %; else empty."""
    drop, realised = before - expected, before - after
    if not (math.isfinite(drop) and math.isfinite(realised)) or abs(drop) < 0.02:
        return ""
    if abs(realised - drop) <= SURPRISE * abs(drop):
        return ""
    return (
        f"The error fell by {quantity.ratio(realised)} where {quantity.ratio(drop)} was expected: "
        "the effect is not linear here, or another effect is missing besides."
    )


@dataclass(frozen=True, repr=False)
class Addition(Plotted, Result):
    """One step of the loop.

    Attributes
    ----------
    effect : str
        The effect that was added.
    before, expected, after : float
        Residual over noise floor before, as predicted, and as realised.
    held_out : bool
        Whether these were judged on data not used for fitting.
    parameters : tuple of Parameter
        Fitted parameters.
    model : tuple of str
        Effects of the new model.
    fit : Any
        The new fit.
    """

    effect: str
    before: float
    expected: float
    after: float
    held_out: bool
    parameters: tuple[Parameter, ...]
    model: tuple[str, ...]
    fit: Any = field(default=None, repr=False, compare=False)

    @property
    def own_parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the added effect alone."""
        return tuple(item for item in self.parameters if item.effect == self.effect)

    @property
    def sentence(self) -> str:
        """The step in a sentence."""
        kind = "held-out error" if self.held_out else "error on the fitted data"
        return (
            f"{self.effect} added: the {kind} went {quantity.fall(self.before, self.after)} "
            f"(expected {quantity.ratio(self.expected)})."
        )

    @property
    def warning(self) -> str:
        """A note if the drop was not the expected one; else empty."""
        return surprise(self.before, self.expected, self.after)

    def to_dict(self) -> dict[str, Any]:
        """JSON of `add`; all parameters of the model by effect besides."""
        return {
            "effect": self.effect,
            "before": json_value(self.before),
            "expected": json_value(self.expected),
            "after": json_value(self.after),
            "held_out": bool(self.held_out),
            "parameters": by_name(self.own_parameters),
            "model": list(self.model),
            "model_parameters": by_effect(self.parameters),
        }

    def to_dataframe(self) -> pd.DataFrame:
        """One row per parameter, SI units."""
        return parameter_frame(self.parameters)

    def _drawn(self, ax: Place | None) -> Drawing:
        """Fitted parameters beside their typical sizes."""
        return drawn_parameters(self.parameters, ax)

    def tables(self) -> tuple[Table, ...]:
        """Parameters of the new model."""
        return (parameter_table(self.parameters, "Parameters of the new model"),)

    def sentences(self) -> list[str]:
        """Return the result as text, the answer first."""
        return [self.sentence, self.warning]
