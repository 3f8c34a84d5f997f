"""Mutations of a log as columns, before it is written in whichever format: values, time stamps, names, types."""

from random import Random
from typing import Any

import numpy as np

from mutated.hostile import FLOATS, NAMES, TEXTS

Columns = dict[str, Any]
"""A column's values by its name; the order is that of the file."""


def _numeric(rng: Random, columns: Columns) -> str:
    """Draw a column of numbers; of none the time's name, which `_floats` then makes."""
    names = [name for name, values in columns.items() if np.asarray(values).dtype.kind == "f"]
    return rng.choice(names) if names else "t"


def _floats(columns: Columns, name: str) -> np.ndarray:
    values = np.atleast_1d(columns.get(name, np.arange(300.0)))
    return values.astype(float) if values.dtype.kind in "fiub" else np.arange(float(len(values)))


def _group(rng: Random, columns: Columns) -> list[str]:
    """One column, the columns of one sensor, or all."""
    name = _numeric(rng, columns)
    which = rng.random()
    if which < 0.5:
        return [name]
    if which < 0.85:
        return [each for each in columns if each.split("_")[0] == name.split("_")[0]]
    return [each for each in columns if each not in {"t", "pose"}]


def some_values(rng: Random, columns: Columns) -> None:
    for name in _group(rng, columns):
        values = _floats(columns, name)
        share = rng.choice((1, 1, 3, max(1, len(values) // 20)))
        for _ in range(share):
            values[rng.randrange(len(values)) if rng.random() < 0.7 else rng.choice((0, -1))] = rng.choice(FLOATS)
        columns[name] = values


def spikes(rng: Random, columns: Columns) -> None:
    """Put in what can be measured although it is wrong: missing samples, outliers, stuck and clipped stretches."""
    which = rng.randrange(5)
    for name in _group(rng, columns):
        if name in {"t", "pose"} or name.startswith("ref_"):
            continue
        values = _floats(columns, name)
        n, spread = len(values), float(np.nanstd(values)) if np.isfinite(values).any() else 1.0
        start, width = rng.randrange(n), rng.choice((1, 5, n // 4))
        if which == 0:
            values[[rng.randrange(n) for _ in range(n // 10)]] = np.nan
        elif which == 1:
            values[rng.randrange(n)] += spread * rng.choice((10.0, 1e3, 1e6))
        elif which == 2:
            values[start : start + width] = values[start]
        elif which == 3:
            values = np.clip(values, -spread, spread)
        else:
            values[start:] += spread * rng.choice((0.1, 1.0, 10.0))
        columns[name] = values


def one_sensor(rng: Random, columns: Columns) -> None:
    """Leave out whole sensors."""
    for sensor in rng.sample(("acc", "gyr", "mag", "temp", "ref_p", "vbat", "motor"), rng.choice((1, 2, 3))):
        for name in [each for each in columns if each.startswith(sensor)]:
            del columns[name]


def jitter(rng: Random, columns: Columns) -> None:
    """Let the clock jump, drift or lose rows, but never run back."""
    t = _floats(columns, "t")
    n = len(t)
    which = rng.randrange(5)
    if which == 0:
        # An earlier mutation may have made the time a matrix.
        t = t + np.multiply.outer([rng.uniform(0, 0.4) for _ in range(n)], (t[-1] - t[0]) / n)
    elif which == 1:
        t[rng.randrange(n) :] += rng.choice((1.0, 60.0, 86400.0))
    elif which == 2:
        t = t * rng.choice((1e-3, 10.0, 100.0, 1e4))
    elif which == 3:
        t = t + rng.choice((1.7e9, -1e6, 1e12))
    else:
        kept = np.array([rng.random() < 0.8 for _ in range(n)])
        for name in columns:
            if np.shape(columns[name])[:1] == (n,):
                columns[name] = np.asarray(columns[name])[kept]
        return
    columns["t"] = t


def constant(rng: Random, columns: Columns) -> None:
    value = rng.choice(FLOATS)
    for name in _group(rng, columns):
        columns[name] = np.full(len(_floats(columns, name)), value)


def scaled(rng: Random, columns: Columns) -> None:
    factor = rng.choice((1e300, 1e154, 1e100, 1e30, 1e6, 1e-6, 1e-100, 1e-300, -1.0, 0.0, 1e308, 1e9))
    for name in _group(rng, columns):
        with np.errstate(all="ignore"):
            columns[name] = _floats(columns, name) * factor


def shifted(rng: Random, columns: Columns) -> None:
    by = rng.choice((1e300, 1e20, 1e16, 1e9, 1e6, -1e9, 1e3))
    for name in _group(rng, columns):
        columns[name] = _floats(columns, name) + by


def missing_stretch(rng: Random, columns: Columns) -> None:
    for name in _group(rng, columns):
        values = _floats(columns, name)
        start = rng.randrange(len(values))
        values[start : start + rng.choice((1, 10, len(values) // 2, len(values)))] = np.nan
        columns[name] = values


def sparse(rng: Random, columns: Columns) -> None:
    """Keep every k-th value only, as of a slower sensor."""
    every, first = rng.choice((2, 5, 50, 1000)), rng.randrange(2)
    for name in _group(rng, columns):
        values = _floats(columns, name)
        kept = np.full(values.shape, np.nan)
        kept[first::every] = values[first::every]
        columns[name] = kept


def noiseless(rng: Random, columns: Columns) -> None:
    """Quantise to a step so coarse, or repeat values so long, that no noise is left."""
    step = rng.choice((1e-3, 0.1, 1.0, 100.0, 1e6))
    hold = rng.choice((1, 1, 7, 100))
    for name in _group(rng, columns):
        values = np.round(_floats(columns, name) / step) * step
        columns[name] = np.repeat(values[::hold], hold)[: len(values)]


def time_stamps(rng: Random, columns: Columns) -> None:
    t = _floats(columns, "t")
    n, at = len(t), rng.randrange(len(t))
    which = rng.randrange(12)
    if which == 0:
        t[at:] -= t[at] - t[max(at - 1, 0)]
    elif which == 1:
        t = t[::-1].copy()
    elif which == 2:
        order = list(range(n))
        rng.shuffle(order)
        t = t[order]
    elif which == 3:
        t = (t + 86390.0) % 86400.0
    elif which == 4:
        t = np.arange(n) * rng.choice((1e-9, 1e9, 1e-300, 1e300, 5e-324, 1e305))
    elif which == 5:
        t = t + rng.choice((1.7e9, 1.7e18, -1e9, 1e300))
    elif which == 6:
        t = t * rng.choice((1e3, 1e6, 1e9, 1e-3))
    elif which == 7:
        t[at:] += rng.choice((1e3, 1e9, 1e300, -1e3))
    elif which == 8:
        t = np.full(n, rng.choice(FLOATS))
    elif which == 9:
        t[at] = rng.choice(FLOATS)
    elif which == 10:
        t = np.concatenate([t[: n // 2], t[: n - n // 2]])
    else:
        t[-1] = rng.choice((1e300, 1e12, np.nan, np.inf))
    columns["t"] = t


def covariate(rng: Random, columns: Columns) -> None:
    n = len(_floats(columns, "t"))
    ramp = np.arange(float(n))
    with np.errstate(all="ignore"):
        values = rng.choice(
            (
                np.full(n, rng.choice(FLOATS)),
                ramp * 1e300,
                ramp * 1e-300,
                np.where(ramp % 7 == 0, 1e300, 0.0),
                np.where(ramp % 7 == 0, 1e300, -1e300),
                _floats(columns, rng.choice(list(columns)))[:n],
                np.where(ramp == n // 2, 1.0, np.nan),
                1.0 + ramp * 1e-16,
                ramp > n / 2,
            )
        )
    columns[rng.choice((*NAMES, "motor_current", "vbat", "motor_current"))] = values


def rename(rng: Random, columns: Columns) -> None:
    old, new = rng.choice(list(columns)), rng.choice((*NAMES, *columns))
    items = [(new if name == old else name, values) for name, values in columns.items()]
    columns.clear()
    columns.update(items)


def drop(rng: Random, columns: Columns) -> None:
    for name in _group(rng, columns) if rng.random() < 0.7 else [rng.choice(list(columns))]:
        columns.pop(name, None)
    if not columns:
        columns["t"] = np.arange(10.0)


def reference(rng: Random, columns: Columns) -> None:
    """Make the reference attitude one that cannot be, or one that tells nothing."""
    names = ["ref_qw", "ref_qx", "ref_qy", "ref_qz"]
    found = [_floats(columns, name) for name in names]
    # An earlier step may have cut one of them.
    rows = min(len(column) for column in [*found, _floats(columns, "t")])
    q = np.stack([column[:rows] for column in found])
    which = rng.randrange(6)
    with np.errstate(all="ignore"):
        if which == 0:
            q = q * 0.0
        elif which == 1:
            q = q * rng.choice((1e-300, 1e300, 2.0, 1 + 1e-4))
        elif which == 2:
            q[:] = np.array([1.0, 0, 0, 0])[:, None]
        elif which == 3:
            q[:, rng.randrange(q.shape[1]) :] = np.nan
        elif which == 4:
            q[:, ::2] = -q[:, ::2]
        else:
            q[rng.randrange(4)] = rng.choice(FLOATS)
    columns.update(zip(names, q, strict=True))


def labels(rng: Random, columns: Columns) -> None:
    n = len(_floats(columns, "t"))
    words = rng.choice((("+x", "-x", "+y", "-y", "+z", "-z"), ("+x",), ("", "+q"), TEXTS, NAMES))
    columns["pose"] = np.array([rng.choice(words) if k % 40 == 0 else words[0] for k in range(n)], dtype=object)


def length(rng: Random, columns: Columns) -> None:
    n = rng.choice((0, 1, 2, 3, 5, 50, 199, 200, 201))
    for name in columns:
        columns[name] = np.atleast_1d(columns[name])[:n]


def of_type(rng: Random, columns: Columns) -> None:
    """Give a column a type that is no float64; which formats can hold it, their writers tell."""
    name = rng.choice(list(columns))
    values = _floats(columns, name)
    n = len(values)
    with np.errstate(all="ignore"):
        made: tuple[Any, ...] = (
            values.astype(np.float32),
            values.astype(np.float16),
            np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0).clip(-100, 100).astype(np.int8),
            np.arange(n, dtype=np.uint64) + np.uint64(2**63),
            np.arange(n) % 2 == 0,
            values.astype(complex) + 1j,
            np.arange(n).astype("datetime64[ms]"),
            np.arange(n).astype("timedelta64[ns]"),
            np.array([str(x) for x in values]),
            np.array([rng.choice(TEXTS) for _ in range(n)], dtype=object),
            np.array([None] * n, dtype=object),
            np.array([10**400] * n, dtype=object),
            np.array([True, None] * n, dtype=object)[:n],
            np.array([b"bytes"] * n),
            values.reshape(-1, 1),
            np.asfortranarray(np.stack([values, values], axis=1)),
            values.astype(">f8"),
            np.float64(3.0),
            values.astype(np.longdouble),
            np.zeros(n, dtype=[("a", "f8"), ("b", "i4")]),
            values[: n // 2],
            np.zeros((n, 0)),
            np.zeros((0,)),
            np.zeros((1, n, 1)),
        )
    columns[name] = rng.choice(made)


COLUMN_MUTATIONS = (
    spikes,
    spikes,
    spikes,
    spikes,
    one_sensor,
    one_sensor,
    jitter,
    jitter,
    jitter,
    covariate,
    noiseless,
    noiseless,
    sparse,
    some_values,
    some_values,
    constant,
    constant,
    scaled,
    shifted,
    missing_stretch,
    missing_stretch,
    sparse,
    noiseless,
    time_stamps,
    time_stamps,
    time_stamps,
    covariate,
    covariate,
    rename,
    drop,
    reference,
    labels,
    length,
    of_type,
)
