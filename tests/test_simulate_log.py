"""A simulated log: rows, noise, metadata, blind trials and marks."""

import json
import time

import imufit.lab.simulate as sim
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imufit.lab.simulate import OBSERVABLE, SCENARIOS, SIZES, Noise, SensorNoise, Truth, grade, hidden, simulate
from imufit.lab.simulate.noise import magnetometer_rows, sampling_times
from imufit.lab.simulate.sealed import HEADER, seal, sealed_path, unseal
from imufit.log import Log

COLUMNS = ("t", "acc", "gyr", "mag", "temp", "ref_q")


@pytest.mark.parametrize("scenario", OBSERVABLE)
def test_same_seed_same_log_and_another_seed_another(scenario):
    one, again, other = (simulate(scenario, {"gyr.bias": None}, s, 20.0, covariates=["vbat"]) for s in (1, 1, 2))
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(one, name), getattr(again, name))
    assert one.truth == again.truth
    for name in COLUMNS[1:]:
        assert not np.allclose(getattr(one, name), getattr(other, name))
    assert not np.allclose(one.covariates["vbat"], other.covariates["vbat"])


@pytest.mark.parametrize("frame", ["NED", "ENU", "NWU"])
@pytest.mark.parametrize("scenario", OBSERVABLE)
def test_log_has_all_columns_and_complete_metadata(scenario, frame):
    kind = SCENARIOS[scenario]
    log = simulate(scenario, duration=40.0, frame=frame, rig_axis="y", covariates=["vbat"]).to_log()
    assert isinstance(log, Log)
    assert log.n == 4000
    assert log.metadata.frame == frame
    assert log.metadata.gravity == 9.80665
    assert (log.metadata.rig_axis == "y") == kind.rig
    np.testing.assert_allclose(np.linalg.norm(log.metadata.mag_reference), np.hypot(20.0, 44.0))
    assert (log.ref_p is not None) == kind.position
    assert (log.ref_angle is not None) == kind.rig
    assert (log.pose is not None) == kind.poses
    assert "vbat" in log.covariates
    for values in (log.acc, log.gyr, log.mag, log.temp, log.ref_q):
        assert values is not None
        assert np.all(np.isfinite(values))


def test_metadata_tell_the_white_noise_unless_told_not_to():
    assert simulate("poses", duration=5.0).metadata["noise"] == pytest.approx(
        {"acc": 0.02, "gyr": np.radians(0.05), "mag": 0.3}
    )
    assert "noise" not in simulate("poses", duration=5.0, noise_in_metadata=False).metadata


def test_pose_labels_name_the_axis_that_points_up_at_rest():
    log = simulate("poses", seed=2, duration=90.0, frame="ENU")
    assert set(log.pose) == {"+x", "-x", "+y", "-y", "+z", "-z", ""}
    for label in ("+x", "-x", "+y", "-y", "+z", "-z"):
        mean = log.acc[log.pose == label].mean(axis=0) / 9.80665
        assert mean["xyz".index(label[1])] * (1 if label[0] == "+" else -1) > np.cos(np.radians(5.0))
        assert np.abs(log.gyr[log.pose == label]).max() < 0.01


def test_white_noise_has_the_stated_deviation():
    log = simulate("turntable", seed=4)
    truth = log.trajectory.at(log.t)
    assert np.std(log.gyr - truth.omega) == pytest.approx(np.radians(0.05), rel=0.02)


def test_coloured_noise_is_correlated_and_random_walk_grows():
    t, rng = np.arange(0.0, 200.0, 0.01), np.random.default_rng(0)
    coloured = SensorNoise(0.0, coloured=1.0, correlation_time=0.2).draw(rng, t)
    assert np.std(coloured) == pytest.approx(1.0, rel=0.1)
    lag = np.mean(coloured[20:] * coloured[:-20]) / np.mean(coloured**2)
    assert lag == pytest.approx(np.exp(-1.0), abs=0.1)
    walk = np.concatenate([SensorNoise(0.0, random_walk=0.5).draw(rng, t[:2001])[-1] for _ in range(200)])
    assert np.std(walk) == pytest.approx(0.5 * np.sqrt(20.0), rel=0.15)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**31), rate=st.floats(20.0, 400.0), jitter=st.floats(0.0, 0.01), lost=st.floats(0.0, 0.5))
def test_times_increase_whatever_the_jitter_and_loss(seed, rate, jitter, lost):
    noise = Noise(jitter=jitter, dropped=lost)
    t = sampling_times(noise, seed, 5.0, rate)
    assert np.all(np.diff(t) > 0.0)
    assert t.size <= round(5.0 * rate)


def test_jittered_samples_show_the_truth_at_their_stamps():
    quiet = SensorNoise(0.0 + 1e-300)
    log = simulate("handheld", duration=20.0, noise=Noise(acc=quiet, gyr=quiet, mag=quiet, jitter=2e-3))
    assert np.std(np.diff(log.t)) > 1e-3
    np.testing.assert_allclose(log.gyr, log.trajectory.at(log.t).omega, atol=1e-12)


def test_slow_magnetometer_has_nothing_between_its_samples():
    noise = Noise(mag_rate=25.0)
    log = simulate("handheld", duration=20.0, noise=noise)
    held = np.isfinite(log.mag).all(axis=1)
    np.testing.assert_array_equal(held, magnetometer_rows(noise, log.t))
    assert held.mean() == pytest.approx(0.25, abs=0.01)
    assert np.isnan(log.mag[~held]).all()
    assert np.isfinite(log.acc).all()


def test_realistic_log_is_rounded_jittered_and_incomplete():
    log = simulate("handheld", seed=1, duration=60.0, realistic=True)
    noise = Noise.realistic()
    np.testing.assert_allclose(log.acc / noise.acc.resolution, np.round(log.acc / noise.acc.resolution), atol=1e-6)
    assert log.t.size < 6000
    assert log.to_log().n == log.t.size
    error = np.linalg.norm(log.ref_p - log.trajectory.at(log.t).position, axis=1)
    assert 1e-4 < error.mean() < 1e-3


def test_log_without_a_sensor():
    log = simulate("handheld", duration=5.0, sensors=("acc", "gyr")).to_log()
    assert log.mag is None
    assert log.temp is None
    with pytest.raises(ValueError, match="unknown sensor 'baro'"):
        simulate("handheld", sensors=("baro",))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"duration": 0.0}, "two rows"),
        ({"rate": float("nan")}, "two rows"),
        ({"frame": "ABC"}, "unknown frame"),
        ({"rig_axis": "w"}, "rig_axis"),
        ({"size": "huge", "effects": {"acc.bias": None}}, "unknown size"),
        ({"size": -1.0, "effects": {"acc.bias": None}}, "positive"),
    ],
)
def test_unusable_arguments_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        simulate("handheld", **options)


def test_two_minutes_at_100_hz_take_well_under_a_second():
    simulate("arm", duration=1.0)
    start = time.perf_counter()
    simulate("arm", {"gyr.scale": None})
    assert time.perf_counter() - start < 1.0


@pytest.mark.parametrize("scenario", OBSERVABLE)
def test_hidden_effect_is_one_the_motion_can_show_and_has_its_size(scenario):
    log, truth = hidden(scenario, 11, "medium", duration=60.0)
    (effect,) = truth.effects
    assert effect in OBSERVABLE[scenario]
    assert truth.sizes[effect] == pytest.approx(SIZES["medium"], rel=0.02)
    assert truth.label == "medium"
    assert set(log.covariates) == {"motor_current", "vbat"}
    assert hidden(scenario, 11, "medium", duration=60.0)[1] == truth


def test_hidden_draws_differ_with_the_seed():
    drawn = {next(iter(hidden("handheld", seed, duration=30.0)[1].effects)) for seed in range(8)}
    assert len(drawn) >= 4


def test_nothing_is_hidden_only_when_that_is_asked_for():
    assert hidden("poses", 1, nothing=True, duration=20.0)[1].effects == {}
    some = [bool(hidden("poses", seed, "large", allow_nothing=True, duration=20.0)[1].effects) for seed in range(16)]
    assert any(some)
    assert not all(some)


def test_hidden_draws_from_the_given_candidates():
    _, truth = hidden("handheld", 3, "large", candidates=["acc.lever_arm"], duration=30.0)
    assert list(truth.effects) == ["acc.lever_arm"]
    with pytest.raises(ValueError, match="is separated from all others"):
        hidden("handheld", 3, "small", candidates=["acc.lowpass"], duration=30.0)


def test_every_observable_effect_is_known_and_has_a_reason():
    for scenario, effects in OBSERVABLE.items():
        assert scenario in SCENARIOS
        for effect, reason in effects.items():
            assert sim.injection(effect).id == effect
            assert reason.endswith(".")


@settings(max_examples=25)
@given(
    effects=st.dictionaries(
        st.sampled_from(["acc.bias", "gyr.delay"]),
        st.dictionaries(st.sampled_from(["x", "tau"]), st.floats(allow_nan=False, allow_infinity=False)),
    ),
    seed=st.integers(0, 2**40),
)
def test_sealed_truth_comes_back_as_it_was(tmp_path_factory, effects, seed):
    path = tmp_path_factory.mktemp("sealed") / "a.parquet"
    truth = Truth("tilt", seed, effects, dict.fromkeys(effects, 0.5), "medium")
    assert seal(truth, path) == sealed_path(path)
    assert unseal(path) == truth


@pytest.mark.parametrize("name", ["log.parquet", "log.csv", "log.npz"])
def test_neither_log_nor_seal_show_what_was_injected(tmp_path, name):
    log, truth = hidden("handheld", 5, "large", duration=20.0)
    _, other = hidden("handheld", 5, nothing=True, duration=20.0)
    path = tmp_path / name
    log.to_log().write(path)
    seal(truth, path)
    (effect,) = truth.effects
    written = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    assert name + ".sealed" in written
    for data in written.values():
        assert effect.encode() not in data
        assert b"parameters" not in data.replace(b"num_parameters", b"")
    assert written[name + ".sealed"].decode().splitlines()[0] == HEADER
    assert json.dumps(log.metadata) == json.dumps(simulate("handheld", seed=5, duration=20.0).metadata)
    assert other.effects == {}


def test_missing_and_damaged_seals_are_told(tmp_path):
    path = tmp_path / "log.csv"
    with pytest.raises(FileNotFoundError, match=r"log\.csv\.sealed"):
        unseal(path)
    for text in ("", "something else\n", HEADER + "\n!!!\n", HEADER + "\nYWJj\n"):
        sealed_path(path).write_text(text)
        with pytest.raises(ValueError, match="not a sealed truth"):
            unseal(path)


TRUTH = Truth("handheld", 1, {"acc.delay": {"tau": 0.01}}, {"acc.delay": 0.5}, "medium")
NOTHING = Truth("handheld", 1)


def answer(verdict, best=None, rivals=(), **parameters):
    return {
        "verdict": verdict,
        "best": best,
        "ambiguous_with": list(rivals),
        "candidates": [{"effect": best, "parameters": parameters}] if best else [],
    }


@pytest.mark.parametrize(
    ("truth", "given_answer", "mark"),
    [
        (TRUTH, answer("missing", "acc.delay"), "right"),
        (TRUTH, answer("ambiguous", "acc.lowpass", ["acc.delay"]), "named among rivals"),
        (TRUTH, answer("ambiguous", "acc.delay", ["acc.lowpass"]), "named among rivals"),
        (TRUTH, answer("missing", "acc.bias"), "wrong"),
        (TRUTH, answer("ambiguous", "acc.bias", ["acc.scale"]), "wrong"),
        (TRUTH, answer("adequate"), "missed"),
        (TRUTH, answer("unknown"), "missed"),
        (NOTHING, answer("adequate"), "right"),
        (NOTHING, answer("missing", "acc.bias"), "false alarm"),
        (TRUTH, {"steps": [{"effect": "acc.delay"}], "model": []}, "right"),
        (TRUTH, {"steps": [], "model": []}, "missed"),
        (TRUTH, {"steps": [{"effect": "acc.bias"}]}, "wrong"),
        (TRUTH, {"steps": [{"effect": "acc.delay"}, {"effect": "acc.bias"}]}, "false alarm"),
        (NOTHING, {"steps": [{"effect": "acc.bias"}]}, "false alarm"),
    ],
)
def test_mark_of_an_answer(truth, given_answer, mark):
    assert grade(truth, given_answer).mark == mark


def test_parameters_are_judged_in_standard_errors():
    found = grade(TRUTH, answer("missing", "acc.delay", tau={"value": 0.012, "standard_error": 0.001}))
    (tau,) = found.parameters
    assert (tau.truth, tau.estimate) == (0.01, 0.012)
    assert tau.error_in_standard_errors == pytest.approx(2.0)
    (missing,) = grade(TRUTH, answer("adequate")).parameters
    assert missing.estimate is None
    assert missing.error_in_standard_errors is None


def test_an_answer_of_another_kind_is_refused():
    with pytest.raises(ValueError, match="neither"):
        grade(TRUTH, {"n": 3})
