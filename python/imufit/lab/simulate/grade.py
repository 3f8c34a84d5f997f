"""Marks for an answer about a log whose truth is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from imufit.lab.simulate.sealed import Truth

Mark = Literal["right", "named among rivals", "wrong", "missed", "false alarm"]


@dataclass(frozen=True)
class ParameterGrade:
    """One parameter of an effect, the truth beside the answer; SI units.

    Attributes
    ----------
    effect, name : str
        The effect and its parameter.
    truth : float
        The true value.
    estimate, standard_error : float or None
        As answered; None where the answer has none.
    """

    effect: str
    name: str
    truth: float
    estimate: float | None
    standard_error: float | None

    @property
    def error_in_standard_errors(self) -> float | None:
        """Return (estimate - truth) / standard error, None where either is not known."""
        if self.estimate is None or not self.standard_error:
            return None
        return (self.estimate - self.truth) / self.standard_error


@dataclass(frozen=True)
class Grade:
    """The mark for an answer.

    Attributes
    ----------
    mark : "right"; "named among rivals" = one of several that the answer did not separate; "wrong" = something else
        was named; "missed" = nothing was named; "false alarm" = something was named beyond what there is.
    truth, answer : effects that there are, and that the answer names.
    parameters : one entry for each parameter of the true effects.
    """

    mark: Mark
    truth: tuple[str, ...]
    answer: tuple[str, ...]
    parameters: tuple[ParameterGrade, ...]


def grade(truth: Truth, answer: Mapping[str, Any]) -> Grade:
    """Compare an answer with the truth.

    Parameters
    ----------
    truth : what was injected.
    answer : the JSON object of a diagnosis (``verdict``, ``best``, ``ambiguous_with``, ``candidates``), or that of a
        ladder (``steps`` with an ``effect`` each). Parameters are taken from the candidates or steps, or from
        ``parameters`` by effect: ``{name: {"value": , "standard_error": }}``.

    Returns
    -------
    Grade

    Raises
    ------
    ValueError
        If `answer` is neither.
    """
    if "steps" in answer:
        named = tuple(str(step["effect"]) for step in answer["steps"])
        mark = _mark_of_ladder(set(truth.effects), set(named))
        found = list(answer["steps"])
    elif "verdict" in answer:
        named = _named(answer)
        mark = _mark_of_diagnosis(set(truth.effects), named)
        found = list(answer.get("candidates", ()))
    else:
        raise ValueError("the answer has neither 'verdict' (of diagnose) nor 'steps' (of ladder)")
    estimates = {str(entry["effect"]): entry.get("parameters") or {} for entry in found}
    more = answer.get("parameters") or {}
    estimates |= {effect: more[effect] for effect in truth.effects if effect in more}
    parameters = tuple(
        _graded(effect, name, value, estimates.get(effect, {}))
        for effect, values in truth.effects.items()
        for name, value in values.items()
    )
    return Grade(mark, tuple(truth.effects), named, parameters)


def _named(answer: Mapping[str, Any]) -> tuple[str, ...]:
    """List the effects that a diagnosis names, the best one first; none if it finds nothing or cannot name it."""
    if answer["verdict"] in ("adequate", "unknown"):
        return ()
    rivals = answer.get("ambiguous_with") or () if answer["verdict"] == "ambiguous" else ()
    best = [answer["best"]] if answer.get("best") is not None else []
    return tuple(dict.fromkeys(str(effect) for effect in (*best, *rivals)))


def _mark_of_diagnosis(truth: set[str], named: tuple[str, ...]) -> Mark:
    if not truth:
        return "false alarm" if named else "right"
    if not named:
        return "missed"
    if not truth & set(named):
        return "wrong"
    return "right" if len(named) == 1 else "named among rivals"


def _mark_of_ladder(truth: set[str], named: set[str]) -> Mark:
    if named == truth:
        return "right"
    if truth <= named:
        return "false alarm"
    return "wrong" if named - truth else "missed"


def _graded(effect: str, name: str, truth: float, estimates: Mapping[str, Any]) -> ParameterGrade:
    entry = estimates.get(name)
    if not isinstance(entry, Mapping):
        return ParameterGrade(effect, name, truth, None if entry is None else float(entry), None)
    value, error = entry.get("value"), entry.get("standard_error")
    return ParameterGrade(
        effect, name, truth, None if value is None else float(value), None if error is None else float(error)
    )
