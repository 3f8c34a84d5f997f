"""A log after its first pass: its facts, and the effects that it can show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from imufit import _imufit
from imufit.errors import InputError
from imufit.fitting.data_faults import data_faults
from imufit.fitting.passes import MIN_COVERAGE, Passes
from imufit.fitting.rest_passes import passes_of
from imufit.log import LogSource, judged_rows
from imufit.model.catalogue import column_effects, effects, unnamed_effects
from imufit.model.effect_stack import EffectStack
from imufit.progress import Progress
from imufit.results import DataFault


@dataclass(frozen=True, eq=False)
class SurveyedLog:
    """A log after its first pass.

    Attributes
    ----------
    passes : Passes
        Further passes over it.
    facts : Facts
        What is known of it as a whole.
    coverage : dict of str to float
        Share of the rows that each covariate is known in.
    effects : dict of str to Effect
        Effects that it can show, by id.
    refused : dict of str to str
        Reasons why it cannot show the others.
    probes : dict of str to Effect
        Dependences without a name that it can be asked about, see `rust/model/src/probes`.
    faults : tuple of DataFault
        What is wrong with its data, as far as rows, units and frames show.
    place : tuple
        The logs that were surveyed together, whose facts depend on each other, and its number among them.
    """

    passes: Passes
    facts: _imufit.Facts
    coverage: dict[str, float]
    effects: dict[str, _imufit.Effect]
    refused: dict[str, str]
    probes: dict[str, _imufit.Effect]
    faults: tuple[DataFault, ...] = ()
    place: tuple[tuple[LogSource, ...], int] = ((), 0)

    @classmethod
    def of(
        cls,
        passes: Passes,
        facts: _imufit.Facts,
        coverage: dict[str, float],
        faults: tuple[DataFault, ...] = (),
        place: tuple[tuple[LogSource, ...], int] = ((), 0),
    ) -> SurveyedLog:
        """Determine the effects that a log can show.

        Parameters
        ----------
        passes, facts, coverage, faults, place
            As the attributes.
        """
        own = [name for name in coverage if name != "temp"]
        named = {(sensor, effect.column) for effect in effects().values() for sensor in effect.sensors}
        columns = {
            key: effect
            for key, effect in column_effects(own, facts.sensors).items()
            if (effect.sensors[0], effect.column) not in named
        }
        unnamed = unnamed_effects()
        offered: dict[str, Any] = {**effects(), **columns, **unnamed}
        reasons = {key: _refusal(effect, passes, facts, coverage) for key, effect in offered.items()}
        testable = {key: effect for key, effect in offered.items() if reasons[key] is None}
        refused = {key: reason for key, reason in reasons.items() if reason is not None and key not in unnamed}
        probes = {effect.id: effect for effect in _imufit.probes(facts)}
        return cls(passes, facts, coverage, testable, refused, probes, faults, place)

    @property
    def columns(self) -> dict[str, _imufit.Effect]:
        """Everything that columns are taken of: effects and probes."""
        return {**self.effects, **self.probes}

    @property
    def log(self) -> LogSource:
        """The log."""
        return self.passes.log

    def column_noise(self, column: str | None) -> float:
        """Return the share of noise in a column's variance; 0 for none and for one that the log does not have."""
        return 0.0 if column is None else self.passes.column_noise.get(column, 0.0)

    def refusal(self, effect: _imufit.Effect) -> str | None:
        """Return why the log cannot show an effect; None if it can."""
        return _refusal(effect, self.passes, self.facts, self.coverage)


def _refusal(effect: _imufit.Effect, passes: Passes, facts: _imufit.Facts, coverage: Mapping[str, float]) -> str | None:
    reason, column = passes.lacking(effect) or effect.not_testable(facts), effect.column
    if reason is not None:
        return reason
    if column is None or coverage.get(column, 0.0) >= MIN_COVERAGE:
        return passes.told(effect, facts)
    return f"column {column} is known in only {100 * coverage.get(column, 0.0):.0f} % of the rows"


def survey(
    model: EffectStack, logs: Sequence[LogSource], progress: Progress, *, keep_constants: bool
) -> list[SurveyedLog]:
    """Make the first pass over every log; what is a matter of the sensor is taken from all of them together.

    Parameters
    ----------
    model : EffectStack
        Effects that are not asked about but fitted.
    logs : sequence of LogSource
        Logs of one sensor.
    progress : callable
        Called with the rows done.
    keep_constants : bool
        Temperatures and covariates count from the means that the model was fitted with, not from these logs'.
    """
    logs = [judged_rows(log) for log in logs]
    passes = [passes_of(log, progress) for log in logs]
    surveys = [each.survey() for each in passes]
    facts = [found for found, _ in surveys]
    ranges = _ranges(passes)
    # A log that never comes to the end of the range is not informative about it: there the model's is the one to go by.
    facts = [each.with_ranges(**{**_ranges_of(model), **ranges}) for each in facts]
    faults = [data_faults(each, found, ranges) for each, found in zip(passes, facts, strict=True)]
    if keep_constants and model.constants:
        constants = model.constants.get("temperature_mean"), model.constants.get("covariate_means")
        facts = [each.with_means(*constants) for each in facts]
    elif len(logs) > 1:
        facts = [each.with_means(*_means(facts)) for each in facts]
    if len(logs) > 1:
        facts = [each.with_bins_of(facts[:k] + facts[k + 1 :]) for k, each in enumerate(facts)]
    _check_sensors(logs, facts)
    return [
        SurveyedLog.of(each, found, coverage, wrong, (tuple(logs), number))
        for number, (each, found, (_, coverage), wrong) in enumerate(zip(passes, facts, surveys, faults, strict=True))
    ]


def _check_sensors(logs: Sequence[LogSource], facts: Sequence[_imufit.Facts]) -> None:
    """Refuse a log that has no sensor in common with any other: it would say nothing about the question."""
    for k, (log, own) in enumerate(zip(logs, facts, strict=True)):
        others = [sensor for other in (*facts[:k], *facts[k + 1 :]) for sensor in other.sensors]
        if others and not set(own.sensors).intersection(others):
            raise InputError(
                f"the log has {' and '.join(own.sensors)}, which no other log has",
                file=log.path,
                remedy="Ask about logs of one sensor together.",
            )


def _ranges(passes: Sequence[Passes]) -> dict[str, float]:
    """Where the ranges of the sensors end, from all logs: a reading beyond shows that it was not an end."""
    ends: dict[str, float] = {}
    largest: dict[str, float] = {}
    for each in passes:
        found, most = each.ranges()
        for sensor, end in found.items():
            ends[sensor] = min(ends.get(sensor, np.inf), end)
        for sensor, value in most.items():
            largest[sensor] = max(largest.get(sensor, 0.0), value)
    return {sensor: end for sensor, end in ends.items() if largest[sensor] <= end * (1.0 + 1e-6)}


def _ranges_of(model: EffectStack) -> dict[str, float]:
    """Where the ranges of the sensors end by the model; without those it does not give a value."""
    given = {sensor: model.parameters.get(f"{sensor}.saturation", {}).get("range", 0.0) for sensor in ("acc", "gyr")}
    return {sensor: end for sensor, end in given.items() if end > 0.0}


def _means(facts: Sequence[_imufit.Facts]) -> tuple[float | None, dict[str, float]]:
    """Mean temperature and covariates of all logs that have them, each row counted once."""

    def mean(known: list[tuple[float, int]]) -> float:
        return sum(value * n for value, n in known) / sum(n for _, n in known)

    warm = [(each.temperature_mean, each.n) for each in facts if each.has_temperature]
    by_name: dict[str, list[tuple[float, int]]] = {}
    for each in facts:
        for name, value in each.covariate_means.items():
            if np.isfinite(value):
                by_name.setdefault(name, []).append((value, each.n))
    return (mean(warm) if warm else None), {name: mean(known) for name, known in by_name.items()}
