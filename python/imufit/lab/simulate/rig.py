"""Errors of a one-axis rig against its commanded angle: backlash, flexure and periodic error of the drive.

Each class is the angle (rad) that the axis really has, as a function of time with its derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from imufit.lab.simulate.motion import Array, Sample, Signal

GRID_STEP = 1e-3
"""Step (s) on which a drive with backlash is followed through its history."""

CONTACT = 1e-13
"""Distance (rad) up to which drive and axis count as touching."""


@dataclass(frozen=True)
class Backlash:
    """A drive with play: the axis stands still after a reversal until the drive has crossed `width` (rad).

    In contact and travelling upwards the axis is half the width behind the drive, downwards half the width before it.
    The history starts at `start` (s) with the axis in the middle of the play, and is known up to `stop` (s).
    """

    drive: Signal
    width: float
    start: float
    stop: float

    @cached_property
    def _history(self) -> tuple[Array, Array]:
        t = np.arange(self.start, self.stop + GRID_STEP, GRID_STEP)
        half = 0.5 * abs(self.width)
        drive = self.drive.at(t).value
        axis = np.empty(t.size)
        now = drive[0]
        low, high = (drive - half).tolist(), (drive + half).tolist()
        for i in range(t.size):
            now = min(max(now, low[i]), high[i])
            axis[i] = now
        return t, axis

    def at(self, t: Array) -> Sample:
        """Return the axis' angle, rate and acceleration at times `t` (s), shape (n,)."""
        grid, axis = self._history
        half = 0.5 * abs(self.width)
        drive = self.drive.at(t)
        before = axis[np.clip(np.searchsorted(grid, t, side="right") - 1, 0, grid.size - 1)]
        value = np.clip(before, drive.value - half, drive.value + half)
        upwards = (value <= drive.value - half + CONTACT) & (drive.rate > 0.0)
        downwards = (value >= drive.value + half - CONTACT) & (drive.rate < 0.0)
        carried = upwards | downwards
        return Sample(value, np.where(carried, drive.rate, 0.0), np.where(carried, drive.acceleration, 0.0))


@dataclass(frozen=True)
class Flexure:
    """An axis that bends under its load: the angle is too large by ``k sin(angle)``, k in rad."""

    drive: Signal
    k: float

    def at(self, t: Array) -> Sample:
        """Return the axis' angle, rate and acceleration at times `t` (s), shape (n,)."""
        angle, rate, acceleration = self.drive.at(t)
        slope, bend = 1.0 + self.k * np.cos(angle), -self.k * np.sin(angle)
        return Sample(angle + self.k * np.sin(angle), slope * rate, slope * acceleration + bend * rate**2)


@dataclass(frozen=True)
class Periodic:
    """A drive with an eccentric gear: the angle is too large by ``a cos(N angle) + b sin(N angle)``, a and b in rad."""

    drive: Signal
    a: float
    b: float
    order: int

    def at(self, t: Array) -> Sample:
        """Return the axis' angle, rate and acceleration at times `t` (s), shape (n,)."""
        angle, rate, acceleration = self.drive.at(t)
        n = self.order
        cosine, sine = np.cos(n * angle), np.sin(n * angle)
        error = self.a * cosine + self.b * sine
        slope = 1.0 + n * (self.b * cosine - self.a * sine)
        return Sample(angle + error, slope * rate, slope * acceleration - n**2 * error * rate**2)
