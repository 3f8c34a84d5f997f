"""Kinds of noise that are not effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from imufit.lab.simulate import Noise, SensorNoise


def everyday() -> Noise:
    """Return white noise with what every log has: 16 bit steps, jitter, lost rows, a slower magnetometer."""
    full = replace(Noise.realistic(), attitude_deg=0.0, position=0.0)
    return _each(full, lambda name: replace(full.sensor(name), coloured=0.0, random_walk=0.0))


def _each(noise: Noise, of: Callable[[str], SensorNoise]) -> Noise:
    """Return noise with that of each sensor replaced."""
    return replace(noise, acc=of("acc"), gyr=of("gyr"), mag=of("mag"))


def coloured() -> Noise:
    """Return noise of which a part is correlated over two to five tenths of a second."""
    full = Noise.realistic()
    return _each(everyday(), lambda name: replace(full.sensor(name), random_walk=0.0))


def wandering() -> Noise:
    """Return noise with bias random walks."""
    full = Noise.realistic()
    return _each(everyday(), lambda name: replace(full.sensor(name), coloured=0.0))


def growing_with_rate() -> Noise:
    """Return noise that doubles at 1 rad/s."""
    plain = everyday()
    return _each(plain, lambda name: replace(plain.sensor(name), growth_with_rate=1.0))


def growing_with_time() -> Noise:
    """Return noise that has doubled at the end of the log."""
    plain = everyday()
    return _each(plain, lambda name: replace(plain.sensor(name), growth_with_time=1.0))


def noisy_reference() -> Noise:
    """Return sensors with white noise beside a reference that has noise, too."""
    full = Noise.realistic()
    return replace(everyday(), attitude_deg=full.attitude_deg, position=full.position)


NOISES: Mapping[str, Callable[[], Noise]] = {
    "white": everyday,
    "coloured": coloured,
    "growing with rate": growing_with_rate,
    "growing with time": growing_with_time,
    "random walk": wandering,
    "reference noise": noisy_reference,
    "all together": Noise.realistic,
}
