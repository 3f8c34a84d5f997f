"""Noise of the columns that effects read: a current that follows the temperature may only be measured better."""

from __future__ import annotations

from collections.abc import Sequence

from imufit.fitting.analysis import Analysis
from imufit.fitting.log_evidence import LogEvidence
from imufit.fitting.passes import CHANNELS


def column_noise(analysis: Analysis) -> list[tuple[int, float]]:
    """Share of noise in the column that each candidate reads, as whitening leaves it, by slot.

    Parameters
    ----------
    analysis : Analysis
        Evidence of the logs.
    """
    found = []
    for slot in analysis.candidate_slots:
        effect = analysis.candidates[analysis.slots[slot]]
        share = max(
            each.surveyed.column_noise(effect.column) * noise_gain(each, effect.sensors) for each in analysis.logs
        )
        if share > 0.0:
            found.append((slot, share))
    return found


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
