"""Blocks of samples that were recorded twice.

Two stretches whose samples agree bit for bit, one after the other, are a copy if that cannot be chance. Coarse steps
make single samples agree often, above all at rest or where a motion repeats itself: the chance is worked out from how
often each sample of the block occurs in the rows around, and must be less than `CHANCE`; and the block must be
`LONGER` times as long as chance agreements are in this log. A constant value is not a copy.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.faults.row_fault import SENSORS, RowFault, runs
from imufit.log import Chunk

Array = NDArray[np.float64]

SAMPLES: Final = 6
CHANCE: Final = 1e-12
LONGER: Final = 3
_TRUE: Final = 4
"""Copies among the longest agreements that may be true ones; those after them show what chance does."""
_FACTORS: Final = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0x27D4EB2F165667C5], np.uint64)


def duplicates(chunk: Chunk) -> list[RowFault]:
    """Find copies of earlier samples in the core rows of a chunk.

    Parameters
    ----------
    chunk : Chunk
        Rows with margins: copies are looked for as far back as the margin.
    """
    log = chunk.log
    found = []
    for sensor in SENSORS:
        column = getattr(log, sensor)
        if column is None:
            continue
        rows = np.flatnonzero(np.isfinite(column).all(axis=1))
        for first, stop, lag in _copies(_codes(column[rows])):
            copy, original = rows[first:stop], rows[first - lag : stop - lag]
            names = tuple(n for n in (*SENSORS, "ref_q") if n == sensor or _same(getattr(log, n), copy, original))
            sensors = tuple(name.removesuffix("_q") for name in names)
            before = float(log.t[copy[0]] - log.t[original[0]])
            found += RowFault.within(chunk, (int(copy[0]), int(copy[-1])), "duplicate", sensors, lag=before)
    return found


def _same(column: Array | None, copy: NDArray[np.intp], original: NDArray[np.intp]) -> bool:
    """Whether nearly all rows of two stretches agree, and are not all alike."""
    if column is None:
        return False
    known = np.isfinite(column[copy]).all(axis=1)
    if np.count_nonzero(known) < SAMPLES:
        return False
    same = (column[copy] == column[original]).all(axis=1)
    return bool(same[known].mean() > 0.9 and np.any(np.ptp(column[copy][known], axis=0) > 0.0))


def _codes(values: Array) -> NDArray[np.uint64]:
    """One number for each row, the same for rows that agree bit for bit."""
    bits = np.ascontiguousarray(values).view(np.uint64).reshape(values.shape)
    mixed = bits * _FACTORS[: values.shape[1]]
    mixed ^= mixed >> np.uint64(29)
    return np.asarray(np.bitwise_xor.reduce(mixed * _FACTORS[1], axis=1))


def _copies(codes: NDArray[np.uint64]) -> list[tuple[int, int, int]]:
    """First sample of each copy, the sample after its last, and how many samples before the original is."""
    n = codes.size
    order = np.argsort(codes, kind="stable")
    same = np.flatnonzero(codes[order[1:]] == codes[order[:-1]])
    if same.size < SAMPLES:
        return []
    lag = np.zeros(n, np.intp)
    lag[order[same + 1]] = order[same + 1] - order[same]
    _, kind, count = np.unique(codes, return_inverse=True, return_counts=True)
    spans = runs(lag)
    spans = spans[lag[spans[:, 0]] > 0]
    lengths = spans[:, 1] - spans[:, 0]
    by_chance = int(np.sort(lengths)[-1 - _TRUE]) if lengths.size > _TRUE else 1
    found = []
    for first, stop in spans[lengths >= max(SAMPLES, LONGER * by_chance)]:
        kinds = kind[first:stop]
        # Without the pair itself.
        share = (count[kinds] - 1.5) / n
        chance = np.sum(np.log10(share)) + 2.0 * np.log10(n)
        if np.unique(kinds).size >= SAMPLES and chance < np.log10(CHANCE):
            found.append((int(first), int(stop), int(lag[first])))
    return found
