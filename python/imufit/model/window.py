"""The argument of a user's effect: rows of a log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import field as attribute

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError

Array = NDArray[np.float64]

TEMPERATURE = "temp"


@dataclass(frozen=True, eq=False)
class Window:
    """Rows of a log: ideal readings and columns, SI units, body frame. Its arrays are read-only.

    Attributes
    ----------
    t : ndarray
        (n,) time, s.
    t_start : float
        Time of the log's first row, s.
    dt : float
        Median time between rows of the log, s.
    omega, alpha : ndarray
        (n, 3) ideal angular rate, rad/s, and angular acceleration, rad/s^2.
    f, m : ndarray
        (n, 3) ideal specific force, m/s^2, and magnetic flux density, uT.
    x : ndarray
        (n, 3) what the effect's stage acts on: the sensor's ideal reading plus earlier effects of the model (of an
        effect with memory the ideal reading alone).
    columns : mapping of str to ndarray
        (n,) every other column of the log.
    means : mapping of str to float
        Their means over the log of the fit, ``temp`` (degC) among them.
    effect : str
        Id of the effect that asks.
    counted_from_mean : set of str
        Columns that were requested less their mean.
    """

    t: Array
    t_start: float
    dt: float
    omega: Array
    alpha: Array
    f: Array
    m: Array
    x: Array
    columns: Mapping[str, Array]
    means: Mapping[str, float]
    effect: str = "of the user"
    counted_from_mean: set[str] = attribute(default_factory=set, repr=False)
    """Columns that were requested less their mean."""

    @property
    def rate(self) -> Array:
        """Ideal angular rate, (n, 3), rad/s: the same as `omega`."""
        return self.omega

    @property
    def angular_acceleration(self) -> Array:
        """Ideal angular acceleration, (n, 3), rad/s^2: the same as `alpha`."""
        return self.alpha

    @property
    def specific_force(self) -> Array:
        """Ideal specific force, (n, 3), m/s^2: the same as `f`."""
        return self.f

    @property
    def field(self) -> Array:
        """Ideal magnetic flux density, (n, 3), uT: the same as `m`."""
        return self.m

    @property
    def temperature(self) -> Array:
        """Sensor temperature less its mean over the log of the fit, (n,), K."""
        return self.column(TEMPERATURE, centred=True)

    def has(self, name: str) -> bool:
        """Return whether the log has a column; ``temp`` is the temperature.

        Parameters
        ----------
        name : str
            Name of the column.
        """
        return name in self.columns

    def column(self, name: str, *, centred: bool = False) -> Array:
        """One of the log's own columns, (n,), in its unit; ``temp`` is the temperature, degC.

        Parameters
        ----------
        name : str
            Name of the column.
        centred : bool, optional
            Less its mean over the log of the fit. The model keeps that mean, so that `apply` counts from it in every
            other log.

        Raises
        ------
        InputError
            The log has no such column.
        """
        if name not in self.columns:
            raise InputError(
                f"effect {self.effect} reads the column {name}, but the log has no column {name}; it has "
                f"{', '.join(self.columns) or 'none of its own'}",
                remedy=f"Add the column, or say needs=[{name!r}]: then the effect is not offered without it.",
            )
        if not centred:
            return self.columns[name]
        self.counted_from_mean.add(name)
        return self.columns[name] - self.means[name]
