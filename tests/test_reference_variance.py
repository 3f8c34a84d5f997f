"""How much noise of the reference reaches the residual through a stack of effects."""

import numpy as np
import pytest
from imufit import Log, SensorModel
from imufit.lab.simulate import simulate
from imufit.log import Metadata
from scipy.spatial.transform import Rotation

ATTITUDE = 1e-3
"""White noise of the reference, rad."""


def variance(effects, attitude=ATTITUDE, position=0.0):
    """Variance of the residual of the gyroscope by axis, no filter taken, rad/s squared."""
    log = simulate("handheld", {}, 5, 30.0).to_log()
    (evidence,) = SensorModel(effects, effects).fit(log).analysis.around(SensorModel(effects, effects), [{}]).logs
    plain = evidence.white.with_filters([[] for _ in range(9)])
    return np.array(plain.reference_variance(attitude, position))


def test_it_grows_with_the_square_of_the_noise_and_with_the_gain():
    ideal = variance({})
    np.testing.assert_allclose(variance({}, 3.0 * ATTITUDE)[3:6], 9.0 * ideal[3:6], rtol=1e-3)
    scaled = variance({"gyr.scale": {"x": 0.1, "y": 0.0, "z": -0.1}})
    np.testing.assert_allclose(scaled[3:6] / ideal[3:6], [1.21, 1.0, 0.81], rtol=1e-3)


def test_a_late_sensor_passes_it_on_and_a_sluggish_one_less_of_it():
    late = variance({"gyr.delay": {"tau": 0.02}})
    sluggish = variance({"gyr.lowpass": {"tau": 0.02}})
    assert np.all(sluggish[3:6] < late[3:6])


def test_a_perfect_sensor_beside_a_noisy_reference_is_off_by_as_much():
    rng = np.random.default_rng(7)
    t = 0.01 * np.arange(12000)
    along, amplitude, rate = np.array([1.0, 0.5, -0.5]), 0.1, 0.4 * np.pi
    turning = Rotation.from_rotvec(amplitude * np.sin(rate * t)[:, None] * along)
    seen = turning * Rotation.from_rotvec(rng.normal(0.0, ATTITUDE, (len(t), 3)))
    gyr = amplitude * rate * np.cos(rate * t)[:, None] * along
    log = Log(t=t, gyr=gyr, ref_q=seen.as_quat()[:, [3, 0, 1, 2]], metadata=Metadata(frame="NED"))
    fit = SensorModel().fit(log)
    (evidence,) = fit.analysis.logs
    noise = evidence.facts.reference_noise
    assert noise[0] == pytest.approx(ATTITUDE, rel=0.05)
    plain = evidence.white.with_filters([[] for _ in range(9)])
    expected = np.sqrt(np.array(plain.reference_variance(*noise))[3:6])
    np.testing.assert_allclose([channel.rms for channel in fit.compare().channels], expected, rtol=0.1)
