"""Mystery log: a game of three levels with a hidden effect, which teaches what evidence can and cannot show."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from imufit.errors import InputError
from imufit.figures import quantity
from imufit.lab.simulate import hidden, simulate, unseal
from imufit.lab.simulate.hidden import COLUMNS
from imufit.lab.simulate.separation import Separation
from imufit.lab.simulate.study import Study
from imufit.lab.simulated_log import save_simulation
from imufit.model.catalogue import units_of
from imufit.results import Diagnosis, Parameter
from imufit.results.phrasing import capital
from imufit.studio.names import effect_name, with_symbol

if TYPE_CHECKING:
    from imufit.lab.simulate import Simulation, Truth


@dataclass(frozen=True)
class Level:
    """One level of the game.

    Attributes
    ----------
    title, words : str
        Its name, and the task.
    lesson : str
        The sentence on the method that the level teaches.
    absence : str
        The same for a log in which nothing is hidden; empty where a level hides an effect in every log.
    """

    title: str
    words: str
    lesson: str
    absence: str = ""

    @property
    def nothing(self) -> bool:
        """Whether there may be nothing hidden."""
        return bool(self.absence)


DEMONSTRATION: Final = 0
"""Level that hides no name of the evidence: the loop is shown, and the truth at its end."""
LEVELS: Final[dict[int, Level]] = {
    DEMONSTRATION: Level(
        "Demonstration",
        "One effect is hidden in one minute of a simulated hand-held sensor. The sentence below names the effect. "
        "Press Add beside the effect under Candidates, see the error fall, then reveal the truth.",
        "The loop on your own log is the same: compare, name, add, and stop where the error stands at the noise floor.",
    ),
    1: Level(
        "An effect that stands out",
        "One effect is hidden in one minute of a hand-held sensor. The effect stands far above the noise, and no other "
        "effect looks like it. Name the effect.",
        "An effect is named by the shape of the residual: the covariate that the residual follows points to the cause.",
    ),
    2: Level(
        "A small effect, or none",
        "A small effect is hidden, or nothing at all. Name the effect, or answer that nothing is missing.",
        "A small effect shows once many rows agree on it: the probability counts all rows, the eye a few.",
        absence="Absence has evidence too: where nothing is hidden, every named effect is a false alarm.",
    ),
    3: Level(
        "An effect with a rival",
        "One effect is hidden. With this motion another effect looks like it. Name an effect that the log allows.",
        "A log cannot separate effects that its motion does not separate: the remedy is another motion, not more rows.",
    ),
}
DEMO_SEED: Final = 3
"""The log of the demonstration: the seed of `imufit demo`, whose effect lies far above the noise."""
NOTHING: Final = ""
"""The answer that nothing is missing."""
DURATION: Final = 60.0
"""Length of a log, s: the evidence of 60 s at 50 Hz is taken in two seconds."""
RATE: Final = 50.0
"""Samples a second."""
SURE: Final = 0.95
"""Probability from which on the evidence names one effect: odds of about 20 to 1."""

ALIKE: Final = 0.95
"""Correlation of two effects from which on they look alike: the second leaves a tenth of the first one's square."""
SEEDS: Final = 1_000_000
"""Logs of the game: none is met twice."""

_RIVALS: Final = (("tilt", "mag.hard_iron"), ("arm", "gyr.delay"), ("arm", "gyr.lowpass"))
"""Scenarios and effects that have a rival there: of 24 logs of these three, all were `ambiguous`."""


@dataclass(frozen=True)
class Compared:
    """A hidden value beside the fitted one.

    Attributes
    ----------
    key : str
        The parameter, such as ``acc.bias.x``.
    hidden : str
        The hidden value with its unit.
    fitted : str
        Value and standard error of the present model. Where the model lacks the effect, they are those that the
        evidence gives to first order, and say so.
    """

    key: str
    hidden: str
    fitted: str


@dataclass(frozen=True)
class Verdict:
    """The end of a game.

    Attributes
    ----------
    right : bool
        Whether the answer is the hidden effect.
    truth : tuple of str
        The hidden effects; empty where nothing was hidden.
    sentences : tuple of str
        Truth and answer, and how sure the evidence is.
    values : tuple of Compared
        The hidden values; empty where nothing was hidden.
    lesson : str
        The sentence on the method.
    """

    right: bool
    truth: tuple[str, ...]
    sentences: tuple[str, ...]
    values: tuple[Compared, ...]
    lesson: str


@dataclass
class Mystery:
    """A game on one log.

    Attributes
    ----------
    level, seed : int
        Level, `DEMONSTRATION` included, and the number that picked the log.
    log : Path
        The log; its sealed truth lies beside it.
    answer : str or None
        Id of the effect that the person chose, or `NOTHING`; None before a choice.
    verdict : Verdict or None
        After the reveal.
    closed : bool
        Whether the person has put the verdict away.
    """

    level: int
    seed: int
    log: Path
    answer: str | None = None
    verdict: Verdict | None = None
    closed: bool = False

    @classmethod
    def hidden(cls, level: int, seed: int, folder: Path) -> Mystery:
        """Simulate the log of a game.

        Parameters
        ----------
        level : int
            One of `LEVELS`.
        seed : int
            Picks effect, size, motion and noise.
        folder : Path
            Where log and sealed truth are written.

        Raises
        ------
        InputError
            The level is unknown.
        """
        if level not in LEVELS:
            raise InputError(f"the level {level} is unknown", remedy="Choose 1, 2 or 3.")
        path = folder / f"mystery-{level}-{seed}.parquet"
        if level in (DEMONSTRATION, 1):
            simulation = _standing_out(seed)
        elif level == 2:
            simulation, _ = hidden("handheld", seed, size="small", allow_nothing=True, duration=DURATION, rate=RATE)
        else:
            scenario, effect = _RIVALS[seed % len(_RIVALS)]
            simulation = simulate(scenario, {effect: None}, seed, duration=DURATION, rate=RATE, size="large")
        save_simulation(simulation, path)
        return cls(level, seed, path)

    def reveal(self, answer: str | None, first: Diagnosis, fitted: Sequence[Parameter] = ()) -> Verdict:
        """Open the truth and judge an answer.

        Parameters
        ----------
        answer : str or None
            Id of an effect; empty answers that nothing is missing, and None where no answer was asked for.
        first : Diagnosis
            The diagnosis of the ideal sensor on this log.
        fitted : sequence of Parameter
            Those of the present model.
        """
        truth = unseal(self.log)
        hidden_effects = tuple(truth.effects)
        right = answer in hidden_effects if hidden_effects else answer == NOTHING
        alike = first.named if first.verdict == "ambiguous" else ()
        rival = not right and answer in alike and not set(hidden_effects).isdisjoint(alike)
        self.verdict = Verdict(
            right,
            hidden_effects,
            (_said(hidden_effects, answer, right, rival), _sureness(first, _evidence(truth, first))),
            tuple(_values(truth, first, fitted)),
            _lesson(LEVELS[self.level], hidden_effects),
        )
        return self.verdict


def _standing_out(seed: int) -> Simulation:
    """Simulate the log of a number, or of the next one whose effect no other effect resembles."""
    for number in itertools.count(seed, SEEDS):
        simulation, truth = hidden("handheld", number, size="large", duration=DURATION, rate=RATE)
        ((effect, parameters),) = truth.effects.items()
        study = Study("handheld", [effect], number, DURATION, RATE, covariates=COLUMNS)
        distances = Separation(study, COLUMNS).distances(effect, parameters)
        if min(distances.values()) >= (1.0 - ALIKE**2) * distances[""]:
            break
    return simulation


def _lesson(level: Level, truth: Sequence[str]) -> str:
    return level.lesson if truth or not level.nothing else level.absence


def _said(truth: Sequence[str], answer: str | None, right: bool, rival: bool) -> str:
    hid = f"{' and '.join(map(_named, truth))} was hidden" if truth else "nothing was hidden"
    if answer is None:
        return f"{capital(hid)}."
    named = f"you named {_named(answer)}" if answer else "you answered that nothing is missing"
    mark = "Right" if right else "Accepted, since this log cannot separate the two" if rival else "Not right"
    return f"{mark}: {hid}, and {named}."


def _named(effect: str) -> str:
    return with_symbol(effect_name(effect), effect)


def _values(truth: Truth, first: Diagnosis, fitted: Sequence[Parameter]) -> list[Compared]:
    """Give the hidden values beside the fitted ones."""
    known = {item.key: item.shown for item in fitted}
    found = []
    for effect, hidden_values in truth.effects.items():
        units = units_of(effect)
        judged = (item for candidate in first.candidates if candidate.effect == effect for item in candidate.parameters)
        expected = {item.key: f"{item.shown} (to first order)" for item in judged}
        for name, value in hidden_values.items():
            key = f"{effect}.{name}"
            shown = known.get(key, expected.get(key, "not known"))
            found.append(Compared(key, quantity.quantity(value, units[name]), shown))
    return found


def _evidence(truth: Truth, first: Diagnosis) -> str:
    """Say which probability the evidence gives to the truth."""
    if not truth.effects:
        largest = max((item.probability for item in first.candidates), default=0.0)
        return f"the evidence gives its likeliest candidate a probability of {quantity.probability(largest)}"
    effect = next(iter(truth.effects))
    found = next((item for item in first.candidates if item.effect == effect), None)
    if found is None:
        return f"the evidence holds no candidate {_named(effect)}, which this log cannot show"
    likely = f"{quantity.probability(found.probability)}{first.shared(found)}"
    return f"the evidence gives {_named(effect)} a probability of {likely}"


def _sureness(first: Diagnosis, evidence: str) -> str:
    """Say how sure one could have been, by the evidence in words."""
    named = first.best_candidate
    best = math.nan if named is None else named.probability
    if first.verdict == "adequate":
        return f"You could not have named an effect: {evidence}."
    if first.verdict == "missing" and best >= SURE:
        return f"You could have been sure: {evidence}."
    if first.verdict == "ambiguous":
        alike = ", ".join(map(_named, first.named))
        return f"You could not have been sure, since {alike} explain this log equally well: {evidence}."
    return f"You could not have been sure, since the evidence names no single effect: {evidence}."
