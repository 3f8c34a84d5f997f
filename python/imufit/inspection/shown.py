"""Which effects a log can show, and from which size on, by the normal equations of its own fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit._imufit import Status
from imufit.diagnosing.column_noise import column_noise
from imufit.diagnosing.diagnose import POWER
from imufit.errors import InputError
from imufit.fitting.analysis import Analysis
from imufit.fitting.passes import CHANNELS
from imufit.fitting.surveyed_log import SurveyedLog
from imufit.log import Contents, LogSource
from imufit.log.columns import SENSOR_NAMES
from imufit.model.catalogue import effects, find_effect
from imufit.model.effect_stack import EffectStack
from imufit.progress import Progress
from imufit.results.effect_sight import EffectSight, ParameterSight
from imufit.results.log_info import MotionInfo

Array = NDArray[np.float64]

ALIKE: Final = 0.99
"""Canonical correlation from which on effects look the same: a standard error beside the other is then seven times as
large, 1 / sqrt(1 - 0.99^2)."""
UNTOLD: Final = 5.0
"""Typical sizes that a standard error has where only the prior of an estimate bounds it: that prior has ten of them."""
SHADOWED: Final = 3.0
"""Factor by which a constant offset beside an effect makes its standard error larger where that is worth saying."""
SLOW: Final = np.radians(5.0)
"""Largest rate, rad/s, of a log that hardly turns: at 5 deg/s a scale error of 1 % makes 0.05 deg/s, which is the noise
of one sample of a low-cost gyroscope."""
SIZES: Final = (1.0, 0.2, 0.04, 0.008)
"""Parts of the typical size that a diagnosis thinks equally likely, as `SIZES` in `rust/inference/src/stack.rs`."""
UNDER_NOISE: Final = "under the noise"
"""Why an effect is not seen where nothing else stands out."""
VANISHES: Final = 1e-9
"""Part of an effect's own information that is rounding once the offsets are taken out."""


@dataclass(frozen=True)
class Shown:
    """The effects that a log can show.

    Attributes
    ----------
    effects : tuple of EffectSight
        Every effect of the catalogue, the user's, and those of the log's own columns.
    judged_by : str or None
        ``reference`` or ``rests``; None where nothing can be judged.
    surveyed : SurveyedLog or None
        The log after its first pass.
    refusal, remedy : str
        Why nothing can be judged, and what to do about it; empty where something can.
    """

    effects: tuple[EffectSight, ...]
    judged_by: str | None
    surveyed: SurveyedLog | None = None
    refusal: str = ""
    remedy: str = ""


def shown(log: LogSource, held: Contents, motion: MotionInfo, progress: Progress) -> Shown:
    """Ask of every effect whether a log can show it.

    Parameters
    ----------
    log : LogSource
        The log.
    held : Contents
        What it holds.
    motion : MotionInfo
        How much it turns and moves.
    progress : callable
        Called with the rows done.
    """
    try:
        analysis = Analysis.of(EffectStack([]), [log], progress)
    except InputError as error:
        return Shown(tuple(_unjudged(held, error.problem)), None, refusal=error.problem, remedy=error.remedy or "")
    surveyed = analysis.logs[0].surveyed
    sight = _Sight(analysis, held, motion)
    ids = dict.fromkeys([*effects(), *(key for key in analysis.candidates if key not in effects())])
    return Shown(tuple(sight.of(key) for key in ids), analysis.judged_by, surveyed)


def _unjudged(held: Contents, problem: str) -> list[EffectSight]:
    """Say of every effect why a log shows nothing of it: its sensor is not there, or nothing can be judged."""
    found = []
    for key, effect in effects().items():
        absent = [sensor for sensor in effect.sensors if sensor in held.missing]
        lacking = len(absent) == len(effect.sensors)
        names = " and no ".join(SENSOR_NAMES[sensor] for sensor in absent)
        found.append(EffectSight(key, (), "no", f"the log has no {names}" if lacking else problem))
    return found


class _Sight:
    """Answers for each effect from one analysis around the ideal sensor."""

    def __init__(self, analysis: Analysis, held: Contents, motion: MotionInfo) -> None:
        self._analysis = analysis
        self._evidence = analysis.logs[0]
        self._slots = {key: slot for slot, key in enumerate(analysis.slots)}
        self._columns = {column.name: column for column in held.columns}
        self._motion = motion
        self._known = {**self._evidence.surveyed.columns, **{key: find_effect(key) for key in analysis.unnamed}}
        self._offsets = [
            slot
            for key, slot in self._slots.items()
            if key in self._known and self._known[key].affine == "offset" and self._known[key].column is None
        ]
        # The dictionary of causes without a name changes no standard error.
        decided = analysis.problem.diagnose(
            analysis.fitted_slots, analysis.candidate_slots, column_noise=column_noise(analysis)
        )
        self._asked = {candidate.slot: candidate for candidate in decided.candidates}
        self._least = 2.0 * _imufit.Problem.threshold(len(analysis.candidates))
        self._alike = _Alike(analysis, [*analysis.unnamed, *(analysis.slots[slot] for slot in self._offsets)])

    def of(self, key: str) -> EffectSight:
        """Say what the log shows of one effect."""
        effect = self._known.get(key)
        refused = self._evidence.surveyed.refused.get(key)
        if effect is None or key not in self._slots or refused is not None:
            return EffectSight(key, (), "no", refused or "it is inside another effect here")
        parameters = self._parameters(effect)
        if not parameters:
            return EffectSight(key, (), "yes")
        if not self._alike.tells(key) and not effect.jumps:
            return EffectSight(key, (), "no", self._why(effect) or "nothing that it depends on changes in this log")
        seen = [p.name for p in parameters if p.seen]
        like = tuple(other for other in self._alike.like(key) if other != key)
        if not seen:
            return EffectSight(key, parameters, "no", self._why(effect) or UNDER_NOISE, like)
        unseen = [p.name for p in parameters if not p.seen]
        if not unseen:
            return EffectSight(key, parameters, "yes", "", like)
        return EffectSight(
            key,
            parameters,
            "in part",
            (f"not {' '.join(unseen)}" if len(unseen) <= len(seen) else f"only {' '.join(seen)}"),
            like,
        )

    def _errors(self, slots: list[int], slot: int) -> Array:
        """Return standard errors of the parameters of one slot, beside others."""
        chosen = sorted({*slots, slot, *self._analysis.fitted_slots})
        counts = [len(self._known[self._analysis.slots[each]].parameters) for each in chosen]
        covariance = self._analysis.problem.estimate(chosen)["covariance"]
        errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        return np.split(errors, np.cumsum(counts)[:-1])[chosen.index(slot)]

    def _parameters(self, effect: _imufit.Effect) -> tuple[ParameterSight, ...]:
        """Smallest sizes of the parameters that the readings determine; those that are only searched for are left out.

        A diagnosis names an effect whose log Bayes factor reaches a threshold. That factor is half the square of the
        value over its error, less what the freedom of all parameters costs by their typical sizes, or parts of these.
        """
        asked = self._asked.get(self._slots[effect.id])
        if asked is not None and not effect.jumps:
            return self._as_asked(effect, asked)
        found = self._analysis.found.get(effect.id)
        if effect.jumps:
            errors = np.asarray(found.spread if found is not None else [np.nan] * len(effect.parameters))
            skipped = {name for (name, _, _), error in zip(effect.parameters, errors, strict=True) if not error > 0.0}
        else:
            errors = self._errors(self._offsets, self._slots[effect.id])
            skipped = set(effect.searched)
        kept = [
            (name, unit, None if size is None else abs(size), float(error))
            for (name, unit, size), error in zip(effect.parameters, errors, strict=True)
            if name not in skipped
        ]
        if not effect.jumps and all(size is None for _, _, size, _ in kept):
            # Where no card bounds a size, an error far below what the rows themselves give comes from the prior.
            own = dict(zip((name for name, _, _ in effect.parameters), self._alike.errors(effect.id), strict=True))
            kept = [(n, u, s, error if error > 0.5 * own[n] else np.inf) for n, u, s, error in kept]
        sizes = [(size, error) for _, _, size, error in kept if size and error > 0.0]

        def smallest(size: float | None, error: float) -> float:
            if not (np.isfinite(error) and error > 0.0) or (size is not None and error > UNTOLD * size):
                return np.inf
            return error * (self._steps(size, error, sizes) + POWER)

        return tuple(ParameterSight(name, unit, error, smallest(size, error), size) for name, unit, size, error in kept)

    def _as_asked(self, effect: _imufit.Effect, asked: _imufit.Candidate) -> tuple[ParameterSight, ...]:
        """Sizes at which the diagnosis itself would see a candidate."""
        testable = asked.status != Status.NOT_TESTABLE
        found = []
        for (name, unit, size), (_, error), least in zip(
            effect.parameters, asked.parameters, asked.detectable, strict=True
        ):
            if name in effect.searched:
                continue
            typical = None if size is None else abs(size)
            known = testable and error > 0.0 and np.isfinite(least)
            told = known and (typical is None or error <= UNTOLD * typical)
            smallest = least + POWER * error if told else np.inf
            found.append(ParameterSight(name, unit, float(error), float(smallest), typical))
        return tuple(found)

    def _steps(self, size: float | None, error: float, sizes: list[tuple[float, float]]) -> float:
        """Return how many standard errors a value has that is seen as often as not, beside all others' freedom."""
        if size is None:
            return float(np.sqrt(self._least))
        squares = []
        for part in SIZES:
            cost = sum(np.log1p((part * other / its) ** 2) for other, its in sizes)
            known = (part * size / error) ** 2
            squares.append((self._least + 2.0 * np.log(len(SIZES)) + cost) * (1.0 + known) / known)
        return float(np.sqrt(min(squares)))

    def _why(self, effect: _imufit.Effect) -> str:
        """Say what the log lacks for an effect to be seen; empty where no single thing stands out."""
        column = None if effect.column is None else self._columns.get(effect.column)
        if column is not None and column.low is not None and column.high is not None:
            unit = f" {column.unit}" if column.unit else ""
            return f"{column.name} spans only {column.high - column.low:.2g}{unit}"
        largest = max(
            (abs(v) for v in (*self._motion.rate_low, *self._motion.rate_high) if v is not None), default=None
        )
        if "gyr" in effect.sensors and largest is not None and largest < SLOW and effect.affine != "offset":
            return f"the sensor hardly turns (at most {np.degrees(largest):.2g} deg/s)"
        slot = self._slots[effect.id]
        if slot not in self._offsets and not effect.jumps:
            alone, beside = self._errors([], slot), self._errors(self._offsets, slot)
            if np.any(beside > SHADOWED * alone):
                return "it looks like a constant offset: there are too few different attitudes and rates"
        return ""


class _Alike:
    """Which effects look the same in a log once its offsets are fitted.

    Parameters
    ----------
    analysis : Analysis
        Of one log, around the ideal sensor.
    along : list of str
        Effects that are fitted along.
    """

    def __init__(self, analysis: Analysis, along: list[str]) -> None:
        evidence = analysis.logs[0]
        known = {**evidence.surveyed.columns, **{key: find_effect(key) for key in analysis.unnamed}}
        places: dict[str, NDArray[np.intp]] = {}
        first = 0
        for key in evidence.slots:
            count = len(known[key].parameters)
            places[key] = np.arange(first, first + count)
            first += count
        whole = np.zeros((first, first))
        for channel in range(len(CHANNELS)):
            gram, variance = evidence.white.gram(channel), evidence.variance[channel]
            if gram is not None and np.isfinite(variance) and variance > 0.0:
                active = np.asarray(evidence.white.active(channel), dtype=int)
                whole[np.ix_(active, active)] += gram[: len(active), : len(active)] / variance
        offsets = np.concatenate([np.empty(0, int), *(places[key] for key in along if key in places)]).astype(int)
        self._own = np.diag(whole).copy()
        left = _without(whole, offsets)
        names = [key for key in places if key in analysis.candidates and key not in along]
        self._bases = {key: _whitening(left[np.ix_(at, at)], self._own[at]) for key, at in places.items()}
        self._left, self._places, self._names, self._along = left, places, names, set(along)

    def tells(self, key: str) -> bool:
        """Whether any row depends on an effect, offsets aside."""
        if key in self._along:
            return bool(np.any(self._own[self._places[key]] > 0.0))
        return bool(self._bases[key].size)

    def errors(self, key: str) -> Array:
        """Return standard errors by the rows alone, offsets aside; infinite where no row is informative."""
        base = self._bases[key]
        squares = np.sum(base**2, axis=1)
        whole = base.shape[1] == base.shape[0]
        return np.where(squares > 0.0, np.sqrt(squares), np.inf) if whole else np.full(base.shape[0], np.inf)

    def like(self, key: str) -> list[str]:
        """Effects that can do whatever this one does."""
        if key not in self._names or not self._bases[key].size:
            return []
        own, at = self._bases[key], self._places[key]
        found = []
        for other in self._names:
            base = self._bases[other]
            if other == key or base.shape[1] < own.shape[1]:
                continue
            cross = own.T @ self._left[np.ix_(at, self._places[other])] @ base
            if np.linalg.svd(cross, compute_uv=False).min() >= ALIKE:
                found.append(other)
        return found


def _without(whole: Array, along: NDArray[np.intp]) -> Array:
    """Information that is left once some parameters are fitted."""
    if not along.size:
        return whole
    own = whole[np.ix_(along, along)]
    scale = np.sqrt(np.maximum(np.diag(own), np.finfo(float).tiny))
    inverse = np.linalg.pinv(own / np.outer(scale, scale), rcond=VANISHES, hermitian=True) / np.outer(scale, scale)
    cross = whole[:, along]
    return np.asarray(whole - cross @ inverse @ cross.T)


def _whitening(information: Array, own: Array) -> Array:
    """Directions of some parameters that the log determines, each of unit information; (parameters, directions)."""
    there = own > 0.0
    scale = np.where(there, 1.0 / np.sqrt(np.where(there, own, 1.0)), 0.0)
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    kept = values > VANISHES
    return np.asarray(scale[:, None] * vectors[:, kept] / np.sqrt(values[kept]))
