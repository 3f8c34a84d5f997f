"""Free rotation for the magnetometer: how much of it was done, reading by reading."""

from __future__ import annotations

import itertools
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit

Array = NDArray[np.float64]

_GRID: Final = np.array([way for way in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
DIRECTIONS: Final = _GRID / np.linalg.norm(_GRID, axis=1)[:, None]
"""(26, 3) faces, edges and corners of a cube, as unit vectors."""
ENOUGH: Final = 21
"""Directions out of the 26 in which the field has to have been seen."""
NEW: Final = 0.1
"""Share of its length by which the field has to differ from the last reading that was kept."""
AGAIN: Final = 20
"""Kept readings after which the middle of the field is worked out anew."""


class FreeTurning:
    """States how much of a free rotation was done: in how many directions of the body the field has pointed.

    The middle of all readings is not known beforehand, since hard iron moves it: a sphere is laid through them.
    """

    def __init__(self) -> None:
        self._kept: list[Array] = []
        self._seen: frozenset[int] = frozenset()
        self._middle: Array | None = None
        self._last: Array | None = None

    @property
    def open(self) -> tuple[int, ...]:
        """Rows of `DIRECTIONS` in which the field has not pointed yet."""
        return tuple(k for k in range(len(DIRECTIONS)) if k not in self._seen)

    @property
    def field(self) -> tuple[float, ...] | None:
        """Unit vector of the field in the body by the last reading; None while its middle is not known."""
        if self._middle is None or self._last is None:
            return None
        away = self._last - self._middle
        return tuple((away / max(float(np.linalg.norm(away)), 1e-30)).tolist())

    @property
    def seen(self) -> int:
        """Directions out of 26 in which the field has pointed so far."""
        return len(self._seen)

    @property
    def progress(self) -> float:
        """How much of it is done, 0 to 1."""
        return min(1.0, self.seen / ENOUGH)

    @property
    def complete(self) -> bool:
        """Whether it is enough."""
        return self.seen >= ENOUGH

    def step(self, mag: Array) -> None:
        """Take one reading.

        Parameters
        ----------
        mag : (3,) array
            Magnetic flux density, uT; NaN where there is none.
        """
        # A middle that moves later must not ask for directions again.
        if self.complete or not np.isfinite(mag).all():
            return
        self._last = np.array(mag, dtype=np.float64)
        if self._kept:
            away = float(np.linalg.norm(mag - self._kept[-1]))
            if away < NEW * float(np.linalg.norm(mag)):
                return
        self._kept.append(self._last)
        if len(self._kept) % AGAIN == 0:
            self._look()

    def _look(self) -> None:
        """Find the middle, and the directions seen from there."""
        readings = np.array(self._kept)
        found = _imufit.sphere(readings)
        if found is None:
            return
        self._middle = np.array(found[0])
        away = readings - self._middle
        length = np.linalg.norm(away, axis=1)
        # Readings of a rotation about one axis lie on a circle, through which there are many spheres.
        fits = np.abs(length - found[1]) < 0.3 * found[1]
        nearest = np.argmax(away[fits] @ DIRECTIONS.T, axis=1)
        self._seen = frozenset(nearest.tolist())
