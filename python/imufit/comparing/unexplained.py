"""The weight of a dependence that no effect explains: its share of a residual's excess, and where in time it lies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.fitting.analysis import Analysis
from imufit.fitting.log_evidence import LogEvidence
from imufit.fitting.passes import CHANNELS
from imufit.results import Unexplained

Array = NDArray[np.float64]


def unexplained(analysis: Analysis, step: Array, found: Sequence[_imufit.Finding]) -> tuple[Unexplained, ...]:
    """Dependences that nothing in the catalogue explains, with their share of the excess and where in time it lies.

    Parameters
    ----------
    analysis : Analysis
        The evidence.
    step : ndarray
        (p,) step of every parameter of the evidence, SI units.
    found : sequence of Finding
        The dependences.
    """
    if not found:
        return ()
    residuals = _residuals(analysis, step)
    return tuple(_dependence(analysis, residuals, item) for item in found)


def _residuals(analysis: Analysis, step: Array) -> Sequence[Mapping[str, Any]]:
    return [analysis.problem.residual(step, log) for log in range(len(analysis.logs))]


def _dependence(analysis: Analysis, residuals: Sequence[Mapping[str, Any]], item: _imufit.Finding) -> Unexplained:
    """Say what one dependence is worth in the log where it is worth most."""
    beside = None
    if item.probe is not None:
        fitted = analysis.problem.estimate([*analysis.fitted_slots, item.probe])
        beside = _residuals(analysis, fitted["full_step"])

    def share(log: int) -> float:
        panels = residuals[log]["panels"]
        same = (p["share"] for p in panels if (p["channel"], p["covariate"]) == (item.channel, item.covariate))
        columns = None if beside is None else beside[log]
        return max(float(next(same, 0.0)), _share(analysis.logs[log], residuals[log], columns, item))

    concerned = range(len(residuals)) if item.log is None else [item.log]
    having = [log for log in concerned if any(c["index"] in item.channels for c in residuals[log]["channels"])]
    log = max(having, key=share)
    facts = analysis.logs[log].facts
    first, last = next(c["stretch"] for c in residuals[log]["channels"] if c["index"] in item.channels)
    spans = analysis.logs[log].passes.spans(facts)[first:last]
    begin, end = float(spans[:, 0].min()), float(spans[:, 1].max())
    return Unexplained(item.channel, item.covariate, share(log), item.shape, begin, end)


def _share(
    evidence: LogEvidence, residual: Mapping[str, Any], beside: Mapping[str, Any] | None, item: _imufit.Finding
) -> float:
    """Return what a dependence explains of the excess of its channels in a log.

    Parameters
    ----------
    evidence : LogEvidence
        The log.
    residual : mapping
        Of the model.
    beside : mapping or None
        That of the model and the columns of the dependence, where these are fitted.
    item : Finding
        The dependence.
    """
    squares = _squares(residual, item)
    floors = {k: evidence.floors[k] for k in squares if evidence.floors[k] > 0.0}
    if item.channel not in CHANNELS or not floors:
        return 0.0
    total = sum(squares[k][1] - squares[k][0] * floor**2 for k, floor in floors.items())
    if beside is not None:
        left = _squares(beside, item)
        drop = sum(squares[k][1] - left[k][1] for k in floors)
    else:
        # The drop is one of the whitened residual; what changes slowly passes whitening with its gain at zero
        # frequency.
        k = CHANNELS.index(item.channel)
        drop = item.drop * evidence.variance[k] / max(evidence.slow_gain(k), 1e-9)
    return float(np.clip(drop / total, 0.0, 1.0)) if total > 0.0 else 0.0


def _squares(residual: Mapping[str, Any], item: _imufit.Finding) -> dict[int, tuple[int, float]]:
    """Return samples and sum of squares of each channel that shows a dependence."""
    channels = (each for each in residual["channels"] if each["index"] in item.channels)
    return {each["index"]: (each["n"], each["n"] * each["rms"] ** 2) for each in channels}
