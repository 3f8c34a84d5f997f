"""Findings in the rows, beside the evidence: noise above the stated one, and a sensor that reads falsely."""

from __future__ import annotations

import numpy as np

from imufit.diagnosing.fast_changes import Seen
from imufit.diagnosing.shaking import is_shaken
from imufit.fitting.analysis import Analysis
from imufit.fitting.log_evidence import LogEvidence
from imufit.fitting.passes import CHANNELS

ABOVE = 2.0
"""Residual of the quiet blocks over the stated noise, with the noise of the reference, from which on the stated noise
is refuted: a data sheet states a density within a third (typical against largest value), and the quiet blocks of noise
that grows with the rate or with time stand at 1.2 to 1.8 times the stated noise (`imufit grade --set nothing`)."""
QUIET = 0.1
"""Part of the blocks that is quiet, whatever the noise of the others grows with."""


def seen_in_rows(analysis: Analysis) -> list[Seen]:
    """Name the channels that stand above their stated noise, and the sensors that read falsely in every log.

    Neither effects nor noise explain that.

    Parameters
    ----------
    analysis : Analysis
        Evidence of the logs.
    """
    # Noise above the stated one names no cause: causes with any evidence come before it.
    found = [
        (log, index, 0.0, f"it stands at {ratio:.1f} times its stated noise")
        for log, evidence in enumerate(() if is_shaken(analysis) else analysis.logs)
        if not evidence.at_rest
        for index, ratio in _above_stated_noise(evidence).items()
    ]
    false = [[fault for fault in each.faults if fault.false_readings] for each in analysis.logs]
    for log, faults in enumerate(false if all(false) else ()):
        longest = max(faults, key=lambda fault: fault.rows)
        words = f"it reads falsely in {longest.rows} rows from {longest.t_start:.1f} s on"
        found.append((log, CHANNELS.index(f"{longest.sensor}_x"), float(longest.rows), words))
    several = len(analysis.logs) > 1
    return [(log if several else None, index, ln_bayes, words) for log, index, ln_bayes, words in found]


def _above_stated_noise(evidence: LogEvidence) -> dict[int, float]:
    """Return the unexplained residual of quiet blocks over the stated noise, by channel index, where that is refuted.

    The noise of the reference counts as stated: no other rule uses it.
    """
    found: dict[int, float] = {}
    for index, channel in enumerate(CHANNELS):
        stated = evidence.surveyed.log.metadata.noise.get(channel[:3])
        variance = evidence.raw_variance[index] * np.quantile(evidence.raw_loudness[index], QUIET)
        if not stated or not np.isfinite(variance):
            continue
        step = evidence.facts.steps[index // 3][index % 3]
        known = stated**2 + evidence.facts.ideal_noise[index // 3] ** 2 + step**2 / 12.0
        ratio = float(np.sqrt(variance / known))
        if ratio > ABOVE:
            found[index] = ratio
    return found
