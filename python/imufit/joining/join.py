"""Two recordings of one motion, on two clocks, become one log."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from imufit.errors import InputError
from imufit.joining.by_force import likeliest_by_force
from imufit.joining.course import Course, Stretches, reference_course
from imufit.joining.forces import position_forces, sensor_forces
from imufit.joining.gravity import mean_force, mounted, upside_down, vertical
from imufit.joining.joined import Compared, Joined, RateTrace
from imufit.joining.likeliest import Likeliest, Placed, likeliest_of_all_widths, placed
from imufit.joining.mount import SMALL, nearest_square_turn, turned
from imufit.joining.refine import Aligned, refine
from imufit.joining.search import FASTER, Candidate, Correlation, comparable
from imufit.log import Log
from imufit.log.assemble import attitude_of_rig
from imufit.log.scalar_first import quaternions_from_rotation, rotation_from_quaternions
from imufit.remedy import REFERENCE_MAP, Remedy, mapped, option, reading, template, when_read

Array = NDArray[np.float64]

TOUCHING: Final = 1e-6
"""Samples of the reference this near to a row of the sensor stand in that row, s."""
LEAST_POSITIONS: Final = 60
"""Positions with which a search by force begins: two to a mean, thirty means."""
RIG_AXES: Final[tuple[Literal["x", "y", "z"], ...]] = ("x", "y", "z")


def join(log: Log, reference: Log, lag: float | None = None, skew: float | None = None) -> Joined:
    """Put the reference of one recording beside the sensor of another.

    The lag between the clocks is found by correlating the angular rates over all of both recordings, in whatever way
    the sensor is mounted; then lag, skew and mount are refined by the turns between samples. The joined log has every
    row of the sensor, with the reference filled in between its samples (``ref_exact`` 0), and a row for every sample of
    the reference (``ref_exact`` 1). Gaps of the reference stay open.

    Parameters
    ----------
    log : Log
        With a gyroscope; with an accelerometer, where the reference has positions alone.
    reference : Log
        Of a body on which the sensor is fixed, on any clock: with an attitude `ref_q`; or an angle `ref_angle` about an
        axis that need not be known; or positions `ref_p` alone, which are joined by the length of the specific force.
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
    if reference.ref_q is None and reference.ref_angle is not None:
        return _join_angle(log, reference, lag, skew)
    if reference.ref_q is None and reference.ref_p is not None:
        return _join_positions(log, reference, lag, skew)
    return _join_attitude(log, reference, lag, skew)


def _join_attitude(log: Log, reference: Log, lag: float | None, skew: float | None, by_gravity: bool = True) -> Joined:
    """Join an attitude; the mount is found by gravity too, unless the reference frame need not be level."""
    sensor, body, rows = _courses(log, reference)
    if not comparable(sensor, body):
        raise _apart(reference)
    rates = Correlation(sensor, body, skew)
    if lag is None:
        found, rival = _only_one(likeliest_of_all_widths(sensor, body, skew), (log, reference))
        best = placed(sensor, body, rates, found.aligned)
    else:
        refined = refine(sensor, body, replace(rates.at(lag), lag=lag), skew is not None, lag_known=True)
        if refined is None:
            raise _apart(reference)
        best, rival = placed(sensor, body, rates, refined), 0.0
    aligned = best.aligned
    assert best.common is not None
    by_both = mounted(best.common, aligned, log if by_gravity else log.with_fields(acc=None), reference, rows)
    square, left = nearest_square_turn(by_both.matrix)
    mount = square if left < SMALL else by_both.matrix
    joined = _result(_joined(log, reference, rows, aligned, mount), best, rival)
    return replace(joined, mount=mount, mount_error=by_both.error, by_gravity=by_both.by_gravity, left=left)


def _join_angle(log: Log, reference: Log, lag: float | None, skew: float | None) -> Joined:
    """Join an angle about an axis that is fixed in the sensor, and found by the rates; gravity levels the frame."""
    assert reference.ref_angle is not None
    turning = replace(reference, ref_q=attitude_of_rig(reference.ref_angle, "x"))
    found = _join_attitude(log, turning, lag, skew, by_gravity=False)
    assert found.mount is not None
    assert found.log.ref_q is not None
    # The body of the reference turns about its x axis; at angle 0 the sensor has the axes of the frame until levelled.
    axis = found.mount[:, 0]
    turns = Rotation.from_matrix(found.mount) * rotation_from_quaternions(found.log.ref_q)
    level = _levelling(found.log, turns)
    joined = _with_turns(found.log, turns if level is None else level * turns)
    along = int(np.argmax(np.abs(axis)))
    if abs(axis[along]) > 1.0 - 1e-9:
        rows = np.flatnonzero(np.isfinite(reference.ref_angle))
        aligned_t = reference.t[rows] - found.lag - found.skew * (reference.t[rows] - reference.t[rows[0]])
        angle = np.sign(axis[along]) * np.interp(joined.t, aligned_t, np.unwrap(reference.ref_angle[rows]))
        metadata = replace(joined.metadata, rig_axis=RIG_AXES[along])
        joined = replace(joined, ref_angle=np.where(joined.has_reference, angle, np.nan), metadata=metadata)
    return replace(found, log=joined, axis=axis, by_gravity=level is not None, upside_down=False)


def _with_turns(log: Log, turns: Rotation) -> Log:
    """Return the log with another attitude where it has one."""
    ref_q = quaternions_from_rotation(turns)
    ref_q[~log.has_reference] = np.nan
    return log.with_fields(ref_q=ref_q)


def _levelling(log: Log, turns: Rotation) -> Rotation | None:
    """Turn that takes the mean specific force upwards; None where its direction in the frame is not steady."""
    mean = mean_force(_with_turns(log, turns))
    if not np.isfinite(mean).all():
        return None
    return Rotation.align_vectors(vertical(log.metadata.frame)[None], mean[None])[0]


def _join_positions(log: Log, reference: Log, lag: float | None, skew: float | None) -> Joined:
    """Join positions without an attitude, by the length of the specific force."""
    if log.acc is None or not np.isfinite(log.acc).all(axis=1).sum() > 1:
        raise InputError(
            "the log has no accelerometer, and only the specific force shows when positions were accelerated",
            file=log.path or "log",
            column="acc_x",
            remedy="Record the accelerometer too, or name its columns, such as " + when_read(template("acc")) + ".",
        )
    assert reference.ref_p is not None
    rows = _ascending(reference, np.asarray(np.isfinite(reference.ref_p).all(axis=1)))
    if len(rows) < LEAST_POSITIONS:
        raise _apart(reference)
    t, p, sensor = reference.t[rows], reference.ref_p[rows], sensor_forces(log)
    near = None if lag is None else Candidate(lag, skew or 0.0, 0.0, np.eye(3))
    up = vertical(reference.metadata.frame)
    most = FASTER * float(np.nanmax(np.linalg.norm(log.acc, axis=1)))
    found, turned_over = (
        likeliest_by_force(sensor, position_forces(t, p, each, most), near, skew) for each in (up, -up)
    )
    likelier = turned_over is not None and (found is None or turned_over.best.traces.gain > found.best.traces.gain)
    if turned_over is not None and likelier and not (turned_over.unrelated or turned_over.ambiguous):
        raise InputError(
            f"the z axis of the positions points {'up' if up[2] < 0.0 else 'down'}, and frame "
            f"{reference.metadata.frame} has the opposite direction",
            file=reference.path or "reference",
            column="ref_pz",
            remedy="Name the frame: " + reading(reference.path, option("frame", "ENU" if up[2] < 0.0 else "NED")),
        )
    best, rival = _only_one(found, (log, reference))
    return _result(_joined(log, reference, rows, best.aligned, None), best, rival)


def _result(log: Log, best: Placed, rival: float) -> Joined:
    """Say what was found, without a mount."""
    aligned, traces = best.aligned, best.traces
    return Joined(
        log=log,
        lag=aligned.lag,
        lag_error=aligned.lag_error,
        skew=aligned.skew,
        skew_error=aligned.skew_error,
        mount=None,
        mount_error=float("inf"),
        by_gravity=False,
        left=0.0,
        correlation=traces.correlation,
        overlap=traces.overlap,
        attitude_error=aligned.attitude_error,
        rival=rival,
        traces=traces,
        upside_down=upside_down(log),
    )


def _ascending(reference: Log, there: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Rows that hold something, the later ones of one time left out."""
    rows = np.flatnonzero(there)
    return rows[np.concatenate(([True], np.diff(reference.t[rows]) > 0.0))] if len(rows) else rows


def _courses(log: Log, reference: Log) -> tuple[Course, Course, NDArray[np.intp]]:
    if log.gyr is None or not np.isfinite(log.gyr).all(axis=1).sum() > 1:
        raise InputError(
            "the log has no gyroscope, and only its rates show when the reference turned",
            file=log.path or "log",
            column="gyr_x",
            remedy="Record the gyroscope too, or name its columns, such as " + when_read(template("gyr")) + ".",
        )
    if reference.ref_q is None or not reference.has_reference.sum() > 1:
        raise InputError(
            "the file has no reference attitude",
            file=reference.path or "reference",
            column="ref_qw",
            remedy="Name its columns, e.g. "
            + reading(
                reference.path or "reference.csv",
                mapped({f"ref_q{part}": part for part in "wxyz"}, shell=REFERENCE_MAP),
            )
            + ".",
        )
    rows = _ascending(reference, reference.has_reference)
    return Course.of(log.t, log.gyr), reference_course(reference.t[rows], reference.ref_q[rows]), rows


def _only_one(found: Likeliest | None, logs: tuple[Log, Log]) -> tuple[Placed, float]:
    """Return the likeliest alignment and its rival, as in `Joined`; refuse one that is not the only one."""
    if found is None:
        raise _apart(logs[1])
    best, second = found.best, found.second
    if found.unrelated and best.traces.left > 0.5:
        raise _unrelated(best.traces, *logs)
    if second is not None and found.ambiguous:
        raise InputError(
            f"the lag is ambiguous: {best.aligned.lag:.3f} s and {second.aligned.lag:.3f} s make "
            f"{best.traces.compared.value} agree equally well "
            f"(correlation {best.traces.correlation:.3f} and {second.traces.correlation:.3f})",
            file=logs[0].path or "log",
            remedy="Move the sensor once as at no other time, or give the lag that is known: "
            + _with_lag(best)
            + " or "
            + _with_lag(second),
        )
    if found.unrelated:
        raise InputError(
            f"the motion that both recordings saw is too short or too uniform to determine the lag: correlation "
            f"{best.traces.correlation:.3f} over {best.traces.overlap:.1f} s",
            file=logs[0].path or "log",
            remedy="Move the sensor for longer, once as at no other time, or give the lag, in s, such as "
            + _with_lag(best),
        )
    return best, found.rival


def _with_lag(found: Placed) -> Remedy:
    """Name the option that states a lag, s, to the millisecond."""
    return option("lag", round(found.aligned.lag, 3))


def _apart(reference: Log) -> InputError:
    return InputError(
        "the recordings share less than a few seconds of motion without a gap",
        file=reference.path or "reference",
        remedy="Record sensor and reference at the same time, and turn the sensor.",
    )


def _unrelated(traces: RateTrace, log: Log, reference: Log) -> InputError:
    of = "attitude that of the body in" if traces.compared is Compared.RATES else "position in metres, in"
    return InputError(
        f"{traces.compared.value} of the sensor and of {reference.path or 'the reference'} are not those of "
        f"one motion: their correlation is {traces.correlation:.2f}",
        file=log.path or "log",
        remedy=f"Are they of the same recording, and is the {of} the reference frame?",
    )


def _joined(log: Log, reference: Log, rows: NDArray[np.intp], aligned: Aligned, mount: Array | None) -> Log:
    """Lay the rows of both in the order of the sensor's clock; without a mount the attitude is omitted."""
    t_ref = aligned.on_sensor_clock(reference.t[rows], float(reference.t[rows[0]]))
    within = (t_ref >= log.t[0]) & (t_ref <= log.t[-1])
    between = Stretches.between_gaps(t_ref).seen(log.t, log.t)
    nearest = np.clip(np.searchsorted(log.t, t_ref), 1, log.n - 1)
    nearest -= np.abs(t_ref - log.t[nearest - 1]) < np.abs(t_ref - log.t[nearest])
    touching = np.abs(t_ref - log.t[nearest]) <= TOUCHING
    exact = np.zeros(log.n)
    exact[nearest[touching]] = 1.0
    own = np.flatnonzero(within & ~touching)
    t = np.concatenate((log.t, t_ref[own]))
    order = np.argsort(t, kind="stable")

    def laid(values: Array | None, more: Array | None = None) -> Array | None:
        if values is None:
            return None
        added = np.full((len(own), *values.shape[1:]), np.nan) if more is None else more
        return np.asarray(np.concatenate((values, added))[order])

    attitude = position = None
    if mount is not None:
        assert reference.ref_q is not None
        q_ref = turned(reference.ref_q[rows], mount)
        at = np.where(between[:, None], reference_course(t_ref, q_ref).at(log.t), np.nan)
        at[nearest[touching]] = q_ref[touching]
        attitude = laid(at, q_ref[own])
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
        extra={**log.metadata.extra, "lag": aligned.lag, "skew": aligned.skew}
        | ({} if mount is None else {"mount": mount.tolist()}),
    )
    return Log.of_fields(
        t=np.asarray(t[order]),
        acc=laid(log.acc),
        gyr=laid(log.gyr),
        mag=laid(log.mag),
        temp=laid(log.temp),
        ref_q=attitude,
        ref_p=position,
        pose=None if log.pose is None else np.concatenate((log.pose, np.full(len(own), "", dtype=object)))[order],
        covariates={name: values for name, values in covariates.items() if values is not None}
        | {"ref_exact": np.asarray(laid(exact, np.ones(len(own))))},
        labels=labels,
        metadata=metadata,
        notes=log.notes,
    )
