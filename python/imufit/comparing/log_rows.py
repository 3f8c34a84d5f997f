"""Rows of a log that a report shows: the channels over time, the measured field, and the noise at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from imufit.allan_deviation import allan
from imufit.comparing.compare import compare_held, held_model
from imufit.comparing.noise_budget import noise_budget
from imufit.comparing.traces import Held, traces
from imufit.errors import InputError
from imufit.log import Log
from imufit.log.several import name_of
from imufit.progress import Progress, silent
from imufit.rests.poses import find_poses
from imufit.results.log_rows import LogRows

if TYPE_CHECKING:
    from imufit.allan_deviation import Allan
    from imufit.fitting import FittedStack
    from imufit.log import LogSource
    from imufit.model import EffectStack
    from imufit.results import Comparison

FIELD_POINTS: Final = 400
"""Readings of the field that a figure of 400 pixels keeps apart."""
LEAST_REST: Final = 20.0
"""Length of a rest that a curve of three decades takes at 50 Hz, s."""
_BLOCK: Final = 16384


def rows_of_fit(
    fit: FittedStack, first: FittedStack | None = None, candidate: str | None = None, progress: Progress = silent
) -> LogRows:
    """Return the rows of the worst log of a fit.

    Parameters
    ----------
    fit : FittedStack
        The model.
    first : FittedStack, optional
        Another model of the same logs, whose residual stands beside.
    candidate : str, optional
        Effect of the catalogue. The residual is then that with the effect added, as the evidence predicts, and the
        fit's own stands beside.
    progress : callable
        Called with (rows done, rows in all, what is being done).
    """
    held: Held | None = Held.of_fit(fit)
    other = None if first is None else Held.of_fit(first)
    if candidate is not None and (added := Held.with_candidate(fit, candidate)) is not None:
        held, other = added, held
    assert held is not None
    log = (first or fit).worst
    return _rows(held, other, log, fit.logs[log], progress)


def compare_with_rows(model: EffectStack, log: LogSource, progress: Progress = silent) -> tuple[Comparison, LogRows]:
    """Compare a model with a log, its parameters as they are, and return the rows of the log besides.

    Parameters
    ----------
    model : EffectStack
        The model.
    log : Log or LogStream
        With reference attitude.
    progress : callable
        Called with (rows done, rows in all, what is being done).
    """
    held = held_model(model, log, progress)
    return compare_held(held, model, progress), _rows(held, None, 0, log, progress)


def _rows(held: Held, first: Held | None, number: int, log: LogSource, progress: Progress) -> LogRows:
    rests = _rests(log) if held.analysis.logs[number].at_rest else ()
    logs = held.analysis.logs
    return LogRows(
        traces=traces(held, first, number),
        field=_field(log),
        rests=rests,
        noise=noise_budget(held.analysis),
        allan=_allan(log, progress),
        log=name_of(log, number) if len(logs) > 1 else "",
    )


def _rests(log: LogSource) -> tuple[tuple[str, NDArray[np.float64]], ...]:
    """Return the name and the mean specific force of each rest of a log in memory."""
    if not isinstance(log, Log) or log.acc is None:
        return ()
    found = find_poses(log, labelled_only=False)
    return tuple((pose.name, pose.mean) for pose in found.poses if pose.used)


def _field(log: LogSource) -> NDArray[np.float64] | None:
    """Return readings of the magnetometer spread over the log."""
    step = max(1, log.n // (4 * FIELD_POINTS))
    kept = [chunk.core.mag[::step] for chunk in log.chunks(_BLOCK) if chunk.core.mag is not None]
    if not kept:
        return None
    points = np.concatenate(kept)
    points = points[np.isfinite(points).all(axis=1)]
    return points[:: max(1, -(-len(points) // FIELD_POINTS))] if len(points) else None


def _allan(log: LogSource, progress: Progress) -> Allan | None:
    """Return the Allan deviation of a log in memory, where a rest is long enough."""
    if not isinstance(log, Log):
        return None
    try:
        found = allan(log, progress=progress)
    except InputError:
        return None
    return found if found.duration >= LEAST_REST else None
