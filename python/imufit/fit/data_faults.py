"""Faults of the data of a log, looked for in passes over it."""

from __future__ import annotations

from imufit import _imufit
from imufit.faults import frame_faults
from imufit.faults.samples import windows
from imufit.fit.passes import Passes
from imufit.results import DataFault


def data_faults(passes: Passes, facts: _imufit.Facts) -> tuple[DataFault, ...]:
    """Name what is wrong with the data of a log.

    Parameters
    ----------
    passes : Passes
        Over the log.
    facts : Facts
        Of the log as declared.
    """
    parts = windows(passes.chunks(facts.margin, "looking for faults of the data"), facts)
    return tuple(frame_faults(parts, facts, passes.log.metadata))
