"""Evidence of one log around one model: what every question is asked of."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.errors import InputError
from imufit.faults import time_faults
from imufit.fit.data_faults import data_faults
from imufit.fit.passes import CHANNELS, MIN_COVERAGE, Passes
from imufit.fit.profile import Found, search
from imufit.fit.users_effects import check_users_effects
from imufit.log import LogSource
from imufit.model.catalogue import COLUMN, column_effects, effects, find_effect
from imufit.model.sensor_model import SensorModel
from imufit.progress import Progress
from imufit.results import DataFault

Array = NDArray[np.float64]

BLOCKS = 48
FIELD_REFERENCE = "mag.field_reference"
"""Fitted along, unnamed, wherever the reference field was estimated from the log itself."""

MAX_ITERATIONS = 6


@dataclass(frozen=True, eq=False)
class Estimate:
    """Fitted parameters of some slots.

    Attributes
    ----------
    values, errors : dict of int to ndarray
        By slot: parameter values and standard errors, SI units.
    step : ndarray
        (p,) step of every parameter of the evidence.
    held_out, training : float
        Residual RMS over noise floor on data not used for the fit, and on all data.
    """

    values: dict[int, Array]
    errors: dict[int, Array]
    step: Array
    held_out: float
    training: float


@dataclass(frozen=True, eq=False)
class Analysis:
    """Evidence of a log with the columns of every effect, taken around given parameter values.

    Slots are effects in a fixed order: those of the model, the unnamed ones that are always fitted, the candidates.
    """

    passes: Passes
    facts: _imufit.Facts
    model: SensorModel
    nuisance: dict[str, list[float]]
    candidates: dict[str, _imufit.Effect]
    found: dict[str, Found]
    refused: dict[str, str]
    raw: _imufit.Evidence
    white: _imufit.Evidence
    problem: _imufit.Problem
    raw_variance: list[float]
    variance: list[float]
    floors: list[float]
    filters: list[list[float]]
    faults: tuple[DataFault, ...] = ()

    @classmethod
    def of(cls, model: SensorModel, log: LogSource, progress: Progress, *, keep_constants: bool = False) -> Analysis:
        """Survey a log, find its noise and take its evidence around a model.

        Parameters
        ----------
        model : SensorModel
            Effects and parameters to take the evidence around.
        log : LogSource
            The log.
        progress : callable
            Told of the rows done.
        keep_constants : bool
            Temperatures and covariates count from the means that the model was fitted with, not from this log's.
        """
        passes = Passes(log, progress)
        facts, coverage = passes.survey()
        ends = passes.ranges()
        facts = facts.with_ranges(**ends)
        faults = data_faults(passes, facts, ends)
        if keep_constants and model.constants:
            facts = facts.with_means(model.constants.get("temperature_mean"), model.constants.get("covariate_means"))
        candidates, refused = _candidates(model, facts, coverage)
        for effect, _ in model.stack():
            reason = effect.not_testable(facts) or _not_covered(effect, coverage)
            if reason is not None:
                raise InputError(f"effect {effect.id} cannot be fitted: {reason}", file=log.path)
        check_users_effects(passes, facts, [*model.effects, *candidates])
        nuisance = {}
        if facts.field_estimated and FIELD_REFERENCE not in model.effects:
            nuisance = {FIELD_REFERENCE: [0.0, 0.0, 0.0]}
        model = _started(passes, facts, model, nuisance)
        found = search(passes, facts, _stack(model, nuisance), candidates)
        raw = _empty(facts, model, nuisance, _asked(candidates, found), [[] for _ in CHANNELS])
        passes.evidence(raw, facts, "taking evidence")
        step, raw_variance = _imufit.saturate(raw)
        _check_samples(log, model, raw_variance)
        if not any(fault.spoils for fault in faults):
            faults = (*faults, *time_faults(raw, raw_variance, _places(model, nuisance, candidates), facts))
        filters = passes.autocovariance(raw, facts, step).filters()
        floors = _floors(log, raw_variance)
        white, variance = raw, raw_variance
        if any(filters):
            white = passes.evidence(raw.with_filters(filters), facts, "whitening the evidence")
            _, variance = _imufit.saturate(white)
        problem = _imufit.Problem(white, raw, variance, floors)
        return cls(
            passes,
            facts,
            model,
            nuisance,
            candidates,
            found,
            refused,
            raw,
            white,
            problem,
            raw_variance,
            variance,
            floors,
            filters,
            faults,
        )

    def around(
        self,
        model: SensorModel,
        nuisance: Mapping[str, list[float]],
        *,
        with_candidates: bool = True,
        only: Collection[str] | None = None,
        lean: bool = False,
    ) -> Analysis:
        """Evidence of the same log around other parameter values or another stack of effects.

        Without candidates, or with only some of them, it is quicker to take; lean, for the next iteration of a fit, it
        does not tell the residual as it stands either, only whitened.
        """
        known = {**self.candidates, **dict(zip(self.model.effects, (e for e, _ in self.model.stack()), strict=True))}
        candidates = {
            key: effect
            for key, effect in known.items()
            if key not in model.effects and key not in nuisance and (only is None or key in only)
        }
        asked = candidates if with_candidates and not lean else {}
        starts = {
            key: self.found[key].start for key in model.effects if key in self.found and key not in self.model.effects
        }
        model = model.starting_at(starts)
        found = search(self.passes, self.facts, _stack(model, nuisance), asked)
        white = _empty(self.facts, model, nuisance, _asked(asked, found), self.filters)
        self.passes.evidence(white, self.facts, "taking evidence")
        raw = white
        if not lean and any(self.filters):
            plain = white.with_filters([[] for _ in CHANNELS])
            raw = self.passes.evidence(plain, self.facts, "taking evidence as it stands")
        # The noise is that of the first evidence, which every effect of the catalogue was fitted to.
        problem = _imufit.Problem(white, raw, self.variance, self.floors)
        return replace(
            self,
            model=model,
            nuisance=dict(nuisance),
            candidates=candidates,
            found=found,
            raw=raw,
            white=white,
            problem=problem,
        )

    @property
    def slots(self) -> list[str]:
        """Ids of all slots: the model's effects, the unnamed ones, the candidates."""
        return [*self.model.effects, *self.nuisance, *self.candidates]

    @property
    def fitted_slots(self) -> list[int]:
        """Slots that are fitted: the model's effects and the unnamed ones."""
        return list(range(len(self.model.effects) + len(self.nuisance)))

    @property
    def candidate_slots(self) -> list[int]:
        """Slots of the candidates."""
        return list(range(len(self.fitted_slots), len(self.slots)))

    def estimate(self) -> Estimate:
        """Fit the model's effects (and the unnamed ones) to the evidence."""
        return self._estimate(self.fitted_slots)

    def estimate_unnamed(self) -> Estimate:
        """Keep the model as it is and fit only what is always fitted along."""
        return self._estimate(self.fitted_slots[len(self.model.effects) :])

    def _estimate(self, chosen: list[int]) -> Estimate:
        result = self.problem.estimate(chosen)
        values, errors, at = {}, {}, 0
        present = [*(v for _, v in self.model.stack()), *self.nuisance.values()]
        for slot in chosen:
            count = len(present[slot])
            values[slot] = self._within_reach(slot, np.asarray(present[slot]) + result["step"][at : at + count])
            errors[slot] = result["standard_error"][at : at + count]
            at += count
        return Estimate(values, errors, result["full_step"], result["held_out"], result["training"])

    def _within_reach(self, slot: int, values: Array) -> Array:
        """Keep what a search started (a time constant) within half and twice its present value in one step."""
        if slot >= len(self.model.effects):
            return values
        effect, present = self.model.stack()[slot]
        for k, (name, _, _) in enumerate(effect.parameters):
            if name in effect.searched and name not in effect.only_searched:
                low, high = sorted((0.5 * present[k], 2.0 * present[k]))
                values[k] = min(max(values[k], low), high)
        return values

    def moved_to(self, estimate: Estimate) -> tuple[SensorModel, dict[str, list[float]]]:
        """Return the model and the unnamed effects with estimated parameters."""
        ids = self.slots
        parameters, errors = {}, {}
        for slot in range(len(self.model.effects)):
            effect = find_effect(ids[slot])
            names = [name for name, _, _ in effect.parameters]
            parameters[ids[slot]] = dict(zip(names, map(float, estimate.values[slot]), strict=True))
            errors[ids[slot]] = dict(zip(names, map(float, estimate.errors[slot]), strict=True))
            errors[ids[slot]] |= dict.fromkeys(effect.only_searched, 0.0)
        nuisance = {
            ids[slot]: [float(v) for v in estimate.values[slot]]
            for slot in self.fitted_slots
            if ids[slot] in self.nuisance
        }
        constants = {
            "temperature_mean": self.facts.temperature_mean if self.facts.has_temperature else None,
            "covariate_means": {
                name: mean
                for name, mean in self.facts.covariate_means.items()
                if any(key.endswith(COLUMN + name) for key in self.model.effects)
            },
        }
        kept = {key: value for key, value in constants.items() if value is not None and value != {}}
        return SensorModel(self.model.effects, parameters, constants=kept, standard_errors=errors), nuisance

    def converged(self, estimate: Estimate) -> bool:
        """Return whether no parameter still moves by more than a tenth of its standard error."""
        present = [*(v for _, v in self.model.stack()), *self.nuisance.values()]
        return all(
            bool(np.all(np.abs(estimate.values[slot] - present[slot]) <= 0.1 * estimate.errors[slot]))
            for slot in estimate.values
        )

    @property
    def linear(self) -> bool:
        """True if the reading is proportional to the fitted parameters, so that one solution is exact."""
        stages = {effect.stage for effect, _ in self.model.stack()}
        stages |= {find_effect(key).stage for key in self.nuisance} if "gain" in stages else set()
        return not any(effect.nonlinear for effect, _ in self.model.stack()) and not {"input", "gain"} <= stages

    def solved(self) -> tuple[Analysis, Estimate]:
        """Evidence around the best parameters, by Gauss and Newton's iteration where the effects are not linear."""
        best, estimate = self._iterated()
        if best is not self:
            best = best.around(*best.moved_to(estimate))
            estimate = best.estimate()
        return best, estimate

    def solved_for(
        self,
        model: SensorModel,
        nuisance: Mapping[str, list[float]],
        *,
        with_candidates: bool = True,
        only: Collection[str] | None = None,
    ) -> tuple[Analysis, Estimate]:
        """Evidence around the best parameters of another stack of effects.

        Without candidates, or with only some of them, it is quicker to take, and enough to know how well that stack
        does.
        """
        best, estimate = self.around(model, nuisance, lean=True)._iterated()
        best = best.around(*best.moved_to(estimate), with_candidates=with_candidates, only=only)
        return best, best.estimate()

    def _iterated(self) -> tuple[Analysis, Estimate]:
        analysis, estimate = self, self.estimate()
        for _ in range(MAX_ITERATIONS):
            if analysis.linear or analysis.converged(estimate):
                break
            analysis = analysis.around(*analysis.moved_to(estimate), lean=True)
            estimate = analysis.estimate()
        return analysis, estimate


def _check_samples(log: LogSource, model: SensorModel, variance: list[float]) -> None:
    """Refuse a log of which too few samples can be used for any sensor, or for one that an effect acts on."""
    used = {channel[:3] for channel, v in zip(CHANNELS, variance, strict=True) if np.isfinite(v)}
    remedy = "Check that sensors and reference cover the same time."
    if not used:
        raise InputError("too few samples have a reference around them", file=log.path, remedy=remedy)
    for effect, _ in model.stack():
        if not used.intersection(effect.sensors):
            sensors = " and ".join(effect.sensors)
            raise InputError(
                f"effect {effect.id} cannot be fitted: too few samples of {sensors} have a reference around them",
                file=log.path,
                remedy=remedy,
            )


def _candidates(
    model: SensorModel, facts: _imufit.Facts, coverage: Mapping[str, float]
) -> tuple[dict[str, _imufit.Effect], dict[str, str]]:
    """Effects that can be asked about on this log, and why the others cannot."""
    own = [name for name in coverage if name != "temp"]
    named = {(sensor, effect.column) for effect in effects().values() for sensor in effect.sensors}
    columns = {
        key: effect
        for key, effect in column_effects(own, facts.sensors).items()
        if (effect.sensors[0], effect.column) not in named
    }
    offered: dict[str, Any] = {**effects(), **columns}
    candidates, refused = {}, {}
    for key, effect in offered.items():
        if key in model.effects or (key == FIELD_REFERENCE and facts.field_estimated):
            continue
        reason = effect.not_testable(facts) or _not_covered(effect, coverage)
        if reason is None:
            candidates[key] = effect
        else:
            refused[key] = reason
    return candidates, refused


def _not_covered(effect: _imufit.Effect, coverage: Mapping[str, float]) -> str | None:
    column = effect.column
    if column is None or coverage.get(column, 0.0) >= MIN_COVERAGE:
        return None
    return f"column {column} is known in only {100 * coverage.get(column, 0.0):.0f} % of the rows"


def _empty(
    facts: _imufit.Facts,
    model: SensorModel,
    nuisance: Mapping[str, list[float]],
    candidates: list[tuple[_imufit.Effect, list[float]]],
    filters: list[list[float]],
) -> _imufit.Evidence:
    return _imufit.Evidence(facts, _stack(model, nuisance), candidates, BLOCKS, filters)


def _places(
    model: SensorModel, nuisance: Mapping[str, list[float]], candidates: Mapping[str, _imufit.Effect]
) -> dict[str, range]:
    """Parameters of every effect in the evidence, by its id."""
    places, first = {}, 0
    for effect in [*(e for e, _ in _stack(model, nuisance)), *candidates.values()]:
        places[effect.id] = range(first, first + len(effect.parameters))
        first += len(effect.parameters)
    return places


def _stack(model: SensorModel, nuisance: Mapping[str, list[float]]) -> list[tuple[_imufit.Effect, list[float]]]:
    return [*model.stack(), *((find_effect(key), values) for key, values in nuisance.items())]


def _asked(
    candidates: Mapping[str, _imufit.Effect], found: Mapping[str, Found]
) -> list[tuple[_imufit.Effect, list[float]]]:
    return [
        (effect, found[key].trial if key in found else [0.0] * len(effect.parameters))
        for key, effect in candidates.items()
    ]


def _started(
    passes: Passes, facts: _imufit.Facts, model: SensorModel, nuisance: Mapping[str, list[float]]
) -> SensorModel:
    """Find where to start for effects of the model that need a search and have no values yet."""
    for effect, values in model.stack():
        if not any(values) and effect.search(facts):
            others = [(e, v) for e, v in _stack(model, nuisance) if e.id != effect.id]
            found = search(passes, facts, others, {effect.id: effect})
            model = model.starting_at({key: item.start for key, item in found.items()})
    return model


def _floors(log: LogSource, variance: list[float]) -> list[float]:
    """Noise floor of each channel: from the metadata, else what no effect of the catalogue explains."""
    given = log.metadata.noise
    return [given.get(channel[:3]) or float(np.sqrt(v)) for channel, v in zip(CHANNELS, variance, strict=True)]
