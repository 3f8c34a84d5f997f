"""Filters on rows as they come from a running device."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from imufit import _imufit
from imufit.replaying.replay import SETTINGS, SMOOTHERS, Settings

if TYPE_CHECKING:
    from imufit.log.metadata import Frame

Array = NDArray[np.float64]
T = TypeVar("T")

_NO_READING: Final[Sequence[float] | Array] = (np.nan, np.nan, np.nan)


class Stream:
    """Several filters at once on a live stream of rows.

    The same compiled step as in `imufit.replaying.replay`: with the same settings and initial attitude the results are
    equal bit by bit, however the rows are cut. A stream does not have the rows to come, so that the rules
    `max_gap`, `acc_range` and `gyr_range` are those of the settings and not taken from the whole log.

    Parameters
    ----------
    filters : sequence of str
        Names out of `imufit.replaying.FILTERS`.
    sensors : sequence of str
        Sensors that the device has: "acc", "gyr", "mag".
    frame : {"NED", "ENU", "NWU"}
        Reference frame of the attitudes.
    gravity : float
        Magnitude of gravity, m/s^2.
    mag_reference : sequence of 3 floats, optional
        Field in the reference frame, uT, of which the horizontal direction is used; without it north.
    settings : mapping of mappings, optional
        ``{"kalman": {"adaptive": 1.0}, "replay": {"acc_range": 19.6}}``, as in `imufit.replaying.replay`.
    initial : (4,) array or Rotation, optional
        Attitude at the first row, scalar first, body to reference frame; without it from the first readings.

    Raises
    ------
    ValueError
        An unknown filter, setting or sensor, or a smoother, which is not a filter for live rows.

    Examples
    --------
    >>> stream = Stream(["complementary", "kalman"], frame="ENU")
    >>> stream.step(0.00, acc=(0.0, 0.0, 9.81), gyr=(0.0, 0.0, 0.0))["kalman"]
    array([1., 0., 0., 0.])
    """

    def __init__(
        self,
        filters: Sequence[str],
        sensors: Sequence[str] = ("acc", "gyr"),
        *,
        frame: Frame = "NED",
        gravity: float = 9.80665,
        mag_reference: Sequence[float] | None = None,
        settings: Settings | None = None,
        initial: ArrayLike | Rotation | None = None,
    ) -> None:
        for sensor in sensors:
            if sensor not in ("acc", "gyr", "mag"):
                raise ValueError(f"{sensor!r} is not a sensor: use acc, gyr, mag")
        for name in filters:
            if name in SMOOTHERS:
                raise ValueError(
                    f"{name} needs the rows to come, which a stream does not know: use mekf here, "
                    f"and {name} on the recorded log with imufit.replaying.replay"
                )
        for name in settings or {}:
            if name not in SETTINGS:
                raise ValueError(f"settings for {name!r}: the filter is unknown. Use one of {', '.join(SETTINGS)}")
        chosen = settings or {}
        q0 = None
        if initial is not None:
            first = initial.as_quat()[[3, 0, 1, 2]] if isinstance(initial, Rotation) else initial
            q0 = np.asarray(first, dtype=np.float64).tolist()
        self.sensors = tuple(sensors)
        surroundings: dict[str, Any] = {
            "frame": frame,
            "gravity": gravity,
            "mag_reference": None if mag_reference is None else [float(x) for x in mag_reference],
            "rules": dict(chosen.get("replay", {})),
            "initial": q0,
        }
        self._skipped_before: dict[str, dict[str, int]] = {}
        self._made = {name: {**surroundings, "settings": dict(chosen.get(name, {}))} for name in filters}
        self._filters = {name: _imufit.Filter(name, **given) for name, given in self._made.items()}

    @property
    def filters(self) -> tuple[str, ...]:
        """Names of the filters."""
        return tuple(self._filters)

    def step(
        self,
        t: float,
        acc: Sequence[float] | Array | None = None,
        gyr: Sequence[float] | Array | None = None,
        mag: Sequence[float] | Array | None = None,
    ) -> dict[str, Array]:
        """Attitudes after one more row.

        Parameters
        ----------
        t : float
            Time, s.
        acc, gyr, mag : (3,) array, optional
            m/s^2, rad/s, uT; None or NaN for a sensor without a reading in this row.

        Returns
        -------
        dict of (4,) arrays
            Per filter, scalar first, body to reference frame; NaN before the start.

        Raises
        ------
        ValueError
            A reading of a sensor that the stream does not have, or not three numbers.
        """
        given: dict[str, Sequence[float] | Array | None] = {"acc": acc, "gyr": gyr, "mag": mag}
        row = self._of_sensors(given, _NO_READING)
        return {name: running.step(t, **row) for name, running in self._filters.items()}

    def extend(
        self,
        t: ArrayLike,
        acc: ArrayLike | None = None,
        gyr: ArrayLike | None = None,
        mag: ArrayLike | None = None,
    ) -> dict[str, Array]:
        """Attitudes after each of n more rows, as they come in a burst.

        Parameters
        ----------
        t : (n,) array
            Time, s.
        acc, gyr, mag : (n, 3) array, optional
            m/s^2, rad/s, uT; None for a sensor without readings in these rows.

        Returns
        -------
        dict of (n, 4) arrays
            Per filter, as in `step`.

        Raises
        ------
        ValueError
            As in `step`, and columns of different lengths.
        """
        times = np.ascontiguousarray(t, dtype=np.float64)
        given = {
            name: None if values is None else np.ascontiguousarray(values, dtype=np.float64)
            for name, values in (("acc", acc), ("gyr", gyr), ("mag", mag))
        }
        rows = self._of_sensors(given, np.full((*times.shape, 3), np.nan))
        return {name: running.run(times, **rows)[0] for name, running in self._filters.items()}

    @property
    def skipped(self) -> dict[str, int]:
        """Reason and number of rows of which something was not used, the largest of all filters."""
        every = list(self._skipped().values())
        return {
            reason: max(one.get(reason, 0) for one in every) for reason in dict.fromkeys(r for o in every for r in o)
        }

    @property
    def state(self) -> dict[str, Array]:
        """All that the next row depends on, per filter: keep it, and set it on another stream to go on there.

        The counts in `skipped` are not part of it.
        """
        return {name: running.state for name, running in self._filters.items()}

    @state.setter
    def state(self, state: Mapping[str, ArrayLike]) -> None:
        if set(state) != set(self._filters):
            raise ValueError(f"the state is of {', '.join(state)}, but the stream has {', '.join(self._filters)}")
        for name, values in state.items():
            self._filters[name].state = np.ascontiguousarray(values, dtype=np.float64)

    def __getstate__(self) -> dict[str, Any]:
        """How the filters were made, how far they are, and what they skipped: the stream goes on to the bit."""
        return {
            "sensors": self.sensors,
            "made": self._made,
            "state": self.state,
            "skipped": self._skipped(),
        }

    def __setstate__(self, kept: dict[str, Any]) -> None:
        self.sensors = kept["sensors"]
        self._made = kept["made"]
        self._filters = {name: _imufit.Filter(name, **given) for name, given in self._made.items()}
        self.state = kept["state"]
        self._skipped_before = kept["skipped"]

    def reset(self) -> None:
        """Go back to before the first row."""
        for running in self._filters.values():
            running.reset()
        self._skipped_before = {}

    def _skipped(self) -> dict[str, dict[str, int]]:
        """Rows skipped by each filter, by reason, those before the stream was pickled among them."""
        both = {}
        for name, running in self._filters.items():
            before, now = self._skipped_before.get(name, {}), running.skipped
            both[name] = {reason: before.get(reason, 0) + now.get(reason, 0) for reason in {**before, **now}}
        return both

    def _of_sensors(self, given: Mapping[str, T | None], missing: T) -> dict[str, T]:
        """Pick the readings of the stream's sensors, `missing` where there is none."""
        for name, values in given.items():
            if values is not None and name not in self.sensors:
                raise ValueError(f"the stream has no {name}: name it among its sensors, or leave it out")
        picked = {}
        for name in self.sensors:
            values = given[name]
            picked[name] = missing if values is None else values
        return picked
