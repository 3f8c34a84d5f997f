"""Several logs of one sensor in one question: evidence adds up, what each log has for itself stays its own."""

import json
from dataclasses import replace

import imufit
import numpy as np
import pytest
from cli_stand_in import run, strict_json
from engine import swaying
from imufit import Diagnosis, InputError, Log, SensorModel
from imufit.lab import simulate
from imufit.lab.simulate import Noise, SensorNoise
from imufit.model.effect import forget


def handheld(effects: dict, seed: int, duration: float = 15.0, **settings) -> Log:
    """A short log of a hand-held sensor without magnetometer."""
    settings.setdefault("sensors", ("acc", "gyr"))
    return simulate.simulate("handheld", effects, seed, duration, **settings).to_log()


def asked(logs: Log | list[Log], *effects: str) -> Diagnosis:
    return SensorModel(effects).fit(logs).diagnose()


def without_files(answer: Diagnosis) -> dict:
    return json.loads(json.dumps(answer.to_dict()))


def test_a_list_of_one_log_gives_the_answer_of_that_log():
    log = handheld({"gyr.bias": {"x": 0.01}, "acc.scale": {"y": 0.003}}, 1)
    assert without_files(asked([log], "gyr.bias")) == without_files(asked(log, "gyr.bias"))
    fit, fits = SensorModel(["gyr.bias"]).fit(log), SensorModel(["gyr.bias"]).fit([log])
    assert fit.to_dict() == fits.to_dict()
    assert "logs" not in fit.to_dict()


def test_logs_each_too_weak_name_an_effect_together():
    logs = [handheld({"gyr.g_sensitivity": {"zz": 1.5e-5}}, seed) for seed in (1, 2, 3, 4)]
    assert [asked(log).verdict for log in logs[:2]] == ["adequate", "adequate"]
    answer = asked(logs)
    assert (answer.verdict, answer.best) == ("missing", "gyr.g_sensitivity")
    found = next(p for p in answer.best_candidate.parameters if p.name == "zz")
    assert abs(found.value - 1.5e-5) < 4.0 * found.standard_error


def test_biases_that_differ_between_logs_are_no_alarm_and_are_listed():
    biases = (0.01, -0.02, 0.005)
    logs = [handheld({"gyr.bias": {"x": b, "y": -b}}, k) for k, b in enumerate(biases)]
    answer = asked(logs)
    assert (answer.verdict, answer.best) == ("missing", "gyr.bias")
    assert [log.parameters[0].value for log in answer.best_candidate.logs] == pytest.approx(biases, abs=1e-3)
    fit = SensorModel(["gyr.bias"]).fit(logs)
    assert fit.diagnose().verdict == "adequate"
    listed = fit.to_dict()["logs"]
    assert [log["file"] for log in listed] == ["log 1", "log 2", "log 3"]
    for log, bias in zip(listed, biases, strict=True):
        found = log["parameters"]["gyr.bias"]["x"]
        assert abs(found["value"] - bias) < 5.0 * found["standard_error"]
        assert log["ratio"] == pytest.approx(1.0, abs=0.03)
    # The file holds the mean, the best guess for the next time the sensor is switched on.
    assert min(biases) < fit.model.parameters["gyr.bias"]["x"] < max(biases)


@pytest.mark.parametrize("scope", ["sensor", "log"])
def test_a_users_effect_has_one_value_for_all_logs_or_one_for_each_as_it_says(scope):
    @imufit.effect("gyr.fan", parameters={"z": "rad/s/A"}, typical=0.01, needs=["fan"], scope=scope)
    def fan(w, z):
        return np.outer(w.column("fan"), [0.0, 0.0, z])

    sizes, logs = (0.01, -0.02), []
    for k, size in enumerate(sizes):
        log = handheld({}, k)
        current = np.sin(0.7 * log.t)
        gyr = log.gyr + np.outer(size * current, [0.0, 0.0, 1.0])
        logs.append(replace(log, gyr=gyr, covariates={**log.covariates, "fan": current}))
    try:
        fit = SensorModel(["gyr.fan"]).fit(logs)
        found = [[p.value for p in own.parameters if p.effect == "gyr.fan"] for own in fit.by_log]
    finally:
        forget("gyr.fan")
    if scope == "sensor":
        assert found == [[], []]
        assert fit.ratio > 1.05
    else:
        assert np.ravel(found) == pytest.approx(sizes, abs=1e-3)
        assert fit.ratio == pytest.approx(1.0, abs=0.03)


def warming(way: float, seed: int) -> Log:
    """A sway during which the sensor warms up (1) or cools down (-1) by 10 K, with a bias of 0.0008 m/s^2/K."""
    log = swaying(noise=1.0, seed=seed)
    since = (log.t - log.t[0]) / log.duration
    temperature = 25.0 + way * 10.0 * (since - 0.5)
    return replace(log, temp=temperature, acc=log.acc + 0.0008 * (temperature - 20.0)[:, None])


def test_a_log_that_warms_up_and_one_that_cools_down_tell_temperature_from_time():
    rising, falling = warming(1.0, 1), warming(-1.0, 2)
    for log in (rising, falling):
        alone = asked(log, "acc.bias")
        assert alone.verdict == "ambiguous"
        assert {alone.best, *alone.ambiguous_with} >= {"acc.bias_temperature", "acc.bias_drift"}
    answer = asked([rising, falling], "acc.bias")
    assert (answer.verdict, answer.best) == ("missing", "acc.bias_temperature")


def test_temperatures_count_from_the_mean_of_all_logs():
    cold, warm = warming(1.0, 1), warming(1.0, 2)
    warm = replace(warm, temp=warm.temp + 30.0, acc=warm.acc + 0.0008 * 30.0)
    # Each log has its own bias, which is that at the common mean temperature.
    fit = SensorModel(["acc.bias", "acc.bias_temperature"]).fit([cold, warm])
    assert fit.model.constants["temperature_mean"] == pytest.approx(40.0, abs=0.1)
    for log in fit.by_log:
        assert [p.value for p in log.parameters] == pytest.approx([0.016] * 3, abs=0.004)
    assert fit.diagnose().verdict == "adequate"


def test_logs_may_differ_in_rate_sensors_noise_and_columns():
    effect = {"gyr.scale": {"x": 0.004, "z": -0.003}}
    loud = Noise(gyr=SensorNoise(3e-3), acc=SensorNoise(0.05))
    logs = [
        handheld(effect, 1, rate=50.0, sensors=("gyr",)),
        handheld(effect, 2, rate=200.0, duration=10.0, sensors=("acc", "gyr", "mag")),
        handheld(effect, 3, noise=loud, noise_in_metadata=False, covariates=("vbat",)),
    ]
    answer = asked(logs)
    assert (answer.verdict, answer.best) == ("missing", "gyr.scale")
    status = {candidate.effect: candidate.status for candidate in answer.candidates}
    # Judged with those logs that can tell of it.
    assert status["mag.hard_iron"] == status["acc.cubic"] == status["gyr.column:vbat"] == "not significant"
    assert status["gyr.scale"] == "significant"


def test_the_ladder_on_several_logs_fits_effects_that_multiply():
    hidden = {"gyr.scale": {"x": 0.05, "y": -0.04}, "acc.lever_arm": {"x": 0.04, "z": 0.03}}
    logs = [handheld(hidden | {"gyr.bias": {"y": b}}, seed, 20.0) for seed, b in ((1, 0.03), (2, -0.02))]
    climbed = imufit.ladder(logs)
    assert climbed.verdict == "adequate"
    assert set(climbed.model) == {"gyr.scale", "gyr.bias", "acc.lever_arm"}
    assert climbed.ratio_end == pytest.approx(1.0, abs=0.02)
    found = {(p.effect, p.name): p for p in climbed.fit.parameters}
    for effect, values in hidden.items():
        for name, value in values.items():
            p = found[effect, name]
            assert abs(p.value - value) < 5.0 * p.standard_error
    apart = [SensorModel(climbed.model).fit(log) for log in logs]
    for fit in apart:
        errors = {(p.effect, p.name): p.standard_error for p in fit.parameters if p.effect in hidden}
        assert all(found[key].standard_error < error for key, error in errors.items())
    assert [log["file"] for log in climbed.to_dict()["logs"]] == ["log 1", "log 2"]


def test_a_time_constant_is_searched_for_in_all_logs_at_once():
    effect = {"gyr.warmup": {"x": 0.02, "y": -0.01, "tau": 12.0}}
    climbed = imufit.ladder([handheld(effect, seed, 40.0) for seed in (1, 2)])
    assert climbed.model[0] == "gyr.warmup"
    tau = next(p for p in climbed.fit.parameters if p.name == "tau")
    assert abs(tau.value - 12.0) < 5.0 * tau.standard_error


def test_logs_of_different_sensors_and_a_log_given_twice_are_refused():
    acc, gyr = handheld({}, 1, sensors=("acc",)), handheld({}, 2, sensors=("gyr",))
    with pytest.raises(InputError, match="no other log has"):
        asked([acc, gyr])
    with pytest.raises(InputError, match="twice"):
        asked([acc, acc])
    with pytest.raises(InputError, match="no log"):
        asked([])


def test_effects_that_no_log_can_tell_of_are_refused():
    with pytest.raises(InputError, match="magnetometer"):
        asked([handheld({}, 1), handheld({}, 2)], "mag.hard_iron")
    fit = SensorModel(["mag.hard_iron"]).fit([handheld({}, 1), handheld({}, 2, sensors=("gyr", "mag"))])
    assert np.isfinite(fit.ratio)


SCALE = {"gyr.scale": {"x": 0.004, "z": -0.003}}


@pytest.mark.parametrize("odd", [0, 2])
def test_an_effect_of_one_log_in_three_is_no_property_of_the_sensor(odd):
    logs = [handheld(SCALE if k == odd else {}, k) for k in range(3)]
    answer = asked(logs)
    assert (answer.verdict, answer.best) == ("unknown", None)
    (found,) = answer.disagrees
    assert (found.file, found.effect, found.wild) == (f"log {odd + 1}", "gyr.scale", True)
    values, others = ({p.name: p for p in side} for side in (found.value, found.others))
    assert abs(values["x"].value - 0.004) < 4.0 * values["x"].standard_error
    assert abs(others["x"].value) < 4.0 * others["x"].standard_error
    assert found.file in answer.sentence
    (rest,) = answer.without
    assert (rest.files, rest.verdict) == ((found.file,), "adequate")
    told = answer.to_dict()["disagrees"][0]
    assert {"file", "effect", "value", "others", "p_value"} <= told.keys()
    assert told["p_value"] < 1e-6
    # Nothing is added on such ground.
    assert imufit.ladder(logs).model == ()


def test_effects_that_cancel_in_two_logs_are_noticed_and_each_log_is_asked_alone():
    logs = [handheld({"gyr.scale": {"x": way * 0.004}}, k) for k, way in ((1, 1.0), (2, -1.0))]
    answer = asked(logs)
    assert answer.verdict == "unknown"
    assert {found.file for found in answer.disagrees} == {"log 1", "log 2"}
    assert {(rest.verdict, rest.best) for rest in answer.without} == {("missing", "gyr.scale")}


def test_a_log_with_an_effect_besides_is_named_beside_the_answer():
    logs = [handheld(SCALE | ({"acc.lever_arm": {"x": 0.03}} if k == 1 else {}), k) for k in range(3)]
    answer = asked(logs)
    assert (answer.verdict, answer.best) == ("missing", "gyr.scale")
    assert [(found.file, found.effect) for found in answer.disagrees] == [("log 2", "acc.lever_arm")]
    assert answer.without == ()


def test_a_small_difference_in_an_effect_of_the_model_is_told_and_spoils_nothing():
    logs = [handheld({"gyr.scale": {"x": 0.004, "z": 0.003 - 0.0005 * (k == 1)}}, k) for k in range(3)]
    answer = asked(logs, "gyr.scale")
    assert [(found.file, found.effect, found.wild) for found in answer.disagrees] == [("log 2", "gyr.scale", False)]
    own, other = answer.disagrees[0].leading()
    assert own.name == "z"
    assert abs(other.value - 0.003) < 4.0 * other.standard_error
    assert "log 2" in answer.sentence


def test_logs_of_one_sensor_agree_whatever_their_noise():
    noise = Noise(
        acc=SensorNoise(0.02, coloured=0.02, correlation_time=0.3),
        gyr=SensorNoise(8.7e-4, random_walk=3e-5),
    )
    logs = [handheld(SCALE, seed, 20.0, noise=noise, noise_in_metadata=False) for seed in range(3)]
    answer = asked(logs)
    assert (answer.verdict, answer.best, answer.disagrees) == ("missing", "gyr.scale", ())
    assert asked(logs, "gyr.scale").disagrees == ()


def test_commands_take_several_logs(capsys, tmp_path):
    paths = [tmp_path / name for name in ("a.parquet", "b.parquet", "c.parquet")]
    for k, path in enumerate(paths):
        handheld({"gyr.bias": {"x": 0.01 * (k + 1)}} | (SCALE if k == 2 else {}), k).write(path)
    code, out, err = run(capsys, "diagnose", *paths[:2], "--json", "-")
    assert (code, err) == (0, [])
    answer = strict_json(out)
    assert (answer["verdict"], answer["best"]) == ("missing", "gyr.bias")
    assert [log["file"] for log in answer["candidates"][0]["logs"]] == ["a.parquet", "b.parquet"]
    model = tmp_path / "model.toml"
    code, out, err = run(capsys, "fit", *paths, "--effects", "gyr.bias", "-o", model)
    assert (code, err) == (0, [])
    assert "Each log's own parameters" in out
    code, out, err = run(capsys, "ladder", *paths, "--model", model, "--html", tmp_path / "page.html")
    assert (code, err) == (0, [])
    assert "c.parquet" in out.split("Without")[0]
    assert "Without c.parquet" in (tmp_path / "page.html").read_text()
    for command in (["diagnose", paths[0], paths[0]], ["ladder", paths[0], paths[1], tmp_path / "." / "a.parquet"]):
        code, out, err = run(capsys, *command)
        assert (code, out, len(err)) == (2, "", 1)
        assert "a.parquet" in err[0]
        assert "twice" in err[0]
