"""The readings of an emulated device: readings by column over time, from a scenario or a log."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.lab.simulate import SCENARIOS, Noise, simulate
from imufit.log import Log, parse_mapping, read
from imufit.log.metadata import Frame
from imufit.remedy import keyword

Array = NDArray[np.float64]
Effects = Mapping[str, Mapping[str, float] | None]

SENSORS = {"acc": ("acc_x", "acc_y", "acc_z"), "gyr": ("gyr_x", "gyr_y", "gyr_z"), "mag": ("mag_x", "mag_y", "mag_z")}
LENGTH = 120.0
"""Time (s) for which a scenario is simulated by default; a longer run repeats it on request."""
FULL = 0.9
"""Share of rows in which a column must have a reading to count as one of the full rate."""


@dataclass(frozen=True)
class Source:
    """Readings as a device takes them.

    Attributes
    ----------
    name : str
        Of the scenario or the log.
    t : (n,) array
        Time since the first row, s.
    groups : dict of dict of (n,) arrays
        Columns that are read together, by sensor or covariate, then by column; SI units, NaN where a reading is
        missing.
    """

    name: str
    t: Array
    groups: Mapping[str, Mapping[str, Array]]
    _full: dict[str, float] = field(default_factory=dict, repr=False)

    @property
    def rate(self) -> float:
        """Rows a second, by the usual distance of two rows."""
        return float(f"{1.0 / np.median(np.diff(self.t)):.9g}")

    @property
    def length(self) -> float:
        """Time (s) after which the first row could follow the last one again."""
        return float(self.t[-1]) + 1.0 / self.rate

    def share(self, group: str) -> float:
        """Return the share of rows in which a group has a reading.

        Parameters
        ----------
        group : str
            Name of the group.
        """
        if group not in self._full:
            there = np.any([np.isfinite(column) for column in self.groups[group].values()], axis=0)
            self._full[group] = float(np.mean(there))
        return self._full[group]

    def at_rate(self, rate: float) -> Source:
        """Return the same readings at another rate: between rows of full rate in a straight line.

        A slow sensor, such as a magnetometer, keeps its own rate: each of its readings goes to the next row.

        Parameters
        ----------
        rate : float
            Rows a second.
        """
        t = np.arange(int(np.floor(self.t[-1] * rate)) + 1) / rate
        if len(t) < 2:
            raise InputError(
                f"{self.name} has less than two rows at {rate:g} Hz",
                remedy="Give a higher " + keyword("rate") + ".",
            )
        groups = {
            name: {column: self._moved(values, t, self.share(name) < FULL) for column, values in columns.items()}
            for name, columns in self.groups.items()
        }
        return Source(self.name, t, groups)

    def _moved(self, values: Array, t: Array, slow: bool) -> Array:
        there = np.isfinite(values)
        if not slow:
            return np.interp(t, self.t[there], values[there])
        moved = np.full(len(t), np.nan)
        rows = np.searchsorted(t, self.t[there])
        kept = rows < len(t)
        moved[rows[kept]] = values[there][kept]
        return moved


def of_log(log: Log, name: str) -> Source:
    """Return what a device would have sent whose recording is `log`: no reference, no labels.

    Parameters
    ----------
    log : Log
        Any log of two rows or more.
    name : str
        What to call it.
    """
    groups: dict[str, dict[str, Array]] = {}
    for sensor, columns in SENSORS.items():
        values = getattr(log, sensor)
        if values is not None:
            groups[sensor] = dict(zip(columns, np.ascontiguousarray(values.T), strict=True))
    if log.temp is not None:
        groups["temp"] = {"temp": log.temp}
    groups |= {column: {column: values} for column, values in log.covariates.items()}
    groups = {name: columns for name, columns in groups.items() if any(np.isfinite(v).any() for v in columns.values())}
    if not groups:
        raise InputError("the log has no readings that a device could send", file=name)
    if log.n < 2:
        raise InputError("a device needs two rows or more", file=name)
    return Source(name, log.t - log.t[0], groups)


def _noise(device: str, scenario: str) -> Noise:
    """Return the random errors of a device; of `floats` those that the scenario has anyhow."""
    if device == "mpu6050":
        return Noise.mpu6050()
    return Noise.gy86() if device == "gy86" else SCENARIOS[scenario].noise()


def open_source(
    source: str | Path | Log,
    *,
    rate: float | None = None,
    duration: float | None = None,
    device: str = "floats",
    effects: Effects | None = None,
    seed: int = 0,
    frame: Frame = "NED",
    mapping: Iterable[str] = (),
) -> Source:
    """Return the readings of a scenario, simulated, or of a log.

    Parameters
    ----------
    source : str, Path or Log
        Name of a scenario out of `imufit.lab.simulate.SCENARIOS`, file of a log, or a log.
    rate : float, optional
        Rows a second; without it 100 for a scenario, those of the log otherwise.
    duration : float, optional
        Length of a scenario, s; `LENGTH` without it, or if that is shorter.
    device : {"floats", "mpu6050", "gy86"}
        Whose random errors a scenario has.
    effects : mapping, optional
        Effects of the scenario's sensor, as for `imufit.lab.simulate.simulate`.
    seed : int
        Of a scenario's motion and noise.
    frame : {"NED", "ENU", "NWU"}
        In which a scenario is simulated, so that its device lies level there.
    mapping : iterable of str
        Columns and units of a file, such as ``acc_x=AccX[g]``.

    Raises
    ------
    InputError
        Neither a scenario nor a readable log, or effects of what is a log.
    """
    if isinstance(source, str) and source in SCENARIOS:
        try:
            made = simulate(
                source,
                effects,
                seed,
                min(duration or LENGTH, LENGTH),
                rate or 100.0,
                frame=frame,
                noise=_noise(device, source),
            )
        except ValueError as error:
            raise InputError(str(error)) from error
        return of_log(made.to_log(), source)
    if effects:
        raise InputError("effects can only be put into a scenario", remedy="Leave them out for a log.")
    if not isinstance(source, Log):
        path = Path(source)
        if not path.is_file():
            near = difflib.get_close_matches(str(source), SCENARIOS, n=1)
            meant = f"Did you mean {near[0]}? " if near else ""
            raise InputError(
                f"{str(source)!r} is neither a scenario nor a file",
                remedy=f"{meant}Scenarios are {', '.join(SCENARIOS)}.",
            )
        source = read(path, mapping=parse_mapping(*mapping) or None)
    found = of_log(source, source.path.name if source.path else "log")
    return found if rate is None else found.at_rate(rate)
