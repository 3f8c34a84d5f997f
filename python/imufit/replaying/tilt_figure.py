"""The drawn part of a replay: the angles, and the stretches that deserve a panel of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from imufit.errors import InputError
from imufit.figures.tilt import Zoom, tilt_figure
from imufit.log import Log
from imufit.replaying.stretches import Stretches, find_stretches
from imufit.replaying.tilt_comparison import tilt_errors
from imufit.replaying.tilt_error import inclination_of_z

if TYPE_CHECKING:
    from imufit.figures.place import Drawing, Place

Array = NDArray[np.float64]

_BEFORE, _AFTER = 2.0, 8.0
_AROUND_A_BLOW = 1.5
_IN_MOTION = 10.0
_OVERVIEW = 60.0


def tilt_figure_of(
    log: Log, attitude: Mapping[str, Array], needs: Mapping[str, Sequence[str]], ax: Place | None = None
) -> Drawing:
    """Draw the tilt of each method beside the reference, and without one the inclination of body z alone.

    Parameters
    ----------
    log : Log
        n rows.
    attitude : mapping of (n, 4) arrays
        Per method, scalar first; NaN before the start.
    needs : mapping
        Sensors that each method uses.
    ax : Axes, Figure or SubFigure, optional
        Where to draw, see :mod:`imufit.figures.place`.

    Raises
    ------
    InputError
        No method shows the angle.
    """
    found = tilt_errors(log, attitude, needs)
    if found is None or log.ref_q is None:
        raise InputError("the log has no reference attitude to draw the tilt against", file=log.path)
    reference, errors = found
    shown = {name: error for name, error in errors.items() if error is not None and np.isfinite(error).any()}
    if not shown:
        raise InputError("no filter shows the angle of this rig, which turns about the vertical", file=log.path)
    names = list(shown)
    if reference.kind == "inclination":
        true = np.degrees(reference.angle())
        angles = {name: np.degrees(inclination_of_z(attitude[name], reference.up)) for name in names}
        deviations = {name: np.degrees(np.linalg.norm(shown[name], axis=1)) for name in names}
    else:
        true = np.degrees(reference.angle() if log.ref_angle is None else log.ref_angle)
        deviations = {name: np.degrees(shown[name][:, 0]) for name in names}
        angles = {name: true + deviations[name] for name in names}
    stretches = find_stretches(log.t, log.ref_q, log.acc)
    what = "inclination of z" if reference.kind == "inclination" else f"angle about {reference.axis}"
    whole = None
    if not stretches.rests and log.duration > _OVERVIEW:
        whole = Zoom(f"The first {_OVERVIEW:g} s", float(log.t[0]), float(log.t[0]) + _OVERVIEW)
    error = "Error of the inclination" if reference.kind == "inclination" else "Error: estimate less reference"
    zooms = _zooms(log, stretches, true)
    return tilt_figure(log.t, true, angles, deviations, zooms, angle=what, error=error, whole=whole, ax=ax)


def _zooms(log: Log, stretches: Stretches, true: Array) -> list[Zoom]:
    """Find the first move with rest after it and the strongest vibration; without either ten seconds."""
    t = log.t
    zooms = []
    moves = sorted(stretches.moves, key=lambda rest: t[rest.stop - 1] - t[rest.start] < 2.0)
    if moves:
        rest = moves[0]
        at = stretches.rests.index(rest)
        before = stretches.rests[at - 1] if at else None
        begin = t[0] if before is None else t[before.stop - 1]
        end = min(t[rest.start] + _AFTER, t[rest.stop - 1])
        angles = [float(np.nanmedian(true[each.start : each.stop])) for each in (before, rest) if each is not None]
        words = f"A move from {angles[0]:.1f} to {angles[1]:.1f} deg" if len(angles) == 2 else "A move"
        zooms.append(Zoom(words, max(t[0], begin - _BEFORE), end, ((begin, t[rest.start]),)))
    if stretches.vibrations and log.acc is not None:
        start, stop = max(stretches.vibrations, key=lambda rows: _strength(log.acc, rows))
        marks = (float(t[start]), float(t[stop - 1]))
        zooms.append(
            Zoom(
                "The strongest vibration",
                max(t[0], marks[0] - _AROUND_A_BLOW),
                min(t[-1], marks[1] + _AROUND_A_BLOW),
                (marks,),
            )
        )
    if not zooms and log.duration > 3.0 * _IN_MOTION:
        middle = 0.5 * (t[0] + t[-1])
        words = "Ten seconds at rest" if stretches.rests else "Ten seconds in the middle"
        zooms.append(Zoom(words, middle - 0.5 * _IN_MOTION, middle + 0.5 * _IN_MOTION))
    return zooms


def _strength(acc: Array | None, rows: tuple[int, int]) -> float:
    """Largest departure of the specific force from its mean over these rows."""
    if acc is None:
        return 0.0
    force = acc[rows[0] : rows[1]]
    return float(np.nanmax(np.linalg.norm(force - np.nanmean(force, axis=0), axis=1)))
