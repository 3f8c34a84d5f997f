"""The residual against causes that a finding names beside the covariates: derivatives, products, the heading.

Such a cause acts through several columns, so the residual stands against the part that their best fit explains.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Final, NamedTuple

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
    """Return the part of each channel's excess that each cause explains beside an offset; no row is read.

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
    beside = cache(analysis.problem.step_beside)
    found: dict[str, dict[str, float]] = {}
    for channel in channels:
        excess = squares[channel] - evidence.floors[evidence.passes.channels.index(channel)] ** 2
        causes, found[channel] = _causes(analysis, log, channel), {}
        if not causes:
            continue
        offset = _offset(analysis, step, channel.partition("_")[0])
        without = analysis.problem.mean_squares(offset.step, log)[channel]
        for cause, (slot, places) in causes.items():
            own, fitted = beside(offset.model, slot)
            both = _moved(step, [*offset.places, *(own[k] for k in places)], fitted)
            left = analysis.problem.mean_squares(both, log)[channel]
            found[channel][cause] = min(max((without - left) / excess, 0.0), 1.0)
    return found


class _Offset(NamedTuple):
    """An offset of a sensor beside the model, unless the model has one.

    Causes are fitted beside it, as covariates are judged about the mean: a residual that is constant depends on
    nothing, and a cause that hardly varies would pass for it.
    """

    model: tuple[int, ...]
    """Slots of the model, and that of the offset."""
    places: list[int]
    """Places of the offset's parameters."""
    step: Array
    """Step of every parameter with the offset."""


def _offset(analysis: Analysis, step: Array, sensor: str) -> _Offset:
    model, moved = tuple(analysis.fitted_slots), step
    places: list[int] = []
    for key, effect in analysis.candidates.items():
        slot = analysis.slots.index(key)
        if effect.affine == "offset" and list(effect.sensors) == [sensor] and slot not in model:
            own, fitted = analysis.problem.step_beside(model, slot)
            moved = _moved(moved, own, fitted)
            model, places = (*model, slot), [*places, *own]
    return _Offset(model, places, moved)


def _moved(step: Array, places: Sequence[int], fitted: Array) -> Array:
    """Return the step with some parameters as they are fitted besides."""
    moved = step.copy()
    moved[places] += fitted[places]
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
    own, fitted = analysis.problem.step_beside(_offset(analysis, step, channel.partition("_")[0]).model, slot)
    moved = _moved(step, [own[k] for k in places], fitted)
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
