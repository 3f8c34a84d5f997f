"""Run attitude filters over a log and compare the result with the log's reference.

The attitude `q_nb` is a Hamilton quaternion, scalar first, that takes body vectors into the log's reference frame. The
error is ``e = q_est * q_ref^-1``, seen in the reference frame.

The initial attitude
--------------------
1. `initial`, where it is given.
2. Else, from specific force and magnetic field (TRIAD) at the first row that has both.
3. Else, for a log without a magnetometer but with a reference: from the reference, at the first row that has one.
   Gravity shows no heading, and without this rule a filter's heading error would be an arbitrary constant.
4. Else, inclination from the specific force at the first row that has one, heading (yaw) 0.
5. Else, for a log with a gyro alone: the identity.

Rows before the start have no attitude: NaN, counted as ``not_started``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from imufit import _imufit
from imufit.errors import InputError
from imufit.filters import ALL, AttitudeFilter, Smoother
from imufit.log import Log
from imufit.log.words import one_of
from imufit.progress import Progress, silent
from imufit.replaying.angle_table import angle_table
from imufit.replaying.clipped import ranges
from imufit.replaying.start_frame import frame_words
from imufit.replaying.tilt_comparison import compare_tilt, tilt_errors
from imufit.results.plotted import Plotted
from imufit.results.result import Result
from imufit.results.table import Table
from imufit.results.tilt import TiltComparison

if TYPE_CHECKING:
    import pandas as pd

    from imufit.figures.place import Drawing, Place

Array = NDArray[np.float64]
Settings = Mapping[str, Mapping[str, float]]

_DESCRIPTIONS: Final = _imufit.filter_descriptions()

FILTERS: Final[dict[str, str]] = {name: entry["summary"] for name, entry in _DESCRIPTIONS.items()}
"""The filters there are: name and one sentence."""

SMOOTHERS: Final[dict[str, str]] = {
    "smoother": "The filter mekf forwards and backwards over the whole log: each row from those before and after it.",
}
"""Filters that need the whole log, and so are not for live rows: name and one sentence."""

SETTINGS: Final[dict[str, dict[str, _imufit._Setting]]] = {
    **{name: entry["settings"] for name, entry in _DESCRIPTIONS.items()},
    "smoother": _DESCRIPTIONS["mekf"]["settings"],
    "replay": _imufit.replay_rules(),
}
"""The settings of each filter and smoother, and of the rules for gaps and free fall: default, unit, meaning."""

_NEEDS: Final = {name: entry["needs"] for name, entry in _DESCRIPTIONS.items()} | {
    "smoother": _DESCRIPTIONS["mekf"]["needs"],
}

DEFAULT_FILTERS: Final[tuple[str, ...]] = ("gyro", "triad", "mahony")

_ERRORS: Final = ("total", "heading", "inclination", "roll", "pitch", "yaw", "sd")


class Errors(TypedDict):
    """Root mean square errors of one filter against the reference, deg.

    `sd_deg` is the spread of the error vector about its mean: ``total_deg**2 == |mean error|**2 + sd_deg**2``. The
    total beyond the spread is a constant error, which no smoothing removes.
    """

    total_deg: float
    heading_deg: float
    inclination_deg: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float
    sd_deg: float


@dataclass(frozen=True, eq=False, repr=False)
class Replay(Plotted, Result):
    """Attitudes of several filters over one log of n rows.

    Parameters
    ----------
    log : Log
        The log that was replayed.
    attitude : dict of (n, 4) arrays
        Per filter, unit quaternions, scalar first, body to reference frame; NaN before the start.
    errors : dict of Errors or None
        Per filter, RMSE in deg; None where the log has no reference.
    skipped : dict of int
        Reason and number of rows of which something was not used. Where filters differ, the largest number.
    mag_reference : (3,) array or None
        Field in the reference frame whose horizontal direction the filters took for known, uT; None: north.
    """

    log: Log
    attitude: dict[str, Array]
    errors: dict[str, Errors | None]
    skipped: dict[str, int]
    mag_reference: Array | None = None

    def sentences(self) -> list[str]:
        """Return the best filter by its error, or the replayed filters if a reference is missing."""
        ran = f"{self.log.n} rows by {', '.join(self.attitude)}"
        total = {name: errors["total_deg"] for name, errors in self.errors.items() if errors is not None}
        if not total:
            return [f"{ran}; the log has no reference attitude to hold them against.", self.frame_words()]
        best = min(total, key=lambda name: total[name])
        return [f"{ran}: {best} comes nearest to the reference, {total[best]:.2f} deg RMS."]

    def tables(self) -> tuple[Table, ...]:
        """Error of each filter, deg RMS; without a reference the angles at some times."""
        if self.log.ref_q is None:
            return (self.angle_table(),)
        rows = tuple(
            (name, f"{errors['total_deg']:.3f}", f"{errors['heading_deg']:.3f}", f"{errors['inclination_deg']:.3f}")
            for name, errors in self.errors.items()
            if errors is not None
        )
        return (Table("Error, deg RMS", ("filter", ">total", ">heading", ">inclination"), rows),)

    def frame_words(self) -> str:
        """Name the frame of the angles; where the sensor starts upside down in it, the remedy."""
        known = [q[np.isfinite(q).all(axis=1)] for q in self.attitude.values()]
        return frame_words(self.log.metadata.frame, next((q[0] for q in known if len(q)), None))

    def angle_table(self) -> Table:
        """Roll, pitch and yaw of every filter at the start, at the end and at the extremes of roll and pitch."""
        return angle_table(self.log.t, {name: self.euler(name) for name in self.attitude})

    def rotation(self, name: str) -> Rotation:
        """Attitude of one filter as n scipy rotations, body to reference frame; rows before the start are NaN.

        Parameters
        ----------
        name : str
            The filter.
        """
        q = self._of(name)[:, [1, 2, 3, 0]]
        start = int(np.isnan(q[:, 0]).sum())  # scipy's rotations take NaN, but not as a quaternion
        before = Rotation.from_rotvec(np.full((start, 3), np.nan))
        return Rotation.concatenate([before, Rotation.from_quat(q[start:])]) if start else Rotation.from_quat(q)

    def euler(self, name: str) -> Array:
        """Roll, pitch, yaw of one filter, (n, 3), rad: ``R = Rz(yaw) Ry(pitch) Rx(roll)``, roll 0 at gimbal lock.

        Parameters
        ----------
        name : str
            The filter.
        """
        return _imufit.euler_from_quaternion(self._of(name))

    def _of(self, name: str) -> Array:
        if name not in self.attitude:
            raise ValueError(f"filter {name!r} was not replayed: there are {', '.join(self.attitude)}")
        return self.attitude[name]

    def columns(self) -> dict[str, Array]:
        """Per filter F the columns ``F_qw F_qx F_qy F_qz`` and ``F_roll F_pitch F_yaw`` (rad), (n,) each."""
        columns: dict[str, Array] = {}
        for name, q in self.attitude.items():
            columns |= {f"{name}_q{part}": q[:, i].copy() for i, part in enumerate("wxyz")}
            euler = self.euler(name)
            columns |= {f"{name}_{part}": euler[:, i].copy() for i, part in enumerate(("roll", "pitch", "yaw"))}
        return columns

    def row_errors(self, name: str) -> Array:
        """Errors of one filter row by row, (n, 6), rad: total, heading, inclination, roll, pitch, yaw.

        NaN on rows without an attitude or a reference; for a log without a reference all rows.

        Parameters
        ----------
        name : str
            The filter.
        """
        q = self._of(name)
        ref = np.full_like(q, np.nan) if self.log.ref_q is None else self.log.ref_q
        return _imufit.attitude_errors(q, ref)

    def tilt_error(self, name: str) -> Array:
        """Error of one filter's tilt row by row, rad; see `imufit.replaying.tilt_error` for its definition.

        Parameters
        ----------
        name : str
            The filter.

        Returns
        -------
        (n, 1) array
            About the metadata's `rig_axis`: estimated angle = reference angle + error.
        (n, 2) array
            Without a rig axis: horizontal components of the inclination's error, reference frame.

        Raises
        ------
        ValueError
            The filter was not replayed, the log has no reference, or the filter does not show this angle: a rig that
            turns about the vertical, for the accelerometer.
        """
        found = tilt_errors(self.log, {name: self._of(name)}, _NEEDS)
        if found is None:
            raise ValueError("the log has no reference attitude, so that no tilt has an error")
        error = found[1][name]
        if error is None:
            raise ValueError(f"the rig turns about the vertical, which {name} does not see")
        return error

    def comparison(self, band_deg: float = 0.1) -> TiltComparison | None:
        """Figures of merit of each filter's tilt (paper B, Tables 3 to 5), and ranks; None without a reference.

        RMSE, offset, SD at rest, drift, noise density, settling time and vibration gain, defined in
        `imufit.replaying.figures_of_merit`. RMSE and offset are taken over the rows of `errors`.

        Parameters
        ----------
        band_deg : float
            Half width of the band of the settling time, deg.

        Raises
        ------
        ValueError
            The band is not positive.
        """
        return compare_tilt(self.log, self.attitude, _NEEDS, counted_rows(self.log), band_deg)

    def _drawn(self, ax: Place | None) -> Drawing:
        """Tilt of all filters over time with the reference, and its error: paper B's Figures 3 to 5.

        Panels for the whole log, the first move and the strongest vibration, as far as the log holds them. Without a
        reference a panel each for roll, pitch and yaw.

        Raises
        ------
        InputError
            No filter was replayed whose tilt could be drawn.
        """
        if self.log.ref_q is None:
            from imufit.figures.angles import angle_panels  # noqa: PLC0415

            return angle_panels(self.log.t, {name: self.euler(name) for name in self.attitude}, ax)
        from imufit.replaying.tilt_figure import tilt_figure_of  # noqa: PLC0415

        return tilt_figure_of(self.log, self.attitude, _NEEDS, ax)

    def to_dict(self, comparison: TiltComparison | None = None) -> dict[str, Any]:
        """Return what goes into JSON: n, skipped, errors (deg) and figures of the tilt per filter, ranks.

        Parameters
        ----------
        comparison : TiltComparison, optional
            From `comparison`; without it with the usual band.
        """
        value: dict[str, Any] = {
            "n": self.log.n,
            "skipped": dict(self.skipped),
            "filters": {name: None if errors is None else dict(errors) for name, errors in self.errors.items()},
        }
        compared = self.comparison() if comparison is None else comparison
        if compared is None:
            return value
        for name, figures in compared.methods.items():
            if value["filters"][name] is not None:
                value["filters"][name]["tilt"] = None if figures is None else figures.to_dict()
        return {**value, **compared.to_dict()}

    def to_dataframe(self) -> pd.DataFrame:
        """Table of n rows: `t` (s), `columns`, and with a reference ``F_total_deg F_heading_deg F_inclination_deg``."""
        import pandas as pd  # noqa: PLC0415  heavy, and only needed here

        columns = {"t": self.log.t, **self.columns()}
        if self.log.ref_q is not None:
            for name in self.attitude:
                errors = np.degrees(self.row_errors(name))
                columns |= {f"{name}_{part}_deg": errors[:, i] for i, part in enumerate(_ERRORS[:3])}
        return pd.DataFrame(columns)

    def to_log(self) -> Log:
        """Return the log with `columns` among its covariates."""
        return self.log.with_fields(covariates={**self.log.covariates, **self.columns()})


def replay(
    log: Log,
    filters: Sequence[str] | None = DEFAULT_FILTERS,
    settings: Settings | None = None,
    initial: ArrayLike | Rotation | str | None = None,
    progress: Progress = silent,
) -> Replay:
    """Attitude for every row of a log by each of several filters.

    Parameters
    ----------
    log : Log
        n rows with the sensors that the filters need.
    filters : sequence of str, optional
        Names out of `FILTERS` and `SMOOTHERS`; a named filter without its sensor is refused. Without it: those of
        gyro, triad and mahony for which the log has the sensors. None or an empty sequence: every filter of
        `FILTERS` for which it has them.
    settings : mapping of mappings, optional
        ``{"mahony": {"k_p": 1.0}, "replay": {"max_gap": 0.5}}``: filter (or "replay"), name and value as in
        `SETTINGS`. Without `max_gap` a gap is a step longer than 1 s and than ten usual steps of the log. Without
        `acc_range` and `gyr_range` the metadata or the readings themselves show where the ranges end
        (`imufit.replaying.clipped`); 0 takes every reading for unclipped.
    initial : (4,) array, Rotation, "vectors" or "reference", optional
        Attitude at the first row, scalar first, body to reference frame; or where to take it from. Without it the
        rules at the head of this module apply.
    progress : callable, optional
        Called with (filters done, filters in all, what is being done).

    Returns
    -------
    Replay
        Attitudes (n, 4), errors in deg, skipped rows.

    Raises
    ------
    ValueError
        An unknown filter or setting, or a filter without its sensor; the message states which and what to do.

    Notes
    -----
    The field's horizontal direction comes from the metadata's `mag_reference`; without it, from
    `estimate_mag_reference`; without a reference it is north. Errors are taken over the rows with a reference and,
    where the log has the covariate `movement`, ``movement == 1``.
    """
    given = _checked(settings)
    around = surroundings(log, given.get("replay", {}), initial)
    sensors = around.sensors
    names = _choose(filters, sensors)
    counted = counted_rows(log)

    attitude: dict[str, Array] = {}
    errors: dict[str, Errors | None] = {}
    skipped: dict[str, int] = {}
    for done, name in enumerate(names):
        progress(done, len(names), f"filter {name}")
        running = _made(name, around.arguments, given.get(name, {}))
        attitude[name] = running.run(**sensors, dt_or_t=log.t)
        reasons = running.skipped
        errors[name] = _errors(attitude[name], log.ref_q, counted)
        skipped = {reason: max(skipped.get(reason, 0), reasons.get(reason, 0)) for reason in (*skipped, *reasons)}
    progress(len(names), len(names), "replayed")
    return Replay(log, attitude, errors, skipped, around.field)


@dataclass(frozen=True)
class Surroundings:
    """The input of every filter over one log.

    Attributes
    ----------
    sensors : dict
        Readings of "acc", "gyr" and "mag", (n, 3); None for a sensor without any.
    field : (3,) array or None
        Field in the reference frame whose horizontal direction counts as known, uT.
    arguments : dict
        Keyword arguments of the compiled filters: frame, gravity, field, rules and start.
    """

    sensors: dict[str, Array | None]
    field: Array | None
    arguments: dict[str, Any]


def surroundings(
    log: Log, rules: Mapping[str, float] | None = None, initial: ArrayLike | Rotation | str | None = None
) -> Surroundings:
    """Return what every filter over this log is given; rules and initial attitude as in `replay`.

    Parameters
    ----------
    log : Log
        n rows.
    rules : mapping, optional
        Settings of the rules.
    initial : optional
        As in `replay`.
    """
    sensors = {name: _present(getattr(log, name)) for name in ("acc", "gyr", "mag")}
    field = _mag_reference(log)
    q0, t0 = _start(log, sensors, initial)
    arguments = {
        "frame": log.metadata.frame,
        "gravity": log.metadata.gravity,
        "mag_reference": None if field is None else field.tolist(),
        "rules": {"max_gap": max(1.0, 10.0 * _usual_step(log.t)), **ranges(log), **(rules or {})},
        "initial": q0,
        "start_time": t0,
    }
    return Surroundings(sensors, field, arguments)


def estimate_mag_reference(log: Log) -> Array | None:
    """Magnetic flux density in the reference frame, (3,), uT: the mean of ``R m`` over the rows with both.

    None where the log has no reference or no magnetometer, or where the mean has no horizontal part. The mean includes
    the magnetometer's own bias and disturbances as far as the log's attitudes do not average them out.

    Parameters
    ----------
    log : Log
        With reference attitude and magnetometer.
    """
    if log.ref_q is None or log.mag is None:
        return None
    rows = _imufit.rotate(log.ref_q, log.mag)
    rows = rows[np.isfinite(rows).all(axis=1)]
    return _with_heading(rows.mean(axis=0)) if len(rows) else None


def _mag_reference(log: Log) -> Array | None:
    known = log.metadata.mag_reference
    return estimate_mag_reference(log) if known is None else _with_heading(np.asarray(known, dtype=np.float64))


def _with_heading(field: Array) -> Array | None:
    return field if np.hypot(field[0], field[1]) > 1e-3 * np.linalg.norm(field) else None


def _present(column: Array | None) -> Array | None:
    return column if column is not None and np.isfinite(column).all(axis=1).any() else None


def _choose(filters: Sequence[str] | None, sensors: Mapping[str, Array | None]) -> tuple[str, ...]:
    if isinstance(filters, str):
        return (filters,)
    if filters is DEFAULT_FILTERS or not filters:
        there = {name for name, column in sensors.items() if column is not None}
        chosen = tuple(name for name in filters or FILTERS if there.issuperset(_DESCRIPTIONS[name]["needs"]))
        if not chosen:
            held = " and ".join(sorted(there)) or "no sensor"
            raise ValueError(f"the log has {held}, from which no filter gives an attitude: record acc or gyr as well")
        return chosen
    return tuple(dict.fromkeys(filters))


def _made(name: str, arguments: Mapping[str, Any], settings: Mapping[str, float]) -> AttitudeFilter | Smoother:
    kinds: dict[str, type[AttitudeFilter | Smoother]] = {**ALL, Smoother.name: Smoother}
    if name not in kinds:
        raise InputError(f"filter {name!r} is unknown", remedy=one_of(name, kinds))
    around = {**arguments, **arguments["rules"], **settings}
    del around["rules"]
    return kinds[name](**around)


def _checked(settings: Settings | None) -> Settings:
    for name in settings or {}:
        if name not in SETTINGS:
            raise ValueError(f"settings for {name!r}: the filter is unknown. Use one of {', '.join(SETTINGS)}")
    return settings or {}


def _usual_step(t: Array) -> float:
    return float(np.median(np.diff(t))) if t.size > 1 else 0.0


def _start(
    log: Log, sensors: Mapping[str, Array | None], initial: ArrayLike | Rotation | str | None
) -> tuple[list[float] | None, float | None]:
    """Return initial attitude and the time it belongs to; None where the filter finds it from its vectors."""
    if isinstance(initial, Rotation):
        return initial.as_quat()[[3, 0, 1, 2]].tolist(), None
    if initial is not None and not isinstance(initial, str):
        return np.asarray(initial, dtype=np.float64).tolist(), None
    if initial not in (None, "vectors", "reference"):
        raise ValueError(f'initial is {initial!r}: pass a quaternion, "vectors", "reference" or None')
    wanted = initial == "reference" or (initial is None and sensors["mag"] is None)
    rows = np.empty(0, np.intp) if log.ref_q is None else np.flatnonzero(np.isfinite(log.ref_q).all(axis=1))
    if wanted and log.ref_q is not None and rows.size:
        return log.ref_q[rows[0]].tolist(), float(log.t[rows[0]])
    if initial == "reference":
        raise ValueError('initial is "reference", but the log has no reference attitude: leave it out')
    return None, None


def counted_rows(log: Log) -> NDArray[np.bool_] | None:
    """Return the rows (n,) that count for errors, ``movement == 1``; None where all do.

    Parameters
    ----------
    log : Log
        With or without the covariate `movement`.
    """
    movement = log.covariates.get("movement")
    return None if movement is None else movement == 1.0


def _errors(q: Array, ref_q: Array | None, counted: NDArray[np.bool_] | None) -> Errors | None:
    rmse = None if ref_q is None else _imufit.attitude_rmse(q, ref_q, counted)
    if rmse is None:
        return None
    degrees = {name: float(np.degrees(rmse[name])) for name in _ERRORS}
    return Errors(
        total_deg=degrees["total"],
        heading_deg=degrees["heading"],
        inclination_deg=degrees["inclination"],
        roll_deg=degrees["roll"],
        pitch_deg=degrees["pitch"],
        yaw_deg=degrees["yaw"],
        sd_deg=degrees["sd"],
    )
