"""Benefit of a sensor's model on a trial outside of its fit: the attitude error of a filter with and without it.

Imported by `benches/recordings.py`. For each trial the model holds the effects that the ladder found on more than half
of the other trials, fitted to all of these at once. Zeros, mounts, tables and drives, which are one recording's, are
fitted along and then left out, unless all trials are stretches of one recording. Nothing of a trial enters its own
model.
"""

import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from confirmed import Part, of_a_recording
from imufit import InputError, Log, SensorModel
from imufit.comparing.attitude import attitude_comparison

Values = Mapping[str, Mapping[str, float]]
WITHIN = 1.05
"""A trial counts as no worse if its error has not grown by more than this factor (demand on real recordings)."""
FILTER = "mekf"


@dataclass(frozen=True)
class Applied:
    """Attitude error of one trial, deg, without a model and with that of the other trials."""

    trial: str
    effects: tuple[str, ...]
    part: str
    without: float
    with_model: float

    @property
    def no_worse(self) -> bool:
        return self.with_model <= WITHIN * self.without


@dataclass(frozen=True)
class Trial:
    """A recording, or rows of one, on which a model of others is tried."""

    title: str
    file: str
    begin: float = 0.0
    end: float = 1.0

    def log(self, folder: Path) -> Log:
        (log,) = Part(self.title, (self.file,), self.begin, self.end).logs(folder)
        return log


def trials_of(parts: Sequence[Part]) -> tuple[Trial, ...]:
    """Return each recording of each part as a trial."""
    return tuple(
        Trial(part.title if len(part.files) == 1 else Path(file).stem, file, part.begin, part.end)
        for part in parts
        for file in part.files
    )


class Others:
    """Models of the other trials, each fitted once."""

    def __init__(self, folder: Path, parts: Mapping[Part, Values]) -> None:
        self.folder = folder
        self.parts = parts
        self.one_recording = len({file for part in parts for file in part.files}) == 1
        self._fitted: dict[tuple[Part, ...], SensorModel | None] = {}

    def model(self, trial: Trial) -> SensorModel | None:
        """Return the model that the other trials give; None where they have none in common."""
        others = tuple(
            part
            for part in self.parts
            if (trial.file not in part.files) or (self.one_recording and part.begin != trial.begin)
        )
        if others not in self._fitted:
            self._fitted[others] = self._fit(others)
        return self._fitted[others]

    def _fit(self, others: Sequence[Part]) -> SensorModel | None:
        count = Counter(effect for part in others for effect in self.parts[part])
        stack = [effect for effect, n in count.items() if 2 * n > len(others)]
        if not stack:
            return None
        start = {e: next(self.parts[part][e] for part in others if e in self.parts[part]) for e in stack}
        before = time.perf_counter()
        try:
            fitted = SensorModel(stack, start).fit([log for part in others for log in part.logs(self.folder)]).model
        except InputError as error:
            print(f"{', '.join(stack)}: {error}", file=sys.stderr)
            return None
        print(f"fit of {', '.join(stack)}: {time.perf_counter() - before:.0f} s", file=sys.stderr, flush=True)
        for effect in stack:
            if of_a_recording(effect) and not self.one_recording:
                fitted = fitted.without_effect(effect)
        return fitted


def applied(folder: Path, parts: Mapping[Part, Values], trials: Sequence[Trial]) -> Iterator[Applied]:
    """Try the model of the other trials on each trial.

    Without a magnetometer the heading is not observable: there the inclination is judged.
    """
    others = Others(folder, parts)
    for trial in trials:
        model = others.model(trial)
        if model is None or not model.effects:
            continue
        log = trial.log(folder)
        found = attitude_comparison(model, log, FILTER)
        if found is None or found.after is None:
            print(f"{trial.title}: no attitude to judge", file=sys.stderr)
            continue
        part = "inclination" if log.mag is None else "total"
        yield Applied(trial.title, tuple(model.effects), part, found.before[part], found.after[part])


def every_trial(folder: Path, pattern: str) -> tuple[Trial, ...]:
    """Return whole recordings as trials."""
    files = sorted(path for path in folder.glob(pattern) if "norefgaps" not in path.name)
    return tuple(Trial(path.stem, str(path.relative_to(folder))) for path in files)
