"""The environment of the sensor: gravity, magnetic field, temperature, supply and motor current, vibration."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from imufit.lab.simulate.courses import Course
from imufit.lab.simulate.motion import Array, Signal, Sinusoids, Steps

GRAVITY = 9.80665
"""Magnitude of gravity, m/s^2."""

FIELD_NORTH, FIELD_DOWN = 20.0, 44.0
"""Horizontal (northward) and downward flux density, uT: mid-European latitudes."""

Axes = tuple[float, float, float]

FRAMES: Mapping[str, tuple[Axes, Axes]] = {
    "NED": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "ENU": ((0.0, 1.0, 0.0), (0.0, 0.0, -1.0)),
    "NWU": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
}
"""Reference frames: the directions north and down in each."""


def stream(seed: int, purpose: str) -> np.random.Generator:
    """Return the random stream that `seed` has for one purpose, so that drawing for one does not disturb another."""
    return np.random.default_rng([seed, zlib.crc32(purpose.encode())])


def north_and_down(frame: str) -> tuple[Array, Array]:
    """Return the unit vectors north and down, (3,) each, of the reference frame `frame`."""
    if frame not in FRAMES:
        raise ValueError(f"unknown frame {frame!r}: use one of {', '.join(FRAMES)}")
    north, down = FRAMES[frame]
    return np.array(north), np.array(down)


def gravity_vector(frame: str) -> Array:
    """Return gravity (3,) in the reference frame, m/s^2: it points down."""
    return GRAVITY * north_and_down(frame)[1]


def field_vector(frame: str, parts: tuple[float, float] = (FIELD_NORTH, FIELD_DOWN)) -> Array:
    """Return the magnetic flux density (3,) in the reference frame, uT, from its northward and downward part."""
    north, down = north_and_down(frame)
    return parts[0] * north + parts[1] * down


@dataclass(frozen=True)
class Temperature:
    """Sensor temperature: a warm-up by ``rise`` (K), time constant ``tau`` (s), on top of the room's slow changes."""

    room: float
    rise: float
    tau: float
    changes: Sinusoids

    @classmethod
    def random(cls, rng: np.random.Generator, duration: float) -> Temperature:
        """Draw a course with a range of about 10 K that comes back to the same temperature several times."""
        changes = Sinusoids(
            rng.uniform([2.0, 1.0], [3.5, 2.0]),
            rng.uniform([1.6, 3.2], [2.4, 4.8]) / duration,
            rng.uniform(0.0, 2 * np.pi, 2),
        )
        return cls(rng.uniform(20.0, 27.0), rng.uniform(4.0, 7.0), rng.uniform(0.15, 0.3) * duration, changes)

    def at(self, t: Array) -> Array:
        """Return the temperature (n,) at times `t` (s), degC."""
        warming = self.rise * (1.0 - np.exp(-np.maximum(t, 0.0) / self.tau))
        return self.room + warming + self.changes.at(t).value


@dataclass(frozen=True)
class Covariate:
    """A quantity logged beside the sensors: a level that is switched now and then, ripple, and a slow slope."""

    levels: Signal
    ripple: Sinusoids
    slope: float

    def at(self, t: Array) -> Array:
        """Return the quantity (n,) at times `t` (s), in its own unit."""
        return self.levels.at(t).value + self.ripple.at(t).value + self.slope * t


def _switched(rng: np.random.Generator, duration: float, low: float, high: float, dwell: float) -> Steps:
    """Levels between `low` and `high` that change every `dwell` seconds or so, each change within 0.3 s."""
    gaps = rng.uniform(0.5 * dwell, 1.5 * dwell, int(2.5 * duration / dwell) + 2)
    start = np.cumsum(gaps)
    start = start[start < duration]
    return Steps(start, np.full(start.size, 0.3), rng.uniform(low, high, start.size + 1))


def _motor_current(rng: np.random.Generator, duration: float) -> Covariate:
    ripple = Sinusoids.random(rng, 0.4, 1.5, 3).with_rate(0.5)
    return Covariate(_switched(rng, duration, 0.2, 3.0, 5.0), ripple, 0.0)


def _battery(rng: np.random.Generator, duration: float) -> Covariate:
    ripple = Sinusoids.random(rng, 0.05, 0.5, 2).with_rate(0.02)
    return Covariate(_switched(rng, duration, 12.1, 12.4, 12.0), ripple, -0.15 / duration)


def _unnamed(rng: np.random.Generator, duration: float) -> Covariate:
    ripple = Sinusoids.random(rng, 0.03, 0.8, 4).with_rate(0.5)
    return Covariate(_switched(rng, duration, 0.0, 2.0, 8.0), ripple, 0.0)


_COVARIATES: Mapping[str, Callable[[np.random.Generator, float], Covariate]] = {
    "motor_current": _motor_current,
    "vbat": _battery,
}


def covariate(name: str, seed: int, duration: float) -> Covariate:
    """Return the course of the quantity `name`: motor current (A), battery voltage (V), or one of any other name."""
    return _COVARIATES.get(name, _unnamed)(stream(seed, f"covariate {name}"), duration)


@dataclass(frozen=True)
class Vibration:
    """Shaking of the sensor by a machine that runs now and then: tones on each axis under one envelope."""

    envelope: Signal
    tones: tuple[Sinusoids, Sinusoids, Sinusoids]

    @classmethod
    def random(cls, rng: np.random.Generator, duration: float, rate: float) -> Vibration:
        """Draw vibration of 1 to 2 m/s^2 per axis while it runs, between 0.2 and 0.4 of the sampling rate (Hz)."""

        def tones() -> Sinusoids:
            drawn = Sinusoids.random(rng, 0.2 * rate, 0.4 * rate, 6)
            even = rng.uniform(0.6, 1.0, 6)
            return Sinusoids(
                even * rng.uniform(1.0, 2.0) * np.sqrt(2.0 / np.sum(even**2)), drawn.frequency, drawn.phase
            )

        return cls(_switched(rng, duration, 0.0, 1.0, 6.0), (tones(), tones(), tones()))

    def at(self, t: Array) -> Array:
        """Return the vibration's acceleration (n, 3) at times `t` (s), body frame, m/s^2."""
        return self.envelope.at(t).value[:, None] * np.stack([tone.at(t).value for tone in self.tones], axis=1)

    def rms(self, t: Array) -> float:
        """Return the root mean square of the vibration over times `t` (s), of one axis, m/s^2."""
        return float(np.sqrt(np.mean(self.power(t)) / 3.0))

    def power(self, t: Array) -> Array:
        """Return the local mean square (n,) of the vibration, all axes together, at times `t` (s), (m/s^2)^2."""
        total = sum(0.5 * float(np.sum(tone.amplitude**2)) for tone in self.tones)
        return total * self.envelope.at(t).value ** 2


@dataclass(frozen=True)
class Environment:
    """All surroundings of one log."""

    gravity: Array
    field: Array
    temperature: Course
    covariates: Mapping[str, Course]
    vibration: Vibration | None = None
