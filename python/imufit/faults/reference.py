"""Everything that is asked of the reference as an instrument, in the order in which the answers are certain."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from imufit import _imufit
from imufit.faults.idle_reference import idle_faults
from imufit.faults.late import late_faults
from imufit.faults.own_filter import own_filter_faults
from imufit.faults.smoothed import smoothed_faults
from imufit.faults.turning import Turning
from imufit.results.data_fault import DataFault

Part = Mapping[str, Any]


def reference_faults(
    chunks: Iterable[Part], parts: Sequence[Part], facts: _imufit.Facts, path: Path | None
) -> list[DataFault]:
    """Name what is wrong with the reference of a log whose axes and units are right; one fault at most.

    Parameters
    ----------
    chunks : iterable of dict
        The log as the compiled core takes it.
    parts : sequence of dict
        Windows of the log, see `imufit.faults.samples.windows`.
    facts : Facts
        Of the log as declared.
    path : Path or None
        File of the log, for the remedy.
    """
    turning = Turning.of(chunks) if parts and "gyr" in facts.sensors else None
    if turning is None:
        return []
    return (
        idle_faults(turning, facts)
        or own_filter_faults(turning, facts)
        or late_faults(turning, parts, facts, path)
        or smoothed_faults(turning, facts)
    )
