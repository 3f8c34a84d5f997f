"""What no catalogue holds is told with what it depends on: memories, tones, knocks, gains that follow something."""

import numpy as np
import pytest
from imufit import Log, SensorModel, ladder
from imufit.diagnosing.telegraph_noise import telegraph_noise
from imufit.diagnosing.tones import strongest
from imufit.lab import simulate
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

COLUMNS = ("motor_current", "vbat")


def answer_to(name, scenario="handheld", seed=3, size=1.0):
    """Return what a log with an effect outside the catalogue is diagnosed with, and the log."""
    sim = simulate.simulate(scenario, {name: None}, seed, size=size, covariates=COLUMNS)
    return SensorModel().fit(sim.to_log()).diagnose(), sim


@pytest.mark.parametrize(
    ("name", "scenario", "cause", "words"),
    [
        ("gyr.current_memory", "arm", "motor_current", "it lags behind"),
        ("acc.warm_misalignment", "poses", "temp", "the mounting turns with it"),
        ("acc.knock", "handheld", "t", "the mounting turns"),
        ("acc.scale_rate", "handheld", "omega_norm", "its gain follows it"),
        ("acc.heading", "arm", "heading", "once or twice a turn"),
        ("gyr.speed", "arm", "speed", "growing with it"),
        ("mag.squared", "poses", "m_", "parabolic"),
    ],
)
def test_the_cause_is_told_though_no_effect_has_it(name, scenario, cause, words):
    answer, _ = answer_to(name, scenario)
    assert (answer.verdict, answer.best) == ("unknown", None)
    first = answer.unexplained[0]
    assert first.channel.startswith(name[:3])
    assert first.covariate.startswith(cause)
    assert first.shape.startswith(words)
    assert 0.3 < first.share <= 1.0


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("sensor", ["acc", "gyr"])
def test_a_tone_is_told_by_its_frequency(sensor, seed):
    answer, sim = answer_to(f"{sensor}.tone", seed=seed, size=0.5)
    assert answer.verdict == "unknown"
    for found in answer.unexplained:
        assert (found.channel[:3], found.covariate) == (sensor, "t")
        words = found.shape.split()
        assert words[:3] == ["a", "line", "at"]
        expected = sim.truth.effects[f"{sensor}.tone"]["frequency"]
        assert float(words[3]) == pytest.approx(expected, abs=1.0 / (sim.t[-1] - sim.t[0]))


def noise_of(kind, seed):
    """Return time stamps and noise of a kind, some of it missing."""
    rng = np.random.default_rng(seed)
    t = np.arange(20_000) / 100.0
    noise = rng.normal(size=t.size)
    if kind == "coloured":
        noise = lfilter([1.0], [1.0, -0.97], noise)
    elif kind == "slowly coloured":
        noise += 0.3 * lfilter([1.0], [1.0, -0.995], noise)
    elif kind == "walk":
        noise += 0.3 * np.cumsum(rng.normal(size=t.size))
    elif kind == "bursts":
        noise *= np.where(rng.random(t.size // 200).repeat(200) < 0.1, 8.0, 1.0)
    elif kind == "short bursts":
        noise *= np.where(rng.random(t.size // 60).repeat(61)[: t.size] < 0.07, 15.0, 1.0)
    elif kind == "resonant":
        noise = lfilter([1.0], [1.0, -1.8 * np.cos(0.3), 0.81], noise)
    elif kind == "step":
        noise += np.where(t > 90.0, 3.0, 0.0)
    noise[rng.random(t.size) < 0.02] = np.nan
    return t, noise


KINDS = ["white", "coloured", "slowly coloured", "walk", "bursts", "short bursts", "resonant", "step"]


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("kind", KINDS)
def test_noise_holds_no_tone_and_no_telegraph_noise(kind, seed):
    t, noise = noise_of(kind, seed)
    assert telegraph_noise(t, noise) is None
    _, _, p_value = strongest(t, noise)
    assert p_value > 1e-4


@pytest.mark.parametrize("kind", ["white", "coloured"])
def test_jumps_are_counted_and_measured(kind):
    t, noise = noise_of(kind, 1)
    noise /= np.nanstd(noise)
    changes = np.array([20.0, 23.0, 60.0, 61.5, 90.0, 95.0, 140.0, 142.0])
    size = 1.5 if kind == "white" else 9.0
    found = telegraph_noise(t, noise + size * (np.searchsorted(changes, t) % 2))
    assert found is not None
    assert (found.count, found.size) == (8, pytest.approx(size, rel=0.2))
    assert found.first == pytest.approx(20.0, abs=0.4)
    assert found.upper == pytest.approx(11.5 / 200.0, rel=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_a_loose_contact_is_told(seed):
    answer, _ = answer_to("gyr.loose_contact", scenario="arm", seed=seed, size=1.5)
    assert (answer.verdict, answer.best) == ("unknown", None)
    assert "random telegraph noise" in answer.unexplained[0].shape


def test_a_tone_is_found_in_noise_that_rises_towards_slow_changes():
    rng = np.random.default_rng(1)
    t = np.arange(20_000) / 100.0 + rng.uniform(0.0, 1e-3, 20_000)
    noise = rng.normal(size=t.size) + 0.05 * np.cumsum(rng.normal(size=t.size))
    frequency, square, p_value = strongest(t, noise + 0.5 * np.sin(2.0 * np.pi * 3.21 * t))
    assert frequency == pytest.approx(3.21, abs=0.005)
    assert p_value < 1e-9
    assert square == pytest.approx(0.125, rel=0.1)


def test_a_few_samples_tell_no_tone():
    assert strongest(np.arange(200) / 10.0, np.zeros(200)) is None


@pytest.mark.parametrize("corner", [0.6, 0.9])
def test_a_response_bent_on_one_side_is_no_sum_of_scale_and_cubic(corner):
    """A polynomial takes up most of it; the ladder says that this is not the end."""
    sim = simulate.simulate("handheld", {}, 4, 120.0)
    rate = sim.trajectory.at(sim.t).omega
    sim.gyr[:] += 0.02 * np.maximum(rate - corner * rate.std(axis=0), 0.0)
    answer = ladder(sim.to_log()).diagnosis
    assert (answer.verdict, answer.best) == ("unknown", None)
    assert {item.covariate[:5] for item in answer.unexplained if item.channel.startswith("gyr")} >= {"omega"}


def test_a_creep_of_seconds_is_not_explained_by_the_scale_that_is_like_it():
    sim = simulate.simulate("poses", {"acc.creep": None}, 3, size=1.0)
    answer = ladder(sim.to_log()).diagnosis
    assert (answer.verdict, answer.best) == ("unknown", None)
    assert answer.unexplained[0].channel.startswith("acc")


@pytest.mark.parametrize("seed", range(4))
def test_noise_of_the_attitude_in_gravity_and_in_the_angular_acceleration_is_no_lever_arm(seed):
    """A vehicle that turns slowly: what its reference says of angular accelerations about x and y is noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 120.0, 1.0 / 400.0)
    yaw = 0.8 * np.sin(0.2 * t) + 0.3 * np.sin(0.71 * t)
    position = np.stack([20.0 * np.sin(0.1 * t), 15.0 * np.sin(0.13 * t), 0.0 * t], axis=1)
    acceleration = np.stack([-0.2 * np.sin(0.1 * t), -0.2535 * np.sin(0.13 * t), 0.0 * t], axis=1)
    attitude = Rotation.from_rotvec(yaw[:, None] * np.array([0.0, 0.0, 1.0]))
    force = attitude.inv().apply(acceleration + np.array([0.0, 0.0, 9.80665])) + 0.02 * rng.normal(size=(t.size, 3))
    noisy = attitude * Rotation.from_rotvec(9e-4 * rng.normal(size=(t.size, 3)))
    log = Log.from_arrays(t, acc=force, reference=noisy, ref_p=position, frame="NWU")
    answer = SensorModel().fit(log).diagnose()
    assert (answer.verdict, answer.best) == ("adequate", None)


@pytest.mark.parametrize("seed", range(3))
def test_shaking_no_stronger_than_the_noise_shows_its_rectification(seed):
    sim = simulate.simulate("poses", {}, seed, 150.0)
    rng = np.random.default_rng(seed)
    steps = rng.normal(size=sim.t.size) * np.sqrt(2.0 * 0.01 / 3.0)
    envelope = 0.02 * np.exp(0.8 * lfilter([1.0], [1.0, -(1.0 - 0.01 / 3.0)], steps))
    sim.acc[:] += envelope[:, None] * rng.normal(size=sim.acc.shape)
    shift = envelope**2
    sim.acc[:] += 0.02 * (shift / shift.std())[:, None] * np.array([1.0, -0.7, 0.4])
    answer = SensorModel().fit(sim.to_log()).diagnose()
    assert "acc.vibration_rectification" in {answer.best, *answer.ambiguous_with}


def test_steady_noise_is_no_shaking():
    answer = SensorModel().fit(simulate.simulate("poses", {}, 2, 60.0).to_log()).diagnose()
    assert "acc.vibration_rectification" not in {candidate.effect for candidate in answer.candidates}
