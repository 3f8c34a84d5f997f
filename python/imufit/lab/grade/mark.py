"""Right and wrong parts of an answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

from imufit.lab.grade.puzzle import Puzzle
from imufit.results.part import Part

CERTAIN, SILENT = "missing", ("adequate", "unknown")


@dataclass(frozen=True, repr=False)
class Answer(Part):
    """The ladder's answer on a log.

    Attributes
    ----------
    verdict : str
        Of the first diagnosis.
    named : tuple of str
        Effects that it names, the best first.
    steps : tuple of str
        Effects that the ladder added.
    end : str
        Verdict after the last step.
    named_at_end : tuple of str
        Effects that the last diagnosis names.
    unexplained : tuple of (channel, covariate)
        What the first diagnosis leaves unexplained, the most important first.
    """

    verdict: str
    named: tuple[str, ...]
    steps: tuple[str, ...]
    end: str
    named_at_end: tuple[str, ...]
    unexplained: tuple[tuple[str, str], ...]


@dataclass(frozen=True, repr=False)
class Marks(Part):
    """Marks of one answer; None where the question does not ask for it.

    Attributes
    ----------
    named : bool or None
        The truth is found: named alone, or among rivals that the log does not separate from it; both of two effects;
        or, of an effect outside the catalogue, called unknown.
    wrong : bool or None
        An effect is named, or added by the ladder, that is not there, and none of the true rivals either.
    missed : bool or None
        Nothing is named although something is there (of two: not both).
    alarm : bool or None
        Something is found although nothing is hidden.
    single : bool or None
        One name alone although the log does not separate it from another.
    needless : bool or None
        Names beside the truth that the log separates from it; of an effect outside the catalogue: effects that
        the ladder adds although the diagnosis said unknown.
    covariate : bool or None
        The first dependence of an effect outside the catalogue is on its cause.
    """

    named: bool | None = None
    wrong: bool | None = None
    missed: bool | None = None
    alarm: bool | None = None
    single: bool | None = None
    needless: bool | None = None
    covariate: bool | None = None

    @property
    def faults(self) -> tuple[str, ...]:
        """Errors of the answer, in words; empty for a right answer."""
        good = ("named", "covariate")
        words = {"named": "not named", "wrong": "wrong name", "covariate": "another covariate"}
        found = [f.name for f in fields(self) if getattr(self, f.name) is (f.name not in good)]
        if "missed" in found or "wrong" in found or "needless" in found:
            found = [name for name in found if name != "named"]
        return tuple(words.get(name, name) for name in found)

    def to_dict(self) -> dict[str, Any]:
        """JSON: those that were requested."""
        return {f.name: getattr(self, f.name) for f in fields(self) if getattr(self, f.name) is not None}


def marked(puzzle: Puzzle, answer: Answer) -> Marks:
    """Compare an answer with the truth.

    Parameters
    ----------
    puzzle : Puzzle
        The log with its truth.
    answer : Answer
        What was said of it.
    """
    if puzzle.question == "nothing":
        return Marks(alarm=answer.verdict != "adequate" or bool(answer.steps))
    if puzzle.question == "two":
        return _two(set(puzzle.truth), answer)
    if puzzle.question == "outside":
        return _outside(puzzle, answer)
    return _one(puzzle, answer)


def _one(puzzle: Puzzle, answer: Answer) -> Marks:
    (truth,) = puzzle.truth
    allowed = {truth, *puzzle.rivals}
    needless = truth in answer.named and not set(answer.named) <= allowed
    if puzzle.question == "confounded":
        return Marks(
            named=truth in answer.named,
            wrong=bool(answer.named) and truth not in answer.named,
            missed=not answer.named,
            single=len(answer.named) == 1,
            needless=needless,
        )
    alone = answer.named == (truth,)
    return Marks(
        named=alone or (truth in answer.named and bool(puzzle.rivals)),
        wrong=(bool(answer.named) and truth not in answer.named) or not set(answer.steps) <= allowed,
        missed=not answer.named,
        needless=needless,
    )


def _two(truth: set[str], answer: Answer) -> Marks:
    found = truth <= set(answer.steps)
    return Marks(
        named=found and answer.end == "adequate",
        wrong=not set(answer.steps) <= truth,
        missed=not found,
    )


def _outside(puzzle: Puzzle, answer: Answer) -> Marks:
    unknown = answer.verdict == "unknown"
    covariate = None
    if any(puzzle.causes.values()):
        covariate = bool(answer.unexplained) and _caused(puzzle, *answer.unexplained[0])
    return Marks(
        named=unknown,
        wrong=bool(answer.named),
        missed=answer.verdict == "adequate",
        needless=unknown and bool(answer.steps),
        covariate=covariate,
    )


def _caused(puzzle: Puzzle, channel: str, covariate: str) -> bool:
    return bool(_words(covariate) & set(puzzle.causes.get(channel, ())))


def _words(covariate: str) -> set[str]:
    """Return the quantities in a covariate's name: several where it is a product."""
    parts: Sequence[str] = covariate.replace("*", " ").replace("×", " ").split()
    return set(parts)
