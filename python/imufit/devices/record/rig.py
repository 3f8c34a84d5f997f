"""The commanded angle of a one-axis rig while it is recorded: where it begins, and what an operator types."""

from __future__ import annotations

import math
import os
import re
import select
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from imufit.errors import InputError
from imufit.log.units import conversion

AXES: Final = ("x", "y", "z")
"""Body axes about which a rig may turn."""
MOVING: Final = math.nan
"""Commanded angle while the rig moves: not known."""
MOST: Final = 1e4
"""Largest angle that is taken, rad: a rig that turns for hours at a turn a second stays below, a slip of a key not."""
_ANGLE: Final = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*\[?\s*(deg|rad)?\s*\]?")
_WHAT: Final = (
    "Type an angle and Enter, such as 10 or 10deg or 0.2rad; only Enter, or m and Enter, while the rig moves."
)


@dataclass(frozen=True)
class Rig:
    """A one-axis rig and its commanded angle.

    Attributes
    ----------
    axis : {"x", "y", "z"}
        Body axis about which it turns.
    angle : float
        Commanded angle when the recording begins, rad.
    typed : callable
        Gives the angles that were commanded since the last call, rad; `MOVING` while the rig moves. It must not
        wait. It receives whether rows have come: before that an angle has no place in the recording, and is not used.
    """

    axis: Literal["x", "y", "z"]
    angle: float
    typed: Callable[[bool], Sequence[float]] = lambda _rows_came: ()

    def __post_init__(self) -> None:
        if self.axis not in AXES:
            raise InputError(f"{self.axis!r} is not a body axis of a rig", remedy="Use x, y or z.")
        if not (math.isnan(self.angle) or abs(self.angle) <= MOST):
            raise InputError(f"{self.angle!r} rad is not an angle of a rig", remedy=f"It is at most {MOST:g} rad.")


def angle_of(text: str) -> float:
    """Read an angle, such as ``5deg``, ``0.1rad`` or ``5``, which is in degrees; rad.

    Raises
    ------
    InputError
        It is not an angle.
    """
    found = _ANGLE.fullmatch(text.strip())
    angle = float(found[1]) * conversion("ref_angle", found[2] or "deg").factor if found else math.inf
    if not abs(angle) <= MOST:
        raise InputError(f"{text.strip()!r} is not an angle", remedy="Write for example 5deg, 5 or 0.1rad.")
    return angle


class TypedAngles:
    """Angles that an operator types into a terminal, a line each. Reading never waits and never changes the terminal.

    Parameters
    ----------
    say : callable
        Reports the understood angle to the operator.
    file : int, optional
        File descriptor of the terminal; standard input if None.
    """

    def __init__(self, say: Callable[[str], None], file: int | None = None) -> None:
        self._say = say
        self._file = _standard_input() if file is None else file
        self._held = b""

    def __call__(self, rows_came: bool = True) -> list[float]:
        """Angles since the last call, rad; `MOVING` while the rig moves. None before rows have come."""
        angles: list[float] = []
        for line in self._lines():
            if not rows_came:
                self._say("ref_angle stays as it is: no row has come yet. Type it again then.")
                continue
            text = line.decode(errors="replace").strip()
            if text in ("", "m"):
                self._say("ref_angle: the rig moves, until an angle is typed")
                angles.append(MOVING)
                continue
            try:
                angles.append(angle_of(text))
            except InputError as error:
                self._say(f"ref_angle stays as it is: {error.problem}. {_WHAT}")
            else:
                self._say(f"ref_angle: {math.degrees(angles[-1]):g} deg from now on")
        return angles

    def _lines(self) -> list[bytes]:
        """Whole lines that have come."""
        if self._file is None or not _ours(self._file):
            return []
        try:
            if not select.select([self._file], [], [], 0.0)[0]:
                return []
            data = os.read(self._file, 4096)
        except (OSError, ValueError):
            data = b""
        if not data:
            # Closed: nothing will be typed any more.
            self._file = None
        *lines, self._held = (self._held + data).split(b"\n")
        return lines


def _standard_input() -> int | None:
    """File descriptor of the terminal in front of the operator; None where there is none that can be asked."""
    # On Windows, select knows sockets only.
    if sys.platform == "win32" or sys.stdin is None or not sys.stdin.isatty():
        return None
    return sys.stdin.fileno()


def _ours(file: int) -> bool:
    """Say whether a terminal listens to this process; one in the background would be stopped by reading it."""
    if sys.platform == "win32":
        return False
    try:
        return not os.isatty(file) or os.tcgetpgrp(file) == os.getpgrp()
    except OSError:
        # Not the terminal that controls this process: reading it blocks nothing.
        return True
