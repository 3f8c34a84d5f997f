"""A fitted parameter with its error, unit and typical size."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from imufit.figures import quantity
from imufit.results.json_value import json_value
from imufit.results.part import Part
from imufit.results.plotted import Plotted
from imufit.results.table import Table

if TYPE_CHECKING:
    import pandas as pd

    from imufit.figures.place import Drawing, Place


FAR: Final = 4.0
"""Standard errors between two values of a parameter from which on chance does not account for their difference: it
lies so far away once in 16,000 times."""
UNTOLD = 10.0
"""A parameter whose standard error is this many typical sizes is one that the log is not informative about."""


@dataclass(frozen=True, repr=False)
class Parameter(Plotted, Part):
    """One parameter of one effect.

    Attributes
    ----------
    effect, name : str
        For instance ``gyr.bias`` and ``x``.
    value, standard_error : float
        In `unit`.
    unit : str
        SI unit.
    typical : float or None
        Size that is usual for such sensors, same unit.
    fixed : bool
        Whether fits leave it as it is; its standard error is then 0.
    lower, upper : float
        Smallest and largest value that it may have, infinite where there is none; same unit. At one of these the data
        would take it further, and its standard error is not a number.
    """

    effect: str
    name: str
    value: float
    standard_error: float
    unit: str
    typical: float | None = None
    fixed: bool = False
    lower: float = -math.inf
    upper: float = math.inf

    @property
    def key(self) -> str:
        """Effect and name with a dot between, such as ``gyr.bias.x``."""
        return f"{self.effect}.{self.name}"

    @property
    def stderr(self) -> float:
        """Standard error, in `unit`: another name for `standard_error`."""
        return self.standard_error

    @property
    def vary(self) -> bool:
        """False if the parameter is fixed."""
        return not self.fixed

    @property
    def min(self) -> float:
        """Smallest value that it may have: another name for `lower`."""
        return self.lower

    @property
    def max(self) -> float:
        """Largest value that it may have: another name for `upper`."""
        return self.upper

    @property
    def at_bound(self) -> str | None:
        """``min`` or ``max`` if the parameter stands at that bound, else None."""
        if self.fixed:
            return None
        return "min" if self.value <= self.lower else "max" if self.value >= self.upper else None

    @property
    def told(self) -> bool:
        """False if the log leaves it open: no such motion, or one direction of it is another effect's as well."""
        return not self.typical or not self.standard_error > UNTOLD * self.typical

    @property
    def shown(self) -> str:
        """Value and standard error in the shown unit."""
        if self.fixed:
            return f"{self.digits.value} {self.digits.unit} (fixed)"
        if self.at_bound is not None:
            return f"{quantity.quantity(self.value, self.unit)} (at its {self.at_bound})"
        return quantity.with_error(self.value, self.standard_error, self.unit) if self.told else "not determined"

    @property
    def digits(self) -> quantity.Digits:
        """The value in the digits in which it is shown; a fixed one in those that a person chose."""
        if self.fixed:
            return quantity.chosen(self.value, self.unit)
        return quantity.digits_of(self.value, self.standard_error, self.unit)

    def to_dict(self) -> dict[str, Any]:
        """JSON of one parameter: value, standard error, unit, typical size; its limits, if it has any."""
        limits = {"min": self.lower, "max": self.upper}
        return {
            "value": json_value(self.value),
            "standard_error": json_value(self.standard_error),
            "unit": self.unit,
            "typical": json_value(self.typical),
            **({"fixed": True} if self.fixed else {}),
            **{word: bound for word, bound in limits.items() if math.isfinite(bound)},
        }

    def to_dataframe(self) -> pd.DataFrame:
        """One row."""
        return parameter_frame((self,))

    def _drawn(self, ax: Place | None) -> Drawing:
        """Value beside the typical size."""
        return drawn_parameters((self,), ax)

    def _repr_html_(self) -> str:
        return parameter_table((self,)).html()

    def __repr__(self) -> str:
        return f"Parameter({self})"

    def __str__(self) -> str:
        return f"{self.effect} {self.name} = {self.shown}"


def by_name(parameters: Iterable[Parameter]) -> dict[str, dict[str, Any]]:
    """JSON of one effect's parameters by their name."""
    return {parameter.name: parameter.to_dict() for parameter in parameters}


def by_effect(parameters: Iterable[Parameter]) -> dict[str, dict[str, dict[str, Any]]]:
    """JSON of a model's parameters by effect and name."""
    effects: dict[str, dict[str, dict[str, Any]]] = {}
    for parameter in parameters:
        effects.setdefault(parameter.effect, {})[parameter.name] = parameter.to_dict()
    return effects


def stands_out(value: float, standard_error: float) -> bool:
    """Return whether a parameter lies so far from that of an ideal sensor that chance does not account for it."""
    return abs(value) > FAR * standard_error > 0.0


def in_lines(parameters: Sequence[Parameter], limit: int = 3) -> list[str]:
    """Write the parameters that stand out most from their errors, one each, and how many more there are."""
    if not parameters:
        return ["-"]

    def weight(parameter: Parameter) -> float:
        if not (parameter.standard_error > 0.0 and math.isfinite(parameter.value)):
            return 0.0
        return abs(parameter.value / parameter.standard_error)

    chosen = sorted(parameters, key=weight, reverse=True)[:limit]
    lines = [f"{item.name} {item.shown}" for item in parameters if item in chosen]
    rest = len(parameters) - len(chosen)
    return [*lines, *([f"and {rest} more"] if rest else [])]


def in_words(parameters: Sequence[Parameter], limit: int = 3) -> str:
    """Write the parameters that stand out most from their errors on one line."""
    return ", ".join(in_lines(parameters, limit)).replace(", and ", " and ")


def parameter_table(parameters: Iterable[Parameter], title: str = "") -> Table:
    """Values in the shown units beside their typical sizes."""
    rows = tuple(
        (
            item.effect,
            item.name,
            item.shown,
            quantity.quantity(item.typical, item.unit),
        )
        for item in parameters
    )
    return Table(title, ("effect", "parameter", "value", "typical size"), rows)


def parameter_frame(parameters: Iterable[Parameter]) -> pd.DataFrame:
    """Parameters as a data frame in SI units."""
    import pandas as pd  # noqa: PLC0415

    columns = ["effect", "name", "value", "standard_error", "unit", "typical", "fixed"]
    return pd.DataFrame([[getattr(item, name) for name in columns] for item in parameters], columns=columns)


def drawn_parameters(parameters: Sequence[Parameter], ax: Place | None = None) -> Drawing:
    """Draw the parameters over their typical sizes."""
    from imufit.figures.parameters import parameter_sizes  # noqa: PLC0415

    return parameter_sizes(
        [f"{item.effect} {item.name}" for item in parameters],
        [item.value for item in parameters],
        [item.standard_error for item in parameters],
        [math.nan if item.typical is None else item.typical for item in parameters],
        [item.shown for item in parameters],
        [item.told for item in parameters],
        ax,
    )
