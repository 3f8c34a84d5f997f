"""Two recordings of one motion, on two clocks, become one log."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.joining.course import Course, reference_course
from imufit.joining.gravity import mounted
from imufit.joining.joined import Joined
from imufit.joining.likeliest import Placed, likeliest, placed
from imufit.joining.mount import SMALL, nearest_square_turn, turned
from imufit.joining.refine import Aligned, refine
from imufit.joining.search import LEAST_OVERLAP, Correlation
from imufit.log import Log

Array = NDArray[np.float64]

TOUCHING: Final = 1e-6
"""Samples of the reference this near to a row of the sensor stand in that row, s."""


def join(log: Log, reference: Log, lag: float | None = None, skew: float | None = None) -> Joined:
    """Put the reference of one recording beside the sensor of another.

    The lag between the clocks is found by correlating the angular rates over all of both recordings, in whatever way
    the sensor is mounted; then lag, skew and mount are refined on the attitude. The joined log has every row of the
    sensor, with the reference filled in between its samples (``ref_exact`` 0), and a row for every sample of the
    reference (``ref_exact`` 1). Gaps of the reference stay open.

    Parameters
    ----------
    log : Log
        With a gyroscope.
    reference : Log
        With a reference attitude `ref_q` of a body on which the sensor is fixed, on any clock.
    lag : float, optional
        Time by which the reference's stamps are late at its first sample, s, where it is known: the reference's clock
        less the sensor's. Found if None.
    skew : float, optional
        Rate of the reference's clock over the sensor's, less one, where it is known.

    Returns
    -------
    Joined

    Raises
    ------
    InputError
        A recording lacks what is needed, the rates have nothing in common, or several lags explain them equally well.
    """
    sensor, body, rows = _courses(log, reference)
    if min(float(course.t[-1] - course.t[0]) for course in (sensor, body)) < LEAST_OVERLAP:
        raise _apart(reference)
    rates = Correlation(sensor, body, skew)
    if lag is None:
        best, rival = _only_one(sensor, body, rates, skew, (log, reference))
    else:
        refined = refine(sensor, body, replace(rates.at(lag), lag=lag), skew is not None, lag_known=True)
        if refined is None:
            raise _apart(reference)
        best, rival = placed(sensor, body, rates, refined), 0.0
    aligned, traces = best.aligned, best.traces
    found = mounted(best.common, aligned, log, reference, rows)
    square, left = nearest_square_turn(found.matrix)
    mount = square if left < SMALL else found.matrix
    return Joined(
        log=_joined(log, reference, rows, aligned, mount),
        lag=aligned.lag,
        lag_error=aligned.lag_error,
        skew=aligned.skew,
        skew_error=aligned.skew_error,
        mount=mount,
        mount_error=found.error,
        by_gravity=found.by_gravity,
        left=left,
        correlation=traces.correlation,
        overlap=traces.overlap,
        attitude_error=aligned.attitude_error,
        rival=rival,
        traces=traces,
    )


def _courses(log: Log, reference: Log) -> tuple[Course, Course, NDArray[np.intp]]:
    if log.gyr is None or not np.isfinite(log.gyr).all(axis=1).sum() > 1:
        raise InputError(
            "the log has no gyroscope, and only its rates show when the reference turned",
            file=log.path or "log",
            column="gyr_x",
            remedy="Record the gyroscope too, or name its columns with --map.",
        )
    if reference.ref_q is None or not reference.has_reference.sum() > 1:
        raise InputError(
            "the file has no reference attitude",
            file=reference.path or "reference",
            column="ref_qw",
            remedy="Name its columns, e.g. --reference-map ref_qw=w.",
        )
    rows = np.flatnonzero(reference.has_reference)
    rows = rows[np.concatenate(([True], np.diff(reference.t[rows]) > 0.0))]
    return Course.of(log.t, log.gyr), reference_course(reference.t[rows], reference.ref_q[rows]), rows


def _only_one(
    sensor: Course, body: Course, rates: Correlation, skew: float | None, logs: tuple[Log, Log]
) -> tuple[Placed, float]:
    """Return the likeliest alignment and its rival, as in `Joined`; refuse one that is not the only one."""
    found = likeliest(sensor, body, rates, skew)
    if found is None:
        raise _apart(logs[1])
    best, second = found.best, found.second
    if found.unrelated:
        raise _unrelated(best.traces.correlation, *logs)
    if second is not None and found.ambiguous:
        raise InputError(
            f"the lag is ambiguous: {best.aligned.lag:.3f} s and {second.aligned.lag:.3f} s make the rates agree "
            f"equally well (correlation {best.traces.correlation:.3f} and {second.traces.correlation:.3f})",
            file=logs[0].path or "log",
            remedy="Move the sensor once as at no other time, or give the lag with --lag.",
        )
    return best, found.rival


def _apart(reference: Log) -> InputError:
    return InputError(
        "the recordings have no few seconds of motion in common that no gap interrupts",
        file=reference.path or "reference",
        remedy="Record sensor and reference at the same time, and turn the sensor.",
    )


def _unrelated(correlation: float, log: Log, reference: Log) -> InputError:
    return InputError(
        f"the rates of the sensor and of {reference.path or 'the reference'} are not those of one motion: "
        f"their correlation is {correlation:.2f}",
        file=log.path or "log",
        remedy="Are they of the same recording, and is the attitude that of the body in the reference frame?",
    )


def _joined(log: Log, reference: Log, rows: NDArray[np.intp], aligned: Aligned, mount: Array) -> Log:
    """Lay the rows of both in the order of the sensor's clock."""
    assert reference.ref_q is not None
    t_ref = aligned.on_sensor_clock(reference.t[rows], float(reference.t[rows[0]]))
    q_ref = turned(reference.ref_q[rows], mount)
    within = (t_ref >= log.t[0]) & (t_ref <= log.t[-1])
    course = reference_course(t_ref, q_ref)
    between = course.seen(log.t, log.t)
    at = np.where(between[:, None], course.at(log.t), np.nan)
    nearest = np.clip(np.searchsorted(log.t, t_ref), 1, log.n - 1)
    nearest -= np.abs(t_ref - log.t[nearest - 1]) < np.abs(t_ref - log.t[nearest])
    touching = np.abs(t_ref - log.t[nearest]) <= TOUCHING
    exact = np.zeros(log.n)
    exact[nearest[touching]] = 1.0
    at[nearest[touching]] = q_ref[touching]
    own = np.flatnonzero(within & ~touching)
    t = np.concatenate((log.t, t_ref[own]))
    order = np.argsort(t, kind="stable")

    def laid(values: Array | None, more: Array | None = None) -> Array | None:
        if values is None:
            return None
        added = np.full((len(own), *values.shape[1:]), np.nan) if more is None else more
        return np.asarray(np.concatenate((values, added))[order])

    position = None
    if reference.ref_p is not None:
        p_ref = reference.ref_p[rows]
        filled = np.stack([np.interp(log.t, t_ref, p_ref[:, k]) for k in range(3)], axis=1)
        filled[~between] = np.nan
        filled[nearest[touching]] = p_ref[touching]
        position = laid(filled, p_ref[own])
    labels = {
        name: np.concatenate((cells, np.full(len(own), "", dtype=object)))[order] for name, cells in log.labels.items()
    }
    covariates = {name: laid(values) for name, values in log.covariates.items()}
    metadata = replace(
        log.metadata,
        frame=reference.metadata.frame,
        extra={**log.metadata.extra, "lag": aligned.lag, "skew": aligned.skew, "mount": mount.tolist()},
    )
    return Log(
        t=np.asarray(t[order]),
        acc=laid(log.acc),
        gyr=laid(log.gyr),
        mag=laid(log.mag),
        temp=laid(log.temp),
        ref_q=laid(at, q_ref[own]),
        ref_p=position,
        pose=None if log.pose is None else np.concatenate((log.pose, np.full(len(own), "", dtype=object)))[order],
        covariates={name: values for name, values in covariates.items() if values is not None}
        | {"ref_exact": np.asarray(laid(exact, np.ones(len(own))))},
        labels=labels,
        metadata=metadata,
        notes=log.notes,
    )
