"""Findings of the ladder on parts of one sensor's recordings, and the size of each effect on the other parts.

Imported by `benches/recordings.py`. An effect that was found on one part is fitted to every other part within the whole
model of the part that shows it best, on another recording with zeros of its own. How much of the effect the other part
has is the ratio r of the two sizes,

    r = sum(w a b) / sum(w a^2),    w = 1 / (s_a^2 + s_b^2),

over its parameters a (here) and b (there) with their standard errors; 1 is the same effect, 0 none, -1 the opposite.
"""

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import imufit
import numpy as np
from imufit import InputError, Ladder, Log, SensorModel
from imufit.loop import Fit
from imufit.model.catalogue import each_log_has_its_own
from imufit.results import Parameter

NOT_CAUSES = ("encoder_deg", "still_", "dmp_")
"""Columns that hold the reference again or come from another sensor: they can't be the cause of an error."""
SAME = 1.0 / 3.0
"""Sizes may differ by this much ..."""
CHANCE = 2.0
"""... or by as many standard errors."""
SEEN = 0.5
"""A part whose ratio has a standard error above this does not see the effect."""
OF_A_RECORDING = ("bias_drift", "warmup", "rig.")
"""Besides what each log has for itself: a drive is loaded otherwise in each set-up."""


@dataclass(frozen=True)
class Part:
    """Rows of one recording, or of several that are asked together, from share `begin` to share `end` of each."""

    title: str
    files: tuple[str, ...]
    begin: float = 0.0
    end: float = 1.0

    def logs(self, folder: Path) -> list[Log]:
        return [self._cut(imufit.read(folder / file)) for file in self.files]

    def _cut(self, log: Log) -> Log:
        causes = {name: column for name, column in log.covariates.items() if not name.startswith(NOT_CAUSES)}
        return replace(log, covariates=causes).rows(round(self.begin * log.n), round(self.end * log.n))


@dataclass(frozen=True)
class Sensor:
    """Parts of the recordings of one sensor, in one set-up."""

    title: str
    parts: tuple[Part, ...]


def halves(file: str, name: str, share: float = 1.0) -> tuple[Part, ...]:
    """Return the two halves of a recording, or the beginning of each."""
    return tuple(
        Part(f"{name}, {half} half", (file,), begin, begin + 0.5 * share)
        for half, begin in (("1st", 0.0), ("2nd", 0.5))
    )


@dataclass(frozen=True)
class Ratio:
    """How much of an effect another part has."""

    part: str
    size: float
    error: float

    @property
    def seen(self) -> bool:
        return self.error <= SEEN

    @property
    def same(self) -> bool:
        return abs(self.size - 1.0) <= max(SAME, CHANCE * self.error)

    @property
    def confirms(self) -> bool:
        return self.seen and self.same and self.size > CHANCE * self.error

    @property
    def contradicts(self) -> bool:
        return not self.same

    def __str__(self) -> str:
        return f"{self.size:.2f} ± {CHANCE * self.error:.2f}" if self.error <= 5.0 else "-"


@dataclass(frozen=True)
class Found:
    """An effect, the part that shows it best, and what the other parts say of it."""

    effect: str
    best: str
    parameters: tuple[Parameter, ...]
    on: tuple[str, ...]
    first_answer_of: tuple[str, ...]
    ratios: tuple[Ratio, ...] = field(default=())

    @property
    def answer(self) -> str:
        if any(ratio.contradicts for ratio in self.ratios):
            return "no"
        return "yes" if any(ratio.confirms for ratio in self.ratios) else "not seen"


@dataclass(frozen=True)
class Climbed:
    """The ladder on every part of a sensor, and the effects it found."""

    sensor: Sensor
    ladders: dict[str, Ladder]
    failures: dict[str, str]
    found: tuple[Found, ...]


def of(parameters: Sequence[Parameter], effect: str) -> tuple[Parameter, ...]:
    return tuple(item for item in parameters if item.effect == effect)


def weight(parameters: Sequence[Parameter]) -> float:
    """Return how far an effect stands out from its errors."""
    values, errors = (np.array([getattr(p, name) for p in parameters]) for name in ("value", "standard_error"))
    known = np.isfinite(errors) & (errors > 0.0)
    return float(np.sum(np.square(values[known] / errors[known])))


def ratio(part: str, here: Sequence[Parameter], there: Sequence[Parameter]) -> Ratio:
    """Compare the sizes of an effect."""
    a, b = (np.array([p.value for p in each]) for each in (here, there))
    spread = np.sum([[p.standard_error**2 for p in each] for each in (here, there)], axis=0)
    known = np.isfinite(spread) & (spread > 0.0)
    w = np.where(known, 1.0 / np.where(known, spread, 1.0), 0.0)
    information = float(np.sum(w * a * a))
    if information <= 0.0:
        return Ratio(part, 0.0, float("inf"))
    return Ratio(part, float(np.sum(w * a * b)) / information, information**-0.5)


def fitted(model: SensorModel, there: Fit) -> tuple[Parameter, ...]:
    """Fit a model to the logs of another fit, from the model's values on; empty where they do not determine it."""
    if any(there.analysis.refusal(effect) for effect, _ in model.stack()):
        return ()
    return Fit(*there.analysis.solved_for(model, there.own, only=())).parameters


def of_a_recording(effect: str) -> bool:
    """Zeros, mounts, tables and drives are one recording's; all else is the sensor's."""
    return each_log_has_its_own(effect) or any(name in effect for name in OF_A_RECORDING)


def comparable(effect: str, here: Part, there: Part) -> bool:
    return not of_a_recording(effect) or here.files == there.files


def with_zeros(model: SensorModel, logs: Sequence[Log]) -> SensorModel:
    """Return a model with the zeros of its sensors: switching on makes others, whether a ladder saw them or not."""
    zeros = [f"{sensor}.bias" for sensor in ("acc", "gyr") if all(getattr(log, sensor) is not None for log in logs)]
    values = {**model.parameters, **{zero: {} for zero in zeros if zero not in model.effects}}
    return SensorModel(list(values), values, constants=model.constants)


class Climber:
    """Climbs the parts of sensors; keeps what was read and fitted for one sensor."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def climb(self, sensor: Sensor) -> Climbed:
        logs: dict[str, list[Log]] = {part.title: part.logs(self.folder) for part in sensor.parts}
        ladders: dict[str, Ladder] = {}
        failures: dict[str, str] = {}
        for title, own in logs.items():
            before = time.perf_counter()
            try:
                ladders[title] = imufit.ladder(own)
            except InputError as error:
                failures[title] = str(error)
                continue
            told = f"{', '.join(ladders[title].model)}: {ladders[title].verdict}"
            print(f"{title}: {told} ({time.perf_counter() - before:.0f} s)", file=sys.stderr, flush=True)
        return Climbed(sensor, ladders, failures, self._found(sensor, ladders))

    def _found(self, sensor: Sensor, ladders: dict[str, Ladder]) -> tuple[Found, ...]:
        parts = {part.title: part for part in sensor.parts}
        fits: dict[tuple[str, str], tuple[Parameter, ...]] = {}

        def there(best: str, other: str) -> tuple[Parameter, ...]:
            if (best, other) not in fits:
                model, fit = ladders[best].fit.model, ladders[other].fit
                same = parts[best].files == parts[other].files
                fits[best, other] = fitted(model if same else with_zeros(model, fit.logs), fit)
            return fits[best, other]

        found = []
        for effect in dict.fromkeys(effect for each in ladders.values() for effect in each.model):
            on = [title for title, each in ladders.items() if effect in each.model]
            best = max(on, key=lambda title: weight(of(ladders[title].fit.parameters, effect)))
            here = of(ladders[best].fit.parameters, effect)
            ratios = [
                ratio(other, here, values)
                for other in ladders
                if other != best and comparable(effect, parts[best], parts[other])
                if (values := of(there(best, other), effect))
            ]
            named = tuple(
                t for t in on if (first := ladders[t].first) and first.verdict == "missing" and first.best == effect
            )
            found.append(Found(effect, best, here, tuple(on), named, tuple(ratios)))
        return tuple(found)
