"""Columns that were computed from the log's own readings: as covariates they would explain the noise by itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from imufit.log.columns import SENSORS
from imufit.log.log import LogSource
from imufit.log.words import words_of

_SAME: Final = 0.9999
"""Correlation with readings, or with the length of their vectors, from which a column is computed from them: printed
with three digits it has more, and no quantity measured beside a sensor follows the sensor's noise."""
_LOOKED_AT: Final = 4096
"""Rows that are looked at."""
_ROWS: Final = 20
"""Rows from which a correlation is looked at."""
_ANGLES: Final = frozenset(("roll", "pitch", "yaw"))
_QUATERNION: Final = (frozenset(("qw", "qx", "qy", "qz")), frozenset(("q0", "q1", "q2", "q3")))


def computed_columns(log: LogSource) -> tuple[str, ...]:
    """Name the covariates that are copies of readings, lengths of their vectors, or a filter's attitude.

    Parameters
    ----------
    log : Log or LogStream
        Its first rows are looked at.
    """
    first = next(iter(log.chunks(_LOOKED_AT, 0)), None)
    if first is None:
        return ()
    head = first.log
    sensors = [values for name in SENSORS if (values := getattr(head, name)) is not None]
    if not sensors:
        return ()
    lengths = [np.linalg.norm(values, axis=1) for values in sensors]
    lengths += [sign * values[:, axis] for values in sensors for axis in range(3) for sign in (1.0, -1.0)]
    found = [name for name, values in head.covariates.items() if any(_follows(values, length) for length in lengths)]
    return tuple(dict.fromkeys([*found, *_attitudes(list(head.covariates))]))


def _follows(values: np.ndarray, length: np.ndarray) -> bool:
    known = np.isfinite(values) & np.isfinite(length)
    if known.sum() < _ROWS:
        return False
    a, b = values[known] - values[known].mean(), length[known] - length[known].mean()
    size = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    return size > 0.0 and float(np.sum(a * b)) > _SAME * size


def _attitudes(names: list[str]) -> Iterator[str]:
    """Names of whole sets of attitude angles or of a quaternion's numbers."""
    sets: dict[tuple[str, ...], dict[str, str]] = {}
    for name in names:
        low = name.lower()
        for part in (*_ANGLES, *(part for four in _QUATERNION for part in four)):
            if low == part or low.endswith((f"_{part}", f".{part}")) or part in words_of(name).words:
                sets.setdefault(tuple(low.replace(part, "*").split("*")), {})[part] = name
    for parts in sets.values():
        if any(whole <= parts.keys() for whole in (_ANGLES, *_QUATERNION)):
            yield from parts.values()
