"""A reference that lost fast motion by more than `ref.lowpass` can follow: it was smoothed before it was written.

The spectra determine the map from the gyroscope's rotation to the reference's, band by band: where both see the same
motion (coherence), the reference shows it at a gain. A sound reference has a gain of one in every band, a gyroscope
with an error of scale another one in all of them. Of a smoothed reference the gain falls with the frequency.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit import _imufit
from imufit.faults.turning import LEAST_SWING, Turning
from imufit.results import fault_words
from imufit.results.data_fault import DataFault

Array = NDArray[np.float64]

SEGMENT: Final = 6.0
"""Length of the segments that spectra are averaged over, s: the slowest resolved motion is a sixth of a hertz."""
LEAST_SEGMENTS: Final = 5
BAND: Final = 1.25
"""Ratio of the ends of a band of frequencies."""
COHERENT: Final = 0.5
"""Coherence from which on a band determines a gain."""
LOST: Final = 0.5
"""Gain below which a band is lost; to first order, as the effect sees it, none of a motion would be left soon after."""
BEYOND: Final = 2e-4
"""Part of the power of the rates that the effect cannot follow, from which on the fault is named: where it is less, the
effect explains what there is to explain."""
LEAST_LOST: Final = 1e-3
"""Part of the power of the rates that lies in lost bands: sound recordings have none in them."""


@dataclass(frozen=True)
class Gain:
    """Gain of the reference over the gyroscope by frequency.

    Attributes
    ----------
    frequency : (k,) array
        Middle of each band, Hz.
    gain : (k,) array
        Rate that the reference shows over the rate that there is.
    share : (k,) array
        Part of the gyroscope's power that lies in the band and that both see.
    """

    frequency: Array
    gain: Array
    share: Array

    @classmethod
    def of(cls, turning: Turning) -> Gain | None:
        """Take the spectra; None where too few stretches are long enough."""
        body, sensor = turning.body, turning.sensor
        step = float(np.median(np.diff(body.t)))
        if not 16.0 <= SEGMENT / step <= len(body.t):
            return None
        length = int(SEGMENT / step)
        segments: list[list[Array]] = []
        whole = 0
        for begin, end in body.unbroken:
            edges = np.arange(max(begin, sensor.t[0]), min(end, sensor.t[-1]), step)
            if len(edges) <= length:
                continue
            whole += len(edges)
            rates = [np.diff(course.angle_at(edges), axis=0) / step for course in (sensor, body)]
            seen = sensor.seen(edges[:-1], edges[1:])
            starts = range(0, len(seen) - length + 1, length // 2)
            segments += [[rate[at : at + length] for rate in rates] for at in starts if seen[at : at + length].all()]
        if whole < LEAST_SEGMENTS * length or len(segments) < LEAST_SEGMENTS:
            return None
        window = np.hanning(length)[:, None]
        own, other, shared = np.zeros(length // 2 + 1), np.zeros(length // 2 + 1), np.zeros(length // 2 + 1, complex)
        for segment in segments:
            a, b = (np.fft.rfft((rate - rate.mean(axis=0)) * window, axis=0) for rate in segment)
            own += np.sum(np.abs(a) ** 2, axis=1)
            other += np.sum(np.abs(b) ** 2, axis=1)
            shared += np.sum(a * np.conj(b), axis=1)
        frequency = np.fft.rfftfreq(length, step)
        band = np.zeros(len(frequency), int)
        band[1:] = np.round(np.log(frequency[1:] / frequency[1]) / np.log(BAND)).astype(int)
        bands = [np.flatnonzero((band == k) & (frequency > 0.0)) for k in range(band.max() + 1)]
        sums = [
            (frequency[at].mean(), own[at].sum(), other[at].sum(), abs(shared[at].sum())) for at in bands if len(at)
        ]
        f, sww, srr, swr = np.array(sums).T
        coherence = swr**2 / np.maximum(sww * srr, 1e-300)
        total = max(float(own[1:].sum()), 1e-300)
        kept = coherence > COHERENT
        share = sww * coherence / total
        gain = srr / np.maximum(swr, 1e-300)
        return cls(f[kept], gain[kept], share[kept])

    @property
    def beyond(self) -> float:
        """Part of the power that a loss with the square of the frequency, the effect's, does not follow."""
        square = (2.0 * np.pi * self.frequency) ** 2
        weight = self.share
        loss = 1.0 - self.gain
        c = float(np.sum(weight * loss * square) / max(float(np.sum(weight * square**2)), 1e-300))
        return float(np.sum(weight * (loss - c * square) ** 2))

    @property
    def lost(self) -> float:
        """Part of the power in the bands of which less than half is left."""
        return float(np.sum(self.share[self.gain < LOST]))

    @property
    def corner(self) -> float:
        """Frequency, Hz, from which on less than half is left in every band; infinite where there is none."""
        lost = self.gain < LOST
        last = np.flatnonzero(~lost)
        first = int(last[-1]) + 1 if last.size else 0
        return float(self.frequency[first]) if first < len(lost) else float("inf")


def smoothed_faults(turning: Turning, facts: _imufit.Facts) -> list[DataFault]:
    """Name a reference that was smoothed.

    Parameters
    ----------
    turning : Turning
        Of the log.
    facts : Facts
        Of the log as declared.
    """
    if turning.swing < LEAST_SWING:
        return []
    gain = Gain.of(turning)
    if gain is None or not gain.frequency.size:
        return []
    if not np.isfinite(gain.corner) or gain.beyond < BEYOND or gain.lost < LEAST_LOST:
        return []
    words = fault_words.smoothed(gain.corner, gain.lost)
    return [DataFault("smoothed", "ref", None, facts.t_start, facts.t_end, facts.n, *words, spoils=True)]
