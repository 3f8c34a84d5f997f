"""Values that a parameter can have which an effect is not linear in: a range, or a few of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from imufit.errors import InputError

MOST_TRIALS = 144
"""Combinations of values in the first grid at most: each is a fit beside the model, and counts as a chance finding."""
PER_DECADE = 4
"""Trials in a factor of ten: a lag differs from one 1.8 times as long by half of its explained part."""
LINEAR_TRIALS = 12
"""Trials of a range that is not a factor (through zero)."""
FINER = 4
"""Steps of a finer grid in one of the grid before, to each side."""
ROUNDS = 2
"""Finer grids: after them a step is a sixteenth of the first, from where differences lead on."""
STEP = 1e-4
"""Step of a difference quotient as a share of value or range: its error is of the order of its square."""


@dataclass(frozen=True)
class SearchRange:
    """A range to search, or the values to try.

    Attributes
    ----------
    low, high : float
        Ends of the range, in the parameter's unit.
    values : tuple of float
        The only values that there are; empty for a range.
    """

    low: float
    high: float
    values: tuple[float, ...] = ()

    @classmethod
    def of(cls, given: object, effect: str, name: str) -> SearchRange:
        """Read what an effect declares of a parameter: two numbers are a range, more are the values to try.

        Raises
        ------
        InputError
            It is neither.
        """
        remedy = f'Write search={{"{name}": (0.01, 10.0)}}, or the values to try, at least three.'
        if not isinstance(given, Sequence | range) or isinstance(given, str) or len(given) < 2:
            raise InputError(f"effect {effect}: search of {name} is {given!r}", remedy=remedy)
        try:
            numbers = tuple(float(value) for value in given)
        except (TypeError, ValueError):
            raise InputError(f"effect {effect}: search of {name} is {given!r}", remedy=remedy) from None
        if not all(map(math.isfinite, numbers)) or len(set(numbers)) < len(numbers):
            raise InputError(f"effect {effect}: search of {name} is {given!r}", remedy=remedy)
        if len(numbers) > 2:
            return cls(min(numbers), max(numbers), numbers)
        if numbers[0] > numbers[1]:
            raise InputError(f"effect {effect}: search of {name} begins above its end", remedy=remedy)
        return cls(numbers[0], numbers[1])

    @property
    def is_factor(self) -> bool:
        """True for a range of positive values, which are tried in equal ratios."""
        return self.low > 0.0

    @property
    def middle(self) -> float:
        """A value in the middle."""
        if self.values:
            return self.values[len(self.values) // 2]
        return math.sqrt(self.low * self.high) if self.is_factor else 0.5 * (self.low + self.high)

    def grid(self, parameters: int) -> list[float]:
        """Values to try first where `parameters` are searched for together."""
        if self.values:
            return list(self.values)
        count = self._count(parameters)
        return [self._at(k / (count - 1)) for k in range(count)]

    def finer(self, at: float, number: int, parameters: int) -> list[float]:
        """Values around the best one of the grid before the finer grid of this number; only it if that is enough."""
        if self.values or number >= ROUNDS:
            return [at]
        step = 1.0 / (self._count(parameters) - 1) / FINER ** (number + 1)
        place = self._place(at)
        places = sorted({min(max(place + k * step, 0.0), 1.0) for k in range(-FINER, FINER + 1)})
        return [self._at(place) for place in places]

    def beside(self, at: float) -> tuple[float, float] | None:
        """Two values on both sides to take a difference between; None where there is nothing between values."""
        if self.values:
            return None
        step = STEP * (abs(at) if self.is_factor else self.high - self.low)
        within = self.low <= at <= self.high
        return (max(at - step, self.low), min(at + step, self.high)) if within else (at - step, at + step)

    def known(self, at: float) -> float:
        """Return the value itself; the middle for the zero of a parameter that has not been searched for."""
        return at if at != 0.0 or self.low <= 0.0 <= self.high else self.middle

    def _count(self, parameters: int) -> int:
        decades = math.log10(self.high / self.low) if self.is_factor else 0.0
        wanted = math.ceil(PER_DECADE * decades) + 1 if self.is_factor else LINEAR_TRIALS
        return max(3, min(wanted, int(MOST_TRIALS ** (1.0 / parameters))))

    def _at(self, place: float) -> float:
        if self.is_factor:
            return float(self.low * (self.high / self.low) ** place)
        return self.low + place * (self.high - self.low)

    def _place(self, value: float) -> float:
        if self.is_factor:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)
