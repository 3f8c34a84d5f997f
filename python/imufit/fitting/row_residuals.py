"""Residuals row by row: what the readings of a log are above what a model makes of its reference."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.errors import InputError
from imufit.fitting.log_evidence import LogEvidence
from imufit.fitting.passes import CHANNELS
from imufit.log import Chunk

Array = NDArray[np.float64]


def residual_chunks(
    evidence: LogEvidence, step: Array, label: str
) -> Iterator[tuple[dict[str, Any], list[Array | None]]]:
    """Yield chunks of a log as the compiled core takes them, each with the residual of the nine channels.

    Parameters
    ----------
    evidence : LogEvidence
        Evidence of the log.
    step : ndarray
        (p,) step of every parameter of the evidence, SI units.
    label : str
        Text of the progress report.
    """
    for arrays in evidence.passes.chunks(evidence.passes.margin(evidence.facts), label):
        yield arrays, _imufit.evaluate(evidence.raw, arrays, step)


def row_residuals(evidence: LogEvidence, step: Array) -> dict[str, Array]:
    """Return measured minus modelled, (n, 3) of each sensor, in the rows of the log; NaN where nothing is judged.

    Parameters
    ----------
    evidence : LogEvidence
        Evidence of the log.
    step : ndarray
        (p,) step of every parameter of the evidence, SI units.

    Raises
    ------
    InputError
        The log has no reference, so that no row has a model.
    """
    log = evidence.surveyed.log
    check_reference(evidence)
    out: dict[str, Array] = {}
    for arrays, residuals in residual_chunks(evidence, step, "taking residuals"):
        rows = slice(arrays["offset"] + arrays["begin"], arrays["offset"] + arrays["end"])
        for channel, values in enumerate(residuals):
            if values is not None:
                sensor = CHANNELS[channel][:3]
                out.setdefault(sensor, np.full((log.n, 3), np.nan))[rows, channel % 3] = values
    return out


def check_reference(evidence: LogEvidence) -> None:
    """Refuse evidence of rests, which has no residual of a row.

    Parameters
    ----------
    evidence : LogEvidence
        Evidence of the log.

    Raises
    ------
    InputError
        The log has no reference, so that no row has a model.
    """
    if evidence.at_rest:
        raise InputError(
            "the log has no reference attitude, from which the readings of its rows would follow",
            file=evidence.surveyed.log.path,
            remedy="Add a reference (ref_qw ref_qx ref_qy ref_qz); rests are judged by their means alone.",
        )


def residuals_of_chunk(evidence: LogEvidence, step: Array, chunk: Chunk) -> dict[str, Array]:
    """Return measured minus modelled of any chunk of a log, also where the evidence is of an excerpt of the log.

    Parameters
    ----------
    evidence : LogEvidence
        Evidence of the log, which has a reference.
    step : ndarray
        (p,) step of every parameter of the evidence, SI units.
    chunk : Chunk
        Rows of the log with as many rows more on either side as `Passes.margin` states.

    Returns
    -------
    dict of str to ndarray
        Each of the nine channels that is judged, (n,) of the core rows, SI units; NaN where no reference is around.
    """
    residuals = _imufit.evaluate(evidence.raw, evidence.passes.arrays_of(chunk), step)
    return {name: values for name, values in zip(CHANNELS, residuals, strict=True) if values is not None}
