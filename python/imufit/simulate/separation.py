"""Whether an effect, as drawn, can be told from the other effects in a log.

Each rival gets its best chance: the least squares fit of its parameters to what the drawn effect does to all sensors,
each in units of its white noise. What is left of the sum of squares is the squared distance, in standard errors, at
which the data put the rival.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from imufit.simulate.injections import INJECTIONS, Injection, Parameters, injection
from imufit.simulate.motion import Array
from imufit.simulate.sensor import SENSORS
from imufit.simulate.size import Scale

APART = 36.0
"""A rival counts as distinguishable when it is six standard errors away (squared)."""

UNTRIED = (
    "acc.saturation",  # acts on single samples: never like an effect that acts all the time
    "gyr.saturation",
    "acc.lowpass",  # to first order the delay of the same sensor, which is tried
    "gyr.lowpass",
    "acc.vibration_rectification",  # nothing without vibration
)


def rivals(scale: Scale, effect: str, columns: Sequence[str]) -> Iterator[tuple[str, Array]]:
    """Yield each other effect with its columns (m, k): the change of all readings for each of its parameters."""
    others = [name for name in INJECTIONS if name not in UNTRIED]
    others += [f"{s}.column:{c}" for s in SENSORS for c in columns if (s, c) != ("mag", "motor_current")]
    touched = set(injection(effect).sensors)
    for name in others:
        entry = injection(name)
        applies = entry.stage != "rig" or scale.trajectory.rig_joint is not None
        present = entry.column is None or entry.column in scale.environment.covariates
        if name == effect or not touched & set(entry.sensors) or not (applies and present):
            continue
        for inner in _inner(entry, scale):
            yield name, np.stack([_stacked(scale, name, p) for p in _units(entry, inner)], axis=1)


def _inner(entry: Injection, scale: Scale) -> list[dict[str, float]]:
    """Return the values tried for parameters inside an effect: time constants, periods."""
    if entry.id == "gyr.warmup":
        length = scale.run.stop - scale.run.start
        return [{"tau": length * part} for part in (0.08, 0.15, 0.3, 0.6)]
    if entry.id == "rig.periodic":
        return [{"N": float(order)} for order in range(4, 26)]
    return [{}]


def _units(entry: Injection, inner: Parameters) -> Iterator[dict[str, float]]:
    """Yield parameters with one of them at a tenth of its typical size and the others zero."""
    for name, typical in entry.typical.items():
        yield dict.fromkeys(entry.typical, 0.0) | {name: 0.1 * typical} | dict(inner)


def _stacked(scale: Scale, effect: str, parameters: Parameters) -> Array:
    change = scale.change(effect, parameters)
    none = np.zeros((scale.rows.t.size, 3))
    parts = [(change.get(name, none) / scale.white[name])[here].ravel() for name, here in scale.sampled.items()]
    return np.concatenate(parts)


def distance(scale: Scale, effect: str, parameters: Parameters, columns: Sequence[str]) -> tuple[float, str]:
    """Return how far (squared, in standard errors per row of `scale`) the nearest rival stays, and its name."""
    signal = _stacked(scale, effect, parameters)
    nearest, name = float(signal @ signal), ""
    for rival, design in rivals(scale, effect, columns):
        length = np.linalg.norm(design, axis=0)
        used = design[:, length > 0.0] / length[length > 0.0]
        if used.shape[1] == 0:
            continue
        fit, *_ = np.linalg.lstsq(used, signal, rcond=1e-8)
        left = float(np.sum((signal - used @ fit) ** 2))
        if left < nearest:
            nearest, name = left, rival
    return nearest, name
