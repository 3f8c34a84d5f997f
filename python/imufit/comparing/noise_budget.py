"""The noise floor of every channel as a sum of parts, each of the instrument that it belongs to."""

from __future__ import annotations

import numpy as np

from imufit.fitting.analysis import Analysis
from imufit.fitting.log_evidence import LogEvidence
from imufit.fitting.passes import CHANNELS
from imufit.results import NoisePart

UNITS = {"acc": "m/s^2", "gyr": "rad/s", "mag": "uT"}


def noise_budget(analysis: Analysis) -> tuple[NoisePart, ...]:
    """Components of the noise of each channel of the first log.

    Parameters
    ----------
    analysis : Analysis
        Evidence of the logs.
    """
    evidence = analysis.logs[0]
    if evidence.at_rest:
        return ()
    zeros = {
        channel: (walk, scatter, block)
        for log, channel, walk, scatter, block in analysis.problem.zero_noise(analysis.fitted_slots)
        if log == 0
    }
    found: list[NoisePart] = []
    for index, channel in enumerate(CHANNELS):
        variance = evidence.raw_variance[index]
        if np.isfinite(variance) and variance > 0.0:
            found += _of_channel(evidence, index, channel, zeros.get(index, (0.0, 0.0, 1.0)))
    return tuple(found)


def _of_channel(evidence: LogEvidence, index: int, channel: str, zero: tuple[float, float, float]) -> list[NoisePart]:
    """Components of one channel: what the reference and the converter make, and as the rest the sensor's own noise."""
    facts, variance = evidence.facts, evidence.raw_variance[index]
    unit = UNITS[channel[:3]]
    reference = min(facts.ideal_noise[index // 3] ** 2, variance)
    quantisation = min(facts.steps[index // 3][index % 3] ** 2 / 12.0, variance - reference)
    white = variance - reference - quantisation
    walk, scatter, block = zero
    rate = 1.0 / facts.sensor_dt[index // 3]
    parts = [
        # A density per root of hertz spreads over half the sampling rate.
        NoisePart(channel, "white", float(np.sqrt(2.0 * white / rate)), f"{unit}/sqrt(Hz)", white / variance),
        NoisePart(channel, "reference", float(np.sqrt(reference)), unit, reference / variance),
        NoisePart(channel, "quantisation", float(np.sqrt(quantisation)), unit, quantisation / variance),
        NoisePart(channel, "random_walk", walk / float(np.sqrt(block)), f"{unit}/sqrt(s)", walk**2 / variance),
        NoisePart(channel, "block_scatter", scatter, unit, scatter**2 / variance),
    ]
    return [part for part in parts if part.value > 0.0]
