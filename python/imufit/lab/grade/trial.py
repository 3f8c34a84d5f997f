"""One blind log: drawn, answered, then unsealed and marked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from imufit.lab.grade.mark import Answer, Marks, marked
from imufit.lab.grade.puzzle import Puzzle
from imufit.lab.grade.sets import draw
from imufit.lab.simulate import Simulation
from imufit.loop import SensorModel
from imufit.remedy import Remedy
from imufit.results import Diagnosis, Ladder
from imufit.results.part import Part
from imufit.verbs import ladder


@dataclass(frozen=True, repr=False)
class Trial(Part):
    """One blind log, answered and marked.

    Attributes
    ----------
    blind_set, seed : str, int
        What draws it again.
    kind, scenario : str
        What is hidden, and in which motion.
    truth : dict
        What was injected, parameters in SI units.
    size : float
        Root mean square of the smallest injected effect over the white noise of its sensor; 0 with none.
    rivals : tuple of str
        Effects that this log does not separate from it.
    answer : Answer
        The ladder's answer.
    marks : Marks
        What is right and wrong in that.
    ratio_start, ratio_end : float
        Held-out error over the noise floor that the ladder took, before and after it.
    true_ratio : float
        Residual at the end of the ladder over the true noise, root mean square over the channels. Where the reference
        has noise, too: over the residual of the ideal sensor in the same log with nothing hidden.
    errors : tuple of float
        (estimate - truth) / standard error of each parameter that was recovered.
    drops : tuple of (float, float)
        For each step the expected and the realised drop of the held-out error.
    """

    blind_set: str
    seed: int
    kind: str
    scenario: str
    truth: dict[str, dict[str, float]]
    size: float
    rivals: tuple[str, ...]
    answer: Answer
    marks: Marks
    ratio_start: float
    ratio_end: float
    true_ratio: float
    errors: tuple[float, ...]
    drops: tuple[tuple[float, float], ...]

    def to_dict(self) -> dict[str, Any]:
        """JSON of all of it; the set under ``set``."""
        found = {**asdict(self), "marks": self.marks.to_dict()}
        return {"set": found.pop("blind_set"), **found}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Trial:
        """Return the trial of a `to_dict`, also after JSON.

        Parameters
        ----------
        data : mapping
            Of `to_dict`.
        """
        answer = {name: _tuples(value) for name, value in data["answer"].items()}
        rest = {name: _tuples(value) for name, value in data.items() if name not in ("set", "answer", "marks")}
        return cls(blind_set=data["set"], answer=Answer(**answer), marks=Marks(**data["marks"]), **rest)

    def __str__(self) -> str:
        first = f"(first {' over '.join(self.answer.unexplained[0])})" if self.answer.unexplained else ""
        said = " ".join(filter(None, [self.answer.verdict, ", ".join(self.answer.named), first]))
        climbed = f"; ladder + {' + '.join(self.answer.steps)} -> {self.answer.end}" if self.answer.steps else ""
        rivals = f" (like {', '.join(self.rivals)})" if self.rivals else ""
        again = Remedy(
            f"imufit.lab.grade.trial({self.blind_set!r}, {self.seed})",
            f"--set {self.blind_set} --seed {self.seed} --logs 1",
        )
        return (
            f"{', '.join(self.marks.faults) or 'right'}: {again}: "
            f"{self.scenario}, {self.kind}, size {self.size:.2f}{rivals}; answer {said}{climbed}"
        )


def _tuples(value: Any) -> Any:
    """Return lists, which JSON makes of tuples, as tuples again."""
    return tuple(map(_tuples, value)) if isinstance(value, list | tuple) else value


def trial(blind_set: str, seed: int) -> Trial:
    """Draw one blind log, climb the ladder, then break the seal and mark the answer.

    Parameters
    ----------
    blind_set : str
        Of `SETS`.
    seed : int
        Of the log.

    Raises
    ------
    ValueError
        The set is unknown.
    """
    puzzle = draw(blind_set, seed)
    result = ladder(puzzle.simulation.to_log(), SensorModel(puzzle.model) if puzzle.model else None)
    return judged(puzzle, result, blind_set, seed)


def judged(puzzle: Puzzle, result: Ladder, blind_set: str = "", seed: int = 0) -> Trial:
    """Mark the ladder's result on a puzzle.

    Parameters
    ----------
    puzzle : Puzzle
        The log with its truth.
    result : Ladder
        The ladder on that log.
    blind_set, seed : str, int
        What draws the puzzle again.
    """
    answer = answer_of(result)
    truth = puzzle.simulation.truth
    return Trial(
        blind_set=blind_set,
        seed=seed,
        kind=puzzle.kind,
        scenario=truth.scenario,
        truth={effect: dict(values) for effect, values in truth.effects.items()},
        size=min((size for name, size in truth.sizes.items() if name not in puzzle.model), default=0.0),
        rivals=puzzle.rivals,
        answer=answer,
        marks=marked(puzzle, answer),
        ratio_start=result.ratio_start,
        ratio_end=result.ratio_end,
        true_ratio=true_ratio(puzzle, result),
        errors=_errors(puzzle, result),
        drops=tuple((step.before - step.expected, step.before - step.after) for step in result.steps),
    )


def answer_of(result: Ladder) -> Answer:
    """Return the ladder's answer, without the figures."""
    first = result.first or result.diagnosis
    return Answer(
        verdict=first.verdict,
        named=_named(first),
        steps=tuple(step.effect for step in result.steps),
        end=result.diagnosis.verdict,
        named_at_end=_named(result.diagnosis),
        unexplained=tuple((item.channel, item.covariate) for item in first.unexplained),
    )


def _named(diagnosis: Diagnosis) -> tuple[str, ...]:
    if diagnosis.verdict not in ("missing", "ambiguous") or diagnosis.best is None:
        return ()
    return tuple(dict.fromkeys([diagnosis.best, *diagnosis.ambiguous_with]))


def true_ratio(puzzle: Puzzle, result: Ladder) -> float:
    """Return the residual at the end of the ladder over the true noise, root mean square over channels.

    Parameters
    ----------
    puzzle : Puzzle
        Holds the noise.
    result : Ladder
        The ladder on its log.
    """
    if result.comparison_end is None or result.diagnosis.evidence != "reference":
        return float("nan")  # the noise of a sample is not that of a rest
    truth = _noise_of(puzzle.simulation) if puzzle.twin is None else _residual_of(puzzle.twin)
    squares = [(channel.rms / truth[channel.channel]) ** 2 for channel in result.comparison_end.channels]
    return float(np.sqrt(np.mean(squares)))


def _noise_of(simulation: Simulation) -> dict[str, float]:
    """Return the root mean square of the noise of each channel, as it was drawn."""
    return {
        f"{name}_{axis}": float(np.sqrt(np.nanmean(noise[:, k] ** 2)))
        for name, noise in simulation.noise.items()
        for k, axis in enumerate("xyz")
    }


def _residual_of(twin: Simulation) -> dict[str, float]:
    """Return the root mean square of what the ideal sensor leaves of each channel of a log with nothing hidden."""
    comparison = SensorModel().compare(twin.to_log())
    return {channel.channel: channel.rms for channel in comparison.channels}


def _errors(puzzle: Puzzle, result: Ladder) -> tuple[float, ...]:
    """Return errors in standard errors, if the final model is the truth: beside other effects they mean little."""
    truth = puzzle.simulation.truth.effects
    if not truth or set(result.model) != set(truth):
        return ()
    return tuple(
        float((p.value - truth[p.effect][p.name]) / p.standard_error)
        for p in result.fit.parameters
        if p.effect in truth and p.standard_error > 0
    )
