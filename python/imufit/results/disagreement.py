"""Which of several logs disagrees with the others, about what, and what the answer is without it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from imufit.figures import quantity
from imufit.results.json_value import json_value
from imufit.results.parameter import Parameter, by_name, in_words
from imufit.results.part import Part
from imufit.results.table import Table


@dataclass(frozen=True, repr=False)
class Disagreement(Part):
    """A log that has another value of an effect than the others.

    Attributes
    ----------
    file : str
        What the log is called.
    effect : str
        The effect.
    value, others : tuple of Parameter
        By this log, and by the others together.
    p_value : float
        Bound on the chance of such a difference: one over the Bayes factor of a value of its own.
    wild : bool
        Whether the difference is so large that the effect can't be called one of the sensor.
    """

    file: str
    effect: str
    value: tuple[Parameter, ...]
    others: tuple[Parameter, ...]
    p_value: float
    wild: bool

    def to_dict(self) -> dict[str, Any]:
        """JSON of one disagreement."""
        return {
            "file": self.file,
            "effect": self.effect,
            "value": by_name(self.value),
            "others": by_name(self.others),
            "p_value": json_value(self.p_value),
            "wild": self.wild,
        }

    def leading(self) -> tuple[Parameter, Parameter]:
        """Return the parameter that differs most, by this log and by the others."""

        def distance(pair: tuple[Parameter, Parameter]) -> float:
            own, other = pair
            error = (own.standard_error**2 + other.standard_error**2) ** 0.5
            return abs(own.value - other.value) / error if error > 0.0 else 0.0

        return max(zip(self.value, self.others, strict=True), key=distance)

    def __str__(self) -> str:
        own, other = self.leading()
        return (
            f"{own.name} = {quantity.with_error(own.value, own.standard_error, own.unit)} in {self.file}, "
            f"{quantity.with_error(other.value, other.standard_error, other.unit)} in the others"
        )


@dataclass(frozen=True, repr=False)
class Without(Part):
    """The answer of some of the logs.

    Attributes
    ----------
    files : tuple of str
        Logs that are left out.
    verdict : str
        As in a diagnosis.
    best : str or None
        The effect that stands out then.
    sentence : str
        The answer in words.
    """

    files: tuple[str, ...]
    verdict: str
    best: str | None
    sentence: str

    def to_dict(self) -> dict[str, Any]:
        """JSON of one answer."""
        return {"files": list(self.files), "verdict": self.verdict, "best": self.best, "sentence": self.sentence}

    def __str__(self) -> str:
        return f"Without {' and '.join(self.files)}: {self.verdict}{f' ({self.best})' if self.best else ''}"


def disagreement_table(found: Sequence[Disagreement]) -> Table:
    """List the logs that disagree.

    Parameters
    ----------
    found : sequence of Disagreement
        What was found.
    """
    rows = tuple(
        (item.file, item.effect, in_words(item.value, 2), in_words(item.others, 2), quantity.p_value(item.p_value))
        for item in found
    )
    return Table("Logs that disagree", ("log", "effect", "there", "in the others", ">p"), rows)
