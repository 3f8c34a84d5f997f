"""The methods of a replay beside each other: figures of merit of the tilt that each makes of the log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from imufit.log import Log
from imufit.replaying.figures_of_merit import SETTLING_REST, figures_of_merit, noise_band
from imufit.replaying.stretches import Stretches, find_stretches
from imufit.replaying.tilt_error import TiltReference
from imufit.results.tilt import TiltComparison, TiltFigures

Array = NDArray[np.float64]


def tilt_errors(
    log: Log, attitude: Mapping[str, Array], needs: Mapping[str, Sequence[str]]
) -> tuple[TiltReference, dict[str, Array | None]] | None:
    """Error of each method's tilt, row by row.

    Parameters
    ----------
    log : Log
        n rows.
    attitude : mapping of (n, 4) arrays
        Per method, scalar first; NaN before the start.
    needs : mapping
        Sensors that each method uses.

    Returns
    -------
    TiltReference
        What the errors are about.
    dict of (n, k) arrays or None
        rad; None for a method that does not show this angle.
    None
        Instead of both, for a log without a reference attitude.
    """
    reference = TiltReference.of(log)
    if reference is None:
        return None
    errors: dict[str, Array | None] = {}
    for name, q in attitude.items():
        blind = reference.kind == "heading" and not {"gyr", "mag"} & set(needs[name])
        errors[name] = None if blind else reference.error(q, bounded=_bounded(reference, needs[name]))
    return reference, errors


def _bounded(reference: TiltReference, needs: Sequence[str]) -> bool:
    """Whether a method holds on to what keeps its error from growing: gravity, or for a heading the field."""
    return ("mag" if reference.kind == "heading" else "acc") in needs


def compare_tilt(
    log: Log,
    attitude: Mapping[str, Array],
    needs: Mapping[str, Sequence[str]],
    counted: NDArray[np.bool_] | None = None,
    band_deg: float = 0.1,
) -> TiltComparison | None:
    """Compare methods by their tilt; None for a log without a reference attitude.

    Parameters
    ----------
    log : Log
        n rows.
    attitude : mapping of (n, 4) arrays
        Per method, scalar first; NaN before the start.
    needs : mapping
        Sensors that each method uses.
    counted : (n,) array of bool, optional
        Rows for RMSE and offset.
    band_deg : float
        Half width of the band of the settling time, deg.

    Raises
    ------
    ValueError
        The band is not positive.
    """
    if not (np.isfinite(band_deg) and band_deg > 0.0):
        raise ValueError(f"the band is {band_deg} deg: give a positive number, such as 0.1")
    found = tilt_errors(log, attitude, needs)
    if found is None or log.ref_q is None:
        return None
    reference, errors = found
    stretches = find_stretches(log.t, log.ref_q, log.acc)
    by_force = None if log.acc is None or not stretches.vibrations else reference.error_of_force(log.acc)
    methods = {
        name: None
        if error is None
        else figures_of_merit(
            log.t, error, stretches, counted, band_deg, by_force, bounded=_bounded(reference, needs[name])
        )
        for name, error in errors.items()
    }
    return TiltComparison(
        kind=reference.kind,
        axis=reference.axis,
        methods=methods,
        rests=len(stretches.rests),
        moves=len(stretches.moves),
        vibrations=len(stretches.vibrations),
        rest_s=float(sum(log.t[rest.stop - 1] - log.t[rest.start] for rest in stretches.rests)),
        band_deg=float(band_deg),
        noise_band_hz=noise_band(log.t[log.has_reference]),
        notes=tuple(_notes(reference, stretches, methods)),
    )


def _notes(reference: TiltReference, stretches: Stretches, methods: Mapping[str, TiltFigures | None]) -> list[str]:
    notes = []
    if not any(methods.values()) and reference.kind != "heading":
        return [
            "No row counts: none has both an estimate and a reference, with movement = 1 where the log has that column."
        ]
    if reference.kind == "heading":
        blind = [name for name, figures in methods.items() if figures is None]
        notes.append(
            f"The rig turns about body {reference.axis}, which is vertical: gravity does not show this angle"
            + (f", so {' and '.join(blind)} cannot be judged." if blind else ".")
        )
    if not stretches.rests:
        notes.append(
            "The reference never rests: no SD at rest, no noise density; the drift is the median slope of its minutes."
        )
    elif stretches.moves and not any(figures.settling_moves for figures in methods.values() if figures is not None):
        notes.append(f"No move is followed by {SETTLING_REST:g} s of rest: no settling time.")
    unfinished = [
        f"{name} after {figures.settling_unfinished} of {figures.settling_moves}"
        for name, figures in methods.items()
        if figures is not None and figures.settling_unfinished
    ]
    if unfinished:
        notes.append(f"Some rests are too short to see the angle settle ({', '.join(unfinished)} moves): lower bounds.")
    return notes
