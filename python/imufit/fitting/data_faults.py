"""Faults of the data of a log, looked for in passes over it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from imufit import _imufit
from imufit.faults import ClippedRows, frame_faults, reference_faults
from imufit.faults.copied import copied_faults
from imufit.faults.own_length import own_length_faults
from imufit.faults.rig_angle import rig_angle_faults
from imufit.faults.samples import samples, windows
from imufit.faults.wrapped import wrapped_faults
from imufit.fitting.passes import Passes
from imufit.fitting.rest_passes import RestPasses
from imufit.log import LogSource
from imufit.results import DataFault


def data_faults(passes: Passes, facts: _imufit.Facts, ends: Mapping[str, float]) -> tuple[DataFault, ...]:
    """Name what is wrong with the data of a log: rows, clipped readings, units, frames, a late reference.

    Parameters
    ----------
    passes : Passes
        Over the log.
    facts : Facts
        Of the log as declared.
    ends : mapping
        End of the range of each sensor that may have one.
    """
    if isinstance(passes, RestPasses):
        return tuple(passes.row_faults)
    told = passes.log.metadata.ranges
    clipped = ClippedRows(ends, [sensor for sensor in ends if sensor in told])

    def counted() -> Iterator[dict[str, Any]]:
        for chunk in passes.chunks(facts.margin, "looking for faults of the data"):
            clipped.add(chunk)
            yield chunk

    parts = windows(counted(), facts)
    faults = rig_angle_faults(passes.log, facts)
    if parts and not faults:
        rows = samples(parts, facts)
        faults = own_length_faults(rows, facts) + copied_faults(rows, facts)
    if not faults:
        faults = frame_faults(parts, facts, passes.log.metadata, passes.log.origin)
    if not faults:
        faults = wrapped_faults(parts, facts)
    if not any(fault.sensor in ("gyr", "ref", None) for fault in faults):
        # Rates that another way of reading the log explains need no other reference.
        faults += reference_faults(passes.chunks(0, "looking at the reference"), parts, facts, passes.log.path)
    return (*faults, *passes.row_faults, *clipped.faults(), *_packets(passes.log, facts))


def _packets(log: LogSource, facts: _imufit.Facts) -> tuple[DataFault, ...]:
    """Name stamps of the reference that come in packets; the compiled module has spread them."""
    size = facts.reference_packet
    if size == 1:
        return ()
    evidence = (
        f"The samples of the reference come in packets of {size} with nearly the same time: their times are those of "
        "arrival, not of sampling. They are spread evenly here."
    )
    remedy = "Let the reference stamp its samples."
    return (DataFault("packets", "ref", None, facts.t_start, facts.t_end, log.n, evidence, remedy),)
