"""Scalar functions of time with exact first and second derivatives: what joints and positions follow.

Everything here is analytic, so it can be evaluated at any time, earlier or later than the log: a late sensor is simply
one that is evaluated earlier. Steps use a polynomial whose first three derivatives vanish at both ends, so rates and
accelerations of the motion are smooth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class Sample(NamedTuple):
    """A scalar motion at times ``t``: value, first and second derivative, each of shape (n,)."""

    value: Array
    rate: Array
    acceleration: Array


class Signal(Protocol):
    """A scalar motion that knows its own derivatives."""

    def at(self, t: Array) -> Sample:
        """Return value, rate and acceleration at times `t` (s), shape (n,)."""


@dataclass(frozen=True)
class Sinusoids:
    """A sum of sinusoids: ``sum(amplitude sin(2 pi frequency t + phase))``; arrays of shape (k,), in Hz and rad."""

    amplitude: Array
    frequency: Array
    phase: Array

    @classmethod
    def random(cls, rng: np.random.Generator, low: float, high: float, count: int) -> Sinusoids:
        """Draw `count` sinusoids between `low` and `high` (Hz), one in each part of the band, equal in rate."""
        edges = np.geomspace(low, high, count + 1)
        frequency = rng.uniform(edges[:-1], edges[1:])
        amplitude = rng.uniform(0.5, 1.0, count) / frequency
        return cls(amplitude, frequency, rng.uniform(0.0, 2 * np.pi, count))

    def with_rate(self, rms: float) -> Sinusoids:
        """Return the same motion scaled so that the root mean square of its first derivative is `rms`."""
        return self._scaled(rms, 1)

    def with_acceleration(self, rms: float) -> Sinusoids:
        """Return the same motion scaled so that the root mean square of its second derivative is `rms`."""
        return self._scaled(rms, 2)

    def _scaled(self, rms: float, order: int) -> Sinusoids:
        now = np.sqrt(0.5 * np.sum((self.amplitude * (2 * np.pi * self.frequency) ** order) ** 2))
        return replace(self, amplitude=self.amplitude * (rms / now))

    def at(self, t: Array) -> Sample:
        """Return value, rate and acceleration at times `t` (s), shape (n,)."""
        omega = 2 * np.pi * self.frequency
        angle = np.multiply.outer(t, omega) + self.phase
        sine, cosine = np.sin(angle), np.cos(angle)
        a = self.amplitude
        return Sample(sine @ a, cosine @ (a * omega), -sine @ (a * omega**2))


def smooth_step(u: Array) -> tuple[Array, Array, Array, Array]:
    """Return the integral, value, first and second derivative of a smooth step from 0 to 1 over ``0 <= u <= 1``."""
    u = np.clip(u, 0.0, 1.0)
    v = 1.0 - u
    return (
        u**5 * (7.0 + u * (-14.0 + u * (10.0 - 2.5 * u))),
        u**4 * (35.0 + u * (-84.0 + u * (70.0 - 20.0 * u))),
        140.0 * (u * v) ** 3,
        420.0 * (u * v) ** 2 * (1.0 - 2.0 * u),
    )


def _current(t: Array, start: Array) -> npt.NDArray[np.intp]:
    """Index of the last start at or before each `t`; before the first one, the first."""
    return np.maximum(np.searchsorted(start, t, side="right") - 1, 0)


@dataclass(frozen=True)
class Steps:
    """Levels held and left by smooth steps that do not overlap.

    ``levels`` (k + 1,) has the value before the first step and after each of them; ``start`` and ``length`` (k,) in s.
    """

    start: Array
    length: Array
    levels: Array

    def at(self, t: Array) -> Sample:
        """Return value, rate and acceleration at times `t` (s), shape (n,)."""
        if self.start.size == 0:
            return Sample(np.full(t.shape, self.levels[0]), np.zeros(t.shape), np.zeros(t.shape))
        k = _current(t, self.start)
        d = self.length[k]
        jump = self.levels[k + 1] - self.levels[k]
        _, value, rate, acceleration = smooth_step((t - self.start[k]) / d)
        return Sample(self.levels[k] + jump * value, jump * rate / d, jump * acceleration / d**2)


@dataclass(frozen=True)
class Cruise:
    """An angle that turns at constant rates and changes the rate by smooth steps that do not overlap.

    ``rates`` (k + 1,) before the first change and after each of them, rad/s; ``start`` and ``length`` (k,) in s; the
    angle at the first change is ``angle`` (rad).
    """

    start: Array
    length: Array
    rates: Array
    angle: float = 0.0

    def at(self, t: Array) -> Sample:
        """Return value, rate and acceleration at times `t` (s), shape (n,)."""
        d, before, after = self.length, self.rates[:-1], self.rates[1:]
        through = 0.5 * d * (before + after)
        between = np.diff(self.start) - d[:-1]
        entry = self.angle + np.concatenate([[0.0], np.cumsum(through[:-1] + between * after[:-1])])
        k = _current(t, self.start)
        since = t - self.start[k]
        area, value, rate, _ = smooth_step(since / d[k])
        jump = (after - before)[k]
        beyond = np.maximum(since - d[k], 0.0)
        angle = entry[k] + before[k] * since + jump * (d[k] * area + beyond)
        return Sample(angle, before[k] + jump * value, jump * rate / d[k])


@dataclass(frozen=True)
class Ringing:
    """A mode of a structure that rings out: ``amplitude exp(-d w s) sin(w sqrt(1 - d^2) s)``, s the time since `start`.

    w = 2 pi `frequency` (Hz), d = `damping` as a fraction of the critical one; before the start it is zero.
    """

    start: float
    amplitude: float
    frequency: float
    damping: float

    def at(self, t: Array) -> Sample:
        """Return value, rate and acceleration at times `t` (s), shape (n,)."""
        natural = 2.0 * np.pi * self.frequency
        decay, omega = self.damping * natural, natural * float(np.sqrt(1.0 - self.damping**2))
        since = t - self.start
        rung = np.where(since > 0.0, self.amplitude * np.exp(-decay * np.maximum(since, 0.0)), 0.0)
        sine, cosine = np.sin(omega * since), np.cos(omega * since)
        return Sample(
            rung * sine,
            rung * (omega * cosine - decay * sine),
            rung * ((decay**2 - omega**2) * sine - 2.0 * decay * omega * cosine),
        )


@dataclass(frozen=True)
class Product:
    """The product of two signals, such as an envelope and a swing."""

    first: Signal
    second: Signal

    def at(self, t: Array) -> Sample:
        """Return value, rate and acceleration at times `t` (s), shape (n,)."""
        a, b = self.first.at(t), self.second.at(t)
        return Sample(
            a.value * b.value,
            a.rate * b.value + a.value * b.rate,
            a.acceleration * b.value + 2.0 * a.rate * b.rate + a.value * b.acceleration,
        )


@dataclass(frozen=True)
class Sum:
    """The sum of signals; of none of them, zero."""

    parts: Sequence[Signal]

    def at(self, t: Array) -> Sample:
        """Return value, rate and acceleration at times `t` (s), shape (n,)."""
        value, rate, acceleration = np.zeros(t.shape), np.zeros(t.shape), np.zeros(t.shape)
        for part in self.parts:
            term = part.at(t)
            value += term.value
            rate += term.rate
            acceleration += term.acceleration
        return Sample(value, rate, acceleration)
