"""How a body turned, by the gyroscope and by the reference, row for row: what the reference is judged by.

The reference is an instrument too. Between two of its samples the gyroscope turned by its rate times the time; the
reference turned by something that is a map of this: the same at once where both are sound.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from imufit.joining.course import Course, reference_course
from imufit.joining.search import LEAST_OVERLAP

Array = NDArray[np.float64]
Part = Mapping[str, Any]

ROWS: Final = 200_000
"""Rows of the beginning of a log that the reference is judged by: half an hour at 100 Hz."""
LEAST_SWING: Final = np.radians(30.0)
"""Angle that the gyroscope must have gone through about one axis before anything is said."""


@dataclass(frozen=True, eq=False)
class Turning:
    """Readings beside the reference, and both integrated.

    Attributes
    ----------
    t : (n,) array
        Time, s.
    gyr, acc, mag : (n, 3) array
        Readings, rad/s, m/s^2, uT; NaN where there are none.
    ref_q : (n, 4) array
        Reference attitude; NaN where there is none.
    """

    t: Array
    gyr: Array
    acc: Array
    mag: Array
    ref_q: Array

    @classmethod
    def of(cls, chunks: Iterable[Part]) -> Turning | None:
        """Take the beginning of a log; None without gyroscope or reference, or where they say nothing.

        Parameters
        ----------
        chunks : iterable of dict
            The log as the compiled core takes it.
        """
        kept: dict[str, list[Array]] = {name: [] for name in ("t", "gyr", "acc", "mag", "ref_q")}
        rows = 0
        for chunk in chunks:
            if chunk["gyr"] is None or chunk["ref_q"] is None:
                return None
            core = slice(chunk["begin"], chunk["end"])
            size = len(chunk["t"][core])
            for name, parts in kept.items():
                parts.append(np.full((size, 3), np.nan) if chunk[name] is None else np.array(chunk[name][core]))
            rows += size
            if rows >= ROWS:
                break
        found = cls(**{name: np.concatenate(parts) for name, parts in kept.items()})
        known = (np.isfinite(each).all(axis=1) for each in (found.gyr, found.ref_q))
        if min(float(np.ptp(found.t[rows])) if rows.any() else 0.0 for rows in known) < LEAST_OVERLAP:
            return None
        return found

    @cached_property
    def sensor(self) -> Course:
        """The gyroscope, integrated."""
        return Course.of(self.t, self.gyr)

    @cached_property
    def rows(self) -> NDArray[np.intp]:
        """Rows with a reference."""
        return np.flatnonzero(np.isfinite(self.ref_q).all(axis=1))

    @cached_property
    def body(self) -> Course:
        """The reference, as a gyroscope on the body would read it."""
        return reference_course(self.t[self.rows], self.ref_q[self.rows])

    @cached_property
    def swing(self) -> float:
        """Angle, rad, that the gyroscope goes through about the axis that moves most, its offset left out."""
        angle = self.sensor.angle - np.median(self.sensor.rate, axis=0) * (self.sensor.t - self.sensor.t[0])[:, None]
        return float(np.max(np.ptp(angle, axis=0)))

    @cached_property
    def read(self) -> Array:
        """Turn of the gyroscope, (m - 1, 3) rad, from each sample of the reference to the next."""
        inside = np.clip(self.body.t, self.sensor.t[0], self.sensor.t[-1])
        return np.diff(self.sensor.angle_at(inside), axis=0)

    @cached_property
    def turned(self) -> Array:
        """Turn of the reference, (m - 1, 3) rad, from each of its samples to the next."""
        return self.body.rate * np.diff(self.body.t)[:, None]

    @cached_property
    def seen(self) -> NDArray[np.bool_]:
        """Which steps between samples of the reference touch no gap of either."""
        return ~self.body.gap & self.sensor.seen(self.body.t[:-1], self.body.t[1:])
