"""What a log can tell is worked out from the truth."""

import numpy as np
import pytest
from imufit.lab.simulate import Line, Noise, SensorNoise
from imufit.lab.simulate.separation import Separation, near, whitening
from imufit.lab.simulate.study import Study
from scipy.signal import lfilter

STEP, SHARE = 0.1, 10


def averaged(values):
    return values.reshape(-1, SHARE, 3).mean(axis=1)


@pytest.mark.parametrize("attitude", [0.0, np.radians(0.03)])
def test_whitened_noise_is_white_with_unit_variance(attitude):
    noise, rng = Noise.realistic().gyr, np.random.default_rng(0)
    t = np.arange(0.0, 2000.0, STEP / SHARE)
    rows = averaged(noise.draw(rng, t))
    error = averaged(attitude * rng.standard_normal((t.size, 3)))
    rows[1:] += np.diff(error, axis=0) / STEP
    top, bottom = whitening(noise, STEP, SHARE, (1, attitude))
    white = lfilter(top, bottom, rows, axis=0)[200:]
    assert np.std(white) == pytest.approx(1.0, abs=0.05)
    for lag in (1, 2, 5):
        assert abs(np.mean(white[lag:] * white[:-lag])) < 0.04


def test_plain_white_noise_is_only_scaled():
    top, bottom = whitening(SensorNoise(0.5), STEP, 4.0)
    np.testing.assert_allclose(top / bottom, [4.0])


def test_length_of_an_effect_is_its_size_times_the_root_of_the_number_of_readings():
    study = Study("handheld", ["acc.bias"], 1, 60.0)
    distance = Separation(study, ()).distances("acc.bias", study.draw("acc.bias", 0.5))[""]
    assert distance == pytest.approx(0.5**2 * 3 * 6000, rel=0.02)


def test_temperature_that_rises_steadily_is_time_once_there_is_a_bias():
    study = Study("arm", ["acc.bias_drift"], 1, 60.0, courses={"temp": Line(20.0, 0.1)})
    drawn = study.draw("acc.bias_drift", 1.0)
    separation = Separation(study, ())
    assert near(separation.distances("acc.bias_drift", drawn, ["acc.bias"]), 1.0) == ("acc.bias_temperature",)
    assert "acc.bias_temperature" not in near(separation.distances("acc.bias_drift", drawn), 1000.0)


def test_wandering_bias_and_noisy_reference_hide_effects_that_white_noise_shows():
    lengths = {}
    for name, realistic in (("plain", False), ("realistic", True)):
        for effect in ("gyr.bias_drift", "gyr.scale", "mag.hard_iron"):
            study = Study("handheld", [effect], 4, 60.0, realistic=realistic)
            parameters = Study("handheld", [effect], 4, 60.0).draw(effect, 0.3)
            lengths[name, effect] = Separation(study, ()).distances(effect, parameters)[""]
    for effect in ("gyr.bias_drift", "gyr.scale", "mag.hard_iron"):
        assert lengths["realistic", effect] < 0.7 * lengths["plain", effect]
    assert lengths["realistic", "gyr.scale"] < 0.2 * lengths["plain", "gyr.scale"]
