"""Evidence of one log: its noise and its Gram matrices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.errors import InputError
from imufit.faults import knock_faults
from imufit.fitting.passes import CHANNELS, Passes
from imufit.fitting.profile import Found
from imufit.fitting.rest_passes import RestPasses
from imufit.fitting.surveyed_log import SurveyedLog
from imufit.log import LogSource
from imufit.model.catalogue import find_effect
from imufit.results import DataFault

Values = Mapping[str, list[float]]
Array = NDArray[np.float64]

LEFT_OF_STEP = 0.05
"""Part of a coarse step that no effect explains, at least: readings that stand on one value are not free of noise."""


@dataclass(frozen=True, eq=False)
class LogEvidence:
    """Evidence of one log with the columns of every effect that it can show, taken around given parameter values.

    Attributes
    ----------
    surveyed : SurveyedLog
        The log.
    slots : tuple of str
        Effects in the order of their columns: those of the model, the unnamed ones, the candidates, the probes.
    raw, white : Evidence
        As it stands, and whitened.
    raw_variance, variance : list of float
        Of the residual of each channel that no effect explains, as it stands and whitened.
    raw_loudness, loudness : list of list of float
        (channels, blocks) variance of each block over that of its channel, as it stands and whitened.
    floors : list of float
        Noise floor of each channel.
    filters : list of list of float
        Whitening filter of each channel.
    faults : tuple of DataFault
        What is wrong with the data of the log.
    """

    surveyed: SurveyedLog
    slots: tuple[str, ...]
    raw: _imufit.Evidence
    white: _imufit.Evidence
    raw_variance: list[float]
    variance: list[float]
    raw_loudness: list[list[float]]
    loudness: list[list[float]]
    floors: list[float]
    filters: list[list[float]]
    faults: tuple[DataFault, ...] = ()

    @property
    def passes(self) -> Passes:
        """Passes over the log."""
        return self.surveyed.passes

    @property
    def facts(self) -> _imufit.Facts:
        """Facts of the log as a whole."""
        return self.surveyed.facts

    @property
    def at_rest(self) -> bool:
        """True if rests judge the log in the place of a reference."""
        return isinstance(self.passes, RestPasses)

    @property
    def rests(self) -> Array:
        """Times at which each rest that judges the log begins and ends, (rests, 2), s; none beside a reference."""
        passes = self.passes
        return passes.rests.held if isinstance(passes, RestPasses) else np.zeros((0, 2))

    @property
    def places(self) -> dict[str, range]:
        """Places of the parameters of every effect in a step of all parameters, by its id."""
        return _places(self.surveyed, self.slots)

    def slow_gain(self, channel: int) -> float:
        """Return by how much whitening multiplies the square of what changes slowly in a channel."""
        return float((1.0 - sum(self.filters[channel])) ** 2)

    @classmethod
    def of(cls, surveyed: SurveyedLog, fitted: Values, found: Mapping[str, Found]) -> LogEvidence:
        """Find the noise of a log and take its evidence.

        Parameters
        ----------
        surveyed : SurveyedLog
            The log.
        fitted : mapping of str to list of float
            Effects to take the evidence around, the model's and the unnamed ones, with their parameters.
        found : mapping of str to Found
            What searches found for the other effects.
        """
        passes, facts = surveyed.passes, surveyed.facts
        candidates = [key for key in surveyed.columns if key not in fitted]
        raw = _empty(surveyed, fitted, candidates, found, [[] for _ in CHANNELS])
        passes.evidence(raw, facts, "taking evidence")
        step, raw_variance, loudness = _imufit.saturate(raw)
        raw_variance = _not_below_steps(facts, raw_variance)
        slots = (*fitted, *candidates)
        faults = surveyed.faults
        if isinstance(passes, RestPasses):
            noise = passes.noise(raw, raw_variance)
            # The noise that metadata state is that of a reading, not of a mean.
            floors = [float(np.sqrt(v)) for v in noise]
            _check_samples(surveyed.log, fitted, noise)
            even = [[1.0] * passes.blocks for _ in CHANNELS]
            return cls(surveyed, slots, raw, raw, noise, noise, even, even, floors, [[] for _ in CHANNELS], faults)
        _check_samples(surveyed.log, fitted, raw_variance)
        if not any(fault.spoils for fault in faults):
            effects = [slot for slot in slots if slot not in surveyed.probes]
            faults = (*faults, *knock_faults(raw, raw_variance, _places(surveyed, effects), facts))
        floors = _floors(surveyed.log, facts, raw_variance)
        filters: list[list[float]] = [[] for _ in CHANNELS]
        plain = cls(surveyed, slots, raw, raw, raw_variance, raw_variance, loudness, loudness, floors, filters, faults)
        return plain._whitened(step)

    def with_noise_after(self, step: Array) -> LogEvidence:
        """Return the evidence with the noise of the residual after a step; that of rests is their scatter.

        Parameters
        ----------
        step : numpy.ndarray
            Step of every parameter.
        """
        return self if self.at_rest else self._whitened(step)

    def _whitened(self, step: Array) -> LogEvidence:
        """Return evidence that replaces its whitened form, whitened; `step` leaves only its noise."""
        passes, facts = self.passes, self.facts
        filters = passes.past_products(self.raw, facts, step).filters()
        if not any(filters):
            return replace(self, white=self.raw, filters=filters)
        white = passes.evidence(self.raw.with_filters(filters), facts, "whitening the evidence")
        _, variance, loudness = _imufit.saturate(white)
        variance = _not_below_steps(facts, variance)
        return replace(self, white=white, variance=variance, loudness=loudness, filters=filters)

    def ln_noise(self, counts: Sequence[int]) -> float:
        """Log of what the size of the noise makes of the density of so many samples of each channel.

        Parameters
        ----------
        counts : sequence of int
            Samples of each channel.
        """
        known = (k for k in range(len(CHANNELS)) if counts[k] and self.variance[k] > 0.0)
        of = (counts[k] * (np.log(self.variance[k]) + np.mean(np.log(self.loudness[k]))) for k in known)
        return -0.5 * float(sum(of))

    def ln_smoothing(self, counts: Sequence[int]) -> float:
        """Log of what the effects raise the density of so many samples by as they smooth the noise of the reference.

        A sensor that is called low-passed or weak leaves less of that noise in the residual, whatever it is. The log
        density of a sample changes by half the part of its variance that is left out.

        Parameters
        ----------
        counts : sequence of int
            Samples of each channel.
        """
        if self.at_rest:
            return 0.0
        noise = self.facts.reference_noise
        own = np.array(self.white.reference_variance(*noise))
        ideal = np.array(_empty(self.surveyed, {}, [], {}, self.filters).reference_variance(*noise))
        variance = np.where(np.isfinite(self.variance), self.variance, np.inf)
        # A reference that would be noisier than the residual has no white noise: the smaller is the correction.
        variance = np.maximum(variance, ideal**2 / np.maximum(variance, np.finfo(float).tiny))
        known = variance > 0.0
        return float(np.sum(0.5 * np.array(counts)[known] * ((ideal - own) / variance)[known]))

    @property
    def counts(self) -> list[int]:
        """Samples of each channel."""
        return [self.white.count(k) for k in range(len(CHANNELS))]

    def around(
        self, fitted: Values, candidates: Sequence[str], found: Mapping[str, Found], *, lean: bool = False
    ) -> LogEvidence:
        """Evidence of the same log around other parameter values or another stack of effects.

        Parameters
        ----------
        fitted : mapping of str to list of float
            As for :meth:`of`.
        candidates : sequence of str
            Effects whose columns are taken besides, where the log can show them.
        found : mapping of str to Found
            As for :meth:`of`.
        lean : bool
            Hold the residual only whitened, not as it stands.
        """
        passes, facts = self.passes, self.facts
        known = self.surveyed.columns
        asked = [key for key in candidates if key in known]
        white = _empty(self.surveyed, fitted, asked, found, self.filters)
        passes.evidence(white, facts, "taking evidence")
        raw = white
        if not lean and any(self.filters):
            plain = white.with_filters([[] for _ in CHANNELS])
            raw = passes.evidence(plain, facts, "taking evidence as it stands")
        # The noise is that of the first evidence, which every effect of the catalogue was fitted to.
        return replace(self, slots=(*fitted, *asked), raw=raw, white=white)


def evidence_again(
    surveyed: SurveyedLog, fitted: Values, like: Mapping[str, Any], found: Mapping[str, Found]
) -> LogEvidence:
    """Take evidence that was taken before once more, with the noise that was found then.

    Parameters
    ----------
    surveyed : SurveyedLog
        The log.
    fitted : mapping of str to list of float
        Effects that it was taken around, the model's and the unnamed ones, with their parameters.
    like : mapping
        Every attribute of that evidence but `surveyed` and the evidence itself; ``one``: plain and whitened were one.
    found : mapping of str to Found
        What searches found for the other effects.
    """
    known = {name: value for name, value in like.items() if name != "one"}
    asked = [key for key in like["slots"] if key not in fitted]
    white = _empty(surveyed, fitted, asked, found, like["filters"])
    surveyed.passes.evidence(white, surveyed.facts, "taking evidence")
    raw = white
    if not like["one"]:
        plain = white.with_filters([[] for _ in CHANNELS])
        raw = surveyed.passes.evidence(plain, surveyed.facts, "taking evidence as it stands")
    return LogEvidence(surveyed=surveyed, raw=raw, white=white, **known)


def _empty(
    surveyed: SurveyedLog,
    fitted: Values,
    candidates: Sequence[str],
    found: Mapping[str, Found],
    filters: list[list[float]],
) -> _imufit.Evidence:
    stack = [(find_effect(key), values) for key, values in fitted.items()]
    columns = surveyed.columns
    asked = [(columns[key], trial(columns[key], found.get(key))) for key in candidates]
    return _imufit.Evidence(surveyed.facts, stack, asked, surveyed.passes.blocks, filters)


def _places(surveyed: SurveyedLog, slots: Sequence[str]) -> dict[str, range]:
    """Parameters of every effect in the evidence, by its id."""
    places, first = {}, 0
    columns = surveyed.columns
    for key in slots:
        effect = columns.get(key) or find_effect(key)
        places[key] = range(first, first + len(effect.parameters))
        first += len(effect.parameters)
    return places


def trial(effect: _imufit.Effect, found: Found | None) -> list[float]:
    """Return the values that the columns of a candidate are taken for.

    Parameters
    ----------
    effect : Effect
        The candidate.
    found : Found, optional
        The result of the search for the effect; None without a search.
    """
    return [0.0] * len(effect.parameters) if found is None else found.trial


def _check_samples(log: LogSource, fitted: Values, variance: list[float]) -> None:
    """Refuse a log of which too few samples can be used for any sensor, or for one that an effect acts on."""
    used = {channel[:3] for channel, v in zip(CHANNELS, variance, strict=True) if np.isfinite(v)}
    remedy = "Check that sensors and reference cover the same time."
    if not used:
        raise InputError("too few samples have a reference around them", file=log.path, remedy=remedy)
    for effect in map(find_effect, fitted):
        if not used.intersection(effect.sensors):
            sensors = " and ".join(effect.sensors)
            raise InputError(
                f"effect {effect.id} cannot be fitted: too few samples of {sensors} have a reference around them",
                file=log.path,
                remedy=remedy,
            )


def _not_below_steps(facts: _imufit.Facts, variance: list[float]) -> list[float]:
    """Keep the variance of readings that hardly ever change at what is left between their steps."""
    steps = (step for sensor in facts.steps for step in sensor)
    return [max(v, (LEFT_OF_STEP * step) ** 2) for v, step in zip(variance, steps, strict=True)]


def _floors(log: LogSource, facts: _imufit.Facts, variance: list[float]) -> list[float]:
    """Noise floor of each channel: from the metadata, else what no effect of the catalogue explains."""
    given = [log.metadata.noise.get(channel[:3]) for channel in CHANNELS]
    steps = (step for sensor in facts.steps for step in sensor)
    return [_floor(*channel) for channel in zip(given, steps, variance, strict=True)]


def _floor(given: float | None, step: float, variance: float) -> float:
    """Noise floor of one channel: a data sheet states it before the converter, whose coarse steps may add theirs."""
    if not given:
        return float(np.sqrt(variance))
    if step == 0.0:
        return given
    return float(np.sqrt(max(given**2, min(given**2 + step**2 / 12.0, variance))))
