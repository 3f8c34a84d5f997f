"""The user's limits of a parameter of a model: that it stays as it is, or within bounds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from imufit.errors import InputError


@dataclass(frozen=True)
class Limits:
    """Limits of one parameter.

    Attributes
    ----------
    fixed : bool
        Whether a fit leaves it as it is.
    lower, upper : float
        Smallest and largest value, SI units; infinite where there is none.
    """

    fixed: bool = False
    lower: float = -math.inf
    upper: float = math.inf

    @property
    def bounded(self) -> bool:
        """Whether there is a smallest or a largest value."""
        return math.isfinite(self.lower) or math.isfinite(self.upper)

    def within(self, value: float) -> float:
        """Return the allowed value that is nearest to a value.

        Parameters
        ----------
        value : float
            SI unit.
        """
        return min(max(value, self.lower), self.upper)

    def check(self, key: str) -> None:
        """Refuse limits that leave nothing to be fitted.

        Parameters
        ----------
        key : str
            Parameter that they belong to, such as ``gyr.scale.z``.

        Raises
        ------
        InputError
            A bound is not a number, or the smallest value is not below the largest.
        """
        for word, bound in (("min", self.lower), ("max", self.upper)):
            if isinstance(bound, bool) or not isinstance(bound, int | float) or math.isnan(bound):
                raise InputError(
                    f"{key}: {word} is {bound!r}, not a number", remedy="Give a number in SI units, or None."
                )
        if not self.lower < self.upper:
            raise InputError(
                f"{key}: min is {self.lower:g} and max is {self.upper:g}",
                remedy="Give a min below the max; a parameter with one value is fixed: set(VALUE, fixed=True).",
            )

    def to_dict(self) -> dict[str, Any]:
        """Keys ``fixed``, ``min`` and ``max``, as far as they say anything."""
        return {
            **({"fixed": True} if self.fixed else {}),
            **({"min": float(self.lower)} if math.isfinite(self.lower) else {}),
            **({"max": float(self.upper)} if math.isfinite(self.upper) else {}),
        }

    @classmethod
    def of(cls, table: Mapping[str, Any], key: str) -> Limits:
        """Read the limits of one parameter from the keys of `to_dict`.

        Parameters
        ----------
        table : mapping
            The keys.
        key : str
            Parameter that they belong to.

        Raises
        ------
        InputError
            A key is unknown, or has a value that cannot be.
        """
        unknown = [name for name in table if name not in ("fixed", "min", "max")]
        if unknown:
            raise InputError(f"limits of {key}: key {unknown[0]} is unknown", remedy="Use fixed, min and max.")
        fixed = table.get("fixed", False)
        if not isinstance(fixed, bool):
            raise InputError(f"limits of {key}: fixed is {fixed!r}", remedy="Write true or false.")
        found = cls(fixed, table.get("min", -math.inf), table.get("max", math.inf))
        found.check(key)
        return found


FREE: Final = Limits()
"""A parameter that may have any value."""
