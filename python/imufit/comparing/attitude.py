"""Benefit of a model to an attitude filter, and the filter's remaining limit: calibration, environment or filter.

The filter runs over the readings as they are and over those with the model's effects taken out. The error
``e = q_est * q_ref^-1`` is split into heading and inclination (seen in the reference frame), and each is held against
angular rate, acceleration, field disturbance and time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from imufit.errors import InputError
from imufit.fitting.apply import apply
from imufit.log import Log
from imufit.progress import Progress, silent
from imufit.replaying import Replay, replay
from imufit.results.attitude import PARTS, AttitudeBins, AttitudeComparison, AttitudeDependence

if TYPE_CHECKING:
    from imufit.log import LogSource
    from imufit.model import EffectStack

Array = NDArray[np.float64]

FILTER = "mekf"
BLOCKS = 24
BINS = 10
MIN_ROWS = 240
MOST_ROWS = 400_000
"""Rows that the filter runs over at most, from the first: each takes 1 kB of memory until all is judged."""
CHANCE = 3.0
"""Standard errors by which a share must stand out."""
LIMITS = 0.5
"""Share of the mean square error from which on something limits the filter."""
CALMEST = 0.25
UNITS = {"angular_rate": "deg/s", "acceleration": "m/s²", "field_disturbance": "%", "time": "s"}
CAUSES = {
    "angular_rate": ("filter", "errors of the rate, of its timing or of the filter's gains appear with rotation"),
    "acceleration": ("filter", "specific force is not gravity while the body accelerates"),
    "field_disturbance": ("environment", "the magnetic field is disturbed at the body's place"),
    "drift": ("filter", "the error grows with time, without a correction"),
    "constant": ("calibration", "a bias, a mount or a field direction is a constant error"),
}


def attitude_comparison(
    model: EffectStack, log: LogSource, filter_name: str = FILTER, progress: Progress = silent
) -> AttitudeComparison | None:
    """Run a filter over a log without and with a model applied, and name the quantity that its error depends on.

    Parameters
    ----------
    model : EffectStack
        Effects to take out of the readings; a delay of the reference and a turned field are undone as well.
    log : Log or LogStream
        With reference attitude. A log that stays on disk is not judged.
    filter_name : str
        Out of `imufit.replaying.FILTERS`.
    progress : callable
        Called with (rows done, rows in all, what is being done).

    Returns
    -------
    AttitudeComparison or None
        None where the log has no attitude, no sensor that the filter needs, or too few rows, or where the model cannot
        be undone.
    """
    if not isinstance(log, Log) or log.ref_q is None:
        return None
    whole, log = log, log.rows(0, MOST_ROWS)
    if not _has_readings(log):
        return None
    run = replay(log, [filter_name], progress=progress)
    kept = _kept(run, filter_name)
    if kept.sum() < MIN_ROWS:
        return None
    before = _parts(run, filter_name)
    after = before
    if model.effects:
        undone = _undone(model, log)
        if undone is None:
            return None
        run = replay(undone, [filter_name], progress=progress)
        after = _parts(run, filter_name)
        kept &= _kept(run, filter_name)
        if kept.sum() < MIN_ROWS:
            return None
    before, after = ({part: e[kept] for part, e in errors.items()} for errors in (before, after))
    # A sensor whose readings stand in other rows than the reference is not informative about these.
    quantities = {name: x[kept] for name, x in _quantities(log).items() if np.isfinite(x[kept]).any()}
    tilts = [v[kept] for v in _tilts(run, filter_name)]
    dependences = sorted(
        (d for d in _dependences(after, tilts, log.t[kept], quantities) if d.share > CHANCE * d.error),
        key=lambda d: -d.share,
    )
    bins = tuple(_bins(before, after, {**quantities, "time": log.t[kept] - log.t[0]}))
    rms_before, rms_after = _rms(before), _rms(after)
    limit, sentence = _limit(filter_name, rms_before, rms_after if model.effects else None, dependences)
    if whole.n > log.n:
        sentence += f" This is of the first {log.n} rows."
    return AttitudeComparison(
        filter_name, rms_before, rms_after if model.effects else None, tuple(dependences), bins, limit, sentence
    )


def _undone(model: EffectStack, log: Log) -> Log | None:
    """Return the corrected log; None where no readings are left or the model cannot be undone."""
    try:
        undone = corrected(model, log)
    except InputError:
        # A nonlinearity may turn back within the readings: then no input belongs to them, and no attitude either.
        return None
    return undone if _has_readings(undone) else None


def _has_readings(log: Log) -> bool:
    """Whether both sensors that the filter needs have a reading at all."""
    return all(
        readings is not None and bool(np.isfinite(readings).all(axis=1).any()) for readings in (log.acc, log.gyr)
    )


def corrected(model: EffectStack, log: Log) -> Log:
    """Return a log with the model's effects taken out of the readings, its delay and its skew out of the reference.

    Parameters
    ----------
    model : EffectStack
        With fitted parameters.
    log : Log
        With reference attitude.
    """
    result = apply(model, log)
    lateness = np.zeros(len(log.t))
    for effect, _ in model.stack():
        values, field = model.parameters[effect.id], result.metadata.mag_reference
        if effect.reference_part == "time":
            lateness += values.get("tau", 0.0) + values.get("k", 0.0) * (log.t - log.t[0])
        elif effect.reference_part == "field" and field is not None:
            true_field = (field[0] + values["x"], field[1] + values["y"], field[2] + values["z"])
            result = replace(result, metadata=replace(result.metadata, mag_reference=true_field))
    if result.ref_q is not None and np.any(lateness):
        result = replace(result, ref_q=_read_at(result.t + lateness, result.t, result.ref_q))
    return result


def _read_at(at: Array, t: Array, q: Array) -> Array:
    """Attitude as it is recorded at the stamps `at`; NaN beyond the ends and beside gaps."""
    known = np.flatnonzero(np.isfinite(q).all(axis=1))
    shifted = np.full_like(q, np.nan)
    if known.size < 2:
        return shifted
    inside = np.isfinite(q).all(axis=1) & (at >= t[known[0]]) & (at <= t[known[-1]])
    between = Slerp(t[known], Rotation.from_quat(q[known][:, [1, 2, 3, 0]]))
    shifted[inside] = between(at[inside]).as_quat()[:, [3, 0, 1, 2]]
    return shifted


def _kept(run: Replay, name: str) -> NDArray[np.bool_]:
    known = np.isfinite(run.row_errors(name)[:, 0])
    movement = run.log.covariates.get("movement")
    return known if movement is None else known & (movement == 1.0)


def _parts(run: Replay, name: str) -> dict[str, Array]:
    """Return the errors of each row, deg: total and inclination as sizes, heading with its sign."""
    errors = np.degrees(run.row_errors(name))
    return {part: errors[:, k] for k, part in enumerate(PARTS)}


def _tilts(run: Replay, name: str) -> list[Array]:
    """Return the horizontal part of each row's error as a vector, deg: along the reference frame and along the body."""
    found = np.full((run.log.n, 3), np.nan)
    known = np.isfinite(run.row_errors(name)[:, 0])
    reference = Rotation.from_quat(np.asarray(run.log.ref_q)[known][:, [1, 2, 3, 0]])
    estimate = Rotation.from_quat(run.attitude[name][known][:, [1, 2, 3, 0]])
    vector = np.degrees((estimate * reference.inv()).as_rotvec())
    vector[:, 2] = 0.0
    found[known] = vector
    along_body = np.full_like(found, np.nan)
    along_body[known] = reference.inv().apply(vector)
    return [found, along_body]


def _rms(errors: dict[str, Array]) -> dict[str, float]:
    return {part: float(np.sqrt(np.mean(e**2))) for part, e in errors.items()}


def _quantities(log: Log) -> dict[str, Array]:
    """Return what may disturb a filter, row by row; what a log lacks is left out."""
    found: dict[str, Array] = {}
    if log.gyr is not None:
        found["angular_rate"] = np.degrees(np.linalg.norm(log.gyr, axis=1))
    if log.acc is not None:
        found["acceleration"] = np.abs(np.linalg.norm(log.acc, axis=1) - log.metadata.gravity)
    if log.mag is not None and log.ref_q is not None:
        known = np.isfinite(log.ref_q).all(axis=1) & np.isfinite(log.mag).all(axis=1)
        field = np.full_like(log.mag, np.nan)
        turned = Rotation.from_quat(log.ref_q[known][:, [1, 2, 3, 0]])
        field[known] = turned.apply(log.mag[known])
        usual = np.median(field[known], axis=0) if known.any() else np.zeros(3)
        size = float(np.linalg.norm(usual))
        if size > 0.0:
            found["field_disturbance"] = 100.0 * np.linalg.norm(field - usual, axis=1) / size
    return found


def _blocks(n: int) -> list[NDArray[np.intp]]:
    return np.array_split(np.arange(n), BLOCKS)


def _dependences(
    errors: dict[str, Array], tilts: list[Array], t: Array, quantities: dict[str, Array]
) -> Iterator[AttitudeDependence]:
    for part in PARTS[1:]:
        e = errors[part]
        if part == "heading":
            yield AttitudeDependence(part, "constant", *_share(e, lambda rows, e=e: float(np.mean(e[rows])) ** 2))
            yield AttitudeDependence(part, "drift", *_share(e, lambda rows, e=e: _line_square(t[rows], e[rows])))
        else:
            # A table out of level is constant in the reference frame, a bias or a mount in the body.
            constant = [_share(e, lambda rows, v=v: float(np.sum(v[rows].mean(axis=0) ** 2))) for v in tilts]
            yield AttitudeDependence(part, "constant", *max(constant))
        for name, x in quantities.items():
            if part == "inclination" and name == "field_disturbance":
                continue
            calm = x <= np.nanquantile(x, CALMEST)
            yield AttitudeDependence(part, name, *_share(e, lambda rows, e=e, calm=calm: _beyond(e[rows], calm[rows])))


def _share(e: Array, explained: Any) -> tuple[float, float]:
    """Return a share of the mean square error and its standard error, one block of time left out after the other."""
    rows = np.arange(e.size)

    def share(chosen: NDArray[np.intp]) -> float:
        whole = float(np.mean(e[chosen] ** 2))
        return float(explained(chosen)) / whole if whole > 0.0 else 0.0

    left_out = np.array([share(np.setdiff1d(rows, block, assume_unique=True)) for block in _blocks(e.size)])
    spread = np.sqrt((BLOCKS - 1) * np.mean((left_out - left_out.mean()) ** 2))
    return min(max(share(rows), 0.0), 1.0), float(spread)


def _line_square(t: Array, e: Array) -> float:
    """Mean square of what a straight line in time takes beyond the mean."""
    time = t - t.mean()
    square = float(time @ time)
    return 0.0 if square == 0.0 else float(time @ e) ** 2 / square / e.size


def _beyond(e: Array, calm: NDArray[np.bool_]) -> float:
    """Mean square error beyond that of the calm rows."""
    return float(np.mean(e**2) - np.mean(e[calm] ** 2)) if calm.any() else 0.0


def _bins(before: dict[str, Array], after: dict[str, Array], quantities: dict[str, Array]) -> Iterator[AttitudeBins]:
    for part in PARTS[1:]:
        for name, x in quantities.items():
            order = np.argsort(x[np.isfinite(x)], kind="stable")
            known = np.flatnonzero(np.isfinite(x))[order]
            groups = [rows for rows in np.array_split(known, BINS) if rows.size]
            yield AttitudeBins(
                part,
                name,
                UNITS[name],
                np.array([x[rows].mean() for rows in groups]),
                *(np.array([np.sqrt(np.mean(e[part][rows] ** 2)) for rows in groups]) for e in (before, after)),
            )


def _limit(
    name: str, before: dict[str, float], after: dict[str, float] | None, dependences: list[AttitudeDependence]
) -> tuple[str, str]:
    """Return the limit of the filter and its sentence."""
    text = f"The attitude of {name} is off by {before['total']:.2f} deg"
    now = before
    if after is not None:
        text += f", {after['total']:.2f} deg with the model applied"
        now = after
    text += f" (heading {now['heading']:.2f} deg, inclination {now['inclination']:.2f} deg)."
    larger = "heading" if now["heading"] >= now["inclination"] else "inclination"
    causes = [d for d in dependences if d.part == larger and d.share >= LIMITS]
    if not causes:
        return "undecided", f"{text} The remaining error does not correlate with any single quantity tested."
    cause = causes[0]
    limit, why = CAUSES[cause.quantity]
    where = {"filter": "the filter", "environment": "the environment", "calibration": "calibration"}[limit]
    what = cause.quantity.replace("_", " ")
    dependence = "is constant" if cause.quantity == "constant" else f"depends on the {what}"
    share = f"{100.0 * cause.share:.0f} %"
    return limit, f"{text} {share} of the {larger}'s mean square error {dependence}. The limit is {where}: {why}."
