"""Content of the studio without a page: logs, the stack of effects, its fits, and the way there.

Nothing here draws. Every number is that of the fit which `imufit add`, `imufit ladder` and `imufit diagnose` make.
Where a fit has yet to be made, the evidence of the first pass gives the numbers to first order, and they say so.
"""

from __future__ import annotations

import math
import threading
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.comparing import cause_names, cause_panels, cause_shares, comparison, panels
from imufit.comparing.two_models import ln_bayes_factor
from imufit.errors import InputError
from imufit.fitting.analysis import Analysis, pooled
from imufit.log import LogSource
from imufit.loop import Fit, SensorModel
from imufit.model.catalogue import each_log_has_its_own, find_effect
from imufit.progress import Progress, silent
from imufit.results import Comparison, Diagnosis, Parameter
from imufit.results.comparison import Panel
from imufit.results.parameter import FAR
from imufit.studio.names import estimating
from imufit.studio.stack import Action, Entry, Stack, Step
from imufit.studio.traces import ModelTraces, Traces

Array = NDArray[np.float64]

FULL: Final = 4
"""Fits that keep their evidence: the first, the present, the one before, and the second of two models. The evidence of
two minutes at 100 Hz takes some 20 MB."""


@dataclass(frozen=True)
class Numbers:
    """Error and parameters of a model.

    Attributes
    ----------
    ratio : float
        Held-out residual RMS over the noise floor; NaN before anything is known.
    parameters : tuple of Parameter
        Of every effect of the model.
    fitted : bool
        True if they are those of a fit, False if the evidence gives them to first order.
    """

    ratio: float
    parameters: tuple[Parameter, ...]
    fitted: bool


@dataclass(eq=False)
class Made:
    """A model that was fitted, and what was asked of it.

    Attributes
    ----------
    fit : Fit
        The fit, with or without its evidence.
    way : tuple of Stack
        Models from the ideal sensor to this one, each fitted from the one before.
    diagnosis : Diagnosis or None
        The effects that it lacks.
    comparison : Comparison or None
        Its residuals.
    shares : dict or None
        Part of the excess of each failing channel that each cause without a name explains, by channel and cause.
    """

    fit: Fit
    way: tuple[Stack, ...]
    numbers: Numbers = field(init=False)
    diagnosis: Diagnosis | None = None
    comparison: Comparison | None = None
    shares: dict[str, dict[str, float]] | None = None

    def __post_init__(self) -> None:
        """Keep the numbers of the fit."""
        self.numbers = Numbers(self.fit.ratio, self.fit.parameters, True)


class Session:
    """A model on its way, on one log or on several of one sensor.

    Parameters
    ----------
    logs : sequence of LogSource
        Logs with a reference, or with rests that stand in for one.

    Attributes
    ----------
    logs : tuple of LogSource
        The logs.
    steps : list of Step
        The way so far, with the steps that were undone at its end.
    position : int
        Number of the present step.
    second : Stack or None
        The other of two models side by side.
    refusal : InputError or None
        Why the logs cannot be judged: their rows are drawn, and nothing can be fitted.
    """

    def __init__(self, logs: Sequence[LogSource]) -> None:
        self.logs = tuple(logs)
        self.steps = [Step(Action.START, "", Stack())]
        self.position = 0
        self.second: Stack | None = None
        self.refusal: InputError | None = None
        self._made: dict[Stack, Made] = {}
        self._full: OrderedDict[Stack, None] = OrderedDict()
        self._weighed: dict[tuple[Stack, Stack], float] = {}
        self._quick: dict[Stack, tuple[Numbers, Array]] = {}
        self._work = threading.RLock()
        self._start: Fit | None = None

    # --- the evidence

    def begin(self, progress: Progress = silent) -> None:
        """Take the evidence of the logs: the one pass that everything else rests on.

        Parameters
        ----------
        progress : callable
            Called with (rows done, rows in all, what is being done).

        Raises
        ------
        InputError
            The logs have no usable reference and no rests.
        """
        with self._work:
            self._start = SensorModel().fit(self.logs, progress=progress)
            self._made[Stack()] = Made(self._start, (Stack(),))

    @property
    def begun(self) -> bool:
        """Whether the evidence is there."""
        return self._start is not None

    @property
    def refused(self) -> bool:
        """Whether the logs cannot be judged."""
        return self.refusal is not None

    @property
    def start(self) -> Fit:
        """The ideal sensor, with the evidence of every candidate."""
        if self._start is None:
            raise InputError("the evidence of the log is not there yet", remedy="Wait until the log is read.")
        return self._start

    # --- the way

    @property
    def step(self) -> Step:
        """The present step."""
        return self.steps[self.position]

    @property
    def stack(self) -> Stack:
        """The present stack."""
        return self.step.stack

    @property
    def can_undo(self) -> bool:
        """Whether a step was made."""
        return self.position > 0

    @property
    def can_redo(self) -> bool:
        """Whether a step was undone."""
        return self.position + 1 < len(self.steps)

    def undo(self) -> None:
        """Return to the step before."""
        self.position = max(0, self.position - 1)

    def redo(self) -> None:
        """Make the step that was undone last."""
        self.position = min(len(self.steps) - 1, self.position + 1)

    def give_up(self) -> None:
        """Return to the step before one whose model cannot be fitted, and forget that step."""
        if self.can_undo:
            del self.steps[self.position :]
            self.position -= 1

    def add(self, effect: str) -> None:
        """Add an effect.

        Parameters
        ----------
        effect : str
            Its id.

        Raises
        ------
        InputError
            The effect is unknown, in the model already, or cannot be tested on these logs.
        """
        find_effect(effect)
        if effect in self.stack.model.effects:
            raise InputError(f"effect {effect} is in the model already", remedy="Nothing needs to be added.")
        analysis = self.start.analysis
        if effect not in analysis.slots:
            reason = analysis.refusal(find_effect(effect)) or "the log does not show it"
            raise InputError(f"effect {effect} cannot be added: {reason}", file=self.logs[0].path)
        made = self.made()
        found = None if made is None or made.diagnosis is None else made.diagnosis.candidates
        expected = next((item.held_out_after for item in found or () if item.effect == effect), None)
        self._go(Action.ADD, effect, self.stack.with_effect(effect), expected)

    def remove(self, effect: str) -> None:
        """Take an effect out of the stack.

        Parameters
        ----------
        effect : str
            Its id.
        """
        self._go(Action.REMOVE, effect, self.stack.without_effect(effect))

    def switch(self, effect: str, on: bool) -> None:
        """Switch an effect on or off; it stays in the stack.

        Parameters
        ----------
        effect : str
            Its id.
        on : bool
            Whether the model has it.
        """
        if self.stack.entry(effect).on != on:
            self._go(Action.ON if on else Action.OFF, effect, self.stack.switched(effect, on))

    def hold(self, effect: str, name: str, value: float) -> None:
        """Fix a parameter at a value.

        Parameters
        ----------
        effect, name : str
            The parameter.
        value : float
            SI unit.

        Raises
        ------
        InputError
            The parameter is unknown, or cannot have this value.
        """
        SensorModel([effect]).adjust(effect, name, value=value, vary=False)
        held = dict(self.stack.entry(effect).held) | {name: float(value)}
        self._go(Action.HOLD, effect, self.stack.held(effect, held), parameter=name)

    def free(self, effect: str, name: str) -> None:
        """Let fits choose a parameter that was fixed.

        Parameters
        ----------
        effect, name : str
            The parameter.
        """
        held = {key: value for key, value in self.stack.entry(effect).held if key != name}
        self._go(Action.FREE, effect, self.stack.held(effect, held), parameter=name)

    def go(self, steps: Sequence[Step], position: int) -> None:
        """Take over a way that was kept.

        Parameters
        ----------
        steps : sequence of Step
            The way, from the ideal sensor on.
        position : int
            Number of the present step.
        """
        self.steps, self.position = list(steps), position

    def _go(
        self, action: Action, effect: str, stack: Stack, expected: float | None = None, parameter: str = ""
    ) -> None:
        del self.steps[self.position + 1 :]
        self.steps.append(Step(action, effect, stack, expected, parameter))
        self.position += 1

    # --- answers

    def made(self, stack: Stack | None = None) -> Made | None:
        """Return the fit of a stack (default: the present one) and what was asked of it; None before it is made.

        Parameters
        ----------
        stack : Stack, optional
            The stack.
        """
        return self._made.get((self.stack if stack is None else stack).model)

    def as_likely(self) -> dict[str, tuple[str, ...]]:
        """Return the effects that explained the logs as well when an effect of the present model was added.

        Returns
        -------
        dict
            Their ids by the id of the effect that was added; without those that the model has besides.
        """
        effects = self.stack.model.effects
        found: dict[str, tuple[str, ...]] = {}
        for before, step in pairwise(self.steps[: self.position + 1]):
            made = self.made(before.stack)
            if step.action is not Action.ADD or step.effect not in effects or made is None or made.diagnosis is None:
                continue
            item = next((item for item in made.diagnosis.candidates if item.effect == step.effect), None)
            others = () if item is None else made.diagnosis.sharing(item)
            if left := tuple(name for name in others if name not in effects):
                found[step.effect] = left
        return found

    def numbers(self, stack: Stack | None = None) -> Numbers | None:
        """Return error and parameters of a stack at once, without a pass over the logs.

        Parameters
        ----------
        stack : Stack, optional
            The stack; default the present one.

        Returns
        -------
        Numbers or None
            Those of the fit if it was made; else to first order from the evidence of the first pass; None where this
            does not give them: a parameter stays at a value, or an effect is not linear in its parameters.
        """
        model = (self.stack if stack is None else stack).model
        made = self._made.get(model)
        if made is not None:
            return made.numbers
        if model not in self._quick:
            if self.needs_pass(model):
                return None
            self._quick[model] = self._first_order(model)
        return self._quick[model][0]

    def held_apart(self) -> bool:
        """Return whether a parameter of the present model stays at another value than the log gave before."""
        return any(
            not self._held_as_estimated(entry.effect, name, value)
            for entry in self.stack.model.entries
            for name, value in entry.held
        )

    def _held_as_estimated(self, effect: str, name: str, value: float) -> bool:
        """Return whether a value is that of the last model in which it was estimated, within its standard error."""
        for step in self.steps[self.position :: -1]:
            made = self.made(step.stack)
            for item in () if made is None else made.numbers.parameters:
                if (item.effect, item.name, item.fixed) == (effect, name, False):
                    return abs(item.value - value) <= FAR * item.standard_error
        return False

    def latest_parameters(self, entry: Entry) -> tuple[Parameter, ...]:
        """Return the parameters of an effect of the present stack, at once.

        Parameters
        ----------
        entry : Entry
            The effect.

        Returns
        -------
        tuple of Parameter
            Those of `numbers`. Where these take a pass, they are those of the last model that has them, with the values
            that are fixed now; empty where none has them.
        """
        for step in self.steps[self.position :: -1]:
            numbers = self.numbers(step.stack)
            own = () if numbers is None else tuple(item for item in numbers.parameters if item.effect == entry.effect)
            if own and step.stack.model == self.stack.model:
                return own
            if own:
                held = dict(entry.held)
                return tuple(
                    replace(item, value=held.get(item.name, item.value), fixed=item.name in held) for item in own
                )
        return ()

    def panels_at_once(self) -> list[Panel]:
        """Return the residuals of the present stack to first order, without a pass; empty where a pass is needed."""
        model = self.stack.model
        if not self.has_reference or self.numbers() is None or model not in self._quick:
            return []
        return panels(self.start.analysis, self._quick[model][1], self.shown)

    def needs_pass(self, stack: Stack) -> bool:
        """Return whether only a pass over the logs gives the numbers of a stack that was not fitted.

        Parameters
        ----------
        stack : Stack
            The stack.
        """
        model = stack.model
        slots = self.start.analysis.slots
        return model.holds or any(
            effect not in slots or find_effect(effect).nonlinear or find_effect(effect).jumps
            for effect in model.effects
        )

    def _first_order(self, model: Stack) -> tuple[Numbers, Array]:
        """Solve for some effects in the evidence around the ideal sensor: numbers, and the step of all parameters."""
        analysis = self.start.analysis
        slots = [analysis.slots.index(effect) for effect in model.effects]
        solved = analysis.problem.estimate([*analysis.fitted_slots, *slots])
        errors = np.sqrt(np.maximum(np.diag(solved["covariance"]), 0.0))
        parameters: list[Parameter] = []
        at = len(solved["step"]) - sum(self._count(effect, analysis) for effect in model.effects)
        for key in model.effects:
            effect, count = find_effect(key), self._count(key, analysis)
            # Logs that have their own values follow one another.
            shape = (-1, len(effect.parameters))
            part = slice(at, at + count)
            values, spread = pooled(solved["step"][part].reshape(shape), errors[part].reshape(shape))
            parameters += [
                Parameter(key, name, float(value), float(error), unit, typical)
                for (name, unit, typical), value, error in zip(effect.parameters, values, spread, strict=True)
            ]
            at += count
        return Numbers(float(solved["held_out"]), tuple(parameters), False), solved["full_step"]

    @staticmethod
    def _count(effect: str, analysis: Analysis) -> int:
        """Return the number of parameters that an effect has in the evidence of all logs."""
        logs = len(analysis.having(effect)) if each_log_has_its_own(effect) else 1
        return logs * len(find_effect(effect).parameters)

    # --- work that takes passes: from a thread

    def fit(self, stack: Stack | None = None, progress: Progress = silent) -> Made:
        """Fit a stack (default: the present one), from the nearest one that was fitted.

        Parameters
        ----------
        stack : Stack, optional
            The stack.
        progress : callable
            Called with (rows done, rows in all, what is being done).

        Raises
        ------
        InputError
            An effect cannot be tested on these logs.
        """
        target = (self.stack if stack is None else stack).model
        with self._work:
            if target not in self._made:
                self._keep(target, self._moved(self._nearest(target), target, progress))
            return self._made[target]

    def diagnose(self, stack: Stack | None = None, progress: Progress = silent) -> Diagnosis:
        """Say what is missing from a stack (default: the present one).

        Parameters
        ----------
        stack : Stack, optional
            The stack.
        progress : callable
            Called with (rows done, rows in all, what is being done).
        """
        with self._work:
            made = self.fit(stack, progress)
            if made.diagnosis is None:
                made.diagnosis = self._with_evidence(made).diagnose(progress=progress)
            return made.diagnosis

    def compare(self, stack: Stack | None = None, progress: Progress = silent) -> Comparison:
        """Say where a stack (default: the present one) fails: in every row beside a reference, or else at the rests.

        Parameters
        ----------
        stack : Stack, optional
            The stack.
        progress : callable
            Called with (rows done, rows in all, what is being done).
        """
        with self._work:
            made = self.fit(stack, progress)
            if made.comparison is None:
                fit = self._with_evidence(made)
                made.comparison = comparison(fit.analysis, fit.estimate.step, self.shown)
            return made.comparison

    def weigh_causes(self, stack: Stack | None = None, progress: Progress = silent) -> dict[str, dict[str, float]]:
        """Say how much of the excess of each failing channel each cause without a name explains.

        Parameters
        ----------
        stack : Stack, optional
            The stack; default the present one.
        progress : callable
            Called with (rows done, rows in all, what is being done).

        Returns
        -------
        dict
            Fraction of the excess variance by channel and cause; rests show no causes.
        """
        with self._work:
            made = self.fit(stack, progress)
            found = self.compare(stack, progress)
            if made.shares is None:
                failing = list(found.failing)
                fit = self._with_evidence(made)
                made.shares = cause_shares(fit.analysis, fit.estimate.step, self.shown, failing) if failing else {}
            return made.shares

    def channel_of(self, parameter: Parameter) -> str | None:
        """Return the channel whose residual a predicted value of a candidate changes most, in its noise floors.

        Parameters
        ----------
        parameter : Parameter
            One of a candidate's predicted ones.

        Returns
        -------
        str or None
            None where the evidence around the present model is not at hand, or has no such candidate.
        """
        fit = self._at_hand(self.stack)
        if fit is None or parameter.effect not in fit.analysis.candidates:
            return None
        analysis, effect = fit.analysis, find_effect(parameter.effect)
        problem = analysis.problem
        own, step = problem.step_beside(analysis.fitted_slots, analysis.slots.index(parameter.effect))
        names = [name for name, _, _ in effect.parameters]
        # Logs that have their own values follow one another.
        chosen = own[names.index(parameter.name) :: len(names)]
        without = step.copy()
        without[chosen] = fit.estimate.step[chosen]
        before, after = problem.mean_squares(without, self.shown), problem.mean_squares(step, self.shown)
        evidence = analysis.logs[self.shown]
        floors = dict(zip(evidence.passes.channels, evidence.floors, strict=True))
        return max(before, key=lambda name: (before[name] - after[name]) / floors[name] ** 2, default=None)

    def weighed(self) -> float | None:
        """Return the ln Bayes factor for the present model over the second one; None before it is worked out."""
        return None if self.second is None else self._weighed.get((self.second.model, self.stack.model))

    def weigh(self, progress: Progress = silent) -> float | None:
        """Work out the ln Bayes factor for the present model over the second one; None without a second one.

        Parameters
        ----------
        progress : callable
            Called with (rows done, rows in all, what is being done).
        """
        with self._work:
            if self.second is None:
                return None
            first, second = (self.fit(stack, progress) for stack in (self.second, self.stack))
            key = (first.way[-1], second.way[-1])
            # The second one's evidence first: the present model's is needed again, and stays.
            self._weighed[key] = ln_bayes_factor(self._with_evidence(first), self._with_evidence(second))
            return self._weighed[key]

    @property
    def has_reference(self) -> bool:
        """Whether every row is judged by a reference, so that residuals can be drawn.

        Before the fit the columns decide.
        """
        if self._start is None:
            return all("ref_qw" in log.columns or "ref_angle" in log.columns for log in self.logs)
        return self.start.analysis.judged_by == "reference"

    @property
    def rests(self) -> Array:
        """Times at which each rest begins and ends that stands in for the reference, (rests, 2), s; often none."""
        return self.start.analysis.logs[self.shown].rests if self.begun else np.zeros((0, 2))

    @property
    def shown(self) -> int:
        """Number of the log that is drawn: the one that stands highest at the start; the first before the evidence."""
        return self.start.worst if self.begun else 0

    def model_traces(self, traces: Traces, stack: Stack) -> ModelTraces:
        """Return residual and predicted readings of a stack over time, after a pass over the rows.

        Parameters
        ----------
        traces : Traces
            The log that is drawn.
        stack : Stack
            The stack.

        Raises
        ------
        InputError
            The log has no reference attitude.
        """
        with self._work:
            fit = self._with_evidence(self.fit(stack))
            step = fit.analysis.own_step(self.shown, fit.estimate.step)
            found = ModelTraces(traces, fit.analysis.logs[self.shown], step)
        found.build()
        return found

    def explained(self, effect: str) -> list[Panel]:
        """Return the residuals that adding an effect to the present model would leave, to first order; no pass.

        Parameters
        ----------
        effect : str
            Its id.

        Returns
        -------
        list of Panel
            Empty where the evidence around the present model is not at hand, or has no such candidate.
        """
        fit = self._at_hand(self.stack)
        if fit is None:
            return []
        analysis = fit.analysis
        if effect not in analysis.candidates:
            return []
        solved = analysis.problem.estimate([*analysis.fitted_slots, analysis.slots.index(effect)])
        return panels(analysis, solved["full_step"], self.shown)

    def causes(self, channel: str) -> tuple[str, ...]:
        """Return the causes without a name that a finding on a channel can name; empty without the evidence.

        Parameters
        ----------
        channel : str
            For instance ``acc_x``.
        """
        fit = self._at_hand(self.stack)
        return () if fit is None else cause_names(fit.analysis, self.shown, channel)

    def against_cause(self, channel: str, cause: str, effect: str = "") -> tuple[Panel | None, ...]:
        """Return the residual against the part of it that a cause without a name explains; takes a pass: from a thread.

        Parameters
        ----------
        channel : str
            For instance ``acc_x``.
        cause : str
            One of `causes`.
        effect : str
            Id of an effect that could be added.

        Returns
        -------
        tuple of Panel or None
            With the present model, with `effect` besides to first order, and with the second of two models.
        """
        fit = self._at_hand(self.stack)
        if fit is None or cause not in cause_names(fit.analysis, self.shown, channel):
            return None, None, None
        analysis = fit.analysis
        others: dict[int, tuple[Analysis, Array]] = {}
        if effect in analysis.candidates:
            solved = analysis.problem.estimate([*analysis.fitted_slots, analysis.slots.index(effect)])
            others[1] = analysis, solved["full_step"]
        second = None if self.second is None else self._at_hand(self.second)
        if second is not None:
            others[2] = second.analysis, second.estimate.step
        found = cause_panels(analysis, fit.estimate.step, self.shown, channel, cause, list(others.values()))
        by_place = dict(zip(others, found[1:], strict=True))
        return found[0], by_place.get(1), by_place.get(2)

    def _at_hand(self, stack: Stack) -> Fit | None:
        """Return the fit of a stack if it was made and has its evidence."""
        made = self.made(stack)
        # A fit does not change; the thread at work may only put another one in its place.
        fit = None if made is None else made.fit
        return fit if fit is not None and fit.has_evidence else None

    def _nearest(self, target: Stack) -> Made:
        """Return the fit of the last step before a stack that was made."""
        models = [step.stack.model for step in self.steps[: self.position + 1]]
        at = models.index(target) if target in models else self.position
        for step in self.steps[at::-1]:
            if (found := self._made.get(step.stack.model)) is not None:
                return found
        return self._made[Stack()]

    def _moved(self, base: Made, target: Stack, progress: Progress) -> Made:
        fit = self._with_evidence(base)
        progress(0, 1, estimating(target.effects))
        return Made(moved(fit, target), (*base.way, target))

    def _with_evidence(self, made: Made) -> Fit:
        """Return a fit whose evidence is at hand, and note that it was used last."""
        made.fit.analysis  # noqa: B018  takes the evidence again if it was laid down
        model = made.way[-1]
        if model != Stack():
            self._full[model] = None
            self._full.move_to_end(model)
            while len(self._full) > FULL - 1:
                old = self._made[self._full.popitem(last=False)[0]]
                old.fit = old.fit.without_evidence()
        return made.fit

    def _keep(self, model: Stack, made: Made) -> None:
        self._made[model] = made
        self._with_evidence(made)


def moved(fit: Fit, target: Stack) -> Fit:
    """Fit a stack, from another one that was fitted to the same logs.

    Parameters
    ----------
    fit : Fit
        Where to start.
    target : Stack
        The stack; all of it is switched on.
    """
    present = fit.model.effects
    new = [effect for effect in target.effects if effect not in present]
    gone = [effect for effect in present if effect not in target.effects]
    if len(new) == 1 and not gone and not target.holds and not fit.model.limits:
        # The same call as `imufit add`: to the last digit the same numbers.
        added: Fit = fit.add(new[0]).fit
        return added
    model = fit.model.copy()
    for effect in gone:
        model = model.without_effect(effect)
    for effect in new:
        model = model.with_effect(effect)
    for entry in target.entries:
        held = dict(entry.held)
        for name in model.parameters[entry.effect]:
            fixed = model.limits.get(entry.effect, {}).get(name)
            if name in held:
                model.adjust(entry.effect, name, value=held[name], vary=False)
            elif fixed is not None and fixed.fixed:
                model.adjust(entry.effect, name, vary=True)
    return fit.moved(model)


def worst_channel(found: Comparison, sensors: Sequence[str] = ("acc", "gyr", "mag")) -> str | None:
    """Return the channel that stands highest above its noise floor.

    Parameters
    ----------
    found : Comparison
        The residuals.
    sensors : sequence of str, optional
        Only channels of these sensors.
    """
    known = [item for item in found.channels if math.isfinite(item.ratio) and item.channel[:3] in sensors]
    return max(known, key=lambda item: item.ratio).channel if known else None
