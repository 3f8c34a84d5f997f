"""Where a model fails: by channel, against every covariate, by segment, by frequency."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from imufit.comparing.attitude import attitude_comparison
from imufit.comparing.notes import notes
from imufit.comparing.traces import Held
from imufit.fitting.analysis import Analysis
from imufit.fitting.log_evidence import LogEvidence
from imufit.fitting.passes import CHANNELS, UNITS
from imufit.fitting.row_residuals import residual_chunks
from imufit.log.segments import is_gap
from imufit.progress import Progress
from imufit.results import ChannelResidual, Comparison, Panel, Spectrum, Where
from imufit.results.comparison import OFFSET

if TYPE_CHECKING:
    from imufit.fitting import FittedStack
    from imufit.log import LogSource
    from imufit.model import EffectStack

Array = NDArray[np.float64]

MIN_SHARE = 0.02
SCATTER = 4.0
WORST_SEGMENTS = 8
SPECTRUM_ROWS = 512
SPECTRUM_CHUNKS = 32
MISSED = 1.75
"""Time between two samples, in usual steps, from which on one is missing between them: even sampling ends there."""


def compare(fit: FittedStack, log: LogSource | None, progress: Progress) -> Comparison:
    """Hold a fitted model against a log (default: its own, of several the worst), the parameters as they are.

    Parameters
    ----------
    fit : FittedStack
        The fitted model.
    log : Log or LogStream, optional
        The log; None is the fit's own.
    progress : callable
        Called with (rows done, rows in all, what is being done).
    """
    if log is not None and not any(log == known for known in fit.logs):
        return compare_model(fit.model, log, progress)
    own = fit.worst if log is None else next(k for k, known in enumerate(fit.logs) if known == log)
    found = comparison(fit.analysis, fit.estimate.step, own)
    return _with_attitude(found, fit.model_of(own), fit.logs[own], progress)


def compare_model(model: EffectStack, log: LogSource, progress: Progress) -> Comparison:
    """Hold a model against a log, its parameters as they are.

    Parameters
    ----------
    model : EffectStack
        The model.
    log : Log or LogStream
        With reference attitude.
    progress : callable
        Called with (rows done, rows in all, what is being done).
    """
    return compare_held(held_model(model, log, progress), model, progress)


def held_model(model: EffectStack, log: LogSource, progress: Progress) -> Held:
    """Take the evidence of a log around a model, its parameters as they are.

    Parameters
    ----------
    model : EffectStack
        The model.
    log : Log or LogStream
        With reference attitude.
    progress : callable
        Called with (rows done, rows in all, what is being done).
    """
    analysis = Analysis.of(model, (log,), progress, keep_constants=True)
    return Held(analysis, analysis.estimate_unnamed().step, analysis.model.effects)


def compare_held(held: Held, model: EffectStack, progress: Progress) -> Comparison:
    """Compare a model with the log that it is held against.

    Parameters
    ----------
    held : Held
        The evidence around the model.
    model : EffectStack
        The model.
    progress : callable
        Called with (rows done, rows in all, what is being done).
    """
    found = comparison(held.analysis, held.step)
    return _with_attitude(found, model, held.analysis.logs[0].surveyed.log, progress)


def _with_attitude(found: Comparison, model: EffectStack, log: LogSource, progress: Progress) -> Comparison:
    return replace(found, attitude=attitude_comparison(model, log, progress=progress))


def comparison(analysis: Analysis, step: Array, log: int = 0) -> Comparison:
    """Comparison of one log with the model after a step of all parameters from where the evidence was taken.

    Parameters
    ----------
    analysis : Analysis
        The evidence.
    step : ndarray
        (p,) step of every parameter, SI units.
    log : int
        Number of the log.
    """
    evidence = analysis.logs[log]
    facts = evidence.facts
    result = analysis.problem.residual(step, log)
    floors = evidence.floors
    blocks = evidence.passes.spans(facts)
    channels, where, segments = [], [], []
    spans = {}
    stands_out: dict[str, bool] = {}
    for item in result["channels"]:
        name, floor = item["channel"], floors[item["index"]]
        channels.append(
            ChannelResidual(
                name,
                item["rms"],
                _rounded(item["mean"], floor),
                floor,
                item["rms"] / floor,
                evidence.passes.units[name],
                item["n"],
            )
        )
        excess = item["rms"] ** 2 - floor**2
        # A mean square scatters by sqrt(2 / n): below that nothing is in excess.
        stands_out[name] = excess > SCATTER * floor**2 * np.sqrt(2.0 / item["n"])
        if stands_out[name] and item["mean"] ** 2 >= MIN_SHARE * excess:
            share = min(item["mean"] ** 2 / excess, 1.0)
            where.append(Where(name, OFFSET, share, facts.t_start, facts.t_end))
        first, last = item["stretch"]
        seen = blocks[first:last]
        spans[name] = (float(seen[:, 0].min()), float(seen[:, 1].max()))
        segments += [
            (float(blocks[b, 0]), float(blocks[b, 1]), name, float(rms / floor))
            for b, rms in enumerate(item["block_rms"])
            if np.isfinite(rms)
        ]
    ratios = {channel.channel: channel.ratio for channel in channels}
    # A channel at its noise floor has no excess, and so no parts of one.
    panels = [panel if stands_out[panel.channel] else replace(panel, share=0.0) for panel in _panels(result, evidence)]
    for panel in panels:
        if panel.share >= MIN_SHARE:
            where.append(Where(panel.channel, panel.covariate, panel.share, *spans[panel.channel]))
    where.sort(key=lambda w: -w.share * (ratios[w.channel] ** 2 - 1.0))
    panels.sort(key=lambda p: -p.share * max(ratios[p.channel] ** 2 - 1.0, 1e-6))
    segments.sort(key=lambda s: -s[3])
    squares = {sensor: [c.ratio**2 for c in channels if c.channel.startswith(sensor)] for sensor in facts.sensors}
    # A sensor with too few samples beside the reference has no channel.
    sensors = {sensor: float(np.sqrt(np.mean(own))) for sensor, own in squares.items() if own}
    return Comparison(
        n=facts.n,
        duration_s=facts.t_end - facts.t_start,
        model=analysis.model.effects,
        channels=tuple(channels),
        sensors=sensors,
        attitude=None,
        where=tuple(where),
        panels=tuple(panels),
        spectra=_spectra(evidence, analysis.own_step(log, step), {item["index"] for item in result["channels"]}),
        segments=tuple(segments[:WORST_SEGMENTS]),
        notes=notes(evidence),
        data_faults=evidence.faults,
    )


def panels(analysis: Analysis, step: Array, log: int = 0) -> list[Panel]:
    """Binned residuals of one log after a step of all parameters, from the evidence alone: no row is read.

    Parameters
    ----------
    analysis : Analysis
        The evidence.
    step : ndarray
        (p,) step of every parameter, SI units.
    log : int
        Number of the log.
    """
    return _panels(analysis.problem.residual(step, log), analysis.logs[log])


def _panels(result: Mapping[str, Any], evidence: LogEvidence) -> list[Panel]:
    return [_panel(item, evidence) for item in result["panels"]]


def _rounded(mean: float, floor: float) -> float:
    """Zero where a mean is nothing but rounding."""
    return mean if abs(mean) > 1e-9 * floor else 0.0


def _panel(item: Mapping[str, Any], evidence: LogEvidence) -> Panel:
    name, passes, facts = item["channel"], evidence.passes, evidence.facts
    inner = item["edges"]
    width = np.diff(inner)
    first = inner[0] - (width[0] if width.size else 1.0)
    last = inner[-1] + (width[-1] if width.size else 1.0)
    if item["covariate"] == "t":
        first, last = facts.t_start, facts.t_end
    edges = np.concatenate([[first], inner, [last]])
    return Panel(
        channel=name,
        covariate=item["covariate"],
        channel_unit=passes.units[name],
        covariate_unit=item["unit"],
        centre=(edges[1:] + edges[:-1]) / 2,
        mean=item["mean"],
        band=item["band"],
        noise_floor=evidence.floors[passes.channels.index(name)],
        share=item["share"],
    )


def _spectra(evidence: LogEvidence, step: Array, judged: Collection[int]) -> tuple[Spectrum, ...]:
    """Density of the residual of each channel that is judged, averaged over stretches without a gap (Welch's method).

    A channel is sampled at its own rate: rows of other channels may stand between its samples.
    """
    from scipy.signal import welch  # noqa: PLC0415  only needed here

    if evidence.at_rest:
        return ()  # a mean over a rest has no spectrum
    sums: dict[int, list[Array]] = {}
    rates: dict[int, float] = {}
    for arrays, residuals in islice(residual_chunks(evidence, step, "spectrum"), SPECTRUM_CHUNKS):
        t = arrays["t"][arrays["begin"] : arrays["end"]]
        for index, residual in enumerate(residuals):
            known = np.empty(0, int) if residual is None else np.flatnonzero(np.isfinite(residual))
            if residual is None or index not in judged or known.size < SPECTRUM_ROWS:
                continue
            steps = np.diff(t[known])
            rate = rates.setdefault(index, 1.0 / float(np.median(steps)))
            for stretch in np.split(residual[known], np.flatnonzero(is_gap(steps, 1.0 / rate, MISSED)) + 1):
                for start in range(0, len(stretch) - SPECTRUM_ROWS + 1, SPECTRUM_ROWS):
                    piece = stretch[start : start + SPECTRUM_ROWS]
                    _, density = welch(piece, rate, nperseg=SPECTRUM_ROWS, detrend="constant")
                    sums.setdefault(index, []).append(density)
    return tuple(
        Spectrum(
            CHANNELS[index],
            f"({UNITS[CHANNELS[index][:3]]})^2/Hz",
            rates[index] / SPECTRUM_ROWS * np.arange(1.0, SPECTRUM_ROWS // 2 + 1),
            np.mean(densities, axis=0)[1:],
            2.0 * evidence.floors[index] ** 2 / rates[index],
        )
        for index, densities in sorted(sums.items())
    )
