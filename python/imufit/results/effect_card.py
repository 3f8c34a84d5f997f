"""An effect's card: details for a decision to add it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from imufit.figures import quantity
from imufit.results.json_value import json_value
from imufit.results.result import Result
from imufit.results.table import Table
from imufit.wrapping import lines_of

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class EffectCard(Result):
    """Description of one effect of the catalogue.

    Attributes
    ----------
    id, sensor, name : str
        For instance ``gyr.g_sensitivity``, ``gyr``, ``g-sensitivity``.
    physics, formula : str
        Cause in a sentence; what it adds to the ideal reading.
    parameters : tuple
        (name, SI unit, typical size or None) each.
    signature, mistaken_for, confirm : str
        How it shows in a residual, what looks like it, and the experiment that settles it.
    """

    id: str
    sensor: str
    name: str
    physics: str
    formula: str
    parameters: tuple[tuple[str, str, float | None], ...]
    signature: str
    mistaken_for: str
    confirm: str

    def to_dict(self) -> dict[str, Any]:
        """JSON of the card."""
        texts = ("id", "sensor", "name", "physics", "formula")
        return {
            **{name: getattr(self, name) for name in texts},
            "parameters": {
                name: {"unit": unit, "typical": json_value(typical)} for name, unit, typical in self.parameters
            },
            **{name: getattr(self, name) for name in ("signature", "mistaken_for", "confirm")},
        }

    def to_dataframe(self) -> pd.DataFrame:
        """One row per parameter."""
        import pandas as pd  # noqa: PLC0415

        return pd.DataFrame(list(self.parameters), columns=["name", "unit", "typical"])

    @property
    def typical_sizes(self) -> str:
        """Typical sizes on one line; equal ones stand together."""
        sizes: dict[str, list[str]] = {}
        for name, unit, typical in self.parameters:
            shown = quantity.quantity(typical, unit) if typical is not None else f"in {quantity.shown_unit(unit)[1]}"
            sizes.setdefault(shown, []).append(name)
        if len(sizes) == 1 and len(self.parameters) > 1:
            shown, names = next(iter(sizes.items()))
            return f"{' '.join(names)}, each {shown}"
        return "; ".join(f"{' '.join(names)}: {size}" for size, names in sizes.items())

    def lines(self) -> tuple[tuple[str, str], ...]:
        """Heading and text of each part of the card."""
        parts = (
            ("physics", self.physics),
            ("formula", self.formula),
            ("typical size", self.typical_sizes),
            ("signature", self.signature),
            ("mistaken for", self.mistaken_for),
            ("confirm by", self.confirm),
        )
        return tuple((heading, text) for heading, text in parts if text)

    def table(self) -> Table:
        """Lay the card out as a table of two columns."""
        return Table(f"{self.id}: {self.name}", ("", ""), self.lines())

    def sentences(self) -> list[str]:
        """Return the name of the effect and its cause."""
        return [f"{self.id}: {self.name}, {self.physics}"]

    def paragraphs(self) -> list[str]:
        """Return nothing: the table has all details."""
        return []

    def tables(self) -> list[Table]:
        """Return the card."""
        return [self.table()]

    def __str__(self) -> str:
        lines = (
            line
            for heading, text in self.lines()
            for line in lines_of(text, 100, first=f"  {heading:<14}", later=" " * 16)
        )
        return "\n".join([f"{self.id}: {self.name}", *lines])
