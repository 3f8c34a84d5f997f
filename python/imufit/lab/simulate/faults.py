"""Faults of the data, which are not effects: what is done to a finished simulated log.

An entry of `FAULTS` states what goes wrong and does it to a log as it would be recorded. Where and how much is drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from imufit.lab.simulate.environment import stream
from imufit.lab.simulate.motion import Array
from imufit.lab.simulate.simulation import Simulation
from imufit.lab.simulate.truth import rotation_from_vector

SENSORS = ("acc", "gyr", "mag")


@dataclass(frozen=True)
class Fault:
    """A fault of the data.

    Attributes
    ----------
    id : its name.
    description : what goes wrong, in a few words.
    apply : makes the faulty log from a sound one; gets the log and a source of randomness.
    names : what a diagnosis may call it.
    """

    id: str
    description: str
    apply: Callable[[Simulation, np.random.Generator], Simulation]
    names: tuple[str, ...]


def _scaled(sensor: str, factor: float) -> Callable[[Simulation, np.random.Generator], Simulation]:
    def apply(log: Simulation, _rng: np.random.Generator) -> Simulation:
        return _with(log, **{sensor: factor * _readings(log, sensor)})

    return apply


def _with(log: Simulation, **columns: Any) -> Simulation:
    return replace(log, **columns)


def _readings(log: Simulation, sensor: str) -> Array:
    column = {"acc": log.acc, "gyr": log.gyr, "mag": log.mag}.get(sensor)
    if column is None:
        raise ValueError(f"this fault needs {sensor}, which the log does not have")
    return column


def _present(log: Simulation) -> list[str]:
    return [name for name in SENSORS if getattr(log, name) is not None]


def _exchanged(log: Simulation, rng: np.random.Generator) -> Simulation:
    order = rng.permutation(3)
    while np.array_equal(order, np.arange(3)):
        order = rng.permutation(3)
    sensor = str(rng.choice(_present(log)))
    return _with(log, **{sensor: np.ascontiguousarray(_readings(log, sensor)[:, order])})


def _flipped(log: Simulation, rng: np.random.Generator) -> Simulation:
    sensor, sign = str(rng.choice(_present(log))), np.ones(3)
    sign[rng.integers(3)] = -1.0
    return _with(log, **{sensor: sign * _readings(log, sensor)})


def _mounted(log: Simulation, rng: np.random.Generator) -> Simulation:
    axis = rng.integers(3)
    turn = np.rint(rotation_from_vector(np.pi / 2 * rng.integers(1, 4) * np.eye(3)[axis]))
    return _with(log, **{name: _readings(log, name) @ turn.T for name in _present(log)})


def _gravity(log: Simulation, _rng: np.random.Generator) -> Simulation:
    return _with(log, acc=-_readings(log, "acc"))


def _misnamed(log: Simulation, _rng: np.random.Generator) -> Simulation:
    name = "ENU" if log.metadata["frame"] == "NED" else "NED"
    return replace(log, metadata={**log.metadata, "frame": name})


def _conjugated(log: Simulation, _rng: np.random.Generator) -> Simulation:
    return _with(log, ref_q=log.ref_q * [1.0, -1.0, -1.0, -1.0])


def _scalar_last(log: Simulation, _rng: np.random.Generator) -> Simulation:
    return _with(log, ref_q=np.ascontiguousarray(log.ref_q[:, [1, 2, 3, 0]]))


def _span(log: Simulation, rng: np.random.Generator, seconds: float) -> tuple[int, int]:
    """Draw a stretch of about so many seconds, not at the ends."""
    rows = max(int(seconds * (log.t.size - 1) / (log.t[-1] - log.t[0])), 16)
    first = int(rng.integers(log.t.size // 10, max(log.t.size * 9 // 10 - 2 * rows, log.t.size // 10 + 1)))
    return first, first + rows


def _liveliest(log: Simulation, rng: np.random.Generator, sensor: str, seconds: float) -> tuple[int, int]:
    """Draw a stretch in which a sensor shows motion."""
    column = _readings(log, sensor)
    spans = [_span(log, rng, seconds) for _ in range(12)]
    return max(spans, key=lambda span: float(np.nansum(np.nanstd(column[span[0] : span[1]], axis=0))))


def _stuck(log: Simulation, rng: np.random.Generator) -> Simulation:
    sensor = str(rng.choice(_present(log)))
    axes = [int(rng.integers(3))] if rng.random() < 0.5 else [0, 1, 2]
    column = _readings(log, sensor).copy()
    first, stop = _liveliest(log, rng, sensor, rng.uniform(0.5, 2.0))
    known = np.flatnonzero(np.isfinite(column[:, 0]))
    held = known[np.searchsorted(known, first) :][0]
    rows = known[(known >= held) & (known < stop)]
    for axis in axes:
        column[rows, axis] = column[held, axis]
    return _with(log, **{sensor: column})


def _repeated(log: Simulation, rng: np.random.Generator) -> Simulation:
    """Repeat a block of samples in place of those that came after it."""
    first, stop = _span(log, rng, rng.uniform(0.4, 1.5))
    changed: dict[str, Array | None] = {}
    for name in _present(log):
        column = _readings(log, name).copy()
        column[stop : 2 * stop - first] = column[first:stop]
        changed[name] = column
    return _with(log, **changed)


def _backlog(log: Simulation, rng: np.random.Generator) -> Simulation:
    """Stamp the first rows with the time at which a receiver got them, three times as fast as they were taken."""
    step = float(np.median(np.diff(log.t)))
    rows = int(rng.uniform(1.0, 2.0) / step)
    arrival = log.t[rows] + (np.arange(rows) - rows) * step / 3.0
    return _with(log, t=np.concatenate([arrival, log.t[rows:]]))


def _clipped(log: Simulation, _rng: np.random.Generator) -> Simulation:
    gyr = _readings(log, "gyr")
    end = 0.7 * float(np.nanmax(np.abs(gyr)))
    return _with(log, gyr=np.clip(gyr, -end, end))


def _knocked(log: Simulation, rng: np.random.Generator) -> Simulation:
    """Turn the sensors in their mount by two to four degrees at one instant."""
    axis = rng.normal(size=3)
    turn = rotation_from_vector(np.radians(rng.uniform(2.0, 4.0)) * axis / np.linalg.norm(axis))
    after = log.t > log.t[0] + rng.uniform(0.3, 0.7) * (log.t[-1] - log.t[0])
    changed: dict[str, Array | None] = {
        name: np.where(after[:, None], _readings(log, name) @ turn, _readings(log, name)) for name in _present(log)
    }
    return _with(log, **changed)


FAULTS: Mapping[str, Fault] = {
    fault.id: fault
    for fault in (
        Fault("units.gyr", "angular rate in deg/s", _scaled("gyr", float(np.degrees(1.0))), ("units",)),
        Fault("units.acc", "specific force in g", _scaled("acc", 1.0 / 9.80665), ("units",)),
        Fault("units.mag", "flux density in gauss", _scaled("mag", 0.01), ("units",)),
        Fault("range.acc", "counts converted for a range twice too small", _scaled("acc", 0.5), ("units",)),
        Fault("axes.exchanged", "axes of one sensor exchanged", _exchanged, ("axes",)),
        Fault("axes.flipped", "one axis of one sensor turned round", _flipped, ("axes",)),
        Fault("mount", "all sensors turned by a multiple of 90 deg", _mounted, ("mount", "reference")),
        Fault("frame.gravity", "gravity instead of specific force", _gravity, ("frame",)),
        Fault("frame.name", "the log names another frame", _misnamed, ("frame",)),
        Fault("reference.conjugate", "the inverse of the reference attitude", _conjugated, ("reference",)),
        Fault("reference.scalar_last", "the reference with its scalar last", _scalar_last, ("reference",)),
        Fault("stuck", "a sensor or one of its axes repeats a value", _stuck, ("stuck",)),
        Fault("duplicate", "a block of samples is repeated", _repeated, ("duplicate",)),
        Fault("backlog", "the first rows have the times of their arrival", _backlog, ("backlog",)),
        Fault("clipped", "readings are pinned at the end of a range", _clipped, ("clipped",)),
        Fault("knock", "the mount shifts at one instant", _knocked, ("knock",)),
    )
}
"""Every fault by its id."""


def with_fault(log: Simulation, fault: str) -> Simulation:
    """Return a simulated log with a fault of the data in it; where and how much depends on the log's seed.

    Parameters
    ----------
    log : Simulation
        A sound log.
    fault : str
        One of `FAULTS`.

    Raises
    ------
    ValueError
        For an unknown fault, or one that needs a sensor the log does not have.
    """
    if fault not in FAULTS:
        raise ValueError(f"unknown fault {fault!r}: use one of {', '.join(FAULTS)}")
    changed = FAULTS[fault].apply(log, stream(log.truth.seed, f"fault {fault}"))
    return replace(changed, truth=replace(log.truth, faults=(*log.truth.faults, fault)))
