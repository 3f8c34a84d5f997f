"""How far a reference is smoothed: by its own noise and motion, whatever the noise of the sensor."""

from dataclasses import replace

import numpy as np
import pytest
from imufit import Log, SensorModel
from scipy.spatial.transform import Rotation

RATE = 100.0
UP = np.array([0.0, 0.0, 1.0])


def bouncing(noise: float, seed: int) -> Log:
    """A sensor that is carried by a person who walks: up and down twice a second, turning a little all the time."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 90.0, 1.0 / RATE)
    swing = [(0.15, 0.9, 0.0), (0.2, 0.6, 1.0), (0.8, 0.11, 2.0)]
    angles = np.stack([a * np.sin(2.0 * np.pi * f * t + p) for a, f, p in swing], axis=1)
    attitude = Rotation.from_euler("xyz", angles)
    terms = [(0, 0.01, 1.0), (1, 0.012, 2.0), (2, 0.02, 2.0), (2, 0.006, 4.0)]
    position, acceleration = np.zeros((t.size, 3)), np.zeros((t.size, 3))
    for axis, size, f in terms:
        w = 2.0 * np.pi * f
        position[:, axis] += size * np.sin(w * t + axis)
        acceleration[:, axis] -= size * w**2 * np.sin(w * t + axis)
    force = attitude.inv().apply(acceleration + 9.80665 * UP) + noise * rng.normal(size=(t.size, 3))
    return Log.from_arrays(t, acc=force, reference=attitude, ref_p=position, frame="ENU")


@pytest.mark.parametrize("noise", [0.02, 0.4, 1.5])
def test_a_noisy_accelerometer_does_not_smooth_the_motion_away(noise):
    fit = SensorModel().fit(bouncing(noise, 1))
    assert fit.ratio == pytest.approx(1.0, abs=0.03)
    residual = fit.compare().channels
    assert all(channel.rms == pytest.approx(noise, rel=0.05) for channel in residual)
    answer = fit.diagnose()
    assert (answer.verdict, answer.best) == ("adequate", None)


def test_a_reference_in_rows_of_its_own_is_smoothed_as_one_beside_the_readings():
    rng = np.random.default_rng(3)
    log = bouncing(0.05, 2)
    # Noise that goes on over three samples is not white: no two widths agree, and the sensor is asked.
    jitter = np.apply_along_axis(np.convolve, 0, rng.normal(size=(log.n, 3)), np.ones(3) / 3.0, mode="same")
    shaken = replace(log, ref_p=log.ref_p + 5e-4 * jitter)
    reading = (np.arange(log.n) % 2 == 0)[:, None]
    apart = replace(
        shaken,
        acc=np.where(reading, shaken.acc, np.nan),
        ref_q=np.where(reading, np.nan, shaken.ref_q),
        ref_p=np.where(reading, np.nan, shaken.ref_p),
    )
    together, own_rows = (
        np.array([channel.rms for channel in SensorModel().fit(each).compare().channels]) for each in (shaken, apart)
    )
    # Half as many samples of the reference; where the sensor was not asked it was seven times as much.
    assert np.all(own_rows < 2.0 * together)
