"""A reference that lost fast motion or runs on another clock: named as such, and not as a gain of the sensor."""

from dataclasses import replace

import imufit
import numpy as np
import pytest
from imufit import SensorModel
from imufit.lab import simulate
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


@pytest.mark.parametrize("seed", [1, 2])
def test_noise_that_was_low_passed_as_well_does_not_hide_the_loss(seed: int) -> None:
    """Such noise is small from sample to sample and large where the body moves; only the gyroscope shows it."""
    sim = simulate.simulate("handheld", {}, seed, 60.0)
    noise = np.random.default_rng(seed).normal(0.0, 2e-4, (len(sim.t), 3))
    attitude = (Rotation.from_quat(sim.ref_q[:, [1, 2, 3, 0]]) * Rotation.from_rotvec(noise)).as_quat()[:, [3, 0, 1, 2]]
    attitude *= np.sign(np.sum(attitude * sim.ref_q, axis=1, keepdims=True))
    b, a = butter(1, 5.0, fs=100.0)
    answer = SensorModel().fit(recorded(sim, filtfilt(b, a, attitude, axis=0), None)).diagnose()
    assert answer.best == "ref.lowpass"
    assert not GAINS & set(answer.ambiguous_with)
    c = next(candidate for candidate in answer.candidates if candidate.effect == "ref.lowpass").parameters[0].value
    assert c == pytest.approx(1.0 / (2.0 * np.pi * 5.0) ** 2, rel=0.1)


def test_poses_of_another_clock_drawn_straight_lose_a_twelfth_of_their_interval_squared() -> None:
    """Two rows lie between three poses, too few to find the poses."""
    sim = simulate.simulate("handheld", {}, 1, 60.0)
    poses = np.arange(sim.t[0] - 0.004, sim.t[-1] + 0.02, 0.015)
    truth = sim.trajectory.at(poses)
    attitude = Slerp(poses, Rotation.from_matrix(truth.rotation))(sim.t).as_quat()[:, [3, 0, 1, 2]]
    position = np.stack([np.interp(sim.t, poses, truth.position[:, axis]) for axis in range(3)], axis=1)
    answer = SensorModel().fit(recorded(sim, attitude, position)).diagnose()
    assert answer.best == "ref.lowpass"
    c = next(candidate for candidate in answer.candidates if candidate.effect == "ref.lowpass").parameters[0].value
    assert c == pytest.approx(0.015**2 / 12.0, rel=0.15)


@pytest.mark.parametrize(("turned", "named"), [(0.4, None), (10.0, "ref.alignment")])
def test_an_axis_that_rests_between_two_steps_of_its_encoder_is_no_mount(turned: float, named: str | None) -> None:
    """``turned``: how far an axis that never moves stands from the angle its encoder shows, in steps of the encoder."""
    step = np.deg2rad(0.14)
    sim = simulate.simulate("tilt", {}, 5, 60.0)
    true = Rotation.from_quat(sim.ref_q[:, [1, 2, 3, 0]])
    vector = true.as_rotvec()
    shown = Rotation.from_rotvec(np.round(vector / step) * step)
    attitude = (shown * Rotation.from_rotvec([0.0, turned * step, 0.0])).as_quat()[:, [3, 0, 1, 2]]
    answer = SensorModel().fit(replace(sim, ref_q=attitude).to_log()).diagnose()
    assert answer.best == named


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
