"""Late or sluggish, sensor or reference: told apart where the log can, and named together where it cannot."""

import imufit
import numpy as np
import pytest
from imufit import Log, SensorModel
from imufit.lab import simulate
from recording import recording
from scipy.signal import butter, sosfilt


def answered(effects, **options):
    sim = simulate.simulate("handheld", effects, 4, 60.0, **options)
    return SensorModel().fit(sim.to_log()).diagnose()


@pytest.mark.parametrize(("truth", "rival"), [("ref.delay", "gyr.delay"), ("gyr.delay", "ref.delay")])
def test_a_gyroscope_alone_does_not_tell_a_late_reference_from_a_sensor_with_late_stamps(truth, rival):
    answer = answered({truth: {"tau": 0.004}}, sensors=("gyr", "temp"))
    assert answer.verdict == "ambiguous"
    assert truth in {answer.best, *answer.ambiguous_with}
    assert rival in {answer.best, *answer.ambiguous_with}


def test_a_sensor_that_would_have_to_know_what_comes_is_never_named_first():
    answer = answered({"ref.delay": {"tau": 0.004}}, sensors=("gyr", "temp"))
    assert answer.best == "ref.delay"
    early = next(candidate for candidate in answer.candidates if candidate.effect == "gyr.delay")
    assert early.status == "negative delay"
    assert early.parameters[0].value == pytest.approx(-0.004, rel=0.1)
    assert "stamped too late" in early.explanation


def test_all_sensors_tell_a_late_reference_from_one_late_sensor():
    answer = answered({"ref.delay": {"tau": 0.004}})
    assert (answer.verdict, answer.best) == ("missing", "ref.delay")


@pytest.mark.parametrize("truth", ["acc.delay", "acc.lowpass"])
def test_a_large_lateness_tells_late_from_sluggish_by_what_the_fits_leave(truth):
    answer = answered({truth: {"tau": 0.014}})
    assert (answer.verdict, answer.best) == ("missing", truth)


@pytest.mark.parametrize("truth", ["acc.delay", "acc.lowpass"])
def test_a_small_lateness_is_not_told_from_sluggishness_by_chance(truth):
    answer = answered({truth: {"tau": 0.0006}})
    assert answer.verdict == "ambiguous"
    assert {answer.best, *answer.ambiguous_with} == {"acc.delay", "acc.lowpass"}


@pytest.mark.parametrize(
    ("truth", "tau"),
    [("gyr.delay", 0.08), ("gyr.lowpass", 0.05), ("acc.delay", 0.1), ("mag.delay", 0.08), ("ref.delay", 0.12)],
)
def test_a_lateness_far_beyond_the_usual_is_named_with_its_size(truth, tau):
    answer = answered({truth: {"tau": tau}})
    assert (answer.verdict, answer.best) == ("missing", truth)
    found = next(candidate for candidate in answer.candidates if candidate.effect == truth)
    assert found.parameters[0].value == pytest.approx(tau, rel=0.02)


def test_a_fit_of_a_late_sensor_finds_a_delay_longer_than_its_motion_takes_to_turn():
    sim = simulate.simulate("handheld", {"gyr.delay": {"tau": 0.15}}, 4, 60.0)
    found = SensorModel(["gyr.delay"]).fit(sim.to_log())
    assert found.params["gyr.delay.tau"].value == pytest.approx(0.15, rel=0.001)
    assert found.ratio < 1.05


@pytest.mark.parametrize("sensor", ["acc", "gyr"])
@pytest.mark.parametrize("trial", ["02_undisturbed_slow_rotation_B", "21_undisturbed_fast_combined"])
def test_a_filter_that_is_switched_on_in_a_real_sensor_makes_it_late(sensor, trial):
    part = imufit.read(recording(f"broad/{trial}.parquet"))[20000:26000]
    frame = part.to_pandas()
    axes = [f"{sensor}_{axis}" for axis in "xyz"]
    # A data sheet's filter of second order and 5 Hz, which is late by 45 ms.
    taps = butter(2, 5.0, fs=1.0 / np.median(np.diff(frame["t"])), output="sos")
    first = frame[axes].iloc[0].to_numpy()
    frame[axes] = first + sosfilt(taps, frame[axes].to_numpy() - first, axis=0)
    answer = SensorModel().fit(Log.from_dataframe(frame, metadata=part.metadata)).diagnose()
    shown = {c.effect: c.parameters[0].value for c in answer.candidates if c.status == "significant"}
    late = next(shown[key] for key in (f"{sensor}.delay", f"{sensor}.lowpass") if key in shown)
    assert 0.035 < late < 0.065
