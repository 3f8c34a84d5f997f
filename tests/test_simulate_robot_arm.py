"""A robot arm that swings a GY-86: how it moves, what its length does to the specific force, and the chip's noise."""

import numpy as np
import pytest
from imufit.lab.simulate import Noise, SensorNoise, simulate
from imufit.lab.simulate.robot_arm import ARM, REACH, STANDING
from scipy.spatial.transform import Rotation

RATE = 200.0
QUIET = Noise(acc=SensorNoise(0.0), gyr=SensorNoise(0.0), mag=SensorNoise(0.0))


@pytest.fixture(scope="module")
def swung():
    return simulate("arm_swing", {}, 5, 60.0, RATE, noise=QUIET)


def test_one_hinge_after_the_other_goes_from_end_to_end_and_stops_there(swung):
    turned = np.linalg.norm(swung.gyr, axis=1)
    assert np.all(turned[swung.t < STANDING] < 1e-9)
    assert np.degrees(turned.max()) < 80.0 + 1e-9
    assert 0.3 < np.mean(turned < 1e-9) < 0.7
    yaw, pitch, roll = Rotation.from_quat(swung.ref_q[:, [1, 2, 3, 0]]).as_euler("ZYX").T
    for angle, reach in zip((yaw, pitch, roll), REACH, strict=True):
        assert np.ptp(angle) == pytest.approx(2.0 * reach, abs=1e-6)
        moving = np.abs(np.gradient(angle, 1.0 / RATE)) > 1e-6
        others = sum(np.abs(np.gradient(other, 1.0 / RATE)) > 1e-6 for other in (yaw, pitch, roll))
        assert np.all(others[moving] == 1)
    assert abs(yaw[0]) > np.radians(20.0)


def test_the_arm_adds_the_acceleration_of_its_end_to_gravity(swung):
    at_joint = simulate("arm_swing", {"acc.lever_arm": {"x": -ARM[0]}}, 5, 60.0, RATE, noise=QUIET)
    np.testing.assert_allclose(np.linalg.norm(at_joint.acc, axis=1), 9.80665, rtol=1e-9)
    np.testing.assert_array_equal(at_joint.ref_q, swung.ref_q)
    r, alpha = np.array(ARM), np.gradient(swung.gyr, 1.0 / RATE, axis=0)
    expected = np.cross(swung.gyr, np.cross(swung.gyr, r)) + np.cross(alpha, r)
    added = swung.acc - at_joint.acc
    assert 1.0 < np.linalg.norm(added, axis=1).max() < 5.0
    assert np.abs(added - expected).max() < 0.02 * np.abs(expected).max()


def test_the_field_is_that_of_the_place_in_readings_and_metadata(swung):
    field = swung.metadata["mag_reference"]
    assert field == [41.0, 0.0, 10.0]
    seen = Rotation.from_quat(swung.ref_q[:, [1, 2, 3, 0]]).apply(swung.mag)
    np.testing.assert_allclose(seen, np.broadcast_to(field, seen.shape), atol=1e-9)


def test_the_gy86_has_its_magnetometers_rate_digits_and_deviation():
    still = simulate("arm_swing", {}, 6, 3.0, RATE)
    there = np.isfinite(still.mag).all(axis=1)
    assert there.sum() / 3.0 == pytest.approx(75.0, rel=0.02)
    steps = still.mag[there] / (100.0 / 1090.0)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert np.std(still.mag[there], axis=0) == pytest.approx([0.2] * 3, rel=0.2)
    tilt = np.degrees(np.std(still.acc, axis=0)) / 9.80665
    assert tilt == pytest.approx([np.degrees(350e-6 * np.sqrt(0.5 * np.pi * 44.0))] * 3, rel=0.15)
