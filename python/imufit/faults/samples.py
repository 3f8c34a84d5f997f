"""Rows from all over a log with what an ideal sensor would have read there."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from imufit import _imufit

Array = NDArray[np.float64]

SENSORS = ("acc", "gyr", "mag")
WINDOWS = 64
WINDOW_ROWS = 256
_NO_FILTERS: list[list[float]] = [[] for _ in range(9)]


def windows(chunks: Iterable[Mapping[str, Any]], facts: _imufit.Facts) -> list[dict[str, Any]]:
    """Cut windows with their margins out of the chunks of a log, evenly over it and copied.

    Parameters
    ----------
    chunks : iterable of dict
        The whole log as the compiled core takes it, with margins of ``facts.margin`` rows.
    facts : Facts
        Of the log.
    """
    rows = min(WINDOW_ROWS, max(1, facts.n // WINDOWS))
    firsts = np.unique(np.linspace(0, max(facts.n - rows, 0), WINDOWS).astype(int))
    found = []
    for chunk in chunks:
        start = chunk["offset"] + chunk["begin"]
        stop = chunk["offset"] + chunk["end"]
        for first in firsts[(firsts >= start) & (firsts < stop)]:
            begin = int(first) - chunk["offset"]
            found.append(_part(chunk, begin, min(begin + rows, chunk["end"]), facts.margin))
    return found


def _part(chunk: Mapping[str, Any], begin: int, end: int, margin: int) -> dict[str, Any]:
    low, high = max(0, begin - margin), min(end + margin, len(chunk["t"]))

    def cut(column: Array | None) -> Array | None:
        return None if column is None else column[low:high].copy()

    names = ("t", "acc", "gyr", "mag", "temp", "ref_q", "ref_p", "ref_exact")
    return {name: cut(chunk[name]) for name in names} | {
        "covariates": [cut(column) for column in chunk["covariates"]],
        "offset": chunk["offset"] + low,
        "begin": begin - low,
        "end": end - low,
    }


SURE_TURNS: Final = 1e-3
"""Mean square of turns, rad^2, that show the size of the field beside iron on the body: two degrees. Steel in a room, a
few uT of 50, is as much as smaller turns show."""
SEEN_TURNS: Final = 1e-5
"""The same for the course of the readings, which any field that fits shows: turns by more than the noise of a
reference, 0.2 degrees. A phone that was held flat had 377 uT of iron; half of that passed for field."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Readings and ideal readings of the same rows, body frame.

    Attributes
    ----------
    readings, ideal : dict of (n, 3) arrays
        By sensor, SI units (magnetometer uT); NaN where one of the two is not known.
    attitude : (n, 3, 3) array
        Reference attitudes, body to reference frame; the identity where there is none.
    """

    readings: dict[str, Array]
    ideal: dict[str, Array]
    attitude: Array

    def with_force(self, more: Array) -> Samples:
        """Return the samples with a specific force (3,), reference frame, added to the ideal one.

        Parameters
        ----------
        more : ndarray
            (3,) specific force, m/s^2, reference frame.
        """
        force = {name: x + more @ self.attitude for name, x in self.ideal.items() if name == "acc"}
        return Samples(self.readings, {**self.ideal, **force}, self.attitude)

    def on_clock(self, factor: float, resting: Samples) -> Samples:
        """Return the samples as they are if the time that passed is a multiple of `t`'s.

        Parameters
        ----------
        factor : float
            Time that passed over that of `t`.
        resting : Samples
            The same rows with a body that does not translate: what an accelerometer reads without its motion.
        """
        ideal = dict(self.ideal)
        if "gyr" in ideal:
            ideal["gyr"] = ideal["gyr"] / factor
        if "acc" in ideal:
            ideal["acc"] = resting.ideal["acc"] + (ideal["acc"] - resting.ideal["acc"]) / factor**2
        return Samples(self.readings, ideal, self.attitude)

    def with_position(self, still: Samples, factor: float) -> Samples:
        """Return the samples with the motion along the reference's path taken times a factor.

        Parameters
        ----------
        still : Samples
            The same rows, the body taken not to move along.
        factor : float
            What positions are multiplied by.
        """
        force = {"acc": still.ideal["acc"] + factor * (self.ideal["acc"] - still.ideal["acc"])}
        return Samples(self.readings, {**self.ideal, **force}, self.attitude)

    def exchanged(self, pairs: Sequence[tuple[str, str]]) -> Samples:
        """Return the samples with pairs of columns exchanged, such as ``acc_x`` and ``gyr_x``.

        Parameters
        ----------
        pairs : sequence of (str, str)
            Names of columns.
        """
        readings = {name: values.copy() for name, values in self.readings.items()}
        for one, other in pairs:
            for target, source in ((one, other), (other, one)):
                readings[target[:3]][:, "xyz".index(target[4])] = self.readings[source[:3]][:, "xyz".index(source[4])]
        return Samples(readings, self.ideal, self.attitude)

    def with_readings(self, **readings: Array) -> Samples:
        """Return the samples with other readings of some sensors, (n, 3) each."""
        return Samples({**self.readings, **readings}, self.ideal, self.attitude)

    def own_field(self, matrix: Array | None = None, least: float = SURE_TURNS) -> Array:
        """Return the field (3,) in the reference frame that fits the magnetometer best, iron on the body beside it.

        Parameters
        ----------
        matrix : ndarray, optional
            (3, 3) map M from true vectors to readings, which is undone first.
        least : float
            Mean square of the turns, rad^2, from which on they separate field and iron.
        """
        readings = self.readings["mag"] if matrix is None else self.readings["mag"] @ np.linalg.inv(matrix).T
        known = np.isfinite(readings).all(axis=1)
        if not known.any():
            return np.zeros(3)
        turned, readings = self.attitude[known], readings[known]
        # Least squares of y = R^T m + b: the mean over the rows of R y and of y.
        mean = turned.mean(axis=0)
        normal = np.block([[np.eye(3), mean], [mean.T, np.eye(3)]])
        right = np.concatenate([np.einsum("nij,nj->ni", turned, readings).mean(axis=0), readings.mean(axis=0)])
        # Where the turns do not separate field and iron, the smallest of both.
        return np.asarray(np.linalg.lstsq(normal, right, rcond=least)[0][:3])

    def with_own_field(self, matrix: Array) -> Samples:
        """Return the samples of the magnetometer, its axes corrected, with the field that its readings then give.

        Parameters
        ----------
        matrix : ndarray
            (3, 3) map M: the reading is M times the true vector.
        """
        readings = self.readings["mag"] @ np.linalg.inv(matrix).T
        return Samples({"mag": readings}, {"mag": self.own_field(matrix, SEEN_TURNS) @ self.attitude}, self.attitude)


def samples(parts: Iterable[Mapping[str, Any]], facts: _imufit.Facts) -> Samples:
    """Return the readings of some windows of a log beside those of an ideal sensor.

    Parameters
    ----------
    parts : iterable of dict
        From `windows`, the reference perhaps changed.
    facts : Facts
        Of the log.
    """
    empty = _imufit.Evidence(facts, [], [], 2, _NO_FILTERS)
    readings: dict[str, list[Array]] = {name: [] for name in facts.sensors}
    ideal: dict[str, list[Array]] = {name: [] for name in facts.sensors}
    attitudes = []
    for part in parts:
        core = slice(part["begin"], part["end"])
        residual = _imufit.evaluate(empty, dict(part), [])
        for name in facts.sensors:
            first = 3 * SENSORS.index(name)
            columns = [residual[first + axis] for axis in range(3)]
            shape = (part["end"] - part["begin"], 3)
            reading = np.full(shape, np.nan) if part[name] is None else part[name][core]
            known = [np.full(shape[0], np.nan) if column is None else column for column in columns]
            readings[name].append(reading)
            ideal[name].append(reading - np.stack(known, axis=1))
        attitudes.append(part["ref_q"][core])
    q = np.concatenate(attitudes)
    q = np.where(np.isfinite(q).all(axis=1)[:, None], q, [1.0, 0.0, 0.0, 0.0])
    found = Samples(
        {name: np.concatenate(values) for name, values in readings.items()},
        {name: np.concatenate(values) for name, values in ideal.items()},
        Rotation.from_quat(q[:, [1, 2, 3, 0]]).as_matrix(),
    )
    if "mag" in facts.sensors and facts.field_estimated:
        # The mean over a log that does not turn evenly takes iron on the body for a part of the field.
        field = np.where(np.isfinite(found.ideal["mag"]), found.own_field(least=SEEN_TURNS) @ found.attitude, np.nan)
        return Samples(found.readings, {**found.ideal, "mag": field}, found.attitude)
    return found
