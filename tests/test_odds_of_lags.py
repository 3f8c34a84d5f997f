"""Odds between two lags count the noise, not the motion: a steady motion has a lag, a periodic one has none."""

from __future__ import annotations

import imufit
import numpy as np
import pytest
from imufit.errors import InputError
from imufit.joining.likeliest import left_error
from imufit.log import Log
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

SECONDS, RATE = 20.0, 100.0
LAG = 3.25


def steady(unsteady: float, seed: int) -> tuple[Log, Log]:
    """Make a motion of one hertz whose size varies by a share, seen by a gyroscope and by a late reference."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(SECONDS * RATE)) / RATE
    size = 1.0 + unsteady * gaussian_filter1d(rng.normal(size=(t.size, 3)), RATE, axis=0) * np.sqrt(3.5 * RATE)
    phase = 2.0 * np.pi * (t[:, None] + np.array([0.0, 0.3, 0.55]))
    rate = size * (np.sin(phase) + 0.5 * np.sin(2.0 * phase + np.array([0.4, 2.0, 1.1])))
    turns = Rotation.from_rotvec(0.5 * (rate[1:] + rate[:-1]) / RATE)
    attitude = [Rotation.identity()]
    for turn in turns:
        attitude.append(attitude[-1] * turn)
    seen = Rotation.concatenate(attitude) * Rotation.from_rotvec(1e-4 * rng.normal(size=(t.size, 3)))
    ref_q = seen.as_quat()[:, [3, 0, 1, 2]]
    return Log(t=t, gyr=rate + 0.05 * rng.normal(size=rate.shape)), Log(t=t + LAG, ref_q=ref_q)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_steady_motion_of_a_few_seconds_has_a_lag_and_a_periodic_one_has_none(seed: int) -> None:
    assert imufit.join(*steady(0.1, seed)).lag == pytest.approx(LAG, abs=1e-3)
    with pytest.raises(InputError, match="the lag is ambiguous"):
        imufit.join(*steady(0.0, seed))


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_the_mean_square_of_what_is_left_scatters_as_stated(memory: float) -> None:
    rng = np.random.default_rng(4)
    stated, power = [], []
    for _ in range(400):
        left = np.zeros((600, 2))
        left[0] = rng.normal(size=2) / np.sqrt(1.0 - memory**2)
        for k in range(1, len(left)):
            left[k] = memory * left[k - 1] + rng.normal(size=2)
        stated.append(left_error(left))
        power.append(np.mean(np.sum(left**2, axis=1)))
    scatter = np.std(power) / np.mean(power)
    # Half a percent of the correlation of 600 samples by chance, squared, at 600 lags: up to half as much again.
    assert scatter <= np.mean(stated) <= 1.5 * scatter
