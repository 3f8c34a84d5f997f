"""Calibrate whatever sensors a log has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from imufit import _imufit
from imufit.calibrating import accelerometer, checks, gyroscope
from imufit.calibrating.calibration import Calibration, SensorCalibration
from imufit.calibrating.magnetometer import fit_magnetometer
from imufit.calibrating.temperature import Temperature
from imufit.errors import InputError
from imufit.loop import SensorModel
from imufit.remedy import template, when_read
from imufit.rests.poses import Found, Pose, distinct, find_poses, repeated
from imufit.rests.turns import find_turns
from imufit.rests.unit import check_unit

if TYPE_CHECKING:
    from imufit.log import Log

COSTS = ("vector", "magnitude")


def calibrate(
    logs: Log | Sequence[Log],
    cost: str | None = None,
    *,
    sensors: Sequence[str] = ("acc", "gyr", "mag"),
    settings: Mapping[str, float] | None = None,
) -> Calibration:
    """Calibrate a sensor from rests, turns between them, and free rotation (paper A).

    The accelerometer needs rests: six sides up on a level table (vector cost), or at least nine attitudes of any kind
    (magnitude cost). The gyro takes its bias from the rests, scale and misalignment from the turns between them. The
    magnetometer needs free rotation.

    Parameters
    ----------
    logs : Log or sequence of Log
        Of one sensor; several add up.
    cost : str, optional
        ``vector``: the named side points up exactly (or in the direction of the log's reference attitude), 12 unknowns.
        ``magnitude``: only the length of gravity is known, 9 unknowns, at least nine different poses. Without it the
        vector cost where poses are labelled, have a reference or lie along the axes, else the magnitude cost.
    sensors : sequence of str
        Those to be calibrated, if the logs have them.
    settings : mapping, optional
        Criteria of a rest, see :func:`imufit.calibrating.find_poses`.

    Returns
    -------
    Calibration
        Sensor model, standard errors, poses, verdict.

    Raises
    ------
    InputError
        The logs do not determine a calibration; the message names the missing poses.
    """
    given = [logs] if not isinstance(logs, Sequence) else list(logs)
    if cost is not None and cost not in COSTS:
        raise InputError(f"the cost {cost!r} is unknown", remedy=f"Use {' or '.join(COSTS)}.")
    if unknown := [name for name in sensors if name not in ("acc", "gyr", "mag")]:
        raise InputError(f"the sensor {unknown[0]!r} is unknown", remedy="Use acc, gyr or mag.")
    if not given:
        raise InputError("a log to calibrate from is missing")
    wanted = [name for name in sensors if any(getattr(log, name) is not None for log in given)]
    if not wanted:
        columns = " nor ".join(f"{name}_x {name}_y {name}_z" for name in sensors)
        raise InputError(
            f"there is nothing to calibrate: the log has {'neither' if len(sensors) > 1 else 'no'} {columns}",
            file=str(given[0].path or "log"),
            remedy="Name the columns, such as " + when_read(template(sensors[0])) + ".",
        )
    gravity = float(given[0].metadata.gravity)
    found, first = [], 1
    for index, log in enumerate(given):
        if log.acc is None:
            found.append(Found((), False, np.nan, np.nan))
            continue
        found.append(find_poses(log, index, first, settings))
        first += len(found[-1].poses)
    return _Session(given, found, gravity, settings or {}).calibrated(cost, wanted)


class _Session:
    """One calibration in the making: what was found, and notes on it."""

    def __init__(
        self, logs: Sequence[Log], found: Sequence[Found], gravity: float, settings: Mapping[str, float]
    ) -> None:
        self.settings = settings
        self.logs = logs
        self.found = found
        self.gravity = gravity
        self.poses: list[Pose] = [pose for one in found for pose in one.poses]
        self.labelled = any(one.labelled for one in found)
        self.file = str(logs[0].path or "log")
        self.notes: list[str] = []

    @property
    def used(self) -> list[Pose]:
        return [pose for pose in self.poses if pose.used]

    def calibrated(self, cost: str | None, wanted: Sequence[str]) -> Calibration:
        """Calibrate sensor after sensor; only what was requested alone may fail."""
        sensors: dict[str, SensorCalibration] = {}
        failures: list[InputError] = []
        temperature: Temperature | None = None
        if self.poses and ("acc" in wanted or "gyr" in wanted):
            check_unit(self.used or self.poses, self.logs[0])
        for name in wanted:
            mean = np.nan if temperature is None or temperature.mean is None else temperature.mean
            try:
                if name == "acc":
                    sensors["acc"], temperature = self._accelerometer_told(cost)
                elif name == "gyr" and (gyr := self._gyroscope(sensors.get("acc"), mean)) is not None:
                    sensors["gyr"] = gyr
                elif name == "mag":
                    logs = [log for log in self.logs if log.mag is not None]
                    sensors["mag"] = fit_magnetometer(logs, sensors.get("acc"), self.gravity)
            except InputError as error:
                failures.append(error)
        # A log for the magnetometer need not rest; one that was to calibrate an accelerometer must.
        if failures and (not sensors or ("acc" in wanted and "acc" not in sensors and "mag" not in sensors)):
            raise failures[0]
        if failures and cost is not None and "acc" not in sensors:
            raise failures[0]
        # Left-out stretches are named once, below.
        self.notes += [f"Not calibrated: {error.problem.split(' (pose ')[0]}." for error in failures]
        self._name_left_out()
        effects = {effect: values for sensor in sensors.values() for effect, values in sensor.effects.items()}
        errors = {effect: values for sensor in sensors.values() for effect, values in sensor.standard_errors.items()}
        constants: dict[str, Any] = {}
        if temperature is not None and temperature.mean is not None:
            constants["temperature_mean"] = temperature.mean
        model = SensorModel(list(effects), effects, constants=constants, standard_errors=errors)
        return Calibration(tuple(self.poses), sensors, model, tuple(self.notes), self.gravity)

    def _name_left_out(self) -> None:
        left_out = [pose for pose in self.poses if not pose.used]
        if left_out:
            texts = [f"pose {pose.number} ({pose.name}): {pose.reason}" for pose in left_out[:6]]
            more = f"; and {len(left_out) - 6} more" if len(left_out) > 6 else ""
            self.notes.append(f"Left out: {'; '.join(texts)}{more}.")

    def _accelerometer_told(self, cost: str | None) -> tuple[SensorCalibration, Temperature | None]:
        """Calibrate the accelerometer; where the equations do not suffice, say what that means on the table."""
        try:
            return self._accelerometer(cost)
        except InputError as error:
            raise (
                error if error.file is not None else checks.too_few_positions(self.used, error, self.file, cost)
            ) from None

    def _accelerometer(self, cost: str | None) -> tuple[SensorCalibration, Temperature | None]:
        self.poses, flips = checks.check_labels(self.poses, self.logs[0])
        if not self.used:
            return self._from_motion(cost), None
        usable = self.used
        if self.labelled and all(pose.attitude is None for pose in usable):
            self.poses = [
                pose.without("it has no label") if pose.used and pose.label is None else pose for pose in self.poses
            ]
            usable = self.used
        chosen = cost or self._cost(usable)
        checks.check_poses(usable, chosen, self.file)
        temperature = Temperature.of(usable)
        if chosen == "magnitude":
            result = accelerometer.fit_magnitude(usable, self.gravity, temperature)
            self._say_of_poses(flips)
            return result, temperature
        result = accelerometer.fit_vector(usable, self._targets(usable), self.gravity, temperature)
        strewn = result.excess > accelerometer.ASTRAY * self.gravity
        if cost is None and not self.labelled and strewn and len(usable) >= 7:
            result = accelerometer.fit_magnitude(usable, self.gravity, temperature, misalignment=False)
            lacking = checks.unshown(np.array([pose.direction for pose in usable]))
            self.notes.append(
                "The poses were not laid on a table: lengths determine scale and bias alone."
                + (f" The poses do not show {lacking.problem()}: record also {lacking.remedy()}." if lacking else "")
            )
        self._say_of_poses(flips)
        return result, temperature

    def _say_of_poses(self, flips: Sequence[str]) -> None:
        """Note flipped axes first, repeated poses last."""
        same = [f"{a.number} and {b.number}" for a, b in repeated(self.used)]
        if same:
            self.notes.append(
                f"Poses {', '.join(same[:3])}{' and others' if len(same) > 3 else ''} are the same: they add no new "
                "direction."
            )
        self.notes[:0] = flips

    def _cost(self, poses: Sequence[Pose]) -> str:
        """Vector where directions are known; else by the number of poses."""
        if self.labelled or all(pose.attitude is not None for pose in poses):
            return "vector"
        if distinct(np.array([pose.direction for pose in poses])) < checks.UNKNOWNS["magnitude"]:
            return "vector"
        try:
            accelerometer.fit_magnitude(poses, self.gravity, Temperature.of(()))
        except InputError:
            return "vector"
        return "magnitude"

    def _targets(self, poses: Sequence[Pose]) -> accelerometer.Targets:
        attitudes = [pose.attitude for pose in poses if pose.attitude is not None]
        if len(attitudes) == len(poses):
            up = np.array(_imufit.frame_vectors(self.logs[0].metadata.frame)["up"])
            return accelerometer.referenced(np.array(attitudes), up, self.gravity, "reference")
        plain = accelerometer.nominal(poses, self.gravity)
        if len(self.logs) > 1 or self.logs[0].gyr is None or len(poses) < 8:
            return plain
        # Headings from the gyro between the poses: then a tilt of the table does not pass for misalignment.
        turns = find_turns(self.logs[0], poses, self.found[0].gyr_noise, self.gravity)
        gyr = gyroscope.fit_gyroscope([turns], poses)
        matrix = np.eye(3) if gyr is None else gyr.matrix
        found = gyroscope.table_attitudes(turns, poses, matrix)
        if found is None:
            return plain
        return accelerometer.referenced(found, np.array([0.0, 0.0, 1.0]), self.gravity, "sides")

    def _from_motion(self, cost: str | None) -> SensorCalibration:
        reasons = "; ".join(f"pose {pose.number} ({pose.name}): {pose.reason}" for pose in self.poses[:3])
        reasons += f"; and {len(self.poses) - 3} more" if len(self.poses) > 3 else ""
        never = f"no pose can be used ({reasons})" if reasons else "the sensor never lay still"
        failed = InputError(
            never,
            file=self.file,
            remedy="Choose a wider range of the sensor."
            if all("saturated" in pose.reason for pose in self.poses) and self.poses
            else "Lay each of the six sides up and keep the sensor still for 3 s each.",
        )
        acc = np.concatenate([log.acc[~np.isnan(log.acc).any(axis=1)] for log in self.logs if log.acc is not None])
        time = sum(float(log.t[-1] - log.t[0]) for log in self.logs if log.acc is not None and log.n)
        if self.labelled or cost == "vector" or time < accelerometer.MOTION_TIME or len(acc) < 1000:
            raise failed
        try:
            return accelerometer.fit_motion(acc, self.gravity)
        except InputError:
            raise failed from None

    def _gyroscope(self, acc: SensorCalibration | None, mean: float) -> SensorCalibration | None:
        turns, rests = [], []
        correct = None if acc is None else acc.correct
        for index, (log, found) in enumerate(zip(self.logs, self.found, strict=True)):
            if log.gyr is None or log.acc is None:
                continue
            # A rest without a label is not informative about the accelerometer, but a turn may begin or end there.
            every = find_poses(log, index, settings=self.settings, labelled_only=False) if found.labelled else found
            resting = [pose for pose in every.poses if pose.used]
            if resting:
                turns.append(find_turns(log, resting, every.gyr_noise, self.gravity, correct, mean))
                rests += resting
        return gyroscope.fit_gyroscope(turns, rests) if rests else None
