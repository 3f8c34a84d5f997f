"""A log with sealed truth, and what counts as a right answer to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from imufit.lab.simulate import Simulation

Question = Literal["one", "nothing", "two", "outside", "confounded"]
"""The question: one effect, none, two, one outside the catalogue, or one that the log does not separate."""


@dataclass(frozen=True)
class Puzzle:
    """One blind log.

    Attributes
    ----------
    question : str
        The question.
    kind : str
        What makes this log differ from others of its set: the effect, the pair, the kind of noise.
    simulation : Simulation
        The log, and what was done to it.
    rivals : tuple of str
        Effects that this log does not separate from the hidden one.
    model : tuple of str
        Effects that are known to be there: the ladder starts from them.
    twin : Simulation or None
        Where the reference has noise: the same log, down to each drawn number, with nothing hidden in it.
    causes : mapping
        For each channel, the quantities of the log that cause an effect outside the catalogue; empty where none does.
    """

    question: Question
    kind: str
    simulation: Simulation
    rivals: tuple[str, ...] = ()
    model: tuple[str, ...] = ()
    twin: Simulation | None = None
    causes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def truth(self) -> tuple[str, ...]:
        """Effects of the catalogue that are in the log and not known to be."""
        effects = () if self.question == "outside" else self.simulation.truth.effects
        return tuple(name for name in effects if name not in self.model)
