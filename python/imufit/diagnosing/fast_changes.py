"""Changes of a residual within blocks, which the blocks' means do not show: tones and jumps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.diagnosing.shaking import is_shaken
from imufit.diagnosing.telegraph_noise import telegraph_noise
from imufit.diagnosing.tones import moving, strongest
from imufit.fitting.analysis import Analysis
from imufit.fitting.log_evidence import LogEvidence

Array = NDArray[np.float64]

MOST_ROWS = 1 << 18
"""Rows of a log that are looked at, from its start."""
LEAST = 0.15
"""RMS of a tone or of jumps that counts, over that of the residual: smoothing of a reference leaves small peaks."""
CHANCE = 1e-6
"""Probability with which noise of a smooth spectrum makes a tone by chance, all frequencies and channels together."""


Seen = tuple[int | None, int, float, str]
"""Log or None for the only one, channel index, log Bayes factor, and what was seen."""


def fast_changes(analysis: Analysis, step: Array) -> list[Seen]:
    """Find lines of the spectrum and random telegraph noise in the residual, which no mean of a block shows.

    Parameters
    ----------
    analysis : Analysis
        Evidence of the logs.
    step : ndarray
        (p,) step of every parameter of the evidence that the fit has taken.
    """
    shaken = is_shaken(analysis)
    found: list[Seen] = []
    for log, evidence in enumerate(analysis.logs):
        if evidence.at_rest:
            continue
        several = log if len(analysis.logs) > 1 else None
        found += [(several, *change) for change in _changes(evidence, analysis.own_step(log, step), shaken=shaken)]
    return found


def _changes(evidence: LogEvidence, step: Array, *, shaken: bool) -> list[tuple[int, float, str]]:
    """Find the line or the random telegraph noise of each channel of a log."""
    found = []
    t, residuals = _residuals(evidence, step)
    channels = {index: residual for index, residual in enumerate(residuals) if residual is not None}
    for index, residual in channels.items():
        square, p_value, shape = 0.0, 1.0, ""
        tone, sweep = (None, None) if shaken else (strongest(t, residual), moving(t, residual))
        jumping = telegraph_noise(t, residual)
        if tone is not None:
            frequency, square, p_value = tone
            shape = f"a line at {frequency:.3g} Hz"
        # A steady line is one in each stretch, too.
        if sweep is not None and sweep[1] > 2.0 * square:
            (first, last), square, p_value = sweep
            shape = f"a line that moves from {first:.3g} to {last:.3g} Hz"
        if jumping is not None:
            square, p_value = jumping.size**2 * jumping.upper * (1.0 - jumping.upper), 2.0**-jumping.count
            shape = (
                f"random telegraph noise: {jumping.count} jumps between two levels, the first at {jumping.first:.1f} s"
            )
        # The drop is one of the whitened residual, as that of other causes is; half of it is a log likelihood ratio.
        whitened = square * evidence.slow_gain(index) / evidence.variance[index]
        certain = jumping is not None or p_value * len(channels) <= CHANCE
        if certain and square >= LEAST**2 * float(np.nanvar(residual)):
            found.append((index, 0.5 * whitened * int(np.sum(np.isfinite(residual))), shape))
    return found


def _residuals(evidence: LogEvidence, step: Array) -> tuple[Array, list[Array | None]]:
    """Return time stamps and residuals of all channels at the start of a log."""
    times: list[Array] = []
    parts: list[list[Array | None]] = []
    for arrays in evidence.passes.chunks(evidence.passes.margin(evidence.facts), "looking for fast changes"):
        parts.append(_imufit.evaluate(evidence.raw, arrays, step))
        times.append(arrays["t"][arrays["begin"] : arrays["end"]])
        if sum(map(len, times)) >= MOST_ROWS:
            break
    joined: list[Array | None] = []
    for pieces in zip(*parts, strict=True):
        known = [piece for piece in pieces if piece is not None]
        joined.append(np.concatenate(known) if len(known) == len(pieces) else None)
    return np.concatenate(times), joined
