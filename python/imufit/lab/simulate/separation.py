"""Separation of a drawn effect from the other effects in a log.

Each rival gets its best chance: the least squares fit of its parameters to what the drawn effect does to all sensors,
each whitened by its true noise. The rest of the sum of squares is the squared distance, in standard errors, at
which the data put the rival.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag, solve_discrete_are
from scipy.signal import lfilter, ss2tf

from imufit.lab.simulate.entry import Injection, Parameters
from imufit.lab.simulate.injections import INJECTIONS, effect_of_column, injection
from imufit.lab.simulate.motion import Array
from imufit.lab.simulate.noise import SensorNoise
from imufit.lab.simulate.scenarios import SCENARIOS
from imufit.lab.simulate.sensor import SENSORS
from imufit.lab.simulate.study import Study

APART = 36.0
"""A rival counts as distinguishable when it is six standard errors away (squared)."""


def whitening(
    noise: SensorNoise, step: float, share: float, reference: tuple[int, float] = (0, 0.0)
) -> tuple[Array, Array]:
    """Return numerator and denominator of the filter that makes a sensor's noise white, with unit variance.

    Parameters
    ----------
    noise : SensorNoise
        White and coloured noise and random walk; the filter is the steady Kalman filter's, from reading to innovation.
    step : float
        Time between two samples, s.
    share : float
        How many of the sensor's own samples each of them stands for: their white noise is averaged.
    reference : (int, float)
        Which difference quotient of the reference the ideal reading is, and the white noise of one of its samples.
    """
    white = max(noise.white, 1e-300) ** 2 / share
    parts: list[tuple[Array, Array, Array]] = []  # transition, drive, what of the state is read
    one = np.eye(1)
    if noise.coloured > 0.0:
        keep = float(np.exp(-step / noise.correlation_time))
        parts.append((keep * one, noise.coloured**2 * (1.0 - keep**2) * one, one))
    if noise.random_walk > 0.0:
        parts.append((one, noise.random_walk**2 * step * one, one))
    order, size = reference
    if size > 0.0:
        first = np.zeros((order + 1, order + 1))
        first[0, 0] = size**2 / share
        quotient = np.array([[1.0, -1.0], [1.0, -2.0, 1.0]][order - 1])[None] / step**order
        parts.append((np.eye(order + 1, k=-1), first, quotient))
    if not parts:
        return np.array([1.0 / np.sqrt(white)]), np.array([1.0])
    f, q = (block_diag(*(part[k] for part in parts)) for k in (0, 1))
    h = np.concatenate([part[2] for part in parts], axis=1)
    # In units of the white noise, so that the equation is well scaled.
    p = solve_discrete_are(f.T, h.T, q / white, np.eye(1))
    variance = float((h @ p @ h.T)[0, 0]) + 1.0
    k = f @ p @ h.T / variance
    top, bottom = ss2tf(f - k @ h, k, -h, np.eye(1))
    return top[0] / np.sqrt(variance * white), bottom


class Separation:
    """Holds the effects of one log against each other.

    Parameters
    ----------
    study : Study
        The log; about ten rows a second of it are looked at.
    columns : sequence of str
        Covariates of which straight lines are rivals, too.
    """

    def __init__(self, study: Study, columns: Sequence[str]) -> None:
        self.scale, _ = study.coarse()
        self.columns = [name for name in columns if name in self.scale.environment.covariates]
        self._known: dict[tuple[object, ...], Array] = {}
        self._length = study.run.stop - study.run.start
        self._filters = {
            name: self._filter(study, name, study.scale.sampled[name])
            for name in SENSORS
            if name in study.scale.sampled
        }

    def _filter(self, study: Study, name: str, rows: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> tuple[Array, Array]:
        count = max(int(np.sum(self.scale.sampled[name])), 1)
        noise, reference = study.noise, (0, 0.0)
        if name == "gyr":
            reference = 1, float(np.radians(noise.attitude_deg))
        elif name == "acc" and SCENARIOS[study.scenario].position:
            reference = 2, noise.position
        return whitening(noise.sensor(name), self._length / count, int(np.sum(rows)) / count, reference)

    def signal(self, effect: str, parameters: Parameters) -> Array:
        """Return what an effect changes, (m,): all sensors one after the other, white, in standard deviations."""
        change = self.scale.change(effect, parameters)
        none = np.zeros((self.scale.rows.t.size, 3))
        parts = []
        for name, here in self.scale.sampled.items():
            top, bottom = self._filters[name]
            parts.append(lfilter(top, bottom, change.get(name, none)[here], axis=0).ravel())
        return np.concatenate(parts)

    def columns_of(self, effect: str, inner: Parameters | None = None) -> Array:
        """Return the change (m, k) for each parameter of an effect, at a tenth of its typical size."""
        entry = injection(effect)
        chosen = entry.trials(self._length)[0] if inner is None else inner
        key = (effect, *map(float, chosen.values()))
        if key not in self._known:
            units = [self.signal(effect, p) for p in _units(entry, chosen)]
            self._known[key] = np.stack(units, axis=1)
        return self._known[key]

    @cached_property
    def _catalogue(self) -> list[str]:
        others = [name for name, entry in INJECTIONS.items() if _is_rival(entry)]
        of_columns = [effect_of_column(sensor, column) for sensor in SENSORS for column in self.columns]
        others += [name for name in of_columns if name not in INJECTIONS]
        return [name for name in others if self._possible(injection(name))]

    def _possible(self, entry: Injection) -> bool:
        applies = entry.stage != "rig" or self.scale.trajectory.rig_joint is not None
        present = entry.column is None or entry.column in self.scale.environment.covariates
        shaken = not entry.vibration or self.scale.environment.vibration is not None
        return applies and present and shaken and any(name in self.scale.sampled for name in entry.sensors)

    def rivals(self, effect: str) -> Iterator[tuple[str, Array]]:
        """Yield each other effect with its columns (m, k); several times where it has a period or time constant."""
        touched = set(injection(effect).sensors)
        for name in self._catalogue:
            entry = injection(name)
            if name == effect or not touched & set(entry.sensors):
                continue
            for inner in entry.trials(self._length):
                yield name, self.columns_of(name, inner)

    def distances(
        self, effect: str, parameters: Parameters, beside: Sequence[str] = (), least: float = 0.0
    ) -> dict[str, float]:
        """Return how far (squared, in standard errors) each rival stays; "" = nothing at all in the effect's place.

        Parameters
        ----------
        effect, parameters :
            The drawn effect.
        beside : sequence of str
            Effects that are fitted along with every rival.
        least : float
            Rivals are looked at only if nothing at all stays at least this far.
        """
        signal = self.signal(effect, parameters)
        along = [self.columns_of(name) for name in beside]
        found = {"": _left(signal, along)}
        if found[""] < least:
            return found
        for rival, design in self.rivals(effect):
            if rival not in beside:
                found[rival] = min(found.get(rival, np.inf), _left(signal, [design, *along]))
        if injection(effect).late and not beside:
            # None of them is linear in its time: they are fitted to each other by Newton's steps.
            for rival in (name for name, entry in INJECTIONS.items() if entry.late and name != effect):
                if set(injection(rival).sensors) & set(injection(effect).sensors):
                    found[rival] = min(found.get(rival, np.inf), self._late(signal, rival))
        return found

    def _late(self, signal: Array, rival: str) -> float:
        """Return the distance of an effect that is not linear in its one parameter, a time."""
        if not self._possible(injection(rival)):
            return np.inf
        tau, step = 0.0, 1e-3
        left = float(signal @ signal)
        now = np.zeros_like(signal)
        for _ in range(4):
            slope = (self.signal(rival, {"tau": tau + step}) - now) / step
            power = float(slope @ slope)
            if power == 0.0:
                break
            tau += float((signal - now) @ slope) / power
            if injection(rival).late == "lag":
                tau = max(tau, 1e-4)
            now = self.signal(rival, {"tau": tau})
            left = min(left, float(np.sum((signal - now) ** 2)))
        return left

    def all_together(self, effect: str, parameters: Parameters) -> tuple[float, float, float]:
        """Return the squared length of an effect, what the nearest rival leaves of it, and what all together leave."""
        signal = self.signal(effect, parameters)
        designs = list(self.rivals(effect))
        nearest = min(_left(signal, [design]) for _, design in designs)
        return float(signal @ signal), nearest, _left(signal, [design for _, design in designs])


def _is_rival(entry: Injection) -> bool:
    """Return whether an effect is held against all others.

    An effect on single samples is never like an effect that acts all the time. A lag is to first order the delay of the
    same sensor, and is held against delays only.
    """
    return entry.stage != "range" and entry.late != "lag"


def _units(entry: Injection, inner: Parameters) -> Iterator[dict[str, float]]:
    """Yield parameters with one of them at a tenth of its typical size and the others zero."""
    for name, typical in entry.typical.items():
        yield dict.fromkeys(entry.typical, 0.0) | {name: 0.1 * typical} | dict(inner)


def _left(signal: Array, designs: Sequence[Array]) -> float:
    """Return the sum of squares that a least squares fit of all columns leaves."""
    if not designs:
        return float(signal @ signal)
    design = np.concatenate(designs, axis=1)
    length = np.linalg.norm(design, axis=0)
    used = design[:, length > 0.0] / length[length > 0.0]
    if used.shape[1] == 0:
        return float(signal @ signal)
    fit, *_ = np.linalg.lstsq(used, signal, rcond=1e-8)
    return float(np.sum((signal - used @ fit) ** 2))


def near(distances: Mapping[str, float], limit: float) -> tuple[str, ...]:
    """Return the rivals within `limit`, nearest first."""
    inside = [name for name, distance in distances.items() if name and distance < limit]
    return tuple(sorted(inside, key=distances.__getitem__))
