"""Columns that differ by no more than the noise of their own measurement: no log tells which of them is the cause."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from imufit.diagnose.rivals import correlations_with_best, is_named, with_rivals
from imufit.fit.analysis import Analysis
from imufit.fit.log_evidence import LogEvidence
from imufit.fit.passes import CHANNELS

ALIKE = 0.99
"""Correlation of two effects' signals from which on the noise of their columns may be all that sets them apart."""
NOISE = 2.0
"""Times the noise of the columns that two signals may differ by and still count as the same."""


def with_measured_columns(analysis: Analysis, result: Mapping[str, Any]) -> Mapping[str, Any]:
    """Name beside the best candidate those that differ from it by no more than their columns' noise.

    A current that follows the temperature explains a drift of the zero better than the temperature itself, if its
    sensor has less noise than the thermometer: that tells of the thermometer, not of what moves the zero. So does the
    time of a steady warm-up.

    Parameters
    ----------
    analysis : Analysis
        Evidence of the logs.
    result : mapping
        What `_imufit.Problem.diagnose` found.
    """
    if not is_named(result):
        return result
    best = result["best"]
    items = {item["slot"]: item for item in result["screened"]}

    sensors = analysis.candidates[analysis.slots[best]].sensors

    def column(slot: int) -> str | None:
        return analysis.candidates[analysis.slots[slot]].column

    def same(slot: int, correlation: float) -> bool:
        if not items[slot]["passed"] or correlation < ALIKE or column(slot) == column(best):
            return False
        noise = max(
            sum(each.surveyed.column_noise(column(s)) for s in (best, slot)) * noise_gain(each, sensors)
            for each in analysis.logs
        )
        return bool(1.0 - correlation**2 <= NOISE * noise)

    alike = correlations_with_best(result).items()
    return with_rivals(result, [slot for slot, correlation in alike if same(slot, correlation)])


def noise_gain(evidence: LogEvidence, sensors: Sequence[str]) -> float:
    """Return by how much whitening raises the share of white noise in a column that changes slowly.

    Parameters
    ----------
    evidence : LogEvidence
        Evidence of a log, with its whitening filters.
    sensors : sequence of str
        Those whose residual is whitened.
    """
    channels = [k for k, name in enumerate(CHANNELS) if name[:3] in sensors]
    white = {k: 1.0 + sum(tap**2 for tap in evidence.filters[k]) for k in channels}
    return float(max([1.0, *(white[k] / max(evidence.slow_gain(k), 1e-9) for k in channels)]))
