"""Guides a person through the poses, sample after sample: the wizard without its face."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.rests.poses import SAME_DIRECTION, SIDES

Array = NDArray[np.float64]

NEARLY = 5.0
"""Scatter over what is allowed below which a hand is trying to hold still."""


@dataclass(frozen=True)
class Advice:
    """Instruction for the user now.

    Attributes
    ----------
    state : str
        ``moving``, ``settling`` (still, not long enough), ``held`` (long enough: the pose counts when it ends).
    side : str or None
        Body axis that points up by the readings.
    progress : float
        How much of the hold is done, 0 to 1.
    missing : tuple of str
        Sides still wanted, the nearest to the present attitude first.
    accepted : str or None
        Side of a pose that was accepted with this sample.
    message : str
        One line: which side next, hold still, or why not.
    wanted : str or None
        Side to lay up next, or to hold still now; None once all sides are known or held.
    """

    state: str
    side: str | None
    progress: float
    missing: tuple[str, ...]
    accepted: str | None
    message: str
    wanted: str | None


class PoseGuide:
    """States, sample after sample, which side comes next, whether the sensor is still enough, and when it is done.

    Parameters
    ----------
    settings : mapping, optional
        Criteria of a rest, see :func:`imufit.calibrating.find_poses`; ``hold`` is 2 s here: a person waits for it.

    Attributes
    ----------
    done : dict of str to (3,) array
        Mean specific force of each accepted side, m/s^2.
    rests : int
        Good poses so far, those of a side that is known already among them.
    """

    def __init__(self, settings: Mapping[str, float] | None = None) -> None:
        self._judge = _imufit.PoseJudge({"hold": 2.0, **(settings or {})})
        self._reached: str | None = None  # held long enough, and not yet left
        self.done: dict[str, Array] = {}
        self.rests = 0

    @property
    def missing(self) -> tuple[str, ...]:
        """Sides still wanted."""
        return tuple(side for side in SIDES if side not in self.done)

    @property
    def complete(self) -> bool:
        """Whether every side was accepted."""
        return not self.missing

    def step(self, t: float, acc: Array, gyr: Array | None = None) -> Advice:
        """Take one sample.

        Parameters
        ----------
        t : float
            Time, s.
        acc : (3,) array
            Specific force, m/s^2; NaN where it is missing.
        gyr : (3,) array, optional
            Angular rate, rad/s.
        """
        judged = self._judge.step(t, [float(v) for v in acc], None if gyr is None else [float(v) for v in gyr])
        accepted, refused = None, ""
        closed = judged["closed"]
        if closed is not None:
            accepted, refused = self._take(np.array(closed["mean"]), closed["flaw"])
        side = None if judged["side"] is None else SIDES[judged["side"]]
        if judged["state"] == "held":
            self._reached = side
        elif closed is not None:
            self._reached = None
        return Advice(
            judged["state"],
            side,
            judged["progress"],
            self._ordered(side),
            accepted,
            self._message(judged["state"], side, judged["progress"], judged["unrest"], refused),
            self._wanted(side),
        )

    def finish(self) -> str | None:
        """End the stream; return the side of the last pose if it was accepted."""
        closed = self._judge.finish()
        return None if closed is None else self._take(np.array(closed["mean"]), closed["flaw"])[0]

    def _take(self, mean: Array, flaw: tuple[str, float] | None) -> tuple[str | None, str]:
        """Accept a pose or say why not."""
        if flaw is not None:
            kind, value = flaw
            return None, {
                "short": f"Too short: hold still for longer than {value:.1f} s.",
                "crept": f"The sensor moved by {np.degrees(value):.1f} deg: hold still.",
            }.get(kind, "It shook: hold still.")
        axis = int(np.argmax(np.abs(mean)))
        side = ("+" if mean[axis] > 0.0 else "-") + "xyz"[axis]
        off = float(np.arccos(np.clip(abs(mean[axis]) / np.linalg.norm(mean), -1.0, 1.0)))
        if off > 2.5 * SAME_DIRECTION:
            return None, f"{side} is {np.degrees(off):.0f} deg off the vertical: lay the sensor flat."
        self.rests += 1
        if side in self.done:
            return None, f"{side} up is known already."
        self.done[side] = mean
        return side, ""

    def _ordered(self, side: str | None) -> tuple[str, ...]:
        """Sides still wanted: from where the sensor is, a quarter turn is nearer than a half one."""
        if side is None:
            return self.missing
        return tuple(sorted(self.missing, key=lambda s: (s != side, s[1] == side[1])))

    def _wanted(self, side: str | None) -> str | None:
        """Return the side to lay up next: a missing one that was held long enough leads to another one."""
        return next((each for each in self._ordered(side) if each != self._reached), None)

    def _message(self, state: str, side: str | None, progress: float, unrest: float, refused: str) -> str:
        if refused:
            return refused
        if self.complete:
            return "All six sides are known."
        wanted = self._wanted(side)
        turn = f"Turn {wanted} up." if wanted else "Pick it up."
        if state == "moving":
            unknown = side in self.missing and side != self._reached
            return f"{side} up: hold still." if unknown and unrest < NEARLY else turn
        if side in self.missing:
            if state == "held":
                return f"{side} up: held. " + (f"Now turn {wanted} up." if wanted else turn)
            return f"{side} up: hold still, {100 * progress:.0f} %."
        return turn
