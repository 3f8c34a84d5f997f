"""The commanded angle of a one-axis rig beside the turn that the gyroscope shows: in degrees, or about another axis."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from imufit import _imufit
from imufit.log import LogSource
from imufit.results import column_words
from imufit.results.data_fault import DataFault

Array = NDArray[np.float64]

PIECE: Final = 1.0
"""Time over which turns are compared, s: long beside a lag of the drive, short beside the drift of a gyroscope."""
PIECES: Final = 10
"""Pieces that show something."""
TURNED: Final = 0.1
"""RMS turn in a piece, rad, from which on an axis is informative."""
LEFT: Final = 0.2
"""Share of the turns' sum of squares that may be left."""
NEAR: Final = 0.25
"""Relative difference of the factor from one, or from that of degrees."""
ZEROS: Final = (0, 90, -90, 180)
"""Zeros of an encoder that are looked for, deg."""
CLEARLY: Final = 1.5
"""Times more of the specific force that another zero must explain."""
CHUNK_ROWS: Final = 65536


def rig_angle_faults(log: LogSource, facts: _imufit.Facts) -> list[DataFault]:
    """Name an angle in degrees and a wrong axis of a rig.

    Parameters
    ----------
    log : LogSource
        The log.
    facts : Facts
        Of the log as declared.
    """
    told = log.metadata.rig_axis
    if told is None or "gyr" not in facts.sensors:
        return []
    angle, turns = _pieces(log)
    if len(angle) < PIECES:
        return []
    rms = np.sqrt(np.mean(turns**2, axis=0))
    if rms.max() < TURNED:
        return []
    axis = int(np.argmax(rms))
    turn = turns[:, axis] - turns[:, axis].mean()
    angle = angle - angle.mean()
    factor = float(turn @ angle) / float(turn @ turn)
    if factor == 0.0 or float(np.sum((turn - angle / factor) ** 2)) > LEFT * float(turn @ turn):
        return []
    found = []
    if abs(abs(factor) * math.pi / 180.0 - 1.0) < NEAR:
        sign = -1 if factor < 0.0 else 1
        found.append(("units", column_words.angle_in_degrees(abs(factor), sign, _zero(log, sign), log.origin)))
    if "xyz"[axis] != told and rms[axis] > 3.0 * rms["xyz".index(told)]:
        found.append(("rig_axis", column_words.other_rig_axis(told, "xyz"[axis])))
    return [
        DataFault(kind, "ref", None, facts.t_start, facts.t_end, facts.n, *words, spoils=True) for kind, words in found
    ]


def _zero(log: LogSource, sign: int) -> int:
    """Return the angle, deg, at which the body stands upright, by gravity: a multiple of 90; 0 where nothing shows it.

    The angle of the encoder is an arbitrary one. Where the sensor is mounted a quarter turn round, so is its zero.
    """
    axis = "xyz".index(str(log.metadata.rig_axis))
    up = np.array(_imufit.frame_vectors(log.metadata.frame)["up"])
    sums = np.zeros(len(ZEROS))
    for chunk in log.chunks(CHUNK_ROWS, 0):
        angle, acc = chunk.log.ref_angle, chunk.log.acc
        if angle is None or acc is None:
            return 0
        known = np.isfinite(angle) & np.isfinite(acc).all(axis=1)
        for k, zero in enumerate(ZEROS):
            vectors = np.radians(sign * angle[known] - zero)[:, None] * np.eye(3)[axis]
            sums[k] += float(np.sum(acc[known] * Rotation.from_rotvec(vectors).inv().apply(up)))
    best = int(np.argmax(sums))
    return ZEROS[best] if sums[best] > CLEARLY * max(sums[0], 0.0) else 0


def _pieces(log: LogSource) -> tuple[Array, Array]:
    """Return the turns of the angle, (k,), and of the gyroscope about each axis, (k, 3), in pieces of the log."""
    angles, turns = [], []
    for chunk in log.chunks(CHUNK_ROWS, 0):
        t, angle, gyr = chunk.log.t, chunk.log.ref_angle, chunk.log.gyr
        if angle is None or gyr is None:
            break
        known = np.isfinite(angle) & np.isfinite(gyr).all(axis=1)
        t, angle, gyr = t[known], angle[known], gyr[known]
        if t.size < 2:
            continue
        mean = 0.5 * (gyr[1:] + gyr[:-1])
        turn = np.concatenate([np.zeros((1, 3)), np.cumsum(mean * np.diff(t)[:, None], axis=0)])
        edges = np.concatenate(([0], np.flatnonzero(np.diff(np.floor((t - t[0]) / PIECE))) + 1))
        angles.append(np.diff(angle[edges]))
        turns.append(np.diff(turn[edges], axis=0))
    return _joined(angles, ()), _joined(turns, (3,))


def _joined(parts: Iterable[Array], shape: tuple[int, ...]) -> Array:
    return np.concatenate([np.empty((0, *shape)), *parts])
