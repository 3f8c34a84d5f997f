"""Whether a log can show an effect, and from which size on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from imufit.figures import quantity
from imufit.results.json_value import json_value
from imufit.results.part import Part
from imufit.results.phrasing import listed
from imufit.results.table import Table

NEARLY: Final = 1.05
"""Sizes within this factor are stated as one: two digits are shown."""


@dataclass(frozen=True, repr=False)
class ParameterSight(Part):
    """How well a log determines one parameter of an effect.

    Attributes
    ----------
    name, unit : str
        Of the parameter, SI.
    standard_error : float
        That of a diagnosis of this log.
    smallest : float
        Size from which on a diagnosis of this log names the effect in four of five cases.
    typical : float or None
        Size that it usually has; None where no card states it.
    """

    name: str
    unit: str
    standard_error: float
    smallest: float
    typical: float | None

    @property
    def seen(self) -> bool:
        """Whether its typical size would be seen."""
        return math.isfinite(self.smallest) and (self.typical is None or self.smallest <= abs(self.typical))

    def to_dict(self) -> dict[str, Any]:
        """JSON of one parameter."""
        return {
            "unit": self.unit,
            "standard_error": json_value(self.standard_error),
            "smallest": json_value(self.smallest),
            "typical": json_value(self.typical),
            "seen": self.seen,
        }


@dataclass(frozen=True, repr=False)
class EffectSight(Part):
    """Whether a log can show one effect.

    Attributes
    ----------
    effect : str
        Its id.
    parameters : tuple of ParameterSight
        What the log determines of it; empty where nothing is known, or where the readings themselves decide.
    shown : str
        ``yes``, ``in part`` (some of its parameters) or ``no``.
    reason : str
        Why not, or why only in part; empty for ``yes``.
    like : tuple of str
        Effects that look the same in this log: it is not separated from them.
    """

    effect: str
    parameters: tuple[ParameterSight, ...]
    shown: str
    reason: str = ""
    like: tuple[str, ...] = ()

    @property
    def clearness(self) -> float:
        """Typical over smallest size of the clearest parameter; 0 where none is known."""
        known = [abs(p.typical) / p.smallest for p in self.parameters if p.typical is not None and p.smallest > 0.0]
        return max(known, default=0.0)

    @property
    def open(self) -> bool:
        """Whether its typical size is unknown: effects of a log's own columns."""
        return bool(self.parameters) and all(p.typical is None for p in self.parameters)

    @property
    def weak(self) -> bool:
        """Whether the log would show it only if it were larger than usual."""
        return self.shown == "no" and any(math.isfinite(p.smallest) for p in self.parameters)

    @property
    def smallest(self) -> str:
        """Size from which on it is seen for certain, on one line: that of the weakest axis that is seen at all."""
        seen = [p for p in self.parameters if p.seen] or [p for p in self.parameters if math.isfinite(p.smallest)]
        largest: dict[str, float] = {}
        for p in seen:
            largest[p.unit] = max(largest.get(p.unit, 0.0), p.smallest)
        return sizes([(value, unit) for unit, value in largest.items()])

    @property
    def typical(self) -> str:
        """Its typical sizes, on one line."""
        return sizes([(abs(p.typical), p.unit) for p in self.parameters if p.typical is not None])

    def to_dict(self) -> dict[str, Any]:
        """JSON of one effect."""
        return {
            "effect": self.effect,
            "shown": self.shown,
            "reason": self.reason or None,
            "parameters": {p.name: p.to_dict() for p in self.parameters},
            "like": list(self.like),
        }

    def __str__(self) -> str:
        if self.shown == "no":
            return f"{self.effect} is not visible: {self.reason}"
        like = f"; it looks like {', '.join(self.like)}" if self.like else ""
        start = f"from {self.smallest} on" if self.parameters else "by the readings themselves"
        only = f"; {self.reason}" if self.reason else ""
        return f"{self.effect} is visible {start}{only}{like}"


def sizes(values: Sequence[tuple[float, str]]) -> str:
    """Several sizes on one line: from the smallest to the largest of one unit.

    Parameters
    ----------
    values : sequence of (float, str)
        Sizes and their SI units.
    """
    by_unit: dict[str, list[float]] = {}
    for value, unit in values:
        if math.isfinite(value):
            by_unit.setdefault(unit, []).append(value)
    parts = []
    for unit, of_unit in by_unit.items():
        low, high = min(of_unit), max(of_unit)
        factor, shown = quantity.shown_unit(unit, high)
        start = "" if high <= NEARLY * low else f"{quantity.number(factor * low, 2)} to "
        parts.append(f"{start}{quantity.number(factor * high, 2)} {shown}")
    return ", ".join(parts) or "-"


def seen_table(effects: Sequence[EffectSight]) -> Table:
    """List the named effects that a log can show, the clearest first.

    Parameters
    ----------
    effects : sequence of EffectSight
        All of them.
    """
    shown = sorted((item for item in effects if item.shown != "no" and not item.open), key=lambda item: -item.clearness)
    rows = tuple(
        (item.effect, item.smallest if item.parameters else "its end shows", item.typical, item.reason)
        for item in shown
    )
    return Table("Effects that this log can show", ("effect", ">visible from", ">typical", "but"), rows)


def open_table(effects: Sequence[EffectSight]) -> Table:
    """List dependences on the log's own columns that it can show; their typical sizes are unknown.

    Parameters
    ----------
    effects : sequence of EffectSight
        All of them.
    """
    rows = tuple((item.effect, item.smallest, item.reason) for item in effects if item.open and item.shown != "no")
    return Table("Dependences that it can show on its own columns", ("effect", ">visible from", "but"), rows)


def weak_table(effects: Sequence[EffectSight]) -> Table:
    """List what a log would show only if it were larger than usual, the clearest first.

    Parameters
    ----------
    effects : sequence of EffectSight
        All of them.
    """
    weak = sorted((item for item in effects if item.weak), key=lambda item: -item.clearness)
    rows = tuple((item.effect, item.smallest, item.typical, item.reason) for item in weak)
    return Table(
        "Effects that it would show only in unusual sizes", ("effect", ">visible from", ">typical", "why"), rows
    )


def unseen_table(effects: Sequence[EffectSight]) -> Table:
    """List what a log cannot show in any size, by reason.

    Parameters
    ----------
    effects : sequence of EffectSight
        All of them.
    """
    reasons: dict[str, list[str]] = {}
    for item in effects:
        if item.shown == "no" and not item.weak:
            reasons.setdefault(item.reason, []).append(item.effect)
    rows = tuple((str(len(ids)), reason, ", ".join(ids)) for reason, ids in reasons.items())
    return Table("Effects that it cannot show", (">", "because", "effects"), rows)


def alike(effects: Sequence[EffectSight]) -> list[str]:
    """Name the effects that a log does not separate, each group in a sentence.

    Parameters
    ----------
    effects : sequence of EffectSight
        All of them.
    """
    groups = dict.fromkeys(
        tuple(sorted((item.effect, *item.like))) for item in effects if item.like and item.shown != "no"
    )
    largest = [group for group in groups if not any(set(group) < set(other) for other in groups)]
    return [f"The log does not separate {listed(group)}." for group in largest]
