"""Two models fitted to one log: their errors, which one the log prefers, and in which channels they differ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from imufit.figures import quantity
from imufit.results.comparison import Comparison
from imufit.results.json_value import json_value
from imufit.results.plotted import Plotted
from imufit.results.result import Result
from imufit.results.table import Table

if TYPE_CHECKING:
    import pandas as pd

    from imufit.figures.place import Drawing, Place

DECISIVE: Final = 5.0
"""Natural logarithm of the Bayes factor from which on one model is preferred: odds of 150 to 1, "very strong" in R.
Kass and A. Raftery, "Bayes Factors", J. Am. Stat. Assoc. 90 (1995), p. 777."""


def preferred(ln_bayes_factor: float) -> str:
    """Return which of two models the evidence prefers: ``first``, ``second``, or ``neither`` where it does not decide.

    Parameters
    ----------
    ln_bayes_factor : float
        Natural logarithm of the evidence for the second over that for the first.
    """
    if abs(ln_bayes_factor) < DECISIVE:
        return "neither"
    return "second" if ln_bayes_factor > 0.0 else "first"


@dataclass(frozen=True, eq=False, repr=False)
class ModelComparison(Plotted, Result):
    """Two models fitted to the same log.

    Attributes
    ----------
    first, second : Comparison
        Residuals of each model.
    first_ratio, second_ratio : float
        Held-out residual RMS over the noise floor, all channels.
    ln_bayes_factor : float
        Natural logarithm of the evidence for the second model over that for the first, parameters integrated out.
    """

    first: Comparison
    second: Comparison
    first_ratio: float
    second_ratio: float
    ln_bayes_factor: float

    @property
    def preferred(self) -> str:
        """``first``, ``second``, or ``neither`` where the evidence does not decide."""
        return preferred(self.ln_bayes_factor)

    @property
    def sentence(self) -> str:
        """The result in two sentences."""
        names = {
            "first": " + ".join(self.first.model) or "the ideal sensor",
            "second": " + ".join(self.second.model) or "the ideal sensor",
        }
        errors = (
            f"Held-out error: {quantity.ratio(self.first_ratio)} times the noise floor with {names['first']}, "
            f"{quantity.ratio(self.second_ratio)} with {names['second']}."
        )
        factor = f"(ln Bayes factor {self.ln_bayes_factor:+.1f} for the second)"
        if self.preferred == "neither":
            return f"{errors} The log prefers neither model {factor}."
        return f"{errors} The log prefers {names[self.preferred]} {factor}."

    def to_dict(self) -> dict[str, Any]:
        """JSON of the comparison."""
        sides = {"first": (self.first, self.first_ratio), "second": (self.second, self.second_ratio)}
        return {
            "preferred": self.preferred,
            "ln_bayes_factor": json_value(self.ln_bayes_factor),
            **{name: {"ratio": json_value(ratio), **found.to_dict()} for name, (found, ratio) in sides.items()},
        }

    def to_dataframe(self) -> pd.DataFrame:
        """One row per channel, worst change first: RMS of the residual with each model, SI units, and their ratio."""
        import pandas as pd  # noqa: PLC0415

        columns = ["channel", "first_rms", "second_rms", "second_over_first", "unit"]
        rows = [[name, a, b, b / a if a else float("nan"), unit] for name, a, b, unit in self._channels()]
        return pd.DataFrame(rows, columns=columns)

    def _channels(self) -> list[tuple[str, float, float, str]]:
        after = {item.channel: item.rms for item in self.second.channels}
        both = [(item.channel, item.rms, after[item.channel], item.unit) for item in self.first.channels]
        return sorted(both, key=lambda row: row[2] / row[1] if row[1] else 1.0)

    def _drawn(self, ax: Place | None) -> Drawing:
        """Residual of each channel with either model."""
        from imufit.figures.two_models import residuals_of_two  # noqa: PLC0415

        floors = {item.channel: item.noise_floor for item in self.first.channels}
        rows = [(name, a / floors[name], b / floors[name]) for name, a, b, _ in self._channels()]
        return residuals_of_two(rows, " + ".join(self.first.model), " + ".join(self.second.model), ax)

    def tables(self) -> tuple[Table, ...]:
        """Where the two differ."""
        rows = tuple(
            (name, quantity.quantity(a, unit), quantity.quantity(b, unit), quantity.ratio(b / a) if a else "-")
            for name, a, b, unit in self._channels()
        )
        header = ("channel", ">first", ">second", ">second / first")
        return (Table("Residual RMS by channel, most changed first", header, rows),)

    def sentences(self) -> list[str]:
        """Return the result as text, the answer first."""
        return [self.sentence]
