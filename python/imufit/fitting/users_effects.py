"""A user's effect is tried on a few rows before anything is fitted: a broken one would spoil every answer."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.errors import InputError
from imufit.fitting.passes import CHUNK_ROWS, Passes, chunk_arrays
from imufit.model.effect import registered, written_as
from imufit.model.user_function import UserFunction, rows_of
from imufit.model.window import Window

TRIED_ROWS = 512
LATE = 0.9
"""Where an effect with memory is tried, in memories after the last whole one before the middle of the log: there its
past is nearly twice as long as the one that it declares, and the two can be compared."""
ROUNDING = 1e-9
"""Share of a value by which two ways to work it out may differ."""
FORGOTTEN = 0.01
"""Share of a value that rows before the memory may still decide: an exponential has come down to it after 4.6 time
constants."""


def check_users_effects(passes: Passes, facts: _imufit.Facts, ids: Iterable[str]) -> None:
    """Check those of the effects `ids` that a user wrote, on some rows of the log that have a reference.

    Raises
    ------
    InputError
        What an effect adds is not finite, has a wrong shape, depends on where the rows are cut or on rows before its
        memory, is not linear where that is declared, changes from call to call, or its function changes the window.
    Exception
        Whatever the user's function raises, unchanged.
    """
    own = registered()
    effects = [own[effect_id] for effect_id in ids if effect_id in own]
    by_memory: dict[float, list[_imufit.Effect]] = {}
    for effect in effects:
        by_memory.setdefault(effect.memory, []).append(effect)
    for memory, alike in by_memory.items():
        arrays = _tried(passes, facts, memory)
        if arrays is None:
            return
        for effect in alike:
            asked = written_as(effect.id)
            at = asked.middle()
            with asked.watched() as seen:
                effect.check(arrays, facts, [at[name] for name in asked.parameters])
                window, history = seen[0]
            _check_function(asked, window, at, history)


def _tried(passes: Passes, facts: _imufit.Facts, memory: float) -> dict[str, Any] | None:
    """Rows to try an effect on, with their margins; None for a log without a reference."""
    best, wanted = None, facts.t_start
    if memory > 0.0:
        half = 0.5 * (facts.t_end - facts.t_start)
        wanted += half if memory == math.inf else (max(2.0, half // memory) + LATE) * memory
    for chunk in passes.log.chunks(CHUNK_ROWS, passes.margin(facts)):
        arrays = chunk_arrays(chunk, passes.covariates)
        core = slice(arrays["begin"], arrays["end"])
        if arrays["ref_q"] is None:
            continue
        known = arrays["begin"] + np.flatnonzero(np.isfinite(arrays["ref_q"][core, 0]))
        if not known.size:
            continue
        late = known[arrays["t"][known] >= wanted]
        begin = int(late[0] if late.size else max(known[0], known[-1] - TRIED_ROWS))
        best = {**arrays, "begin": begin, "end": min(begin + TRIED_ROWS, arrays["end"])}
        if late.size:
            break
    return best


def _check_function(asked: UserFunction, window: Window, at: Mapping[str, float], history: int) -> None:
    """Hold what a function returns against what its effect declares of it."""
    value = asked.value(window, at)
    size = float(np.nanmax(np.abs(value), initial=0.0))

    def differ(other: NDArray[np.float64], of: NDArray[np.float64], allowed: float) -> bool:
        return bool(np.any(np.abs(other - of) > allowed * size))

    def refuse(problem: str, remedy: str) -> InputError:
        return InputError(f"effect {asked.effect} {problem}", remedy=remedy)

    if not np.array_equal(asked.value(window, at), value, equal_nan=True):
        raise refuse(
            "returns another value when called again with the same window and parameters",
            "Keep no state between calls, and draw no random numbers.",
        )
    linear = [name for name in asked.parameters if name not in asked.searched]
    if linear:
        twice = {name: (-2.0 if name in linear else 1.0) * v for name, v in at.items()}
        alone = sum(
            (asked.value(window, {name: at[name] if name in {key, *asked.searched} else 0.0 for name in at}))
            for key in linear
        )
        if differ(asked.value(window, twice), -2.0 * value, ROUNDING) or differ(np.asarray(alone), value, ROUNDING):
            raise refuse(
                f"is not linear in {' and '.join(linear)}",
                f'Name those that it is not linear in with a range: search={{"{linear[-1]}": (low, high)}}.',
            )
    if 0.0 < asked.memory < math.inf:
        begin = int(np.searchsorted(window.t, window.t[history] - asked.memory))
        short = asked.value(rows_of(window, begin, len(window.t)), at)[history - begin :]
        if differ(short, value[history:], FORGOTTEN):
            raise refuse(
                f"depends on rows more than its memory of {asked.memory:g} s before",
                'Declare a longer memory, or memory="log" for all rows since the start.',
            )
