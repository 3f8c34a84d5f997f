"""Diagnosis: what is missing is named, what cannot be told apart is said, and nothing is made up."""

import json
from dataclasses import replace

import numpy as np
import pytest
from engine import swaying
from imufit import InputError, Log, SensorModel
from imufit.lab import grade, simulate
from imufit.lab.simulate import OBSERVABLE, Noise, SensorNoise
from scipy.spatial.transform import Rotation
from test_fit import FIRST_EFFECTS

LATE_OR_SLUGGISH = {f"{sensor}.{name}" for sensor in ("acc", "gyr") for name in ("delay", "lowpass")}
"""As late as they are at a third of the noise, they differ by less than a hundredth of it."""


@pytest.mark.parametrize("effect", [effect for effect in FIRST_EFFECTS if effect not in LATE_OR_SLUGGISH])
def test_each_effect_is_named_when_it_is_missing(effect):
    sim = simulate.simulate("handheld", {effect: None}, 3, 60.0, size=0.3, covariates=("vbat", "motor_current"))
    answer = SensorModel().fit(sim.to_log()).diagnose()
    assert (answer.verdict, answer.best) == ("missing", effect)
    best = answer.best_candidate
    assert best.effect in answer.sentence
    assert best.p_value < 0.01
    assert best.held_out_after < best.held_out_before
    for p in best.parameters:
        truth = sim.truth.effects[effect][p.name]
        # A time constant is one of a grid in steps of 1.5 until the effect is added.
        error = 5.0 * p.standard_error if p.name != "tau" or effect != "gyr.warmup" else 0.5 * truth
        assert abs(p.value - truth) < error


@pytest.mark.parametrize("effect", sorted(LATE_OR_SLUGGISH))
def test_a_late_sensor_and_a_sluggish_one_are_both_named_while_they_differ_by_less_than_the_noise(effect):
    sensor = effect.split(".")[0]
    sim = simulate.simulate("handheld", {effect: None}, 3, 60.0, size=0.3)
    answer = SensorModel().fit(sim.to_log()).diagnose()
    assert {answer.best, *answer.ambiguous_with} == {f"{sensor}.delay", f"{sensor}.lowpass"}
    assert answer.experiment


@pytest.mark.parametrize("scenario", OBSERVABLE)
def test_nothing_is_missing_from_an_ideal_sensor(scenario):
    for seed in range(2):
        log = simulate.simulate(
            scenario, {}, seed, 60.0, covariates=("vbat", "motor_current"), noise_in_metadata=False
        ).to_log()
        answer = SensorModel().fit(log).diagnose()
        assert (answer.verdict, answer.best, answer.ambiguous_with, answer.unexplained) == ("adequate", None, (), ())


COLOURED = Noise(
    acc=SensorNoise(0.02, coloured=0.02, correlation_time=0.5),
    gyr=SensorNoise(8.7e-4, coloured=8.7e-4, correlation_time=0.5),
    mag=SensorNoise(0.3, coloured=0.3, correlation_time=0.5),
)
WANDERING = Noise(gyr=SensorNoise(8.7e-4, random_walk=3e-5), acc=SensorNoise(0.02, random_walk=5e-4))


@pytest.mark.parametrize("noise", [COLOURED, WANDERING, Noise.realistic()], ids=["coloured", "wandering", "realistic"])
def test_noise_that_is_not_white_is_no_effect(noise):
    for scenario in ("handheld", "poses"):
        for seed in range(2):
            log = simulate.simulate(scenario, {}, seed, 90.0, noise=noise, noise_in_metadata=False).to_log()
            answer = SensorModel().fit(log).diagnose()
            assert answer.verdict == "adequate", (scenario, seed, answer.best, answer.unexplained)


def static(offset: float, rotvec: tuple[float, float, float], seed: int = 0, n: int = 6000) -> Log:
    """A sensor at rest in one pose whose accelerometer is off by `offset` (1, -0.7, 0.5) m/s^2."""
    rng = np.random.default_rng(seed)
    pose = Rotation.from_rotvec(rotvec)
    force, field = pose.inv().apply([0.0, 0.0, -9.80665]), pose.inv().apply([20.0, 0.0, 44.0])
    return Log.from_arrays(
        np.arange(n) / 100,
        acc=force + offset * np.array([1.0, -0.7, 0.5]) + 0.02 * rng.standard_normal((n, 3)),
        gyr=8.7e-4 * rng.standard_normal((n, 3)),
        mag=field + 0.3 * rng.standard_normal((n, 3)),
        reference=Rotation.from_quat(np.tile(pose.as_quat(), (n, 1))),
        mag_reference=[20.0, 0.0, 44.0],
    )


def test_bias_and_scale_cannot_be_told_apart_in_one_pose():
    answer = SensorModel().fit(static(0.1, (0.6, 0.5, 0.2))).diagnose()
    assert answer.verdict == "ambiguous"
    assert {answer.best, *answer.ambiguous_with} >= {"acc.bias", "acc.scale"}
    assert answer.best not in answer.ambiguous_with
    assert answer.experiment
    assert "acc.bias" in answer.experiment
    assert "acc.scale" in answer.experiment
    for effect in ("acc.bias", "acc.scale"):
        assert effect in answer.sentence
    rivals = {r.effect: r.correlation for r in answer.best_candidate.confounded_with}
    assert all(rivals[effect] > 0.99 for effect in answer.ambiguous_with)


def test_what_is_in_the_span_of_the_model_is_not_testable():
    answer = SensorModel(["acc.bias"]).fit(static(0.1, (0.6, 0.5, 0.2))).diagnose()
    assert answer.verdict == "adequate"
    status = {c.effect: c.status for c in answer.candidates}
    assert status["acc.scale"] == status["acc.misalignment"] == "not testable here"
    scale = next(c for c in answer.candidates if c.effect == "acc.scale")
    assert scale.minimal_detectable == {}
    assert "cannot show it" in scale.explanation


def test_what_was_never_excited_is_not_testable():
    status = {c.effect: c.status for c in SensorModel().fit(static(0.0, (0.6, 0.5, 0.2))).diagnose().candidates}
    for effect in ("gyr.scale", "gyr.misalignment", "acc.lever_arm", "ref.delay"):
        assert status[effect] == "not testable here", effect


def test_a_covariate_that_never_changes_is_not_testable():
    log = replace(swaying(noise=1.0), covariates={"vbat": np.full(4000, 12.3)})
    answer = SensorModel().fit(log).diagnose()
    assert answer.verdict == "adequate"
    status = {c.effect: c.status for c in answer.candidates}
    assert [status[f"{s}.column:vbat"] for s in ("acc", "gyr", "mag")] == ["not testable here"] * 3


def test_an_effect_in_the_model_is_no_candidate():
    log = simulate.simulate("handheld", {"gyr.bias": None}, 1, 40.0, size="large", covariates=("vbat",)).to_log()
    effects = ["gyr.bias", "acc.column:vbat"]
    names = [c.effect for c in SensorModel(effects).fit(log).diagnose().candidates]
    assert len(names) == len(set(names))
    assert not set(names) & set(effects)
    assert {"acc.bias", "gyr.column:vbat"} <= set(names)


def test_candidates_are_listed_best_first():
    log = simulate.simulate("arm", {"gyr.scale": None}, 1, 60.0, size="medium").to_log()
    answer = SensorModel().fit(log).diagnose()
    order = {"significant": 0, "not testable here": 2}
    ranks = [(order.get(c.status, 1), -c.ln_bayes) for c in answer.candidates]
    assert ranks == sorted(ranks)


def test_how_small_an_effect_would_have_been_seen_is_about_right():
    noise = {"noise_in_metadata": False, "sensors": ("gyr",)}
    first = SensorModel().fit(simulate.simulate("handheld", {}, 0, 30.0, **noise).to_log()).diagnose()
    limit, unit = next(c for c in first.candidates if c.effect == "gyr.bias").minimal_detectable["x"]
    assert unit == "rad/s"
    seen = {0.4: 0, 2.0: 0}
    for factor in seen:
        for seed in range(5):
            hidden = {"gyr.bias": {"x": factor * limit}}
            answer = SensorModel().fit(simulate.simulate("handheld", hidden, seed, 30.0, **noise).to_log()).diagnose()
            seen[factor] += answer.best == "gyr.bias"
    assert seen[2.0] >= 4
    assert seen[0.4] <= 2


def bent_by_current(shape, seed: int = 1) -> Log:
    """A log whose gyroscope reads on x too much by 3e-3 rad/s times a `shape` of the motor current that has no name."""
    sim = simulate.simulate("handheld", {}, seed, 120.0, covariates=("motor_current",))
    sim.gyr[:, 0] += 3e-3 * shape(sim.covariates["motor_current"])
    return sim.to_log()


SHAPES = {
    "V": lambda c: np.abs(c - 1.6),
    "parabola": lambda c: (c - 1.5) ** 2,
    "two waves": lambda c: np.sin(4.0 * c),
}


@pytest.mark.parametrize("name", SHAPES)
def test_something_without_a_name_is_unknown(name):
    fit = SensorModel(["gyr.bias"]).fit(bent_by_current(SHAPES[name]))
    where = fit.compare().where[0]
    assert (where.channel, where.covariate) == ("gyr_x", "motor_current")
    assert where.share > 0.8
    answer = fit.diagnose()
    assert answer.verdict == "unknown"
    assert (answer.unexplained[0].channel, answer.unexplained[0].covariate) == ("gyr_x", "motor_current")
    assert "gyr_x" in answer.sentence
    assert "motor_current" in answer.sentence


@pytest.mark.parametrize("at", [52.5, 53.1, 54.0])
def test_a_step_is_found_wherever_it_lies_and_is_no_zero_that_wanders(at):
    sim = simulate.simulate("handheld", {}, 8, 120.0)
    sim.acc[:] += np.where(sim.t[:, None] < at, -0.05, 0.06) * np.array([1.0, 0.0, -0.8])
    answer = SensorModel().fit(sim.to_log()).diagnose()
    assert answer.verdict == "unknown"
    steps = {item.channel: item.shape for item in answer.unexplained if item.shape.startswith("a level shift at")}
    assert set(steps) == {"acc_x", "acc_z"}
    for shape in steps.values():  # to half a block
        assert float(shape.split()[4]) == pytest.approx(at, abs=1.25)


@pytest.mark.parametrize(("sensor", "size"), [("acc", 0.06), ("gyr", 2.6e-3), ("mag", 1.0)])
@pytest.mark.parametrize("spans", [[(50.3, 53.3)], [(50.3, 70.3)], [(30.2, 36.1), (80.1, 91.0)]])
def test_another_level_for_a_while_is_unknown_and_is_dated(sensor, size, spans):
    sim = simulate.simulate("arm", {}, 3, 120.0)
    inside = np.any([(begin < sim.t) & (sim.t < end) for begin, end in spans], axis=0)
    getattr(sim, sensor)[:, 2] += size * inside
    answer = SensorModel().fit(sim.to_log()).diagnose()
    assert answer.verdict == "unknown"
    found = answer.unexplained[0]
    assert (found.channel, found.covariate) == (f"{sensor}_z", "t")
    times = [float(word) for word in found.shape.split() if word[0].isdigit()]
    # One of the stays, to a block. One of a block or two may as well be a transient: its middle and its width.
    begin, end = min(spans, key=lambda span: abs(span[0] - times[0]))
    if found.shape.startswith("a transient"):
        assert end - begin < 5.0
        times = [times[0] - 0.5 * times[1], times[0] + 0.5 * times[1]]
    assert times == pytest.approx([begin, end], abs=2.5)


@pytest.mark.parametrize("seed", [710026, 710040])
def test_noise_that_grows_with_the_rate_is_no_effect_of_the_few_fast_turns(seed):
    puzzle = grade.draw("nothing", seed)
    assert puzzle.kind == "growing with rate"
    answer = SensorModel().fit(puzzle.simulation.to_log()).diagnose()
    assert (answer.verdict, answer.best, answer.unexplained) == ("adequate", None, ())


@pytest.mark.parametrize("name", SHAPES)
def test_diagnosis_and_comparison_give_a_dependence_the_same_share(name):
    fit = SensorModel(["gyr.bias"]).fit(bent_by_current(SHAPES[name]))
    shown = fit.compare().where[0].share
    assert fit.diagnose().unexplained[0].share == pytest.approx(shown, abs=0.2)


def test_a_diagnosis_on_another_log_is_of_that_log():
    clean = simulate.simulate("handheld", {}, 1, 40.0).to_log()
    other = simulate.simulate("handheld", {"acc.bias": None}, 2, 40.0, size="large").to_log()
    fit = SensorModel().fit(clean)
    assert fit.diagnose().verdict == "adequate"
    assert fit.diagnose(other).best == "acc.bias"
    assert fit.diagnose().verdict == "adequate"


@pytest.fixture(scope="module")
def answered():
    log = simulate.simulate(
        "handheld", {"gyr.g_sensitivity": None}, 1, 40.0, size="large", covariates=("vbat",)
    ).to_log()
    fit = SensorModel(["gyr.bias"]).fit(log)
    return fit, fit.diagnose(), fit.compare(), fit.add("gyr.g_sensitivity")


def as_json(result) -> dict:
    return json.loads(json.dumps(result.to_dict(), allow_nan=False))


def test_json_of_a_diagnosis_has_the_promised_keys(answered):
    found = as_json(answered[1])
    assert found.keys() >= {"verdict", "best", "ambiguous_with", "candidates", "unexplained"}
    for candidate in found["candidates"]:
        keys = {"effect", "p_value", "expected_ratio", "held_out_before", "held_out_after", "parameters"}
        assert candidate.keys() >= keys | {"confounded_with", "explanation"}
        assert candidate["explanation"]
        for parameter in candidate["parameters"].values():
            assert parameter.keys() >= {"value", "standard_error", "unit"}
        for rival in candidate["confounded_with"]:
            assert rival.keys() >= {"effect", "correlation"}
    unknown = as_json(SensorModel(["gyr.bias"]).fit(bent_by_current(lambda c: np.abs(c - 1.6))).diagnose())
    assert unknown["unexplained"]
    for item in unknown["unexplained"]:
        assert item.keys() >= {"channel", "covariate", "share"}


def test_json_of_a_comparison_has_the_promised_keys(answered):
    found = as_json(answered[2])
    assert found.keys() >= {"n", "duration_s", "model", "channels", "sensors", "attitude", "where"}
    assert found["model"] == ["gyr.bias"]
    assert set(found["channels"]) == {f"{s}_{a}" for s in ("acc", "gyr", "mag") for a in "xyz"}
    for channel in found["channels"].values():
        assert channel.keys() >= {"rms", "mean", "noise_floor", "ratio", "unit"}
        assert channel["ratio"] == pytest.approx(channel["rms"] / channel["noise_floor"])
    assert {name: set(s) for name, s in found["sensors"].items()} == {s: {"ratio"} for s in ("acc", "gyr", "mag")}
    assert found["where"]
    for item in found["where"]:
        assert item.keys() >= {"channel", "covariate", "share", "t_start", "t_end"}
    assert found["where"][0]["channel"].startswith("gyr")


def test_json_of_an_addition_has_the_promised_keys(answered):
    found = as_json(answered[3])
    assert found.keys() >= {"effect", "before", "expected", "after", "held_out", "parameters", "model"}
    assert found["held_out"] is True
    assert found["model"] == ["gyr.bias", "gyr.g_sensitivity"]
    assert len(found["parameters"]) == 9


def test_before_expected_and_after_agree(answered):
    fit, diagnosis, _, addition = answered
    assert addition.before == fit.ratio
    assert addition.expected == pytest.approx(diagnosis.best_candidate.held_out_after, rel=1e-5)
    assert addition.after == pytest.approx(addition.expected, rel=1e-3)
    assert addition.after == pytest.approx(1.0, abs=0.05)
    assert addition.warning == ""
    assert addition.fit.ratio == addition.after


@pytest.mark.parametrize(
    ("effect", "problem"),
    [
        ("gyr.bias", "gyr.bias is in the model already"),
        ("gyr.biass", "unknown effect gyr.biass.*Did you mean gyr.bias"),
        ("acc.column:fan", "acc.column:fan cannot be added: the log has no column fan"),
    ],
)
def test_what_cannot_be_added_is_refused_in_words(answered, effect, problem):
    with pytest.raises(InputError, match=problem):
        answered[0].add(effect)


def test_a_residual_above_the_noise_floor_is_never_said_to_be_at_it():
    noise = Noise(gyr=SensorNoise(8.7e-4, random_walk=8e-4))
    fit = SensorModel().fit(simulate.simulate("handheld", {}, 1, 60.0, noise=noise).to_log())
    answer = fit.diagnose()
    assert (answer.verdict, answer.best) == ("adequate", None)
    assert f"{fit.ratio:.2f} times the noise" in answer.sentence
    assert "at its noise floor" not in answer.sentence
