"""Attitude filters as objects on bare arrays.

Every filter has the same calls::

    q = imufit.filters.Mahony(k_p=0.5).run(gyr, acc, mag, 0.01)     # (n, 4), all rows at once
    now = running.update(gyr, acc, mag, dt=0.01)                    # (4,), sample by sample

Rows of arrays are samples: angular rate in rad/s, specific force in m/s^2, magnetic flux density in uT, in the axes of
the body. Attitudes are unit quaternions, scalar first, that turn body vectors into the reference frame. NaN is a
missing sample. One call for all rows, calls for parts of them and calls for single rows give the same to the last bit.
"""

from __future__ import annotations

import copy
import inspect
from collections.abc import Mapping
from typing import Any, ClassVar, Final, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from imufit import _imufit
from imufit.errors import InputError
from imufit.log.words import nearest
from imufit.results.table import Table, html

Array = NDArray[np.float64]

RULES: Final = _imufit.replay_rules()
"""Settings of the rules around every filter (gaps, free fall, ends of the ranges): default, unit, meaning by name."""
FRAMES: Final = ("NED", "ENU", "NWU")
"""Reference frames."""


class AttitudeFilter:
    """The common part of all filters.

    Parameters
    ----------
    frame : {"NED", "ENU", "NWU"}
        Reference frame of the attitudes.
    gravity : float
        Magnitude of gravity, m/s^2.
    mag_reference : (3,) array, optional
        Magnetic field in the reference frame, uT, of which the horizontal direction is used; without it north.
    initial : (4,) array or Rotation, optional
        Attitude at the first row, scalar first, body to reference frame; without it from the first readings.
    start_time : float, optional
        Time that `initial` belongs to, s, where it is not that of the first row.
    **settings
        Settings of the filter and of the rules around every filter (:data:`RULES`), in SI units.

    Raises
    ------
    InputError
        A setting or the frame is unknown, or a setting cannot be.
    """

    name: ClassVar[str] = ""
    """Name of the filter in :func:`imufit.replay` and on the command line."""
    settings: ClassVar[Mapping[str, _imufit._Setting]] = {}
    """Settings of the filter: default, unit, meaning by name."""
    needs: ClassVar[tuple[str, ...]] = ()
    """Sensors that the filter cannot do without."""

    def __init_subclass__(cls) -> None:
        described = _imufit.filter_descriptions()[cls.name]
        cls.settings, cls.needs = described["settings"], tuple(described["needs"])
        keywords = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=entry["default"], annotation=float)
            for name, entry in cls.settings.items()
        ]
        common = list(inspect.signature(AttitudeFilter.__init__).parameters.values())[1:-1]
        # what help() and completion show
        setattr(cls, "__signature__", inspect.Signature([*keywords, *common]))  # noqa: B010  no type knows it
        lines = [
            f"    {name} : float, {entry['unit']}\n        {entry['meaning']}" for name, entry in cls.settings.items()
        ]
        more = "\n\n    Settings\n    --------\n" + "\n".join(lines) + "\n    " if lines else ""
        cls.__doc__ = f"{(cls.__doc__ or '').rstrip()}{more}"

    def __init__(
        self,
        *,
        frame: str = "NED",
        gravity: float = 9.80665,
        mag_reference: ArrayLike | None = None,
        initial: ArrayLike | Rotation | None = None,
        start_time: float | None = None,
        **settings: float,
    ) -> None:
        if frame not in FRAMES:
            raise InputError(f"the frame {frame!r} is unknown", remedy=f"Use {', '.join(FRAMES)}.")
        for setting in settings:
            if setting not in self.settings and setting not in RULES:
                close = nearest(setting, [*self.settings, *RULES])
                asked = f"Did you mean {close[0]}? " if close else ""
                own = ", ".join(self.settings) or "none of its own"
                raise InputError(f"{self.name} has no setting {setting}", remedy=f"{asked}Its settings: {own}.")
        first = None if initial is None else _quaternion(initial)
        self._given: dict[str, Any] = {
            "frame": frame,
            "gravity": float(gravity),
            "mag_reference": None if mag_reference is None else np.asarray(mag_reference, np.float64).tolist(),
            "settings": {name: float(value) for name, value in settings.items() if name in self.settings},
            "rules": {name: float(value) for name, value in settings.items() if name in RULES},
            "initial": None if first is None else first.tolist(),
            "start_time": start_time,
        }
        try:
            self._core = _imufit.Filter(self.name, **self._given)
        except ValueError as error:
            raise InputError(str(error)) from error
        self._clock = _Clock()

    def run(
        self,
        gyr: ArrayLike | None = None,
        acc: ArrayLike | None = None,
        mag: ArrayLike | None = None,
        dt_or_t: ArrayLike | None = None,
    ) -> Array:
        """Attitudes after each of n more rows.

        Parameters
        ----------
        gyr : (n, 3) array, optional
            Angular rate, rad/s.
        acc : (n, 3) array, optional
            Specific force, m/s^2.
        mag : (n, 3) array, optional
            Magnetic flux density, uT.
        dt_or_t : float or (n,) array
            Time between two rows, s; or the time of each row, s, strictly increasing.

        Returns
        -------
        (n, 4) array
            Unit quaternions, scalar first, body to reference frame; NaN before the start.

        Raises
        ------
        InputError
            A sensor that the filter needs is missing, arrays have different lengths, or the time cannot be.
        """
        arrays = {name: _rows(name, given) for name, given in (("acc", acc), ("gyr", gyr), ("mag", mag))}
        self._check_sensors(arrays)
        n = next(array.shape[0] for array in arrays.values() if array is not None)
        for name, array in arrays.items():
            if array is not None and array.shape[0] != n:
                raise InputError(f"{name} has {array.shape[0]} rows, but another sensor has {n}")
        t = self._clock.times(dt_or_t, n)
        return self._core.run(t, **arrays)[0]

    def update(
        self,
        gyr: ArrayLike | None = None,
        acc: ArrayLike | None = None,
        mag: ArrayLike | None = None,
        dt: float | None = None,
        *,
        t: float | None = None,
    ) -> Array:
        """Attitude after one more row.

        Parameters
        ----------
        gyr : (3,) array, optional
            Angular rate, rad/s.
        acc : (3,) array, optional
            Specific force, m/s^2.
        mag : (3,) array, optional
            Magnetic flux density, uT.
        dt : float
            Time since the row before, s; or `t` instead.
        t : float
            Time of the row, s.

        Returns
        -------
        (4,) array
            Unit quaternion, scalar first, body to reference frame; NaN before the start.

        Raises
        ------
        InputError
            As in `run`.
        """
        arrays = {name: _rows(name, given, one=True) for name, given in (("acc", acc), ("gyr", gyr), ("mag", mag))}
        self._check_sensors(arrays)
        at = self._clock.times(dt if t is None else np.array([t]), 1)
        rows = {name: None if array is None else array[0] for name, array in arrays.items()}
        return self._core.step(float(at[0]), **rows)

    @property
    def skipped(self) -> dict[str, int]:
        """Reason and number of rows of which something was not used, since the filter was made or reset."""
        return self._core.skipped

    @property
    def state(self) -> Array:
        """All that the next row depends on, (k,): set it on another filter with the same settings to go on there."""
        return np.concatenate([self._clock.state, self._core.state])

    @state.setter
    def state(self, state: ArrayLike) -> None:
        values = np.ascontiguousarray(state, dtype=np.float64)
        if values.shape != self.state.shape:
            raise InputError(
                f"the state has shape {values.shape}, but that of {self.name} has {self.state.shape}",
                remedy="Take the state of a filter of the same kind.",
            )
        self._clock.state = values[: _Clock.SIZE]
        self._core.state = values[_Clock.SIZE :]

    def reset(self) -> None:
        """Go back to before the first row."""
        self._core.reset()
        self._clock = _Clock()

    def copy(self) -> Self:
        """Return an independent filter that stands where this one does."""
        return copy.copy(self)

    def _check_sensors(self, arrays: Mapping[str, Array | None]) -> None:
        there = [name for name, array in arrays.items() if array is not None]
        for name in self.needs:
            if name not in there:
                raise InputError(f"{self.name} needs {name}", remedy=f"Pass {' and '.join(self.needs)}.")

    def __copy__(self) -> Self:
        other = type(self).__new__(type(self))
        other.__setstate__(self.__getstate__())
        return other

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self.__copy__()

    def __getstate__(self) -> dict[str, Any]:
        """How the filter was made and how far it is; what it has skipped begins anew."""
        return {"given": self._given, "state": self.state}

    def __setstate__(self, kept: Mapping[str, Any]) -> None:
        """Make the filter as it was."""
        self._given = kept["given"]
        self._core = _imufit.Filter(self.name, **self._given)
        self._clock = _Clock()
        self.state = kept["state"]

    def _repr_html_(self) -> str:
        settings = _imufit.filter_descriptions()[self.name]["settings"]
        values = {**{name: entry["default"] for name, entry in settings.items()}, **self._given["settings"]}
        rows = tuple(
            (name, f"{values[name]:g}", settings[name]["unit"], settings[name]["meaning"]) for name in settings
        )
        header = ("setting", ">value", "unit", "meaning")
        return html([f"{self!r}: {_imufit.filter_descriptions()[self.name]['summary']}"], [Table("", header, rows)])

    def __repr__(self) -> str:
        changed = {**self._given["settings"], **self._given["rules"]}
        words = [f"{name}={value:g}" for name, value in changed.items()]
        words += [f"frame={self._given['frame']!r}"] if self._given["frame"] != "NED" else []
        return f"{type(self).__name__}({', '.join(words)})"


class Accel(AttitudeFilter):
    """Inclination from the specific force alone, row by row; the heading stays where it started (paper B, eq. 1)."""

    name = "accel"


class Gyro(AttitudeFilter):
    """The angular rate integrated from the initial attitude; exact for a constant rate, and it drifts."""

    name = "gyro"


class Complementary(AttitudeFilter):
    """The integrated rate pulled a little towards the accelerometer's inclination at each step (paper B, eq. 8)."""

    name = "complementary"


class Kalman(AttitudeFilter):
    """A Kalman filter of attitude and gyro bias with the accelerometer's inclination as its measurement (paper B)."""

    name = "kalman"


class Triad(AttitudeFilter):
    """Attitude from two vectors, specific force first and magnetic field second, row by row (paper C)."""

    name = "triad"


class Mahony(AttitudeFilter):
    """Mahony's nonlinear complementary filter with gyro bias, with or without a magnetometer (paper C)."""

    name = "mahony"


class Madgwick(AttitudeFilter):
    """Madgwick's gradient descent with the rate integrated, with or without a magnetometer (ICORR 2011)."""

    name = "madgwick"


class Quest(AttitudeFilter):
    """Attitude from two weighted vectors, the most probable one, row by row."""

    name = "quest"


class Hybrid(AttitudeFilter):
    """Mahony's filter driven (or, with driven = 0, started) by the attitude that TRIAD finds (paper C)."""

    name = "hybrid"


class Mekf(AttitudeFilter):
    """A multiplicative extended Kalman filter that knows disturbances, with or without a magnetometer."""

    name = "mekf"


ALL: Final[Mapping[str, type[AttitudeFilter]]] = {kind.name: kind for kind in AttitudeFilter.__subclasses__()}
"""The filters by the name that the command line has for them."""


class Smoother:
    """The filter :class:`Mekf` forwards and backwards over all rows: for recorded logs, not for live rows.

    Parameters
    ----------
    frame, gravity, mag_reference, initial, start_time, **settings
        As those of :class:`Mekf`.

    Attributes
    ----------
    skipped : dict of str to int
        Reason and number of rows of which something was not used in the last run.
    """

    name: ClassVar[str] = "smoother"
    settings: ClassVar[Mapping[str, _imufit._Setting]] = Mekf.settings
    needs: ClassVar[tuple[str, ...]] = Mekf.needs

    def __init__(self, **options: Any) -> None:
        self._like = Mekf(**options)
        self.skipped: dict[str, int] = {}

    def run(
        self,
        gyr: ArrayLike | None = None,
        acc: ArrayLike | None = None,
        mag: ArrayLike | None = None,
        dt_or_t: ArrayLike | None = None,
    ) -> Array:
        """Attitudes of n rows, each judged by all of them; parameters and result as in :meth:`AttitudeFilter.run`.

        Parameters
        ----------
        gyr, acc, mag : (n, 3) array, optional
            rad/s, m/s^2, uT.
        dt_or_t : float or (n,) array
            Time between two rows, or of each row, s.
        """
        arrays: dict[str, Any] = {
            name: _rows(name, given) for name, given in (("acc", acc), ("gyr", gyr), ("mag", mag))
        }
        self._like._check_sensors(arrays)
        n = next(array.shape[0] for array in arrays.values() if array is not None)
        attitude, self.skipped = _imufit.smooth(_Clock().times(dt_or_t, n), **arrays, **self._like._given)
        return attitude


class _Clock:
    """Times of rows that come a fixed step apart, the same however the rows are cut into calls."""

    SIZE: ClassVar[int] = 3

    def __init__(self) -> None:
        # rows since `_anchor`, each `_step` s after the one before; no row yet where the anchor is NaN
        self._anchor, self._step, self._rows = np.nan, np.nan, 0

    @property
    def state(self) -> Array:
        return np.array([self._anchor, self._step, float(self._rows)])

    @state.setter
    def state(self, values: Array) -> None:
        self._anchor, self._step, self._rows = float(values[0]), float(values[1]), int(values[2])

    def times(self, dt_or_t: ArrayLike | None, n: int) -> Array:
        if dt_or_t is None:
            raise InputError("the time is missing", remedy="Pass the step in s, or the time of each row in s.")
        given = np.asarray(dt_or_t, dtype=np.float64)
        if given.ndim == 0:
            return self._steps(float(given), n)
        if given.shape != (n,):
            raise InputError(f"the time has shape {given.shape}, but there are {n} rows")
        if n:
            self._anchor, self._step, self._rows = float(given[-1]), np.nan, 0
        return np.ascontiguousarray(given)

    def _steps(self, step: float, n: int) -> Array:
        if not (np.isfinite(step) and step > 0.0):
            raise InputError(f"the step is {step:g} s", remedy="Pass a step of more than 0 s.")
        if np.isnan(self._anchor):
            self._anchor, self._step, self._rows = 0.0, step, -1
        elif step != self._step:
            self._anchor, self._step, self._rows = self._now, step, 0
        times = self._anchor + step * np.arange(self._rows + 1, self._rows + 1 + n, dtype=np.float64)
        self._rows += n
        return times

    @property
    def _now(self) -> float:
        return self._anchor if np.isnan(self._step) else self._anchor + self._step * self._rows


def _rows(name: str, given: ArrayLike | None, *, one: bool = False) -> Array | None:
    if given is None:
        return None
    try:
        array = np.ascontiguousarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} does not hold numbers") from None
    wanted = "(3,)" if one else "(n, 3)"
    if one and array.shape == (3,):
        array = array[None, :]
    elif one or array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"{name} has shape {array.shape}, but {wanted} is required", remedy="Rows are samples.")
    return array


def _quaternion(initial: ArrayLike | Rotation) -> Array:
    first = initial.as_quat()[..., [3, 0, 1, 2]] if isinstance(initial, Rotation) else np.asarray(initial, np.float64)
    if first.shape != (4,):
        raise InputError(f"the initial attitude has shape {first.shape}, but (4,) is required: scalar first")
    return first
