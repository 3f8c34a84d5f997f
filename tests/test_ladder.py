"""The ladder: effect after effect until nothing is missing, and not one more."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from imufit import SensorModel, ladder
from imufit.diagnosing.ladder import Climb, next_effect
from imufit.diagnosing.revise import revise
from imufit.lab import simulate
from imufit.lab.simulate import OBSERVABLE, Noise
from imufit.results.diagnosis import SIGNIFICANT
from scipy.spatial.transform import Rotation
from test_diagnose import static

PAIRS = [
    ("handheld", ("gyr.g_sensitivity", "acc.scale"), True),
    ("handheld", ("gyr.bias", "gyr.scale"), False),
    ("handheld", ("ref.delay", "acc.lever_arm"), False),
    ("arm", ("ref.alignment", "acc.bias_temperature"), True),
    ("arm", ("acc.bias", "acc.misalignment"), False),
    ("turntable", ("gyr.scale", "gyr.misalignment"), False),
    ("poses", ("mag.hard_iron", "mag.soft_iron"), True),
    ("poses", ("acc.bias", "gyr.column:motor_current"), False),
]


@pytest.mark.parametrize(("scenario", "effects", "realistic"), PAIRS)
def test_two_missing_effects_are_both_found(scenario, effects, realistic):
    sim = simulate.simulate(scenario, dict.fromkeys(effects), 7, 120.0, size="large", realistic=realistic)
    answer = ladder(sim.to_log())
    assert set(answer.model) == set(effects)
    assert answer.verdict == "adequate"
    for p in answer.fit.parameters:
        assert abs(p.value - sim.truth.effects[p.effect][p.name]) < 5.0 * p.standard_error, str(p)


@pytest.mark.parametrize("scenario", OBSERVABLE)
def test_nothing_is_added_to_an_ideal_sensor(scenario):
    answer = ladder(simulate.simulate(scenario, {}, 5, 60.0, noise=Noise.realistic()).to_log())
    assert (answer.steps, answer.model, answer.verdict) == ((), (), "adequate")
    assert answer.ratio_start == answer.ratio_end


def test_each_step_starts_where_the_last_one_ended():
    sim = simulate.simulate(
        "handheld", dict.fromkeys(["gyr.bias", "acc.scale", "mag.hard_iron"]), 2, 60.0, size="large"
    )
    answer = ladder(sim.to_log())
    assert [s.effect for s in answer.steps] == list(answer.model)
    assert answer.steps[0].before == answer.ratio_start
    assert answer.steps[-1].after == answer.ratio_end == answer.fit.ratio
    for a, b in zip(answer.steps[:-1], answer.steps[1:], strict=True):
        assert a.after == b.before
    for step in answer.steps:
        assert step.after < step.before
        assert step.after == pytest.approx(step.expected, rel=0.01)
        assert step.training <= step.after
    assert answer.ratio_end == pytest.approx(1.0, abs=0.05)
    assert answer.first.model == ()
    assert answer.comparison_start.model == ()
    assert answer.comparison_end.model == answer.model


def test_a_ladder_starts_from_the_model_given():
    sim = simulate.simulate("handheld", {"gyr.bias": None, "acc.scale": None}, 2, 60.0, size="large")
    answer = ladder(sim.to_log(), SensorModel(["gyr.bias"]))
    assert answer.model == ("gyr.bias", "acc.scale")
    assert [s.effect for s in answer.steps] == ["acc.scale"]


def test_what_cannot_be_told_apart_is_not_added():
    answer = ladder(static(0.1, (0.6, 0.5, 0.2)))
    assert answer.verdict == "ambiguous"
    assert answer.steps == ()
    assert answer.diagnosis.experiment


def test_beside_what_cannot_be_told_apart_the_rest_is_added():
    log = static(0.1, (0.6, 0.5, 0.2))
    current = np.repeat(np.random.default_rng(1).uniform(0.0, 3.0, 60), 100)
    log = replace(log, gyr=log.gyr + 0.002 * (current - current.mean())[:, None], covariates={"current": current})
    answer = ladder(log)
    assert answer.model == ("gyr.column:current",)
    assert answer.verdict == "ambiguous"


def test_of_two_things_that_cannot_be_told_apart_none_is_added():
    log = static(0.1, (0.6, 0.5, 0.2))
    answer = ladder(replace(log, gyr=log.gyr + np.array([0.002, -0.004, 0.001])))
    assert answer.model == ()
    assert answer.verdict == "ambiguous"


@pytest.mark.parametrize("effect", ["acc.delay", "acc.lowpass"])
def test_of_a_delay_and_a_lowpass_that_are_alike_one_stays_and_the_answer_names_the_other(effect):
    alike = {"acc.delay", "acc.lowpass"}
    sim = simulate.simulate("handheld", {effect: None, "gyr.bias": None}, 3, 60.0, size=0.3)
    answer = ladder(sim.to_log())
    (held,) = alike & set(answer.model)
    (other,) = alike - {held}
    assert set(answer.model) == {"gyr.bias", held}
    assert answer.verdict == "ambiguous"
    value = answer.to_dict()
    assert value["ambiguous_with"] == [other]
    assert value["experiment"]
    assert f"{held} and {other}" in answer.sentence
    assert "adequate" not in answer.sentence
    # The error is down to the noise, and the delay that the model holds is the one that is there.
    assert answer.ratio_end == pytest.approx(1.0, abs=0.02)
    (tau,) = (p for p in answer.fit.parameters if p.effect == held)
    assert abs(tau.value - sim.truth.effects[effect]["tau"]) < 5.0 * tau.standard_error


def test_a_second_pose_tells_them_apart():
    parts = [
        static(0.1, v, seed=k) for k, v in enumerate([(0.6, 0.5, 0.2), (-0.5, 0.9, 0.0), (0.1, -0.8, 1.0), (2.5, 0, 0)])
    ]
    n = sum(p.n for p in parts)
    quaternions = np.concatenate([p.ref_q for p in parts])
    log = replace(
        parts[0],
        t=np.concatenate([p.t + 70.0 * k for k, p in enumerate(parts)]),
        **{s: np.concatenate([getattr(p, s) for p in parts]) for s in ("acc", "gyr", "mag")},
        ref_q=quaternions,
    )
    assert log.n == n
    assert isinstance(log.reference, Rotation)
    answer = ladder(log)
    assert (answer.model, answer.verdict) == (("acc.bias",), "adequate")


def test_json_of_a_ladder_has_the_promised_keys():
    sim = simulate.simulate("handheld", {"gyr.bias": None}, 2, 40.0, size="large")
    found = json.loads(json.dumps(ladder(sim.to_log()).to_dict(), allow_nan=False))
    assert found.keys() >= {"steps", "model", "verdict", "ratio_start", "ratio_end", "attitude"}
    assert found["model"] == ["gyr.bias"]
    for step in found["steps"]:
        assert step.keys() >= {"effect", "before", "expected", "after"}
    if found["attitude"] is not None:
        assert found["attitude"].keys() >= {"before_deg", "after_deg"}


def test_what_stands_in_for_an_effect_gives_way_to_it():
    sim = simulate.simulate("handheld", dict.fromkeys(["acc.scale", "gyr.bias"]), 3, 120.0, size="large")
    fit = SensorModel(["gyr.bias", "acc.cubic"]).fit(sim.to_log())
    tried = set()
    (swap,) = revise(fit, ["acc.cubic", "gyr.bias"], 2.0 * fit.ratio, tried)
    assert (swap.removed, swap.by) == ("acc.cubic", "acc.scale")
    assert swap.after < swap.before == pytest.approx(fit.ratio)
    assert frozenset({"acc.scale", "gyr.bias"}) in tried
    assert "acc.scale took the place of acc.cubic" in str(swap)
    # What the user began with stays, whatever it is.
    assert revise(fit, ["gyr.bias"], 2.0 * fit.ratio, set()) == []


def test_what_others_explain_is_taken_out_again():
    log = simulate.simulate("handheld", {"acc.scale": None}, 3, 120.0, size="large").to_log()
    fit = SensorModel(["acc.scale", "acc.cubic"]).fit(log)
    (drop,) = revise(fit, ["acc.scale", "acc.cubic"], 2.0 * fit.ratio, set())
    assert (drop.removed, drop.by) == ("acc.cubic", None)
    assert drop.after == pytest.approx(drop.before, rel=0.002)
    assert "acc.cubic was taken out again" in str(drop)
    assert drop.to_dict() == {"removed": "acc.cubic", "by": None, "before": drop.before, "after": drop.after}


def test_a_model_with_all_that_is_there_is_not_revised():
    sim = simulate.simulate("handheld", dict.fromkeys(["acc.scale", "gyr.bias"]), 3, 120.0, size="large")
    fit = SensorModel(["acc.scale", "gyr.bias"]).fit(sim.to_log())
    assert revise(fit, ["acc.scale", "gyr.bias"], 2.0 * fit.ratio, set()) == []


def test_the_way_is_told_without_what_was_taken_out_again():
    log = simulate.simulate("handheld", {"acc.scale": None, "gyr.bias": None}, 3, 120.0, size="large").to_log()
    climb = Climb(SensorModel().fit(log))
    climb.up()
    again = climb.again([("gyr.bias", None)])
    assert [step.effect for step in again.steps] == ["acc.scale"] == list(again.fit.model.effects)
    assert again.steps[0].before == climb.start.ratio
    assert again.diagnosis.best == "gyr.bias"


def test_the_effect_that_lowers_the_error_most_comes_first() -> None:
    def candidate(effect: str, ln_bayes: float, after: float) -> SimpleNamespace:
        return SimpleNamespace(effect=effect, status=SIGNIFICANT, ln_bayes=ln_bayes, held_out_after=after)

    late, iron = candidate("gyr.delay", 900.0, 33.1), candidate("mag.hard_iron", 470.0, 4.5)
    found = SimpleNamespace(verdict="missing", without=(), candidates=(late, iron))
    assert next_effect(None, found) == "mag.hard_iron"
    assert next_effect(None, found, {"mag.hard_iron"}) == "gyr.delay"
    assert next_effect(None, found, {"mag.hard_iron", "gyr.delay"}) is None
