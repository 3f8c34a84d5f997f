"""The function of a user's effect as the compiled core asks for it: values, derivatives, trial values, the past."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.model.search_range import SearchRange
from imufit.model.window import TEMPERATURE, Window

Array = NDArray[np.float64]
Function = Callable[..., Any]

PER_ROW = ("omega", "alpha", "f", "m", "x")
"""Ideal readings of a window."""


@dataclass(frozen=True, eq=False)
class UserFunction:
    """A user's function of a window and parameters, and what its effect declares of it.

    Attributes
    ----------
    effect : str
        Id of the effect.
    function : callable
        Takes a `Window` and the parameters by name; returns (n, 3) or (n,) of what the effect adds to the reading.
    parameters : tuple of str
        Names of all parameters.
    sizes : tuple of float
        Size of each parameter that its column is taken with, in its unit.
    searched : mapping of str to SearchRange
        Parameters that the value is not linear in.
    memory : float
        How long before a row others decide what is added to it, s; infinite for the whole log before, 0 for none.
    axes : str
        Axes that a value of shape (n,) is added to.
    counted_from_mean : set of str
        Columns that the function has requested less their mean.
    """

    effect: str
    function: Function
    parameters: tuple[str, ...]
    sizes: tuple[float, ...]
    searched: Mapping[str, SearchRange]
    memory: float
    axes: str
    counted_from_mean: set[str] = field(default_factory=set)
    _watched: list[tuple[Window, int]] = field(default_factory=list)

    @property
    def centred(self) -> list[str]:
        """Columns that the function has requested less their mean, by name."""
        return sorted(self.counted_from_mean)

    def __call__(self, arrays: dict[str, Any], parameters: Sequence[float], asked: str) -> Array:
        """Columns ``(n, 3, p)`` of a model or a candidate, or the value ``(n, 3, 1)`` that is ``added``."""
        history = arrays.pop("history")
        window = self._window(arrays)
        if self._watched and len(window.t) > len(self._watched[0][0].t):
            self._watched[:] = [(window, history)]
        named = dict(zip(self.parameters, map(float, parameters), strict=True))
        at = {name: self.searched[name].known(v) if name in self.searched else v for name, v in named.items()}
        out = np.empty((len(window.t) - history, 3, 1 if asked == "added" else len(at)))
        if asked == "added" and not any(named.values()):
            out[:] = 0.0
            return out
        for part, first, rows in self._parts(window, history):
            if asked == "added":
                out[rows, :, 0] = self.value(part, at)[first:]
            elif asked == "candidate":
                out[rows] = self._candidate(part, at)[first:]
            else:
                out[rows] = self.columns(part, at)[first:]
        return out

    @contextmanager
    def watched(self) -> Iterator[list[tuple[Window, int]]]:
        """Keep the longest window that is asked about within the context, and how many of its rows are of the past."""
        self._watched.append((_NOTHING, 0))
        try:
            yield self._watched
        finally:
            self._watched.clear()

    def value(self, window: Window, at: Mapping[str, float]) -> Array:
        """Return what the effect adds to the reading, (n, 3), at parameters by name.

        Raises
        ------
        InputError
            The function returned another shape.
        """
        n = len(window.t)
        try:
            given = np.asarray(self.function(window, **at), dtype=np.float64)
        except ValueError:
            # Perhaps because the arrays are read-only.
            if (changed := self._changed(window, at)) is None:
                raise
            raise InputError(
                f"effect {self.effect} changes {changed} of its window", remedy="Let the function work on a copy."
            ) from None
        if given.shape == (n, 3):
            return given
        if given.shape != (n,):
            raise InputError(
                f"effect {self.effect} returned shape {given.shape} for {n} rows",
                remedy=f"Return what it adds to the reading as ({n}, 3), or as ({n},) for the axes {self.axes}.",
            )
        return np.outer(given, [float(axis in self.axes) for axis in "xyz"])

    def _changed(self, window: Window, at: Mapping[str, float]) -> str | None:
        """Return the array of a window that the function changes; None if it changes none."""
        copy = _copied(window)
        with suppress(Exception):
            self.function(copy, **at)
        pairs = [(name, getattr(window, name), getattr(copy, name)) for name in ("t", *PER_ROW)]
        pairs += [(f"column {name}", values, copy.columns[name]) for name, values in window.columns.items()]
        return next((name for name, a, b in pairs if not np.array_equal(a, b, equal_nan=True)), None)

    def columns(self, window: Window, at: Mapping[str, float]) -> Array:
        """Return d value / d parameter, (n, 3, p): exact where the value is linear, else by central differences."""
        still = {name: (value if name in self.searched else 0.0) for name, value in at.items()}
        out = np.zeros((len(window.t), 3, len(at)))
        for k, (name, size) in enumerate(zip(self.parameters, self.sizes, strict=True)):
            if name not in self.searched:
                out[:, :, k] = self.value(window, {**still, name: size}) / size
            elif (sides := self.searched[name].beside(at[name])) is not None:
                low, high = sides
                above, below = (self.value(window, {**at, name: side}) for side in (high, low))
                out[:, :, k] = (above - below) / (high - low)
        return out

    def _candidate(self, window: Window, trial: Mapping[str, float]) -> Array:
        """Columns of a candidate at trial values; without a linear parameter the value over the first parameter."""
        if len(self.searched) < len(self.parameters):
            return self.columns(window, trial)
        out = np.zeros((len(window.t), 3, len(trial)))
        first = trial[self.parameters[0]]
        out[:, :, 0] = self.value(window, trial) / first if first else 0.0
        return out

    def middle(self) -> dict[str, float]:
        """Parameters of their typical size, searched ones in the middle of their range."""
        sizes = dict(zip(self.parameters, self.sizes, strict=True))
        return {name: self.searched[name].middle if name in self.searched else size for name, size in sizes.items()}

    def trials(self, found: Sequence[float] | None, number: int) -> list[list[float]]:
        """Values of all parameters to try: a grid, then, around what was found best, finer ones.

        Parameters
        ----------
        found : sequence of float, optional
            What the grid before found best.
        number : int
            Number of grids made around a best value before this one.
        """
        at = dict(zip(self.parameters, found or [0.0] * len(self.parameters), strict=True))
        count = len(self.searched)
        if found is None:
            each = {name: span.grid(count) for name, span in self.searched.items()}
        else:
            each = {name: span.finer(at[name], number, count) for name, span in self.searched.items()}
            if all(len(values) < 2 for values in each.values()):
                return []
        return [
            [dict(zip(each, values, strict=True)).get(name, 0.0) for name in self.parameters]
            for values in product(*each.values())
        ]

    def _window(self, arrays: dict[str, Any]) -> Window:
        temperature, mean = arrays.pop("temperature"), arrays.pop("temperature_mean")
        columns, means = arrays.pop("columns"), arrays.pop("means")
        if temperature is not None:
            # A log without a temperature has no mean; what an effect depends on is asked with made-up ones.
            mean = mean if np.isfinite(mean) else 0.0
            columns, means = {TEMPERATURE: temperature + mean, **columns}, {TEMPERATURE: mean, **means}
        if self.memory > 0.0:
            # One gap of the reference would otherwise be carried on by whatever is summed up from the past.
            arrays |= {name: _bridged(arrays["t"], arrays[name]) for name in PER_ROW}
            columns = {name: _bridged(arrays["t"], values) for name, values in columns.items()}
        for values in (arrays["t"], *(arrays[name] for name in PER_ROW), *columns.values()):
            values.setflags(write=False)
        return Window(
            **arrays, columns=columns, means=means, effect=self.effect, counted_from_mean=self.counted_from_mean
        )

    def _parts(self, window: Window, history: int) -> Iterator[tuple[Window, int, slice]]:
        """Cut a window into parts with their past: each with its first row that is wanted, and where these rows go.

        The past of a part begins at a whole multiple of the memory since the log's start, so that a row sees the same
        past however the log is cut.
        """
        n = len(window.t)
        if not 0.0 < self.memory < math.inf:
            yield window, history, slice(0, n - history)
            return
        stretch = np.floor((window.t[history:] - window.t_start) / self.memory)
        edges = [0, *(np.flatnonzero(np.diff(stretch)) + 1).tolist(), n - history]
        for begin, end in pairwise(edges):
            past = window.t_start + (stretch[begin] - 1.0) * self.memory
            first = min(int(np.searchsorted(window.t, past)), history + begin)
            yield rows_of(window, first, history + end), history + begin - first, slice(begin, end)


def rows_of(window: Window, begin: int, end: int) -> Window:
    """Return some rows of a window."""
    cut = {name: getattr(window, name)[begin:end] for name in ("t", *PER_ROW)}
    return replace(window, **cut, columns={name: values[begin:end] for name, values in window.columns.items()})


def _copied(window: Window) -> Window:
    """Return a window whose arrays can be written to."""
    arrays = {name: getattr(window, name).copy() for name in ("t", *PER_ROW)}
    return replace(window, **arrays, columns={name: values.copy() for name, values in window.columns.items()})


def _bridged(t: Array, values: Array) -> Array:
    """Interpolate what is not known over time, (n,) or (n, k); what is known nowhere stays unknown."""
    if np.isfinite(values).all():
        return values
    out = np.array(values)
    for column in out.T if out.ndim > 1 else [out]:
        known = np.isfinite(column)
        if known.any():
            column[~known] = np.interp(t[~known], t[known], column[known])
    return out


_NONE: Array = np.empty(0)
_NOTHING = Window(_NONE, 0.0, 0.0, _NONE, _NONE, _NONE, _NONE, _NONE, {}, {})
