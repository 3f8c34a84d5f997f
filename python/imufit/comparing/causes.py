"""The residual against causes that a finding names beside the covariates: derivatives, products, the heading.

Such a cause acts through several columns, so the residual stands against the part that their best fit explains.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.fitting.analysis import Analysis
from imufit.fitting.passes import CHANNELS, CHUNK_ROWS, UNITS
from imufit.results import Panel

Array = NDArray[np.float64]

MOST_CHUNKS: Final = 8
"""Chunks of rows that are evaluated, spread over the log: some 130 000 rows, in a second."""


def cause_names(analysis: Analysis, log: int, channel: str) -> tuple[str, ...]:
    """Return the causes that a finding can name for a channel, as a finding calls them.

    Parameters
    ----------
    analysis : Analysis
        The evidence, with the columns of the causes.
    log : int
        Number of the log.
    channel : str
        For instance ``acc_x``.
    """
    return tuple(_causes(analysis, log, channel))


def cause_shares(analysis: Analysis, step: Array, log: int, channels: Sequence[str]) -> dict[str, dict[str, float]]:
    """Return the part of each channel's excess that each cause explains, from the evidence alone: no row is read.

    Parameters
    ----------
    analysis : Analysis
        The evidence.
    step : ndarray
        (p,) step of every parameter, SI units.
    log : int
        Number of the log.
    channels : sequence of str
        Channels that stand above their noise floors.

    Returns
    -------
    dict
        Fraction of the excess variance, 0 to 1, by channel and cause.
    """
    squares = analysis.problem.mean_squares(step, log)
    evidence = analysis.logs[log]
    beside = cache(partial(analysis.problem.step_beside, analysis.fitted_slots))
    found: dict[str, dict[str, float]] = {}
    for channel in channels:
        excess = squares[channel] - evidence.floors[evidence.passes.channels.index(channel)] ** 2
        found[channel] = {}
        for cause, (slot, places) in _causes(analysis, log, channel).items():
            left = analysis.problem.mean_squares(_moved(step, *beside(slot), places), log)[channel]
            found[channel][cause] = min(max((squares[channel] - left) / excess, 0.0), 1.0)
    return found


def _moved(step: Array, own: Sequence[int], fitted: Array, places: Sequence[int]) -> Array:
    """Return the step with a cause in it: some of the parameters of its slot, as they are fitted beside the model's."""
    chosen = [own[k] for k in places]
    moved = step.copy()
    moved[chosen] += fitted[chosen]
    return moved


def cause_panels(
    analysis: Analysis, step: Array, log: int, channel: str, cause: str, others: Sequence[tuple[Analysis, Array]] = ()
) -> tuple[Panel | None, ...]:
    """Return the residual of a channel against the part of it that a cause explains, after a step of all parameters.

    Parameters
    ----------
    analysis : Analysis
        The evidence.
    step : ndarray
        (p,) step of every parameter, SI units.
    log : int
        Number of the log.
    channel : str
        For instance ``acc_x``.
    cause : str
        One of `cause_names`.
    others : sequence of (Analysis, ndarray)
        Evidence and step of other models of the same log, whose residuals are drawn against the same part.

    Returns
    -------
    tuple of Panel or None
        One for the model, then one for each of the others; None where too few rows are known.
    """
    slot, places = _causes(analysis, log, channel)[cause]
    evidence = analysis.logs[log]
    moved = _moved(step, *analysis.problem.step_beside(analysis.fitted_slots, slot), places)
    index = CHANNELS.index(channel)
    asked = [(analysis, step), (analysis, moved), *others]
    sources = [(each.logs[log].raw, each.own_step(log, at)) for each, at in asked]
    every = -(-evidence.surveyed.log.n // (CHUNK_ROWS * MOST_CHUNKS))
    pieces: list[list[Array]] = []
    for number, arrays in enumerate(evidence.passes.chunks(evidence.passes.margin(evidence.facts), "comparing")):
        if number % every:
            continue
        residuals = [_imufit.evaluate(raw, arrays, at)[index] for raw, at in sources]
        size = arrays["end"] - arrays["begin"]
        pieces.append([np.full(size, np.nan) if found is None else found for found in residuals])
    rows = [np.concatenate(part) for part in zip(*pieces, strict=True)]
    if not rows:
        return (None,) * (1 + len(others))
    part = rows[0] - rows[1]
    floor = evidence.floors[index]
    return tuple(_panel(part, residual, channel, cause, floor) for residual in (rows[0], *rows[2:]))


def _causes(analysis: Analysis, log: int, channel: str) -> dict[str, tuple[int, list[int]]]:
    """Return the slot of every cause of a channel, and which of the slot's parameters are the cause's, by its name."""
    evidence = analysis.logs[log]
    found: dict[str, tuple[int, list[int]]] = {}
    if evidence.at_rest:
        return found  # causes act on single rows
    sensor, axis = channel.split("_")
    for slot in analysis.probe_slots:
        key = analysis.slots[slot]
        probe = evidence.surveyed.probes.get(key)
        if probe is None or key not in evidence.slots or probe.reference_part or probe.sensors != [sensor]:
            continue
        for k in range(len(probe.parameters)):
            name = probe.cause(k, "xyz".index(axis))
            if name is None:
                continue
            of, places = found.setdefault(name, (slot, []))
            # A second cause of the same name says the same in other words.
            if of == slot:
                places.append(k)
    return found


def _panel(part: Array, residual: Array, channel: str, cause: str, floor: float) -> Panel | None:
    """Average a residual in bins of equal count."""
    found = _imufit.residual_against(part, residual, floor)
    if found is None:
        return None
    centre, mean, band, share = found
    unit = UNITS[channel[:3]]
    return Panel(channel, cause, unit, unit, centre=centre, mean=mean, band=band, noise_floor=floor, share=share)
