"""Each channel of a log over time with a model: one pass that keeps the extremes of every stretch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.fitting.analysis import Analysis
from imufit.fitting.fitted_stack import FittedStack
from imufit.fitting.passes import CHANNELS, UNITS
from imufit.fitting.row_residuals import residual_chunks
from imufit.log.columns import SENSOR_NAMES
from imufit.log.segments import is_gap
from imufit.results.residual_trace import ResidualTrace, extreme_rows, stretches_of

Array = NDArray[np.float64]

STRETCHES: Final = 200
"""Stretches of time that a trace keeps apart: five pixels each in a column of 1000. Nine channels, of which twelve
effects move every one, then take 0.7 megabytes of a page."""


@dataclass(frozen=True, eq=False)
class Held:
    """A model held against logs: evidence around it, and the step of all parameters from there.

    Attributes
    ----------
    analysis : Analysis
        The evidence.
    step : ndarray
        (p,) step of every parameter, SI units.
    effects : tuple of str
        Effects of the model.
    """

    analysis: Analysis
    step: Array
    effects: tuple[str, ...]

    @classmethod
    def of_fit(cls, fit: FittedStack) -> Held:
        """Return the model of a fit.

        Parameters
        ----------
        fit : FittedStack
            The fit.
        """
        return cls(fit.analysis, fit.estimate.step, fit.analysis.model.effects)

    @classmethod
    def with_candidate(cls, fit: FittedStack, effect: str) -> Held | None:
        """Return the model of a fit with a candidate added as the evidence predicts; None where this is unknown.

        Parameters
        ----------
        fit : FittedStack
            The fit.
        effect : str
            Id of the candidate.
        """
        analysis = fit.analysis
        if effect not in analysis.candidates:
            return None
        slots = [*analysis.fitted_slots, analysis.slots.index(effect)]
        step = analysis.problem.estimate(slots)["full_step"]
        return cls(analysis, np.asarray(step), (*analysis.model.effects, effect))

    @property
    def name(self) -> str:
        """Effects of the model, or the ideal sensor."""
        return " + ".join(self.effects) or "the ideal sensor"


def traces(held: Held, first: Held | None = None, log: int = 0) -> tuple[ResidualTrace, ...]:
    """Return the channels of one log over time, in memory that does not grow with the log.

    Parameters
    ----------
    held : Held
        The model.
    first : Held, optional
        Another model of the same logs, whose residual stands beside.
    log : int
        Number of the log.

    Returns
    -------
    tuple of ResidualTrace
        One for each channel that is judged; none where rests stand in for a reference.
    """
    evidence = held.analysis.logs[log]
    if evidence.at_rest:
        return ()
    step = held.analysis.own_step(log, held.step)
    full = _full_steps(held, log, step)
    start = None if first is None else first.analysis.logs[log]
    before_step = np.empty(0) if first is None else first.analysis.own_step(log, first.step)
    facts = evidence.facts
    kept: dict[int, _Kept] = {}
    for arrays, residuals in residual_chunks(evidence, step, "drawing the channels"):
        rows = slice(arrays["begin"], arrays["end"])
        t = arrays["t"][rows]
        without = {key: _imufit.evaluate(evidence.raw, arrays, step + each) for key, each in full.items()}
        earlier = None if start is None else _imufit.evaluate(start.raw, arrays, before_step)
        for index, residual in enumerate(residuals):
            if residual is None:
                continue
            measured = arrays[list(SENSOR_NAMES)[index // 3]][rows, index % 3]
            series = [measured, residual]
            if earlier is not None:
                series.append(_or_nan(earlier[index], t.size))
            # A step by the parameter itself takes the effect's columns times the parameter from the residual.
            parts = [residual - _or_nan(each[index], t.size) for each in without.values()]
            kept.setdefault(index, _Kept(facts.t_start, facts.t_end)).add(t, series, parts)
    out = []
    for index, rows_kept in sorted(kept.items()):
        t, drawn, shares = rows_kept.lines(facts.sensor_dt[index // 3])
        if not t.size:
            continue
        moved = {
            key: part for key, part in zip(full, shares, strict=True) if np.nanmax(np.abs(part), initial=0.0) > 0.0
        }
        out.append(
            ResidualTrace(
                channel=CHANNELS[index],
                unit=UNITS[CHANNELS[index][:3]],
                t=t,
                measured=drawn[0],
                residual=drawn[1],
                before=drawn[2] if first is not None else None,
                parts=moved,
                noise_floor=evidence.floors[index],
                model=held.name,
                first_model="" if first is None else first.name,
            )
        )
    return tuple(out)


def _or_nan(values: Array | None, n: int) -> Array:
    return np.full(n, np.nan) if values is None else values


def _full_steps(held: Held, log: int, step: Array) -> dict[str, Array]:
    """Return for each effect of the model a step of its parameters by their own values."""
    analysis = held.analysis
    out: dict[str, Array] = {}
    for key, places in analysis.logs[log].places.items():
        if key in held.effects:
            at = analysis.own[log].get(key) or list(analysis.model.parameters.get(key, {}).values())
            out[key] = np.zeros_like(step)
            out[key][places] = step[places] + (np.asarray(at) if at else 0.0)
    return out


class _Kept:
    """Rows of one channel with the extremes of every stretch, chunk by chunk."""

    def __init__(self, begin: float, end: float) -> None:
        self._begin, self._width = begin, max(end - begin, np.finfo(float).tiny) / STRETCHES
        self._rows: list[Array] = []
        self._watched = 0

    def add(self, t: Array, series: Sequence[Array], parts: Sequence[Array]) -> None:
        """Take the rows of a chunk: those of `series` decide which of them stay."""
        if not t.size:
            return
        self._watched = len(series)
        self._rows.append(self._thinned(np.stack([t, *series, *parts])))

    def _thinned(self, rows: Array) -> Array:
        stretch = stretches_of(rows[0], self._begin, self._begin + STRETCHES * self._width, STRETCHES)
        return rows.take(extreme_rows(stretch, list(rows[1 : 1 + self._watched])), axis=1)

    def lines(self, usual: float) -> tuple[Array, Array, Array]:
        """Return times, series and parts; a row of NaN stands in each gap.

        Parameters
        ----------
        usual : float
            Median step between samples, s.
        """
        # A stretch that a chunk's end cuts has extremes of both of its sides.
        rows = self._thinned(np.concatenate(self._rows, axis=1))
        steps = np.diff(rows[0])
        gaps = np.flatnonzero(is_gap(steps, usual) & (steps > 2.0 * self._width))
        broken = np.insert(rows, gaps + 1, np.nan, axis=1)
        broken[0, gaps + 1 + np.arange(gaps.size)] = 0.5 * (rows[0, gaps] + rows[0, gaps + 1])
        return broken[0], broken[1 : 1 + self._watched], broken[1 + self._watched :]
