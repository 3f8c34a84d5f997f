"""Attitudes of a log over time, thinned for a player: a filter's, the reference, and those of predicted readings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.filters import AttitudeFilter, Mekf
from imufit.fitting.passes import CHANNELS
from imufit.fitting.row_residuals import check_reference, residual_chunks
from imufit.log import LogSource
from imufit.log.columns import SENSORS
from imufit.log.size import BLOCK_ROWS
from imufit.replaying import convert_frame

if TYPE_CHECKING:
    from imufit.loop import Fit

Array = NDArray[np.float64]
Rows = tuple[Array, Mapping[str, Array]]
"""Times (n,) and the sensors (n, 3) of some rows."""

KEPT: Final = 20_000
"""Attitudes that are kept of a track: ten minutes at 30 pictures a second, 0.8 MB."""
NEAR: Final = 5.0
"""Steps of a track from one kept attitude to the next within which the last one is still shown."""

SCENE: Final = "ENU"
"""Frame in which attitudes are drawn: x to the right, y away from the viewer, z up."""


@dataclass(frozen=True, eq=False)
class Track:
    """One attitude over time; n rows.

    Attributes
    ----------
    name : str
        ``measured``, ``predicted`` or ``reference``.
    t : (n,) array
        Time, s of the log.
    q : (n, 4) array
        Unit quaternions, scalar first, body to `frame`; NaN where the attitude is unknown.
    frame : {"NED", "ENU", "NWU"}
        Reference frame.
    """

    name: str
    t: Array
    q: Array
    frame: str

    @property
    def known(self) -> float:
        """Time of the first attitude that is known, s of the log; the first time where none is."""
        return float(self.t[np.argmax(np.isfinite(self.q).all(axis=1))])

    def at(self, time: float) -> Array | None:
        """Return the attitude at a time: that of the last row before it; None where it is unknown.

        Parameters
        ----------
        time : float
            s of the log.
        """
        row = int(np.searchsorted(self.t, time, side="right")) - 1
        if row < 0:
            return None
        usual = (self.t[-1] - self.t[0]) / max(self.t.size - 1, 1)
        if time - self.t[row] > NEAR * usual or not np.isfinite(self.q[row]).all():
            return None
        return np.asarray(self.q[row])


def scene_rotation(q: Array, frame: str) -> Array:
    """Return the matrix that turns body vectors into the axes of the scene: east, north, up.

    Parameters
    ----------
    q : (4,) array
        Unit quaternion, scalar first, body to `frame`.
    frame : {"NED", "ENU", "NWU"}
        Reference frame.

    Returns
    -------
    (3, 3) array
        Its columns are the body's x, y and z axis in the scene.
    """
    w, x, y, z = convert_frame(np.asarray(q, np.float64).reshape(1, 4), frame, SCENE)[0]
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def error_deg(one: Array, other: Array) -> float:
    """Return the angle between two attitudes, deg.

    Parameters
    ----------
    one, other : (4,) array
        Unit quaternions of one frame.
    """
    return float(np.degrees(2.0 * np.arccos(np.clip(abs(float(np.dot(one, other))), 0.0, 1.0))))


def reference_track(log: LogSource) -> Track | None:
    """Return the reference attitude of a log; None where it has none.

    Parameters
    ----------
    log : LogSource
        Read chunk by chunk.
    """
    parts = ((chunk.core.t, chunk.core.ref_q) for chunk in log.chunks(BLOCK_ROWS))
    known = ((t, q) for t, q in parts if q is not None)
    return _track("reference", known, log)


def measured_track(log: LogSource, chosen: type[AttitudeFilter] = Mekf) -> Track | None:
    """Return the attitude that a filter makes of the readings; None where a sensor is missing that the filter needs.

    Parameters
    ----------
    log : LogSource
        Read chunk by chunk.
    chosen : type of AttitudeFilter
        The filter.
    """
    return _filtered("measured", _readings(log), log, chosen)


def predicted_track(fit: Fit, log: LogSource, number: int = 0, chosen: type[AttitudeFilter] = Mekf) -> Track | None:
    """Return the attitude that a filter makes of the readings which a fitted model predicts from the reference.

    A model that lacks nothing predicts the errors of the measured attitude, too.

    Parameters
    ----------
    fit : Fit
        The fit.
    log : LogSource
        The log.
    number : int
        Number of the log among those of the fit.
    chosen : type of AttitudeFilter
        The filter.

    Raises
    ------
    InputError
        The log has no reference.
    """
    evidence, step = fit.analysis.logs[number], fit.analysis.own_step(number, fit.estimate.step)
    check_reference(evidence)

    def rows() -> Iterator[Rows]:
        for arrays, residuals in residual_chunks(evidence, step, "predicting readings"):
            yield _predicted(arrays, residuals)

    return _filtered("predicted", rows(), log, chosen)


def _predicted(arrays: Mapping[str, Any], residuals: list[Array | None]) -> Rows:
    """Return the readings of the core rows less their residuals."""
    core = slice(arrays["begin"], arrays["end"])
    by_channel = dict(zip(CHANNELS, residuals, strict=True))
    readings: dict[str, Array] = {}
    for sensor in SENSORS:
        three = [by_channel[f"{sensor}_{axis}"] for axis in "xyz"]
        found = [each for each in three if each is not None]
        if arrays[sensor] is not None and len(found) == len(three):
            readings[sensor] = arrays[sensor][core] - np.column_stack(found)
    return arrays["t"][core], readings


def _readings(log: LogSource) -> Iterator[Rows]:
    for chunk in log.chunks(BLOCK_ROWS):
        core = chunk.core
        yield core.t, {name: getattr(core, name) for name in SENSORS if getattr(core, name) is not None}


def _filtered(name: str, parts: Iterable[Rows], log: LogSource, chosen: type[AttitudeFilter]) -> Track | None:
    """Run a filter over rows part by part."""
    running: AttitudeFilter | None = None

    def run() -> Iterator[tuple[Array, Array]]:
        nonlocal running
        for t, sensors in parts:
            if set(chosen.needs) - set(sensors):
                return
            if running is None:
                running = chosen(**_surroundings(log, sensors))
            yield t, running.run(sensors.get("gyr"), sensors.get("acc"), sensors.get("mag"), t)

    return _track(name, run(), log)


def _surroundings(log: LogSource, sensors: Mapping[str, Array]) -> dict[str, Any]:
    """Frame, gravity and field of a log, and without a magnetometer the attitude of the first reference."""
    metadata = log.metadata
    given: dict[str, Any] = {"frame": metadata.frame, "gravity": metadata.gravity}
    if metadata.mag_reference is not None:
        given["mag_reference"] = metadata.mag_reference
    if "mag" not in sensors:
        first = next(iter(log.chunks(BLOCK_ROWS))).core
        rows = np.empty(0, int) if first.ref_q is None else np.flatnonzero(np.isfinite(first.ref_q).all(axis=1))
        if first.ref_q is not None and rows.size:
            given |= {"initial": first.ref_q[rows[0]], "start_time": float(first.t[rows[0]])}
    return given


def _track(name: str, parts: Iterable[tuple[Array, Array]], log: LogSource) -> Track | None:
    """Keep every so many rows."""
    every, passed = max(1, -(-log.n // KEPT)), 0
    times: list[Array] = []
    attitudes: list[Array] = []
    for t, q in parts:
        kept = slice(-passed % every, None, every)
        times.append(t[kept].copy())
        attitudes.append(q[kept].copy())
        passed += t.size
    if not passed:
        return None
    return Track(name, np.concatenate(times), np.concatenate(attitudes), log.metadata.frame)
