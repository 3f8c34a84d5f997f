"""What a residual does within blocks, where their means do not show it: tones and hops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.diagnose.hops import hops
from imufit.diagnose.tones import strongest
from imufit.fit.analysis import Analysis
from imufit.fit.log_evidence import LogEvidence
from imufit.fit.passes import CHANNELS
from imufit.fit.rest_passes import RestPasses

Array = NDArray[np.float64]

MOST_ROWS = 1 << 18
"""Rows of a log that are looked at, from its start."""
ON_FLOOR = 1.01
"""Ratio to a stated noise up to which nothing is left that could be a tone."""
LEAST = 0.15
"""RMS of a tone or of hops that counts, over that of the residual: smoothing of a reference leaves small peaks."""
CHANCE = 1e-6
"""Probability with which noise of a smooth spectrum makes a tone by chance, all frequencies and channels together."""


def with_fast_changes(analysis: Analysis, step: Array, ratio: float, result: Mapping[str, Any]) -> Mapping[str, Any]:
    """Turn `adequate` into `unknown` where a residual holds a tone or hops, and a swing into the tone that it is.

    Parameters
    ----------
    analysis : Analysis
        Evidence of the logs.
    step : ndarray
        Step of every parameter of the evidence that the fit has taken.
    ratio : float
        Held-out error over noise floor.
    result : mapping
        What `_imufit.Problem.diagnose` found.
    """
    # What the means of blocks show of a fast tone is a swing that it is not.
    only_in_time = result["best"] is None and all(item["covariate"] == "t" for item in result["unexplained"])
    swings = any(_is_swing(item) for item in result["unexplained"])
    if not (result["verdict"] == "adequate" or (result["verdict"] == "unknown" and only_in_time and swings)):
        return result
    found = []
    for log, evidence in enumerate(analysis.logs):
        stated = set(evidence.facts.sensors) <= set(evidence.surveyed.log.metadata.noise)
        if isinstance(evidence.passes, RestPasses) or (stated and ratio < ON_FLOOR):
            continue
        several = log if len(analysis.logs) > 1 else None
        found += [{**change, "log": several} for change in _changes(evidence, analysis.own_step(log, step))]
    if not found:
        return result
    found.sort(key=lambda change: -change["gain"])
    told = {change["channel"] for change in found}
    others = [item for item in result["unexplained"] if not (item["channel"] in told and _is_swing(item))]
    return {**result, "verdict": "unknown", "unexplained": [*found, *others]}


def _is_swing(item: Mapping[str, Any]) -> bool:
    return bool(item["shape"].startswith("a swing"))


def _changes(evidence: LogEvidence, step: Array) -> list[dict[str, Any]]:
    """Find the tone or the hops of each channel of a log."""
    found = []
    t, residuals = _residuals(evidence, step)
    channels = {index: residual for index, residual in enumerate(residuals) if residual is not None}
    for index, residual in channels.items():
        square, p_value, shape = 0.0, 1.0, ""
        tone, hopping = strongest(t, residual), hops(t, residual)
        if tone is not None:
            frequency, square, p_value = tone
            shape = f"a tone of {frequency:.3g} Hz"
        if hopping is not None:
            square, p_value = hopping.size**2 * hopping.upper * (1.0 - hopping.upper), 2.0**-hopping.count
            shape = f"{hopping.count} hops between two levels, the first at {hopping.first:.1f} s"
        # The gain is one of the whitened residual, as that of other changes is.
        whitened = square * evidence.slow_gain(index) / evidence.variance[index]
        certain = hopping is not None or p_value * len(channels) <= CHANCE
        if certain and square >= LEAST**2 * float(np.nanvar(residual)):
            found.append(
                {
                    "channel": CHANNELS[index],
                    "covariate": "t",
                    "p_value": p_value,
                    "gain": whitened * int(np.sum(np.isfinite(residual))),
                    "shape": shape,
                    "held_out": None,
                }
            )
    return found


def _residuals(evidence: LogEvidence, step: Array) -> tuple[Array, list[Array | None]]:
    """Return time stamps and residuals of all channels at the start of a log."""
    times: list[Array] = []
    parts: list[list[Array | None]] = []
    for arrays in evidence.passes.chunks(evidence.facts.margin, "looking for fast changes"):
        parts.append(_imufit.evaluate(evidence.raw, arrays, step))
        times.append(arrays["t"][arrays["begin"] : arrays["end"]])
        if sum(map(len, times)) >= MOST_ROWS:
            break
    joined: list[Array | None] = []
    for pieces in zip(*parts, strict=True):
        known = [piece for piece in pieces if piece is not None]
        joined.append(np.concatenate(known) if len(known) == len(pieces) else None)
    return np.concatenate(times), joined
