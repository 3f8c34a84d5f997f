"""Late or sluggish, sensor or reference: told apart where the log can, and named together where it cannot."""

import pytest
from imufit import SensorModel
from imufit.lab import simulate


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
