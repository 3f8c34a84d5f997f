"""A reference that lost fast motion or runs on another clock: named as such, and not as a gain of the sensor."""

from dataclasses import replace

import imufit
import numpy as np
import pytest
from imufit import SensorModel, simulate
from scipy.signal import butter, filtfilt
from scipy.spatial.transform import Rotation, Slerp

GAINS = {"gyr.scale", "acc.scale", "gyr.cubic", "acc.cubic", "acc.lever_arm"}


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("effect", ["ref.skew", "ref.lowpass", "gyr.vibration_rectification"])
def test_the_ladder_adds_it_with_its_size(effect: str, seed: int) -> None:
    # Shaking that no reference follows stands far above a stated noise.
    sim = simulate.simulate("handheld", {effect: None}, seed, 60.0, noise_in_metadata="vibration" not in effect)
    result = imufit.ladder(sim.to_log())
    assert (result.model, result.verdict) == ((effect,), "adequate")
    truth = sim.truth.effects[effect]
    for parameter in result.fit.parameters:
        assert abs(parameter.value - truth[parameter.name]) < 4.0 * parameter.standard_error
        assert parameter.standard_error < 0.1 * abs(truth[parameter.name])


@pytest.mark.parametrize(
    ("scenario", "tau", "k"), [("arm", 0.006, -2e-4), ("handheld", 0.002, -2e-4 / 3), ("arm", 0.006, -2e-5)]
)
def test_clocks_that_drift_apart_and_start_apart_are_both_found(scenario: str, tau: float, k: float) -> None:
    """Also where they agree in the middle of the log, so that neither of the two explains much without the other."""
    truth = {"ref.delay": {"tau": tau}, "ref.skew": {"k": k}}
    result = imufit.ladder(simulate.simulate(scenario, truth, 3, 60.0).to_log())
    assert set(result.model) == set(truth)
    assert result.verdict == "adequate"


def recorded(sim, attitude, position):
    """The log with another reference."""
    q = attitude / np.linalg.norm(attitude, axis=1, keepdims=True)
    return replace(sim, ref_q=q, ref_p=position).to_log()


@pytest.mark.parametrize(("order", "lost"), [(1, 1.0 / (2.0 * np.pi * 6.0) ** 2), (2, None)])
def test_a_reference_low_passed_at_six_hertz_is_no_scale(order: int, lost: float | None) -> None:
    sim = simulate.simulate("handheld", {}, 1, 60.0)
    b, a = butter(order, 6.0, fs=100.0)
    log = recorded(sim, filtfilt(b, a, sim.ref_q, axis=0), filtfilt(b, a, sim.ref_p, axis=0))
    answer = SensorModel().fit(log).diagnose()
    assert answer.best == "ref.lowpass"
    assert not GAINS & set(answer.ambiguous_with)
    if lost is not None:
        c = next(candidate for candidate in answer.candidates if candidate.effect == "ref.lowpass").parameters[0].value
        assert c == pytest.approx(lost, rel=0.05)


def test_straight_lines_between_sparse_poses_are_not_taken_for_the_motion() -> None:
    sim = simulate.simulate("handheld", {}, 1, 60.0)
    poses = np.arange(sim.t[0], sim.t[-1] + 0.04, 0.04)
    truth = sim.trajectory.at(poses)
    attitude = Slerp(poses, Rotation.from_matrix(truth.rotation))(sim.t).as_quat()[:, [3, 0, 1, 2]]
    position = np.stack([np.interp(sim.t, poses, truth.position[:, axis]) for axis in range(3)], axis=1)
    answer = SensorModel().fit(recorded(sim, attitude, position)).diagnose()
    assert (answer.verdict, answer.best) == ("adequate", None)


def test_a_reference_with_its_full_bandwidth_has_lost_nothing() -> None:
    answer = SensorModel().fit(simulate.simulate("handheld", {}, 4, 60.0, realistic=True).to_log()).diagnose()
    assert (answer.verdict, answer.best) == ("adequate", None)
