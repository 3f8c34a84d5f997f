"""Evidence of one log, or of several of one sensor, around one model: what every question is asked of."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.errors import InputError
from imufit.fitting.log_evidence import LogEvidence, Values, evidence_again, trial
from imufit.fitting.profile import Found, search
from imufit.fitting.rest_passes import RestPasses
from imufit.fitting.surveyed_log import SurveyedLog, survey
from imufit.fitting.users_effects import check_users_effects
from imufit.log import LogSource
from imufit.log.several import name_of
from imufit.model.catalogue import each_log_has_its_own, effects, find_effect, unnamed_effects
from imufit.model.effect import registered
from imufit.model.effect_stack import EffectStack
from imufit.progress import Progress, silent
from imufit.results import DataFault

Array = NDArray[np.float64]

MAX_ITERATIONS = 6
MAX_HALVINGS = 6
"""Shares of a step that are tried: if a thirty-second raises the misfit, the fit stays where it is."""
RISE = 0.02
"""Part of the misfit by which it may rise: samples that are left out move it by up to 0.6 % on real recordings, a step
beyond what columns at one point say moves it by many times itself."""
MAX_SEARCHES = 3


@dataclass(frozen=True, eq=False)
class Estimate:
    """Fitted parameters of some slots.

    Attributes
    ----------
    values, errors : dict of int to ndarray
        By slot: parameter values and standard errors, SI units; of an effect that each log has for itself those of
        one log after the other. The error of a fixed parameter is 0, that of one at its bound not a number.
    covariance : ndarray
        (k, k) covariance of these parameters, slot after slot, with the errors' squares in its diagonal.
    step : ndarray
        (p,) step of every parameter of the evidence.
    held_out, training : float
        Residual RMS over noise floor on data not used for the fit, and on all data.
    samples : float
        Number of samples of all channels that both are of.
    folds : ndarray
        (folds,) whitened sum of squares on data not used for the fit, of each part of the log that was left out.
    misfit : float
        Whitened square per sample at the values that the evidence was taken around, and their square in prior
        deviations: the estimate makes it least.
    """

    values: dict[int, Array]
    errors: dict[int, Array]
    covariance: Array
    step: Array
    held_out: float
    training: float
    samples: float
    folds: Array
    misfit: float


@dataclass(frozen=True, eq=False)
class Analysis:
    """Evidence of one log or of several with the columns of every effect, taken around given parameter values.

    Slots are effects in a fixed order: those of the model, the unnamed ones that are always fitted, the candidates.

    Attributes
    ----------
    logs : tuple of LogEvidence
        Evidence of each log.
    model : EffectStack
        The effects and the parameters that all logs share.
    own : tuple of dict
        For each log the parameters that it has for itself, the unnamed effects among them.
    unnamed : tuple of str
        Effects that are always fitted along.
    candidates : dict of str to Effect
        Further effects that at least one log can show.
    probes : tuple of str
        Dependences without a name that are asked about once nothing else explains more.
    found : dict of str to Found
        What searches found for the candidates.
    problem : Problem
        All logs together.
    """

    logs: tuple[LogEvidence, ...]
    model: EffectStack
    own: tuple[dict[str, list[float]], ...]
    unnamed: tuple[str, ...]
    candidates: dict[str, _imufit.Effect]
    probes: tuple[str, ...]
    found: dict[str, Found]
    problem: _imufit.Problem

    @classmethod
    def of(
        cls, model: EffectStack, logs: Sequence[LogSource], progress: Progress, *, keep_constants: bool = False
    ) -> Analysis:
        """Survey logs of one sensor, find their noise and take their evidence around a model.

        Parameters
        ----------
        model : EffectStack
            Effects and parameters to take the evidence around.
        logs : sequence of LogSource
            The logs.
        progress : callable
            Called with the rows done.
        keep_constants : bool
            Temperatures and covariates count from the means that the model was fitted with, not from these logs'.
        """
        # Its owner may set the model later on; the evidence belongs to it as it is now.
        model = model.of_a_fit()
        surveyed = survey(model, logs, progress, keep_constants=keep_constants)
        for effect, _ in model.stack():
            reasons = [each.refusal(effect) for each in surveyed]
            if None not in reasons:
                raise InputError(f"effect {effect.id} cannot be fitted: {reasons[0]}", file=surveyed[0].log.path)
        along = {key for each in surveyed for key, effect in each.effects.items() if effect.fitted_along(each.facts)}
        unnamed = tuple(key for key in (*effects(), *unnamed_effects()) if key in along - {*model.effects})
        fixed = {*model.effects, *unnamed}
        candidates = {key: each.effects[key] for each in surveyed for key in each.effects if key not in fixed}
        for each in surveyed:
            own_candidates = [key for key in each.effects if key not in fixed]
            check_users_effects(each.passes, each.facts, [*model.effects, *own_candidates])
        own = _with_own(surveyed, model, unnamed, tuple({} for _ in surveyed))
        model = _started(surveyed, model, own)
        fitted = [_fitted(each, model, unnamed, values) for each, values in zip(surveyed, own, strict=True)]
        found = search(surveyed, fitted, candidates)
        evidence = [LogEvidence.of(each, values, found) for each, values in zip(surveyed, fitted, strict=True)]
        probes = _probes(surveyed)
        problem = _problem(evidence, model, unnamed, [*candidates, *probes])
        return cls(tuple(evidence), model, own, unnamed, candidates, probes, found, problem)

    def around(
        self,
        model: EffectStack,
        own: Sequence[Values],
        *,
        with_candidates: bool = True,
        only: Collection[str] | None = None,
        lean: bool = False,
    ) -> Analysis:
        """Evidence of the same logs around other parameter values or another stack of effects.

        Without candidates, or with only some of them, it is quicker to take; lean, for the next iteration of a fit, it
        does not hold the residual itself either, only the whitened one.
        """
        surveyed = [each.surveyed for each in self.logs]
        fixed = {*model.effects, *self.unnamed}
        asked = {
            key: effect
            for each in surveyed
            for key, effect in each.effects.items()
            if key not in fixed and (only is None or key in only) and with_candidates and not lean
        }
        starts = {
            key: self.found[key].start for key in model.effects if key in self.found and key not in self.model.effects
        }
        model = model.starting_at(starts)
        values = _with_own(surveyed, model, self.unnamed, own)
        fitted = [_fitted(each, model, self.unnamed, at) for each, at in zip(surveyed, values, strict=True)]
        kept = {key: self.found[key] for key in model.effects if key in self.found}
        found = kept | search(surveyed, fitted, asked)
        probes = () if lean else _probes(surveyed, noise_only=not with_candidates or only is not None)
        columns = [*asked, *probes]
        evidence = [each.around(at, columns, found, lean=lean) for each, at in zip(self.logs, fitted, strict=True)]
        return replace(
            self,
            logs=tuple(evidence),
            model=model,
            own=values,
            candidates=asked,
            probes=probes,
            found=found,
            problem=_problem(evidence, model, self.unnamed, columns),
        )

    def ln_likelihood(self, of: Analysis, estimate: Estimate, open_to: Sequence[int] = ()) -> float:
        """Log of the marginal likelihood of the logs under another stack, with the noise that its own residual has.

        A stack changes the noise, too: what smooths the ideal reading smooths the noise of the reference.

        Parameters
        ----------
        of : Analysis
            The other stack; its rows are counted as those of this one, since a stack may lack some at the ends.
        estimate : Estimate
            Its best parameters.
        open_to : sequence of int, optional
            Slots of the other stack's candidates that may be there besides or not, one as likely as the other.
        """
        logs = [each.with_noise_after(of.own_step(k, estimate.step)) for k, each in enumerate(of.logs)]
        problem = _problem(logs, of.model, of.unnamed, [*of.candidates, *of.probes])
        size = sum(
            own.ln_noise(each.counts) - own.ln_smoothing(each.counts) for own, each in zip(logs, self.logs, strict=True)
        )
        square = 0.5 * sum(sum(each.counts) for each in logs)
        members = len(of.model.effects)
        along = of.fitted_slots[members:]
        return size + square + problem.ln_evidence(along, of.fitted_slots[:members], list(open_to))

    def freed(self) -> Analysis:
        """Return the same evidence of a model in which nothing is fixed or bounded."""
        model = type(self.model)(self.model.effects, self.model.parameters, constants=self.model.constants).of_a_fit()
        problem = _problem(self.logs, model, self.unnamed, [*self.candidates, *self.probes])
        return replace(self, model=model, problem=problem)

    def of_logs(self, chosen: Sequence[int]) -> Analysis:
        """Return the same evidence of some of the logs alone; effects that none of them can show are left out."""
        logs = [self.logs[k] for k in chosen]
        known = {key for each in logs for key in each.slots}
        effects = [key for key in self.model.effects if key in known]
        values = {key: at for key, at in self.model.parameters.items() if key in known}
        model = type(self.model)(effects, values, constants=self.model.constants, limits=self.model.limits).of_a_fit()
        unnamed = tuple(key for key in self.unnamed if key in known)
        candidates = {key: effect for key, effect in self.candidates.items() if key in known}
        own = tuple(self.own[k] for k in chosen)
        probes = tuple(key for key in self.probes if key in known)
        problem = _problem(logs, model, unnamed, [*candidates, *probes])
        return Analysis(tuple(logs), model, own, unnamed, candidates, probes, self.found, problem)

    @property
    def slots(self) -> list[str]:
        """Ids of all slots: the model's effects, the unnamed ones, the candidates, the probes."""
        return [*self.model.effects, *self.unnamed, *self.candidates, *self.probes]

    @property
    def fitted_slots(self) -> list[int]:
        """Slots that are fitted: the model's effects and the unnamed ones."""
        return list(range(len(self.model.effects) + len(self.unnamed)))

    @property
    def candidate_slots(self) -> list[int]:
        """Slots of the candidates."""
        first = len(self.fitted_slots)
        return list(range(first, first + len(self.candidates)))

    @property
    def probe_slots(self) -> list[int]:
        """Slots of the probes."""
        return list(range(len(self.slots) - len(self.probes), len(self.slots)))

    @property
    def judged_by(self) -> str:
        """The evidence of the logs: ``reference``, ``rests``, or ``reference and rests``."""
        kinds = {"rests" if isinstance(each.passes, RestPasses) else "reference" for each in self.logs}
        return " and ".join(sorted(kinds))

    @property
    def faults(self) -> tuple[DataFault, ...]:
        """Faults of the data of the logs; of several logs each fault names its log."""
        if len(self.logs) == 1:
            return self.logs[0].faults
        names = [name_of(each.surveyed.log, k) for k, each in enumerate(self.logs)]
        return tuple(
            replace(fault, file=name) for name, each in zip(names, self.logs, strict=True) for fault in each.faults
        )

    def refusal(self, effect: _imufit.Effect) -> str | None:
        """Return why no log can show an effect; None if one can."""
        reasons = [each.surveyed.refusal(effect) for each in self.logs]
        return None if None in reasons else reasons[0]

    def having(self, effect_id: str) -> list[int]:
        """Return the logs with parameters of an effect for themselves; the first stands for all where it is shared."""
        known = [k for k, each in enumerate(self.logs) if effect_id in each.slots]
        return known if each_log_has_its_own(effect_id) else known[:1]

    def estimate(self, beside: Sequence[int] = ()) -> Estimate:
        """Fit the model's effects (and the unnamed ones) to the evidence, and candidates of some slots beside them."""
        return self._estimate([*self.fitted_slots, *beside])

    def estimate_unnamed(self) -> Estimate:
        """Keep the model as it is and fit only what is always fitted along."""
        return self._estimate(self.fitted_slots[len(self.model.effects) :])

    def _present(self, slot: int) -> list[float]:
        """Values that the evidence was taken around, of one log after the other where each has its own."""
        key = self.slots[slot]
        if slot not in self.fitted_slots:
            logs = len(self.having(key)) if each_log_has_its_own(key) else 1
            effect = find_effect(key)
            found = None if effect.tried_at_full_size else self.found.get(key)
            return trial(effect, found) * logs
        if each_log_has_its_own(key):
            return [value for log in self.having(key) for value in self.own[log][key]]
        return self.model.stack()[slot][1]

    @property
    def _held(self) -> list[int]:
        """Slots of effects that stay at what a search found: readings jump as they change, no slope leads there."""
        return [slot for slot, (effect, _) in enumerate(self.model.stack()) if effect.jumps]

    def _estimate(self, chosen: list[int]) -> Estimate:
        held = [slot for slot in chosen if slot in self._held]
        free = [slot for slot in chosen if slot not in held]
        result = self.problem.estimate(free)
        # A held parameter is not exact, and leaves the others as uncertain as a fitted one.
        along = self.problem.estimate(chosen) if held else result
        covariance = along["covariance"]
        errors = _by_slot(self, chosen, np.sqrt(np.maximum(np.diag(covariance), 0.0)))
        searched = {slot: self.found.get(self.slots[slot]) for slot in held}
        # A slope does not contain the jumps, which are most informative.
        spreads = {slot: np.array(found.spread) for slot, found in searched.items() if found}
        spreads = {slot: np.where(self._fixed(slot), 0.0, spread) for slot, spread in spreads.items()}
        errors |= spreads
        covariance = _with_errors(covariance, np.concatenate([errors[slot] for slot in chosen]) if chosen else None)
        steps = _by_slot(self, free, result["step"])
        values = {slot: np.asarray(self._present(slot)) for slot in chosen}
        values |= {slot: self._within_reach(slot, values[slot] + step) for slot, step in steps.items()}
        values = {slot: self._allowed(slot, at) for slot, at in values.items()}
        return Estimate(
            values,
            errors,
            covariance,
            result["full_step"],
            result["held_out"],
            result["training"],
            result["samples"],
            result["folds"],
            result["misfit"],
        )

    def _fixed(self, slot: int) -> NDArray[np.bool_]:
        """Return which parameters of a slot are fixed."""
        if slot >= len(self.model.effects):
            return np.zeros(len(self._present(slot)), bool)
        fixed = [limits.fixed for limits in self.model.limits_of(self.slots[slot])]
        return np.resize(np.array(fixed, dtype=bool), len(self._present(slot)))

    def _allowed(self, slot: int, values: Array) -> Array:
        """Return values of a slot as the model's limits allow them: a step to a bound ends on it to the last digit."""
        if slot >= len(self.model.effects):
            return values
        count = len(self.model.limits_of(self.slots[slot]))
        each = [self.model.allowed(self.slots[slot], at.tolist()) for at in values.reshape(-1, count)]
        return np.array(each, dtype=np.float64).ravel()

    def _within_reach(self, slot: int, values: Array) -> Array:
        """Keep what a search started (a time constant) within half and twice its present value in one step."""
        if slot >= len(self.model.effects):
            return values
        effect, present = self.model.stack()[slot]
        for k, (name, _, _) in enumerate(effect.parameters):
            if name in effect.searched and name not in effect.only_searched:
                low, high = sorted((0.5 * present[k], 2.0 * present[k]))
                values[k] = min(max(values[k], low), high)
                if effect.limits:
                    values[k] = min(max(values[k], effect.limits[k][0]), effect.limits[k][1])
        return values

    def moved_to(self, estimate: Estimate) -> tuple[EffectStack, tuple[dict[str, list[float]], ...]]:
        """Return the model with estimated parameters, and those that each log has for itself.

        In the model, what each log has for itself stands with its mean.
        """
        parameters, errors = {}, {}
        keys, covariance = self.covariance_of(estimate)
        sizes = dict(zip(keys, np.sqrt(np.diag(covariance)), strict=True))
        own: tuple[dict[str, list[float]], ...] = tuple({} for _ in self.logs)
        for slot, key in enumerate(self.slots[: len(self.fitted_slots)]):
            effect = find_effect(key)
            own_values = effect.scope == "log"
            logs = self.having(key) if own_values else [0]
            values = estimate.values[slot].reshape(len(logs), -1)
            spread = estimate.errors[slot].reshape(len(logs), -1)
            if own_values:
                for log, at in zip(logs, values, strict=True):
                    own[log][key] = [float(value) for value in at]
            if slot >= len(self.model.effects):
                continue
            names = [name for name, _, _ in effect.parameters]
            mean = self.model.allowed(key, pooled(values, spread)[0].tolist())
            parameters[key] = dict(zip(names, mean, strict=True))
            errors[key] = {name: float(sizes[f"{key}.{name}"]) for name in names}
        facts = [each.facts for each in self.logs]
        means = {name: mean for each in reversed(facts) for name, mean in each.covariate_means.items()}
        constants = {
            "temperature_mean": next((each.temperature_mean for each in facts if each.has_temperature), None),
            "covariate_means": {
                name: mean
                for name, mean in means.items()
                if any(name in effect.centred_columns for effect, _ in self.model.stack())
            },
        }
        kept = {key: value for key, value in constants.items() if value is not None and value != {}}
        model = type(self.model)(
            self.model.effects, parameters, constants=kept, standard_errors=errors, limits=self.model.limits
        )
        return model.of_a_fit(), own

    def covariance_of(self, estimate: Estimate) -> tuple[list[str], Array]:
        """Return the covariance of all parameters of the model, and their names ``EFFECT.PARAM`` in its order.

        A log's own parameters stand with their mean over the logs. Rows of parameters that are fixed or only
        searched for are zero, those of parameters at their bounds are not numbers.
        """
        keys: list[str] = []
        ends = np.cumsum([0, *(len(values) for values in estimate.values.values())])
        first = dict(zip(estimate.values, map(int, ends[:-1]), strict=True))
        rows: list[Array] = []
        unknown: list[bool] = []
        zero: list[bool] = []
        for slot, key in enumerate(self.model.effects):
            effect = find_effect(key)
            names = [name for name, _, _ in effect.parameters]
            keys += [f"{key}.{name}" for name in names]
            errors = estimate.errors[slot].reshape(-1, len(names))
            shares = _shares(errors)
            unknown += [bool(np.isnan(errors[:, k]).all()) for k in range(len(names))]
            zero += [name in effect.only_searched for name in names]
            for k in range(len(names)):
                row = np.zeros(ends[-1])
                row[first[slot] + k : first[slot] + errors.size : len(names)] = shares[:, k]
                rows.append(row)
        means = np.array(rows).reshape(len(keys), int(ends[-1]))
        covariance = means @ np.nan_to_num(estimate.covariance) @ means.T
        covariance[zero, :] = 0.0
        covariance[:, zero] = 0.0
        covariance[unknown, :] = np.nan
        covariance[:, unknown] = np.nan
        return keys, covariance

    def own_step(self, log: int, step: Array) -> Array:
        """Return a step of all parameters as one of the parameters of one log's evidence."""
        return step[self.problem.places(log)]

    def converged(self, estimate: Estimate) -> bool:
        """Return whether no parameter still moves by more than a tenth of its standard error."""
        return all(
            bool(
                np.all(
                    np.abs(estimate.values[slot] - self._present(slot)) <= 0.1 * np.nan_to_num(estimate.errors[slot])
                )
            )
            for slot in estimate.values
        )

    @property
    def linear(self) -> bool:
        """True if the reading is proportional to the fitted parameters, so that one solution is exact."""
        if self.fitted_slots and any(isinstance(each.passes, RestPasses) for each in self.logs):
            return False
        if any(limits.bounded for of in self.model.limits.values() for limits in of.values()):
            # Questions are asked where the parameters stand: at a bound, of what is left there.
            return False
        stages = {effect.stage for effect, _ in self.model.stack()}
        stages |= {find_effect(key).stage for key in self.unnamed} if "gain" in stages else set()
        return not any(effect.nonlinear for effect, _ in self.model.stack()) and not {"input", "gain"} <= stages

    def solved(self) -> tuple[Analysis, Estimate]:
        """Evidence around the best parameters, by Gauss and Newton's iteration where the effects are not linear."""
        best, estimate = self._iterated()
        return (best, estimate) if best is self else best._finished(estimate)

    def solved_for(
        self,
        model: EffectStack,
        own: Sequence[Values],
        *,
        with_candidates: bool = True,
        only: Collection[str] | None = None,
    ) -> tuple[Analysis, Estimate]:
        """Evidence around the best parameters of another stack of effects.

        Without candidates, or with only some of them, it is quicker to take, and enough to know how well that stack
        does.
        """
        best, estimate = self.around(model, own, lean=True)._iterated()
        return best._finished(estimate, with_candidates=with_candidates, only=only)

    def _finished(
        self, estimate: Estimate, *, with_candidates: bool = True, only: Collection[str] | None = None
    ) -> tuple[Analysis, Estimate]:
        """Evidence around an estimate, or around the present values if these fit better."""
        for values in (estimate, self._partway(estimate, 0.0)):
            best = self.around(*self.moved_to(values), with_candidates=with_candidates, only=only)
            found = best.estimate()
            if self._exact or not _worse(found, estimate):
                break
        return best, found

    def _iterated(self) -> tuple[Analysis, Estimate]:
        analysis, estimate = self._stepped()
        for _ in range(MAX_SEARCHES if analysis._held else 0):
            searched, moved = analysis._searched_again(estimate)
            if not moved:
                return searched, searched.estimate()
            analysis, estimate = searched._stepped()
        return analysis, estimate

    def _searched_again(self, estimate: Estimate) -> tuple[Analysis, bool]:
        """Search anew for what is held, beside what is fitted now; and whether it moves."""
        model, own = self.moved_to(estimate)
        surveyed = [each.surveyed for each in self.logs]
        found = dict(self.found)
        moved = {}
        for slot in self._held:
            effect, present = model.stack()[slot]
            fitted = [_fitted(each, model, self.unnamed, at) for each, at in zip(surveyed, own, strict=True)]
            others = [{key: at for key, at in values.items() if key != effect.id} for values in fitted]
            if self._fixed(slot).all():
                continue
            found |= search(surveyed, others, {effect.id: effect}, {effect.id: present})
            now = found[effect.id]
            if np.any(np.abs(np.subtract(now.start, present)) > 0.1 * np.array(now.spread)):
                moved[effect.id] = now.start
        searched = replace(self, found=found)
        if moved:
            searched = searched.around(model.starting_at(moved), own, lean=True)
        return searched, bool(moved)

    def _stepped(self) -> tuple[Analysis, Estimate]:
        analysis, estimate = self, self.estimate()
        for _ in range(MAX_ITERATIONS):
            if analysis.linear or analysis.converged(estimate):
                break
            analysis, estimate = analysis._lowered(estimate)
        return analysis, estimate

    def _lowered(self, estimate: Estimate) -> tuple[Analysis, Estimate]:
        """Evidence at the estimate, or at as much of the way there as lowers the misfit (Armijo's backtracking)."""
        for halvings in range(MAX_HALVINGS):
            there = self._partway(estimate, 0.5**halvings)
            moved = self.around(*self.moved_to(there), lean=True)
            found = moved.estimate()
            if self._exact or not _worse(found, estimate):
                return moved, found
        return self, self._partway(estimate, 0.0)

    @property
    def _exact(self) -> bool:
        """True if a step is right though the misfit rises: a linear model's, or one to a value that the user fixes."""
        return self.linear or bool(self.model.limits)

    def _partway(self, estimate: Estimate, share: float) -> Estimate:
        """Return an estimate with a share of its step."""
        if share == 1.0:
            return estimate
        present = {slot: np.asarray(self._present(slot)) for slot in estimate.values}
        steps = {slot: values - present[slot] for slot, values in estimate.values.items()}
        return replace(estimate, values={slot: present[slot] + share * step for slot, step in steps.items()})


def _worse(found: Estimate, before: Estimate) -> bool:
    """Return whether the misfit has risen from one evidence to the next, by more than other samples make of it."""
    return found.misfit > before.misfit * (1.0 + RISE)


@dataclass(frozen=True, eq=False)
class KeptAnalysis:
    """An analysis without its evidence, as it goes into a pickle: from the logs the same evidence is taken again.

    Attributes
    ----------
    together : tuple of LogSource
        Logs that were surveyed together.
    numbers : tuple of int
        Which of them the analysis is of.
    evidence : tuple of dict
        What is known of each of these without another pass, see `imufit.fitting.log_evidence.evidence_again`.
    model, own, unnamed, found
        As those of the analysis.
    candidates, probes : tuple of str
        Ids.
    users : tuple of Effect
        Effects of the user's among the candidates.
    """

    together: tuple[LogSource, ...]
    numbers: tuple[int, ...]
    evidence: tuple[dict[str, Any], ...]
    model: EffectStack
    own: tuple[dict[str, list[float]], ...]
    unnamed: tuple[str, ...]
    candidates: tuple[str, ...]
    probes: tuple[str, ...]
    found: dict[str, Found]
    users: tuple[_imufit.Effect, ...]

    @classmethod
    def of(cls, analysis: Analysis) -> KeptAnalysis:
        """Keep what is needed of an analysis.

        Parameters
        ----------
        analysis : Analysis
            The analysis.
        """
        places = [each.surveyed.place for each in analysis.logs]
        evidence = [
            {
                item.name: getattr(each, item.name)
                for item in fields(each)
                if item.name not in ("surveyed", "raw", "white")
            }
            | {"one": each.raw is each.white}
            for each in analysis.logs
        ]
        users = tuple(effect for key, effect in analysis.candidates.items() if key in registered())
        return cls(
            places[0][0],
            tuple(number for _, number in places),
            tuple(evidence),
            analysis.model,
            analysis.own,
            analysis.unnamed,
            tuple(analysis.candidates),
            analysis.probes,
            analysis.found,
            users,
        )

    def restored(self) -> Analysis:
        """Take the evidence of the logs again.

        Raises
        ------
        InputError
            The file of a log cannot be read any more.
        """
        surveyed = survey(self.model, self.together, silent, keep_constants=False)
        chosen = [surveyed[number] for number in self.numbers]
        logs = [
            evidence_again(each, _fitted(each, self.model, self.unnamed, own), like, self.found)
            for each, own, like in zip(chosen, self.own, self.evidence, strict=True)
        ]
        known = {key: effect for each in chosen for key, effect in each.effects.items()}
        candidates = {key: known[key] for key in self.candidates}
        problem = _problem(logs, self.model, self.unnamed, [*candidates, *self.probes])
        return Analysis(tuple(logs), self.model, self.own, self.unnamed, candidates, self.probes, self.found, problem)


def _by_slot(analysis: Analysis, slots: Sequence[int], parameters: Array) -> dict[int, Array]:
    """Cut numbers for the parameters of some slots, one slot after the other, into those of each."""
    counts = [len(analysis._present(slot)) for slot in slots]
    return dict(zip(slots, np.split(parameters, np.cumsum(counts)[:-1]), strict=True)) if slots else {}


def pooled(values: Array, errors: Array) -> tuple[Array, Array]:
    """Mean of values of several logs (logs, k), weighted by their errors, and its standard error."""
    if len(values) == 1:
        return values[0], errors[0]
    shares = _shares(errors)
    known = (np.isfinite(errors) & (errors > 0.0)).any(axis=0)
    square = (np.nan_to_num(shares * errors) ** 2).sum(axis=0)
    return (shares * values).sum(axis=0), np.where(known, np.sqrt(square), np.nan)


def _shares(errors: Array) -> Array:
    """Shares (logs, k) of the values of several logs in their mean, by their errors (logs, k)."""
    known = np.isfinite(errors) & (errors > 0.0)
    weights = np.where(known, 1.0 / np.where(known, errors, 1.0) ** 2, 0.0)
    weights = np.where(known.any(axis=0), weights, 1.0)
    return np.asarray(weights / weights.sum(axis=0))


def _with_own(
    logs: Sequence[SurveyedLog], model: EffectStack, unnamed: Sequence[str], known: Sequence[Values]
) -> tuple[dict[str, list[float]], ...]:
    """Values that each log has for itself: those known, else the model's, else zero."""
    starts = {key: values for key, values in model.parameters.items() if each_log_has_its_own(key)}
    out = []
    for each, values in zip(logs, known, strict=True):
        own = {key: list(starts[key].values()) for key in starts if each.refusal(find_effect(key)) is None}
        own |= {key: [0.0] * len(find_effect(key).parameters) for key in unnamed if key in each.effects}
        out.append(own | {key: list(values[key]) for key in own if key in values})
    return tuple(out)


def _fitted(each: SurveyedLog, model: EffectStack, unnamed: Sequence[str], own: Values) -> dict[str, list[float]]:
    """Effects that are fitted to one log, with their parameters."""
    named = {effect.id: own.get(effect.id, values) for effect, values in model.stack() if each.refusal(effect) is None}
    return named | {key: own[key] for key in unnamed if key in own}


def _probes(logs: Sequence[SurveyedLog], *, noise_only: bool = False) -> tuple[str, ...]:
    known = {key: effect for each in logs for key, effect in each.probes.items()}
    return tuple(key for key, effect in known.items() if effect.reference_part or not noise_only)


def _problem(
    logs: Sequence[LogEvidence], model: EffectStack, unnamed: Sequence[str], candidates: Collection[str]
) -> _imufit.Problem:
    slots = {key: slot for slot, key in enumerate([*model.effects, *unnamed, *candidates])}
    known = {key: effect for each in logs for key, effect in each.surveyed.columns.items()}
    known |= {effect.id: effect for effect, _ in model.stack()}
    return _imufit.Problem(
        [
            (each.white, each.raw, each.variance, each.loudness, each.floors, [slots[key] for key in each.slots])
            for each in logs
        ],
        [known[key].scope == "log" for key in slots],
        [
            (slots[key], k, None if limits.fixed else (limits.lower, limits.upper))
            for key in model.limits
            for k, limits in enumerate(model.limits_of(key))
            if limits.fixed or limits.bounded
        ],
    )


def _with_errors(covariance: Array, errors: Array | None) -> Array:
    """Return a covariance with other standard errors where they differ; what is searched for is beside the others."""
    if errors is None:
        return covariance
    known = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    other = (known != errors) & ~(np.isnan(known) & np.isnan(errors))
    out = covariance.copy()
    out[other, :] = 0.0
    out[:, other] = 0.0
    out[other, other] = errors[other] ** 2
    return out


def _started(logs: Sequence[SurveyedLog], model: EffectStack, own: Sequence[Values]) -> EffectStack:
    """Find where to start for effects of the model that need a search and have no values yet."""
    for effect, values in model.stack():
        if not any(values) and any(effect.search(each.facts) for each in logs):
            others = [
                {key: at for key, at in _fitted(each, model, list(at_own), at_own).items() if key != effect.id}
                for each, at_own in zip(logs, own, strict=True)
            ]
            found = search(logs, others, {effect.id: effect})
            model = model.starting_at({key: item.start for key, item in found.items()})
    return model.of_a_fit()
