"""What records the reference: late by a clock of its own, smoothed by an average over poses, and nothing else."""

import numpy as np
import pytest
from imufit.lab.simulate import simulate
from imufit.lab.simulate.noise import Noise, SensorNoise
from imufit.lab.simulate.recorder import Recorder
from imufit.lab.simulate.study import Study
from scipy.spatial.transform import Rotation

QUIET = Noise(acc=SensorNoise(1e-300), gyr=SensorNoise(1e-300), mag=SensorNoise(1e-300), temperature=0.0)


def quiet(scenario, effects=None):
    return simulate(scenario, effects, seed=3, duration=20.0, noise=QUIET)


def matrices(log):
    return Rotation.from_quat(log.ref_q[:, [1, 2, 3, 0]]).as_matrix()


def test_a_reference_on_another_clock_stamps_every_second_longer():
    k = 2e-3
    log = quiet("arm", {"ref.skew": {"k": k}})
    # What happened at t is stamped t0 + (1 + k) (t - t0).
    then = log.trajectory.at(log.t[0] + (log.t - log.t[0]) / (1.0 + k))
    np.testing.assert_allclose(log.ref_p, then.position, atol=1e-12)
    np.testing.assert_allclose(matrices(log), then.rotation, atol=1e-12)
    np.testing.assert_array_equal(log.gyr, quiet("arm").gyr)


def averaged(values, t, c):
    """Values of a function of time averaged with weights that fall off exponentially to both sides, by trapezia."""
    constant = np.sqrt(c)
    offsets = np.linspace(-30.0, 30.0, 6001)
    weights = np.exp(-np.abs(offsets))
    weights /= weights.sum()
    return np.stack([np.tensordot(weights, values(at + constant * offsets), axes=1) for at in t])


def test_a_smoothed_reference_is_the_mean_of_the_poses_around():
    c = 8e-4
    log = quiet("handheld", {"ref.lowpass": {"c": c}})
    rows = np.arange(300, 1500, 100)
    mean = averaged(lambda t: log.trajectory.at(t).position, log.t[rows], c)
    np.testing.assert_allclose(log.ref_p[rows], mean, atol=1e-7)
    left, _, right = np.linalg.svd(averaged(lambda t: log.trajectory.at(t).rotation, log.t[rows], c))
    np.testing.assert_allclose(matrices(log)[rows], left @ right, atol=1e-7)
    assert np.max(np.abs(log.ref_p[rows] - log.trajectory.at(log.t[rows]).position)) > 1e-5
    np.testing.assert_array_equal(log.acc, quiet("handheld").acc)


@pytest.mark.parametrize("recorder", [Recorder(smoothing=1e-3), Recorder(delay=0.01, skew=0.02, start=1.0)])
def test_recorded_rates_and_accelerations_are_those_of_the_recorded_poses(recorder):
    trajectory, h = Study("handheld", [], 5, 20.0).trajectory, 1e-4
    t = np.linspace(2.0, 18.0, 40)
    before, now, after = (recorder.poses(trajectory, t + step) for step in (-h, 0.0, h))
    turns = [Rotation.from_matrix(np.swapaxes(now.rotation, 1, 2) @ other.rotation) for other in (before, after)]
    np.testing.assert_allclose((turns[1].as_rotvec() - turns[0].as_rotvec()) / (2 * h), now.omega, atol=1e-5)
    np.testing.assert_allclose((after.omega - before.omega) / (2 * h), now.alpha, atol=1e-4)
    np.testing.assert_allclose((after.position - before.position) / (2 * h), now.velocity, atol=1e-6)
    np.testing.assert_allclose((after.velocity - before.velocity) / (2 * h), now.acceleration, atol=1e-5)


def test_the_angle_of_a_rig_is_smoothed_like_its_attitude():
    log = quiet("tilt", {"ref.lowpass": {"c": 1e-3}})
    turned = Rotation.from_matrix(np.swapaxes(quiet("tilt").trajectory.at(log.t).rotation, 1, 2) @ matrices(log))
    change = log.ref_angle - quiet("tilt").ref_angle
    assert np.max(np.abs(change)) > 1e-4
    np.testing.assert_allclose(turned.as_rotvec()[:, 0], change, atol=1e-5)
