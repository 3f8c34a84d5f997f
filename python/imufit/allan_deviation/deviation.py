"""Allan deviations of every sensor of a log, and what is read off them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

from imufit import _imufit
from imufit.allan_deviation.rest import longest_rest
from imufit.allan_deviation.result import Allan, Channel
from imufit.allan_deviation.samples import Samples, even_samples
from imufit.allan_deviation.terms import TERMS, Term, dominant, fit
from imufit.errors import InputError
from imufit.log import Log
from imufit.progress import Progress, silent

Array = NDArray[np.float64]

UNITS = {"acc": "m/s^2", "gyr": "rad/s", "mag": "uT"}
PER_OCTAVE = 4
"""Averaging times in an octave that are shown."""
_LONGEST = 4
"""The longest averaging time is this part of the longest piece."""
_CONFIDENCE = 0.6827
_BLOCK = 100
"""Samples about whose mean the noise of one sample is taken, and the least time that they cover, s."""
_BLOCK_TIME = 2.0


def allan(log: Log, sensors: tuple[str, ...] = ("acc", "gyr", "mag"), progress: Progress = silent) -> Allan:
    """Overlapping Allan deviation of each sensor, over the longest rest of the log, with the noise read off it.

    Parameters
    ----------
    log : Log
        n rows; the sensors lie still, at least for some minutes of it.
    sensors : tuple of str
        Out of "acc", "gyr" and "mag"; those that the log lacks are passed over.
    progress : callable, optional
        Called with (channels done, channels in all, what is being done).

    Returns
    -------
    Allan
        One channel for each axis.

    Raises
    ------
    InputError
        The log never rests, or has too few readings.
    """
    rest, note = longest_rest(log)
    found: dict[str, Samples] = {}
    for name in sensors:
        if name not in UNITS:
            raise ValueError(f"{name!r} is not a sensor: use acc, gyr or mag")
        readings = getattr(rest, name)
        samples = None if readings is None else even_samples(rest.t, readings)
        if samples is not None and samples.longest >= 2 * _LONGEST:
            found[name] = samples
    if not found:
        raise InputError(
            "the sensors have too few readings for an Allan deviation",
            file=log.path or "log",
            remedy="Record the sensor lying still for at least some seconds.",
        )
    channels: dict[str, Channel] = {}
    for done, (name, samples) in enumerate(found.items()):
        progress(3 * done, 3 * len(found), f"Allan deviation of {name}")
        for k, axis in enumerate("xyz"):
            pieces = [np.ascontiguousarray(piece[:, k]) for piece in samples.pieces]
            channels[f"{name}_{axis}"] = _channel(f"{name}_{axis}", UNITS[name], pieces, samples)
    progress(3 * len(found), 3 * len(found), "Allan deviations")
    return Allan(channels, rest.duration, rest.n, log.metadata.gravity, _field(rest), (note,) if note else ())


def _quantile(part: float, freedom: Array) -> Array:
    """Quantile of chi-squared with these degrees of freedom."""
    return np.asarray(2.0 * gammaincinv(0.5 * freedom, part))


def _field(log: Log) -> float | None:
    """Return the length of the measured field, uT."""
    if log.mag is None or not np.isfinite(log.mag).all(axis=1).any():
        return None
    return float(np.linalg.norm(np.nanmean(log.mag, axis=0)))


def averaging_factors(longest: int) -> list[int]:
    """Return the averaging times, in samples, spread evenly over the octaves up to a quarter of `longest` samples."""
    octaves = np.log2(max(1, longest // _LONGEST))
    spread = 2.0 ** np.arange(0.0, octaves + 1e-9, 1.0 / PER_OCTAVE)
    return sorted({round(float(m)) for m in spread})


def _channel(name: str, unit: str, pieces: list[Array], samples: Samples) -> Channel:
    factors = averaging_factors(samples.longest)
    deviation, _ = _imufit.allan_deviation(pieces, factors)
    factor, tau = np.array(factors), samples.step * np.array(factors, dtype=np.float64)
    # Lost samples carry nothing: what is left is as sure as a shorter piece.
    present = [round(np.count_nonzero(np.isfinite(piece))) for piece in pieces]

    def freedom(kind: str, m: int) -> float:
        return max(1.0, sum(_imufit.allan_freedom(kind, n, m) for n in present))

    octaves = np.flatnonzero((factor & (factor - 1)) == 0)
    fitted = fit(tau[octaves], deviation[octaves] ** 2, lambda kind, i: freedom(kind, int(factor[octaves[i]])))
    squares = np.array([0.0, 1.0, 0.0, 0.0] if fitted is None else list(fitted.squares.values()))
    edf = np.array([freedom(kind, m) for kind, m in zip(dominant(squares, tau), factors, strict=True)])
    tail = 0.5 * (1.0 - _CONFIDENCE)
    block = max(_BLOCK, round(_BLOCK_TIME / samples.step))
    hidden = {kind: Term(None, None, float("nan")) for kind in TERMS}
    return Channel(
        name=name,
        unit=unit,
        step=samples.step,
        n=int(sum(present)),
        scatter=_imufit.block_scatter(pieces, block),
        tau=tau,
        deviation=deviation,
        low=deviation * np.sqrt(edf / _quantile(1.0 - tail, edf)),
        high=deviation * np.sqrt(edf / _quantile(tail, edf)),
        freedom=edf,
        terms=hidden if fitted is None else fitted.terms,
        squares=None if fitted is None else fitted.squares,
        tau_start=None if fitted is None else fitted.tau_start,
        probability=None if fitted is None else fitted.probability,
    )
