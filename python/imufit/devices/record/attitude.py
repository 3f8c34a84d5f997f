"""Attitude of a device while its rows come: filters on batches of columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.errors import InputError
from imufit.log.columns import GROUPS, SENSORS
from imufit.log.metadata import Frame
from imufit.replaying import Stream

Array = NDArray[np.float64]

WITH_MAG: Final = ("triad", "mahony", "hybrid")
"""Filters of a device with a magnetometer, unless others are named: those of paper C."""
WITHOUT_MAG: Final = ("accel", "gyro", "complementary", "kalman")
"""Filters of a device without one: those of paper B."""


def sensors_in(columns: Sequence[str]) -> tuple[str, ...]:
    """Sensors of which all three axes are there.

    Parameters
    ----------
    columns : sequence of str
        Columns of a log.
    """
    return tuple(name for name in SENSORS if all(axis in columns for axis in GROUPS[name]))


class LiveAttitude:
    """Several filters on the batches of a device.

    Parameters
    ----------
    columns : sequence of str
        Columns of the device.
    filters : sequence of str
        Names out of `imufit.replaying.FILTERS`; none means those of the papers for the sensors that are there.
    frame : {"NED", "ENU", "NWU"}
        Reference frame of the angles.

    Attributes
    ----------
    angles : dict of (3,) arrays
        Roll, pitch and yaw after the last row, rad, for each filter; NaN before its start.
    """

    def __init__(self, columns: Sequence[str], filters: Sequence[str] = (), *, frame: Frame = "NED") -> None:
        self.sensors = sensors_in(columns)
        descriptions = _imufit.filter_descriptions()
        chosen = tuple(filters) or (WITH_MAG if "mag" in self.sensors else WITHOUT_MAG)
        runnable = [name for name in chosen if not set(descriptions[name]["needs"]) - set(self.sensors)]
        if filters and len(runnable) < len(chosen):
            name = next(name for name in chosen if name not in runnable)
            missing = " and ".join(sorted(set(descriptions[name]["needs"]) - set(self.sensors)))
            raise InputError(f"{name} needs {missing}, which the device does not send", remedy="Take another filter.")
        self._stream = Stream(runnable, self.sensors, frame=frame) if runnable else None
        self.angles: dict[str, Array] = {name: np.full(3, np.nan) for name in runnable}

    def add(self, batch: Mapping[str, Array]) -> None:
        """Take the next rows.

        Parameters
        ----------
        batch : mapping of (n,) arrays
            `t` and the columns, SI units.
        """
        if self._stream is None or not batch["t"].size:
            return
        readings = {name: np.stack([batch[axis] for axis in GROUPS[name]], axis=1) for name in self.sensors}
        for name, q in self._stream.extend(batch["t"], **readings).items():
            self.angles[name] = _imufit.euler_from_quaternion(np.ascontiguousarray(q[-1:]))[0]
