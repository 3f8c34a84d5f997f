"""Other processes: a child computes, however it was made, after its parent has; results go from one to the other."""

import multiprocessing
import pickle

import imufit
import numpy as np
import pytest
from imufit import SensorModel
from imufit.lab import simulate
from imufit.log import LogStream
from imufit.replaying import FILTERS, Stream

PATIENCE = 60.0
"""Time that a child has, s: it needs about two, and hung for ever."""


def small_log():
    return simulate.simulate("handheld", {"gyr.bias": None}, 3, 20.0, size="large").to_log()


@pytest.fixture(scope="module")
def fitted():
    return SensorModel(["gyr.bias"]).fit(small_log())


def answer(path):
    """What a child makes of a log by itself."""
    log = imufit.read(path)
    fit = SensorModel(["gyr.bias"]).fit(log)
    return fit.to_dict(), fit.diagnose().to_dict()


def put(queue, task, given):
    queue.put(task(given))


def in_a_child(method, task, given):
    context = multiprocessing.get_context(method)
    queue = context.Queue()
    child = context.Process(target=put, args=(queue, task, given))
    child.start()
    try:
        return queue.get(timeout=PATIENCE)
    finally:
        child.terminate()
        child.join()


@pytest.mark.parametrize("method", multiprocessing.get_all_start_methods())
def test_a_child_fits_and_diagnoses_after_its_parent_has(method, fitted, tmp_path):
    small_log().write(tmp_path / "log.parquet")
    fitted.diagnose()
    fit, diagnosis = in_a_child(method, answer, tmp_path / "log.parquet")
    assert (fit, diagnosis) == answer(tmp_path / "log.parquet")


def test_a_childs_child_computes_too(fitted, tmp_path):
    small_log().write(tmp_path / "log.parquet")
    assert in_a_child("fork", in_a_grandchild, tmp_path / "log.parquet") == answer(tmp_path / "log.parquet")


def in_a_grandchild(path):
    answer(path)
    return in_a_child("fork", answer, path)


def again(value):
    return pickle.loads(pickle.dumps(value))


def outcomes(fit):
    """Numbers that a fit gives, those from its evidence among them."""
    return fit.to_dict(), fit.compare().to_dict(), fit.diagnose().to_dict(), fit.add("acc.bias").to_dict()


def test_a_model_comes_back_from_a_pickle(fitted):
    for model in (fitted.model, SensorModel(["acc.column:vbat"], {"acc.column:vbat": {"x": 1.0}})):
        back = again(model)
        assert type(back) is type(model)
        assert back.effects == model.effects
        assert back.parameters == model.parameters
        assert repr(back.listed()) == repr(model.listed()), "NaN is no error of its own"
        assert back.constants == model.constants
        assert back.standard_errors == model.standard_errors


def test_a_fit_comes_back_from_a_pickle_and_answers_the_same_to_the_bit(fitted):
    back = again(fitted)
    assert back.to_dict() == fitted.to_dict()
    assert back.to_dict() == again(back).to_dict(), "before it has taken its evidence again"
    assert outcomes(back) == outcomes(fitted)
    assert outcomes(again(back)) == outcomes(fitted)


def test_a_fit_of_effects_that_are_not_linear_comes_back(fitted):
    fit = fitted.add("acc.delay").fit.add("gyr.scale").fit
    back = again(fit)
    assert back.diagnose().to_dict() == fit.diagnose().to_dict()


def test_a_fit_of_several_logs_and_of_some_of_them_comes_back():
    logs = [simulate.simulate("handheld", {"gyr.bias": None}, seed, 20.0, size="large").to_log() for seed in (3, 4, 5)]
    fit = SensorModel(["gyr.bias"]).fit(logs)
    for one in (fit, fit.of_logs([0, 2])):
        back = again(one)
        assert back.to_dict() == one.to_dict()
        assert back.diagnose().to_dict() == one.diagnose().to_dict()


def test_a_fit_without_reference_comes_back():
    from dataclasses import replace

    log = simulate.simulate("six_sides", {"acc.bias": None}, 1, 120.0, size="large").to_log()
    fit = SensorModel(["acc.bias"]).fit(replace(log, ref_q=None, ref_p=None, ref_angle=None))
    assert again(fit).diagnose().to_dict() == fit.diagnose().to_dict()


def test_a_fit_of_a_log_on_disk_comes_back(tmp_path):
    small_log().write(tmp_path / "log.parquet")
    fit = SensorModel(["gyr.bias"]).fit(LogStream(tmp_path / "log.parquet"))
    assert again(fit).diagnose().to_dict() == fit.diagnose().to_dict()


def test_other_results_come_back_from_a_pickle(fitted):
    results = [fitted.compare(), fitted.diagnose(), fitted.add("acc.bias"), imufit.ladder(small_log())]
    for result in results:
        back = again(result)
        assert type(back) is type(result)
        assert back.to_dict() == result.to_dict()
        assert str(back) == str(result)
        if hasattr(result, "fit"):
            assert back.fit.diagnose().to_dict() == result.fit.diagnose().to_dict()


def result_in_a_child(path):
    return SensorModel(["gyr.bias"]).fit(imufit.read(path)).add("acc.bias")


@pytest.mark.parametrize("method", multiprocessing.get_all_start_methods())
def test_a_result_comes_from_a_child_and_is_asked_further(method, fitted, tmp_path):
    small_log().write(tmp_path / "log.parquet")
    addition = in_a_child(method, result_in_a_child, tmp_path / "log.parquet")
    here = result_in_a_child(tmp_path / "log.parquet")
    assert addition.to_dict() == here.to_dict()
    assert addition.fit.diagnose().to_dict() == here.fit.diagnose().to_dict()


def diagnosed(fit):
    return fit.diagnose().to_dict()


@pytest.mark.parametrize("method", multiprocessing.get_all_start_methods())
def test_a_fit_goes_to_a_child_and_is_asked_there(method, fitted):
    assert in_a_child(method, diagnosed, fitted) == fitted.diagnose().to_dict()


OWN = """
import imufit

@imufit.effect("gyr.of_its_own", parameters={"k": "1"}, explanation="the body feels its own weight", typical=0.01)
def of_its_own(w, k):
    return k * w.f
"""


def test_a_users_effect_goes_along_where_its_function_does(tmp_path, monkeypatch):
    from imufit.model.effect import forget

    (tmp_path / "effects_of_a_user.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    import effects_of_a_user  # noqa: F401

    try:
        model = SensorModel(["gyr.of_its_own"], {"gyr.of_its_own": {"k": 0.01}})
        fit = model.fit(small_log())
        data, wanted = pickle.dumps(fit), fit.diagnose().to_dict()
        forget("gyr.of_its_own")
        back = pickle.loads(data)
        assert back.model.effects == ("gyr.of_its_own",)
        assert back.diagnose().to_dict() == wanted
        for method in multiprocessing.get_all_start_methods():
            assert in_a_child(method, diagnosed, back) == wanted
    finally:
        forget("gyr.of_its_own")


def readings(stream, log, first, last):
    rows = slice(first, last)
    return stream.extend(log.t[rows], acc=log.acc[rows], gyr=log.gyr[rows], mag=log.mag[rows])


def test_a_stream_goes_on_from_a_pickle_to_the_bit():
    log = small_log()
    log.acc[300:310] = np.nan
    filters = [name for name in FILTERS if name != "smoother"]
    settings = {"mahony": {"k_p": 2.0}, "replay": {"acc_range": 30.0}}
    whole = Stream(filters, ("acc", "gyr", "mag"), frame=log.metadata.frame, settings=settings)
    stream = Stream(filters, ("acc", "gyr", "mag"), frame=log.metadata.frame, settings=settings)
    expected = readings(whole, log, 0, log.n)
    readings(stream, log, 0, 700)
    back = again(again(stream))
    found = readings(back, log, 700, log.n)
    for name in filters:
        np.testing.assert_array_equal(found[name], expected[name][700:])
    assert whole.skipped
    assert back.skipped == whole.skipped
    assert back.filters == stream.filters
    assert back.sensors == stream.sensors
    back.reset()
    assert not back.skipped
    first = readings(back, log, 0, log.n)
    np.testing.assert_array_equal(first["mahony"], expected["mahony"])
