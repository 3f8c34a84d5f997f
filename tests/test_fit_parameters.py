"""Parameters of a model and of a fit, as Python users hold them: names, covariance, residuals, fixed values, bounds."""

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import imufit
import numpy as np
import pytest
from imufit import InputError, SensorModel, filters
from imufit.cli.app import main

EFFECTS = ["gyr.bias", "gyr.scale"]


@pytest.fixture(scope="module")
def log():
    return imufit.simulate(
        "handheld", {"gyr.bias": None, "gyr.scale": None}, seed=71, duration=20.0, size="large"
    ).to_log()


@pytest.fixture(scope="module")
def other_log():
    return imufit.simulate(
        "handheld", {"gyr.bias": None, "gyr.scale": None}, seed=72, duration=20.0, size="large"
    ).to_log()


@pytest.fixture(scope="module")
def fit(log):
    return SensorModel(EFFECTS).fit(log)


def test_parameters_are_a_mapping_by_name(fit):
    assert list(fit.params) == [f"{effect}.{axis}" for effect in EFFECTS for axis in "xyz"]
    one = fit.params["gyr.scale.z"]
    assert one.value == fit.model.parameters["gyr.scale"]["z"]
    assert one.stderr == fit.model.standard_errors["gyr.scale"]["z"] > 0.0
    assert (one.unit, one.vary, one.fixed) == ("1", True, False)
    assert one.typical > 0.0
    assert len(fit.params) == 6
    assert "gyr.scale.z" in fit.params
    assert "gyr.scale.z" not in fit.params.to_dict()
    assert list(fit.params.to_dataframe()["value"]) == [item.value for item in fit.params.values()]
    assert "<table" in fit.params._repr_html_()
    assert fit.model.params["gyr.scale.z"].value == one.value
    with pytest.raises(KeyError, match=r"gyr\.scale\.x"):
        fit.params["gyr.scale"]


def test_the_covariance_has_the_standard_errors_in_its_diagonal(fit):
    covariance = fit.covariance
    assert list(covariance.index) == list(covariance.columns) == list(fit.params)
    assert np.allclose(np.sqrt(np.diag(covariance)), [item.stderr for item in fit.params.values()], rtol=1e-9)
    assert np.allclose(covariance, covariance.T)
    assert np.all(np.linalg.eigvalsh(fit.correlation) > 0.0)
    assert np.all(np.diag(fit.correlation) == 1.0)
    expected = covariance.loc["gyr.bias.y", "gyr.scale.y"]
    expected /= fit.params["gyr.bias.y"].stderr * fit.params["gyr.scale.y"].stderr
    assert fit.correlation.loc["gyr.bias.y", "gyr.scale.y"] == pytest.approx(expected)


def test_the_covariance_foretells_the_scatter_of_fits():
    truth = {"x": 0.01, "y": -0.02, "z": 0.03}
    logs = [
        imufit.simulate("handheld", {"gyr.bias": truth}, seed=seed, duration=12.0).to_log() for seed in range(300, 316)
    ]
    fits = [SensorModel(["gyr.bias"]).fit(each) for each in logs]
    values = np.array([[item.value for item in fit.params.values()] for fit in fits])
    errors = np.array([np.sqrt(np.diag(fit.covariance)) for fit in fits])
    # The root mean square of 48 standard normal numbers is within 0.7 and 1.3 but once in a thousand times.
    assert 0.7 < np.sqrt(np.mean(((values - list(truth.values())) / errors) ** 2)) < 1.3


def test_several_logs_share_a_covariance(log, other_log):
    fit = SensorModel(EFFECTS).fit([log, other_log])
    assert np.allclose(np.sqrt(np.diag(fit.covariance)), [item.stderr for item in fit.params.values()])
    with pytest.raises(InputError, match="log="):
        fit.residuals("gyr")
    assert np.array_equal(fit.residuals("gyr", log=1), fit.residuals("gyr", log=other_log), equal_nan=True)
    measured = other_log.gyr - fit.predict(other_log).gyr
    assert np.allclose(fit.residuals("gyr", log=1), measured, atol=1e-12, equal_nan=True)


@pytest.mark.parametrize("sensor", ["acc", "gyr", "mag"])
def test_residuals_are_measured_minus_predicted(log, fit, sensor):
    residuals, predicted = fit.residuals(sensor), fit.predict(log)
    measured = getattr(log, sensor)
    assert residuals.shape == (log.n, 3)
    assert np.allclose(residuals, measured - getattr(predicted, sensor), atol=1e-12, equal_nan=True)
    assert np.array_equal(predicted.t, log.t)
    channels = {channel.channel: channel for channel in fit.compare().channels}
    for k, axis in enumerate("xyz"):
        known = residuals[np.isfinite(residuals[:, k]), k]
        assert known.size == channels[f"{sensor}_{axis}"].n
        assert np.sqrt(np.mean(known**2)) == pytest.approx(channels[f"{sensor}_{axis}"].rms, rel=1e-6)


def test_a_prediction_holds_the_effects(log, fit):
    ideal = SensorModel().fit(log).predict().gyr
    model = fit.params
    scale = np.array([model[f"gyr.scale.{axis}"].value for axis in "xyz"])
    bias = np.array([model[f"gyr.bias.{axis}"].value for axis in "xyz"])
    known = np.isfinite(ideal).all(axis=1)
    assert np.allclose(fit.predict().gyr[known], (ideal + scale * ideal + bias)[known], atol=1e-9)


def test_rows_without_a_reading_are_not_judged(log, fit):
    holes = log.gyr.copy()
    holes[500:520] = np.nan
    fit = SensorModel(EFFECTS).fit(log.with_fields(gyr=holes))
    assert np.isnan(fit.residuals("gyr")[500:520]).all()
    assert np.isfinite(fit.residuals("acc")[500:520]).all()


def test_unusable_questions_are_refused(fit):
    with pytest.raises(InputError, match="acc"):
        fit.residuals("baro")
    with pytest.raises(InputError, match="not one of the logs"):
        fit.residuals("acc", log=3)


def test_a_fixed_parameter_stays_to_the_last_digit(log, tmp_path):
    model = SensorModel(EFFECTS)
    model["gyr.scale"].set(z=0.01, fixed=True)
    fit = model.fit(log)
    one = fit.params["gyr.scale.z"]
    assert (one.value, one.stderr, one.fixed, one.vary) == (0.01, 0.0, True, False)
    assert "fixed" in one.shown
    assert "fixed" in str(fit.params)
    assert fit.params["gyr.scale.x"].stderr > 0.0
    assert "gyr.scale.z" not in fit.covariance.index
    assert len(fit.covariance) == 5
    # A later step does not move it either, nor does a file or a pickle.
    added = fit.add("acc.bias").fit
    fit.save(tmp_path / "model.toml")
    for held in (added.model, SensorModel.load(tmp_path / "model.toml"), pickle.loads(pickle.dumps(fit.model))):
        assert held.params["gyr.scale.z"].fixed
        assert held.params["gyr.scale.z"].value == 0.01
        assert held.params["gyr.scale.z"].stderr == 0.0
    assert SensorModel.load(tmp_path / "model.toml").fit(log).params["gyr.scale.z"].value == 0.01
    assert pickle.loads(pickle.dumps(fit)).add("acc.bias").fit.params["gyr.scale.z"].value == 0.01


def test_what_is_fixed_at_its_true_value_is_not_missed_and_at_a_wrong_one_is(log, fit):
    model = fit.model.copy()
    model["gyr.scale"].set(fixed=True)
    held = model.fit(log)
    assert held.ratio == pytest.approx(fit.ratio, rel=0.01)
    assert held.diagnose().verdict == "adequate"
    model["gyr.scale"].set(x=0.05, y=0.05, z=0.05)
    wrong = model.fit(log)
    assert wrong.ratio > 2.0 * fit.ratio
    assert wrong.diagnose().verdict != "adequate"


def test_a_ladder_keeps_what_is_fixed(log):
    model = SensorModel(["gyr.bias"])
    model["gyr.bias"].set(x=0.0, fixed=True)
    found = imufit.ladder(log, model)
    assert found.fit.params["gyr.bias.x"].value == 0.0
    assert found.fit.params["gyr.bias.x"].fixed
    assert "gyr.scale" in found.model


def test_bounds_hold_and_are_named(log, fit):
    free = fit.params["gyr.scale.x"].value
    model = SensorModel(EFFECTS)
    bound = 0.5 * free
    model["gyr.scale"].set(x=(None, -abs(bound), abs(bound)))
    held = model.fit(log)
    one = held.params["gyr.scale.x"]
    assert one.value == pytest.approx(bound, abs=0.0)
    assert one.at_bound == ("max" if free > 0 else "min")
    assert f"at its {one.at_bound}" in str(held.params)
    assert np.isnan(one.stderr)
    assert "gyr.scale.x" not in held.covariance.index
    assert np.isfinite(held.covariance).all(axis=None)
    model["gyr.scale"].set(x=(0.0, -1.0, 1.0))
    wide = model.fit(log)
    assert wide.params["gyr.scale.x"].value == pytest.approx(free, abs=0.01 * fit.params["gyr.scale.x"].stderr)
    assert wide.params["gyr.scale.x"].stderr == pytest.approx(fit.params["gyr.scale.x"].stderr, rel=0.01)
    assert wide.params["gyr.scale.x"].at_bound is None


def test_the_others_move_to_the_best_that_bounds_allow(log):
    """A fit with one parameter at its bound is the fit with that parameter fixed there."""
    bounded, fixed = SensorModel(EFFECTS), SensorModel(EFFECTS)
    bounded.params["gyr.bias.x"].set(value=0.06, min=0.05, max=0.07)
    fixed.params["gyr.bias.x"].set(value=0.05, vary=False)
    at, held = bounded.fit(log), fixed.fit(log)
    assert at.params["gyr.bias.x"].value == 0.05
    for key in at.params:
        assert at.params[key].value == pytest.approx(held.params[key].value, rel=1e-6, abs=1e-9)
    assert np.allclose(at.covariance, held.covariance, rtol=0.05, atol=0.0)


def test_a_nonlinear_effect_is_held_and_bounded():
    log = imufit.simulate("handheld", {"gyr.delay": {"tau": 0.02}}, seed=12, duration=20.0).to_log()
    model = SensorModel(["gyr.delay"])
    model.params["gyr.delay.tau"].set(value=0.01, vary=False)
    assert model.fit(log).params["gyr.delay.tau"].value == 0.01
    model.params["gyr.delay.tau"].set(vary=True, min=0.0, max=0.012)
    one = model.fit(log).params["gyr.delay.tau"]
    assert (one.value, one.at_bound) == (0.012, "max")


def test_setting_is_in_place_and_not_for_the_model_of_a_fit(log, fit):
    model = SensorModel(EFFECTS)
    one = model.params["gyr.scale.z"]
    one.set(value=0.02, min=-0.05)
    assert (one.value, one.min, one.max) == (0.02, -0.05, np.inf)
    assert model.parameters["gyr.scale"]["z"] == 0.02
    one.set(min=0.03)
    assert one.value == 0.03
    before = fit.params["gyr.scale.z"].value
    with pytest.raises(InputError, match="copy"):
        fit.model["gyr.scale"].set(z=0.5)
    for own in (fit.model.copy(), copy.copy(fit.model)):
        own["gyr.scale"].set(z=0.5)
    assert fit.params["gyr.scale.z"].value == before
    # What is set after a fit changes nothing of the fit.
    fitted = model.fit(log)
    ratio = fitted.compare().to_dict()
    model["gyr.scale"].set(z=0.9)
    assert fitted.compare().to_dict() == ratio


@pytest.mark.parametrize(
    "wrong",
    [
        {"w": 1.0},
        {"x": float("nan")},
        {"x": "fast"},
        {"x": (None, 1.0)},
        {"x": (None, 0.2, 0.1)},
        {"x": (0.5, 0.1, 0.2)},
        {"min": 0.1, "max": 0.1},
        {"min": float("nan")},
        {"vary": True, "fixed": True},
        {"x": 0.001, "y": float("inf")},
    ],
)
def test_what_cannot_be_set_changes_nothing(wrong):
    model = SensorModel(["gyr.scale"], {"gyr.scale": {"x": 0.01}})
    before = model.parameters, model.limits
    with pytest.raises(InputError) as caught:
        model["gyr.scale"].set(**wrong)
    assert caught.value.remedy
    assert (model.parameters, model.limits) == before


def test_the_file_of_a_model_keeps_bounds_and_refuses_what_cannot_be(tmp_path):
    model = SensorModel(EFFECTS)
    model.params["gyr.scale.x"].set(min=-0.05, max=0.05)
    model.params["gyr.bias.y"].set(value=0.1, vary=False)
    path = tmp_path / "model.toml"
    model.save(path)
    assert SensorModel.load(path).limits == model.limits
    text = path.read_text()
    for wrong in ("min = 1.0", "min = 'low'", "fixed = 1", "most = 0.1"):
        path.write_text(text.replace("min = -0.05", wrong))
        with pytest.raises(InputError, match=r"gyr\.scale"):
            SensorModel.load(path)


def test_a_second_effect_of_one_name_is_refused():
    @imufit.effect("gyr.twice", parameters={"k": "1"})
    def first(w, k):
        return k * w.omega

    try:
        with pytest.raises(InputError, match="defined already") as caught:

            @imufit.effect("gyr.twice", parameters={"k": "1"})
            def second(w, k):
                return k * w.omega

        assert "forget_effect" in caught.value.remedy
        with pytest.raises(InputError, match="built in"):
            imufit.effect("gyr.bias", parameters={"k": "1"})
        imufit.forget_effect("gyr.twice")
        imufit.effect("gyr.twice", parameters={"k": "1"})(first)
    finally:
        imufit.forget_effect("gyr.twice")


def described(value):
    """What a worker makes of a result that it was sent, and the result again."""
    return repr(value), value


def test_everything_goes_to_another_process_and_back(log, fit):
    ladder = imufit.ladder(log)
    running = filters.Mahony()
    running.run(log.gyr[:100], log.acc[:100], log.mag[:100], 0.01)
    sent = [
        SensorModel(EFFECTS),
        fit,
        fit.params,
        fit.model.params,
        fit.model["gyr.scale"],
        fit.add("acc.bias"),
        ladder,
        fit.compare(),
        fit.diagnose(),
        imufit.compare(log, ["gyr.bias"], EFFECTS),
        imufit.replay(log),
        InputError("no", file="a.csv", row=1, column="x", remedy="Do."),
    ]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        for value, (text, back) in zip(sent, pool.map(described, sent), strict=True):
            assert type(back) is type(value)
            assert text == repr(value)
        _, back = pool.submit(described, running).result()
        assert type(back) is type(running)
        assert np.array_equal(
            back.run(log.gyr[100:200], log.acc[100:200], log.mag[100:200], 0.01),
            running.run(log.gyr[100:200], log.acc[100:200], log.mag[100:200], 0.01),
        )
        again = pool.submit(described, fit).result()[1]
    assert again.covariance.equals(fit.covariance)
    assert np.array_equal(again.residuals("gyr"), fit.residuals("gyr"), equal_nan=True)


def test_the_command_line_fixes_a_parameter(capsys, log, tmp_path):
    log.write(tmp_path / "walk.parquet")
    call = ["fit", str(tmp_path / "walk.parquet"), "--effects", ",".join(EFFECTS), "-o", str(tmp_path / "model.toml")]
    assert main([*call, "--fix", "gyr.scale.z=0.02", "--fix", "gyr.bias.x = -1e-3"]) == 0
    capsys.readouterr()
    params = SensorModel.load(tmp_path / "model.toml").params
    assert [key for key, one in params.items() if one.fixed] == ["gyr.bias.x", "gyr.scale.z"]
    assert (params["gyr.scale.z"].value, params["gyr.bias.x"].value) == (0.02, -1e-3)
    assert main([*call, "--fix", "gyr.scale.q=0.02"]) == 2
    assert "unknown parameter of this model 'gyr.scale.q'" in capsys.readouterr().err


def test_a_fixed_value_that_the_log_contradicts_is_named(log):
    model = SensorModel(EFFECTS)
    fitted = model.fit(log)
    true = fitted.params["gyr.scale.z"]
    for away, named in ((1.0, False), (30.0, True)):
        model.params["gyr.scale.z"].set(true.value + away * true.stderr, vary=False)
        found = model.fit(log).diagnose()
        assert ("gyr.scale.z is fixed at" in found.sentence) is named
        assert [item.key for item in found.contradicted] == (["gyr.scale.z"] if named else [])
        assert found.to_dict().get("contradicted", []) == [item.key for item in found.contradicted]
