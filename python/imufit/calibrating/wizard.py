"""Everything a live calibration asks for, batch after batch, whoever shows it: six sides, more rests, free rotation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.calibrating.free_turning import ENOUGH, FreeTurning
from imufit.calibrating.guide import PoseGuide
from imufit.figures import quantity
from imufit.rests.poses import SIDES

Array = NDArray[np.float64]
Batch = Mapping[str, Array]

_ACC: Final = ("acc_x", "acc_y", "acc_z")
_GYR: Final = ("gyr_x", "gyr_y", "gyr_z")
_MAG: Final = ("mag_x", "mag_y", "mag_z")


@dataclass(frozen=True)
class Stage:
    """Where a live calibration stands.

    Attributes
    ----------
    message : str
        One line: what to do now.
    done : tuple of str
        Sides that are known, in the order in which they came.
    progress : float
        How much of the present hold, or of the free rotation, is done, 0 to 1.
    rests : int
        Good rests so far.
    directions : int or None
        Directions out of 26 in which the magnetic field has pointed; None without a magnetometer.
    rows : int
        Samples so far.
    t : float
        Time of the last one, s.
    side : str or None
        Side to lay up next; None where no side is wanted.
    turning : FreeTurning or None
        The free rotation, while it is what is wanted.
    """

    message: str
    done: tuple[str, ...]
    progress: float
    rests: int
    directions: int | None
    rows: int
    t: float
    side: str | None
    turning: FreeTurning | None = None


class Wizard:
    """Asks for the six sides, for more rests if wanted, then for free rotation if there is a magnetometer.

    Parameters
    ----------
    sensors : sequence of str
        Those that are to be calibrated, of ``acc``, ``gyr``, ``mag``.
    rests : int
        Good rests that are wanted, the six sides among them.
    settings : mapping, optional
        Criteria of a rest, see :class:`imufit.calibrating.PoseGuide`.
    """

    def __init__(
        self,
        sensors: Sequence[str] = ("acc", "gyr", "mag"),
        rests: int = len(SIDES),
        settings: Mapping[str, float] | None = None,
    ) -> None:
        self.guide = PoseGuide(settings)
        self._rests = rests if {"acc", "gyr"} & set(sensors) else 0
        self._turning = FreeTurning() if "mag" in sensors else None
        self._has_mag = False
        self._accepted: list[str] = []
        self._rows, self._t = 0, 0.0
        self._message, self._progress = "Waiting for the device.", 0.0
        self._side: str | None = None

    @property
    def sides_known(self) -> bool:
        """Whether every side and every rest that is wanted was taken."""
        return not self._rests or (self.guide.complete and self.guide.rests >= self._rests)

    @property
    def complete(self) -> bool:
        """Whether nothing more is wanted."""
        turned = self._turning is None or not self._has_mag or self._turning.complete
        return self._rows > 0 and self.sides_known and turned

    @property
    def wanted(self) -> str:
        """The missing steps, in words; empty if nothing is missing."""
        if not self.sides_known:
            if self.guide.missing:
                return f"sides {' '.join(self.guide.missing)}"
            return f"{self._rests - self.guide.rests} more rests"
        return "" if self.complete else "free rotation for the magnetometer"

    def feed(self, batch: Batch) -> Stage:
        """Take rows as they came; return where things stand behind them.

        Parameters
        ----------
        batch : mapping of (n,) arrays
            ``t`` and columns of a log, SI units.
        """
        t = batch["t"]
        if len(t):
            self._rows += len(t)
            self._t = float(t[-1])
            self._turn(batch)
            self._hold(batch)
        return self.stage

    def _hold(self, batch: Batch) -> None:
        """Ask for sides and rests."""
        if not all(name in batch for name in _ACC) or not self._rests:
            self._free()
            return
        acc = np.column_stack([batch[name] for name in _ACC])
        gyr = np.column_stack([batch[name] for name in _GYR]) if all(name in batch for name in _GYR) else None
        for row, time in enumerate(batch["t"].tolist()):
            if self.sides_known:
                break
            advice = self.guide.step(time, acc[row], None if gyr is None else gyr[row])
            if advice.accepted:
                self._accepted.append(advice.accepted)
            self._message, self._progress, self._side = advice.message, advice.progress, advice.wanted
        if self.sides_known:
            self._free()
        elif self.guide.complete:
            more = self._rests - self.guide.rests
            self._message = (
                f"All six sides are known. {more} more rest{'s' if more > 1 else ''} for the gyro: quarter turns."
            )

    def _turn(self, batch: Batch) -> None:
        """Follow the magnetometer, from the beginning: what is seen between the sides counts."""
        self._has_mag = self._has_mag or any(name in batch and np.isfinite(batch[name]).any() for name in _MAG)
        if self._turning is None or not all(name in batch for name in _MAG):
            return
        for mag in np.column_stack([batch[name] for name in _MAG]):
            self._turning.step(mag)

    def _free(self) -> None:
        """Ask for free rotation, or for nothing more."""
        if self.complete or self._turning is None:
            self._message, self._progress = "Everything is known.", 1.0
            return
        self._progress = self._turning.progress
        left = max(0, ENOUGH - self._turning.seen)
        self._message = (
            f"Turn it slowly through all attitudes, away from iron: {quantity.counted(left, 'direction')} to go."
        )

    @property
    def stage(self) -> Stage:
        """Where things stand."""
        return Stage(
            self._message,
            tuple(self._accepted),
            self._progress,
            self.guide.rests,
            self._turning.seen if self._turning is not None and self._has_mag else None,
            self._rows,
            self._t,
            None if self.sides_known else self._side,
            self._turning if self.sides_known and self._has_mag and not self.complete else None,
        )
