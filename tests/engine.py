"""Helpers of the engine's tests: logs with exact motion, evidence in pieces, residuals of the ideal sensor."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from imufit import Log, SensorModel, _imufit
from imufit.fitting.analysis import Analysis
from imufit.fitting.passes import CHANNELS, Passes, chunk_arrays
from imufit.progress import silent
from scipy.spatial.transform import Rotation

GRAVITY = 9.80665
NORTH_DOWN = {"NED": ((1, 0, 0), (0, 0, 1)), "ENU": ((0, 1, 0), (0, 0, -1)), "NWU": ((1, 0, 0), (0, 0, -1))}
NO_FILTERS: list[list[float]] = [[] for _ in CHANNELS]


def swaying(
    frame: str = "NED",
    *,
    rate: float = 100.0,
    duration: float = 40.0,
    jitter: float = 0.0,
    dropped: float = 0.0,
    highest: float = 2.0,
    noise: float = 0.0,
    seed: int = 0,
) -> Log:
    """Log of a body that sways by about 30 deg and 0.5 m/s^2 in sums of sines up to `highest` Hz.

    Readings are worked out on paper. `noise` is in units of 0.02 m/s^2, 0.05 deg/s and 0.3 uT.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(int(duration * rate)) / rate
    t = t + np.clip(jitter * rng.standard_normal(t.size), -0.4 / rate, 0.4 / rate)
    t = t[rng.random(t.size) >= dropped]

    def sines(amplitude: float, power: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Three sums of three sines with their first and second derivative; amplitudes go with w^-power."""
        w = 2 * np.pi * rng.uniform(0.1, highest, (3, 3))
        w[:, -1] = 2 * np.pi * highest * rng.uniform(0.9, 1.0, 3)
        a = amplitude * rng.uniform(0.2, 0.4, (3, 3)) / w**power
        angle = t[:, None, None] * w + rng.uniform(0, 2 * np.pi, (3, 3))
        parts = a * np.sin(angle), a * w * np.cos(angle), -a * w**2 * np.sin(angle)
        return parts[0].sum(2), parts[1].sum(2), parts[2].sum(2)

    angles, rates, _ = sines(np.radians(30.0), 0)
    position, _, acceleration = sines(0.5, 2)
    (_, pitch, roll), (yaw_rate, pitch_rate, roll_rate) = angles.T, rates.T
    reference = Rotation.from_euler("ZYX", angles)
    omega = np.stack(
        [
            roll_rate - np.sin(pitch) * yaw_rate,
            np.cos(roll) * pitch_rate + np.sin(roll) * np.cos(pitch) * yaw_rate,
            -np.sin(roll) * pitch_rate + np.cos(roll) * np.cos(pitch) * yaw_rate,
        ],
        axis=1,
    )
    north, down = (np.array(v, float) for v in NORTH_DOWN[frame])
    field = 20.0 * north + 44.0 * down
    shape = (t.size, 3)
    return Log.from_arrays(
        t,
        acc=reference.inv().apply(acceleration - GRAVITY * down) + 0.02 * noise * rng.standard_normal(shape),
        gyr=omega + np.radians(0.05) * noise * rng.standard_normal(shape),
        mag=reference.inv().apply(field) + 0.3 * noise * rng.standard_normal(shape),
        reference=reference,
        ref_p=position,
        frame=frame,
        mag_reference=field.tolist(),
    )


def residuals(log: Log, model: SensorModel | None = None) -> tuple[_imufit.Facts, dict[str, np.ndarray]]:
    """Facts of a log, and measured - modelled (n, 3) of each of its sensors."""
    passes = Passes(log, silent)
    facts, _ = passes.survey()
    evidence = _imufit.Evidence(facts, (model or SensorModel()).stack(), [], 2, NO_FILTERS)
    parameters = sum(len(values) for _, values in (model or SensorModel()).stack())
    parts = [_imufit.evaluate(evidence, chunk, [0.0] * parameters) for chunk in passes.chunks(facts.margin, "")]
    columns = {
        name: np.stack([np.concatenate([part[3 * k + axis] for part in parts]) for axis in range(3)], axis=1)
        for k, name in enumerate(("acc", "gyr", "mag"))
        if parts[0][3 * k] is not None
    }
    return facts, columns


def pieces(log: Log, covariates: Sequence[str], cuts: Sequence[int], margin: int) -> list[dict]:
    """Chunks of a log between the rows `cuts`, each with `margin` rows more on either side."""
    edges = [0, *sorted({c for c in cuts if 0 < c < log.n}), log.n]
    out = []
    for start, stop in itertools.pairwise(edges):
        first, last = max(0, start - margin), min(stop + margin, log.n)
        (chunk,) = log.rows(first, last).chunks(last - first)
        begin, end = start - first, stop - first
        out.append(chunk_arrays(replace(chunk, start=start, begin=begin, end=end), covariates))
    return out


def analysis_of(log: Log, *effects: str) -> Analysis:
    """Evidence of a log around the model of these effects, parameters zero."""
    return Analysis.of(SensorModel(effects), (log,), silent)
