"""A user's effect that is not linear or looks back: found, added and taken out like a built-in one."""

import math
import multiprocessing
import pickle
from dataclasses import replace

import imufit
import numpy as np
import pytest
from engine import analysis_of, pieces
from imufit import InputError, SensorModel, _imufit
from imufit.model.catalogue import effects, find_effect
from imufit.model.effect import forget
from scipy.signal import lfilter

ALONG = np.array([8e-4, -5e-4, 3e-4])


@pytest.fixture
def user_effect():
    """The decorator; effects made with it are forgotten after the test."""
    before = set(effects())
    yield imufit.effect
    for effect_id in set(effects()) - before:
        forget(effect_id)


def warmed(seed, duration=150.0):
    """A hand-held log whose case is warmed and cooled at random, and the true temperature of its case, degC."""
    log = imufit.simulate("handheld", {}, seed=seed, duration=duration).to_log()
    rng = np.random.default_rng(seed)
    power = np.repeat(rng.uniform(-1.0, 1.0, 400), 700)[: log.n]
    case = np.empty(log.n)
    case[0] = 30.0
    for i in range(1, log.n):
        case[i] = case[i - 1] + (0.6 * power[i] - (case[i - 1] - 30.0) / 20.0) * (log.t[i] - log.t[i - 1])
    return replace(log, temp=case + 0.002 * rng.standard_normal(log.n)), case


def lagging(user_effect):
    """An effect: the zero follows the temperature of a die that lags behind the thermometer's."""

    @user_effect(
        "gyr.die",
        parameters={"x": "rad/s/K", "y": "rad/s/K", "z": "rad/s/K", "tau": "s"},
        typical={"x": 1e-3, "y": 1e-3, "z": 1e-3},
        search={"tau": (0.5, 40.0)},
        memory="2 min",
        needs=["temp"],
        explanation="the zero follows the die, which is warmed through its package",
    )
    def die(w, x, y, z, tau):
        kept = np.exp(-w.dt / tau)
        warmth = w.column("temp", centred=True)
        inside, _ = lfilter([1.0 - kept], [1.0, -kept], warmth, zi=[kept * warmth[0]])
        return np.outer(inside, [x, y, z])

    return die


def with_lag(seed, tau):
    """A log whose gyroscope's zero goes with the heat that flows into its die; integrated in small steps."""
    log, case = warmed(seed)
    die = np.empty(log.n)
    die[0] = case[0]
    for i in range(1, log.n):
        inside = die[i - 1]
        for part in range(10):
            outside = case[i - 1] + (part + 0.5) / 10.0 * (case[i] - case[i - 1])
            inside += (outside - inside) / tau * (log.t[i] - log.t[i - 1]) / 10.0
        die[i] = inside
    return replace(log, gyr=log.gyr + np.outer(die - die.mean(), ALONG)), np.outer(die - die.mean(), ALONG)


def sticking(user_effect):
    """An effect: the zero follows the temperature with play."""

    @user_effect(
        "gyr.sticking",
        parameters={"x": "rad/s/K", "y": "rad/s/K", "z": "rad/s/K", "width": "K"},
        typical={"x": 1e-3, "y": 1e-3, "z": 1e-3},
        search={"width": (0.1, 10.0)},
        memory="log",
        needs=["temp"],
    )
    def play(w, x, y, z, width):
        warmth = w.temperature
        follows = np.empty(len(warmth))
        at = warmth[0]
        for i, now in enumerate(warmth.tolist()):
            at = min(max(at, now - 0.5 * width), now + 0.5 * width)
            follows[i] = at
        return np.outer(follows, [x, y, z])

    return play


def with_hysteresis(seed, width):
    """A log whose zero is pulled by a joint that slips: a spring drags a block that friction holds."""
    log, case = warmed(seed)
    block, stiffness = case[0], 3.0
    friction = stiffness * width / 2.0
    course = np.empty(log.n)
    for i in range(log.n):
        pull = stiffness * (case[i] - block)
        if abs(pull) > friction:
            block += (abs(pull) - friction) / stiffness * math.copysign(1.0, pull)
        course[i] = block
    added = np.outer(course - case.mean(), ALONG)
    return replace(log, gyr=log.gyr + added), added


def near(fit, effect_id, true):
    """Fitted parameters of an effect in standard errors from the true ones."""
    return {p.name: (p.value - true[p.name]) / p.standard_error for p in fit.parameters if p.effect == effect_id}


CASES = {
    "lag": (lagging, with_lag, "gyr.die", "tau", 6.0),
    "hysteresis": (sticking, with_hysteresis, "gyr.sticking", "width", 2.0),
}


@pytest.mark.parametrize("case", CASES)
def test_what_looks_back_is_named_added_and_taken_out(user_effect, case):
    define, record, effect_id, inside, size = CASES[case]
    function = define(user_effect)
    log, added = record(11, size)
    answer = imufit.diagnose(log)
    assert (answer.verdict, answer.best) == ("missing", effect_id)
    better = SensorModel(["gyr.bias"]).fit(log).add(function)
    assert better.after < better.before
    assert better.after == pytest.approx(1.0, abs=0.02)
    off = near(better.fit, effect_id, {**dict(zip("xyz", ALONG, strict=True)), inside: size})
    assert max(map(abs, off.values())) < 2.5, off
    assert better.fit.diagnose().verdict == "adequate"
    left = better.fit.model.apply(log).gyr - (log.gyr - added)
    assert np.sqrt(np.mean((left - left.mean(axis=0)) ** 2)) < 0.05 * np.std(added)


def test_a_lag_of_the_rate_with_an_unknown_time_constant(user_effect):
    log = imufit.simulate("handheld", {}, seed=3, duration=60.0).to_log()
    true = imufit.simulate("handheld", {}, seed=3, duration=60.0).to_log()
    creep = np.zeros((log.n, 3))
    for i in range(1, log.n):
        creep[i] = creep[i - 1] + (true.gyr[i] - creep[i - 1]) * -math.expm1(-(log.t[i] - log.t[i - 1]) / 1.5)
    log = replace(log, gyr=log.gyr + 0.01 * creep)

    @user_effect(
        "gyr.creep", parameters={"k": "1", "tau": "s"}, typical={"k": 0.01}, search={"tau": (0.1, 10.0)}, memory=20
    )
    def creeps(w, k, tau):
        kept = np.exp(-w.dt / tau)
        return k * lfilter([1.0 - kept], [1.0, -kept], w.rate, axis=0)

    answer = imufit.diagnose(log)
    assert answer.best == "gyr.creep"
    fit = SensorModel([creeps]).fit(log)
    off = near(fit, "gyr.creep", {"k": 0.01, "tau": 1.5})
    assert max(map(abs, off.values())) < 2.5, off
    left = fit.model.apply(log).gyr - true.gyr
    assert np.std(left) < 0.1 * np.std(0.01 * creep)


@pytest.mark.parametrize("memory", [1.5, "log"])
def test_nothing_depends_on_how_the_log_is_cut(user_effect, memory):
    log, _ = warmed(2, 20.0)

    @user_effect("gyr.sum", parameters={"k": "rad/s"}, memory=memory, needs=["temp"])
    def running(w, k):
        warmth = w.temperature
        return k * lfilter([0.02], [1.0, -0.98], warmth, zi=[0.98 * warmth[0]])[0] + 0.1 * k * w.rate[:, 0]

    analysis = analysis_of(log, "gyr.sum")
    evidence, facts = analysis.logs[0].raw, analysis.logs[0].facts
    margin = analysis.logs[0].surveyed.passes.margin(facts)
    names = analysis.logs[0].surveyed.passes.covariates
    whole = None
    step = np.zeros(len(analysis.estimate().step))
    step[0] = 1.0  # that of the effect, which is first in the model
    for size in (log.n, 997, 300, 131):
        cuts = list(range(size, log.n, size))
        parts = [
            _imufit.evaluate(evidence, chunk, analysis.own_step(0, step)) for chunk in pieces(log, names, cuts, margin)
        ]
        joined = np.concatenate([np.stack(part[3:6], axis=1) for part in parts])
        whole = joined if whole is None else whole
        np.testing.assert_allclose(joined, whole, rtol=0.0, atol=1e-9 * np.nanmax(np.abs(whole)))


def test_a_chunk_size_changes_no_fit(user_effect, monkeypatch):
    lagging(user_effect)
    log, _ = with_lag(5, 6.0)
    found = []
    for rows in (16384, 5000, 1777):
        monkeypatch.setattr("imufit.fitting.passes.CHUNK_ROWS", rows)
        fit = SensorModel(["gyr.bias", "gyr.die"]).fit(log)
        found.append([p.value for p in fit.parameters])
    np.testing.assert_allclose(found[1:], [found[0]] * 2, rtol=1e-6)


def test_a_centred_column_counts_from_the_mean_of_the_fit_in_every_log(user_effect):
    @user_effect("gyr.load", parameters={"k": "rad/s/A"}, needs=["load"])
    def load(w, k):
        return k * w.column("load", centred=True)

    log = imufit.simulate("handheld", {}, seed=1, duration=40.0).to_log()
    current = 3.0 + np.sin(0.5 * log.t)
    loaded = replace(log, gyr=log.gyr + 0.02 * (current - current.mean())[:, None], covariates={"load": current})
    fit = SensorModel([load]).fit(loaded)
    assert fit.model.constants["covariate_means"]["load"] == pytest.approx(current.mean())
    other = replace(loaded, covariates={"load": np.full(log.n, 5.0)})
    taken = loaded.gyr - fit.model.apply(other).gyr
    np.testing.assert_allclose(taken, fit.model.parameters["gyr.load"]["k"] * (5.0 - current.mean()), rtol=1e-9)


def test_values_that_are_not_a_range_are_the_only_ones_tried(user_effect):
    log = imufit.simulate("handheld", {}, seed=1, duration=40.0).to_log()
    wheel = np.cumsum(np.random.default_rng(0).uniform(0.0, 0.02, log.n))
    log = replace(log, gyr=log.gyr + 0.01 * np.sin(3.0 * wheel)[:, None], covariates={"wheel": wheel})

    @user_effect("gyr.teeth", parameters={"a": "rad/s", "n": "1"}, typical={"a": 0.01}, search={"n": range(1, 7)})
    def teeth(w, a, n):
        return a * np.sin(n * w.column("wheel"))

    fit = SensorModel([teeth]).fit(log)
    assert fit.model.parameters["gyr.teeth"]["n"] == 3.0
    assert fit.model.parameters["gyr.teeth"]["a"] == pytest.approx(0.01, rel=0.02)


def test_an_effect_with_no_linear_parameter_is_searched_for_at_its_full_size(user_effect):
    log = imufit.simulate("handheld", {}, seed=4, duration=40.0).to_log()
    load = np.sin(0.8 * log.t)
    log = replace(log, gyr=log.gyr + 0.01 * np.tanh(4.0 * load)[:, None], covariates={"load": load})

    @user_effect("gyr.sharp", parameters={"k": "1"}, search={"k": (0.5, 20.0)})
    def sharp(w, k):
        return 0.01 * np.tanh(k * w.column("load"))

    answer = imufit.diagnose(log)
    assert answer.best == "gyr.sharp"
    fit = SensorModel([sharp]).fit(log)
    (found,) = fit.parameters
    assert abs(found.value - 4.0) < 2.5 * found.standard_error


CALLS = []


def counted(w, k):
    CALLS.append(1)
    return k * np.full(len(w.t), float(len(CALLS)))


def spoiling(w, k):
    w.omega[:] = 0.0
    return k * w.t


BREACHES = {
    "remembers too much": (
        {"memory": 0.5},
        lambda w, k: k * np.cumsum(w.omega[:, 0] ** 2),
        r"gyr\.liar depends on rows more than its memory of 0\.5 s before",
    ),
    "not linear": ({}, lambda w, k: np.sin(k * w.omega), r"gyr\.liar is not linear in k.*search="),
    "not proportional": ({}, lambda w, k: k * w.omega + 0.1, r"gyr\.liar is not linear in k"),
    "another each time": ({}, counted, r"gyr\.liar.*(another value|rows are cut)"),
    "at random": (
        {},
        lambda w, k: k * np.random.default_rng().standard_normal(len(w.t)),
        r"gyr\.liar.*(another value|rows are cut)",
    ),
    "looks ahead": (
        {"memory": "log"},
        lambda w, k: k * (w.omega - w.omega[-1]),
        r"gyr\.liar.*rows are cut",
    ),
}


@pytest.mark.parametrize("breach", BREACHES)
def test_a_function_that_breaks_its_word_is_told_so(user_effect, breach):
    declared, function, said = BREACHES[breach]
    log = imufit.simulate("handheld", {}, seed=1, duration=20.0).to_log()
    user_effect("gyr.liar", parameters={"k": "1"}, **declared)(function)
    for asked in (lambda: SensorModel(["gyr.liar"]).fit(log), lambda: imufit.diagnose(log)):
        with pytest.raises(InputError, match=said):
            asked()


def test_a_function_cannot_change_its_window(user_effect):
    log = imufit.simulate("handheld", {}, seed=1, duration=20.0).to_log()
    user_effect("gyr.spoiling", parameters={"k": "1"})(spoiling)
    with pytest.raises(InputError, match=r"gyr\.spoiling changes omega of its window"):
        SensorModel(["gyr.spoiling"]).fit(log)


@pytest.mark.parametrize(
    ("declared", "said"),
    [
        ({"search": {"tau": (0.1, 1.0)}}, "search names tau, which is not a parameter. Use one of k"),
        ({"search": {"k": (1.0, 0.1)}}, "search of k begins above its end"),
        ({"search": {"k": 3.0}}, "search of k is 3.0"),
        ({"search": {"k": (0.1, math.nan)}}, "search of k is"),
        ({"memory": "long"}, "memory is 'long'.*10 s"),
        ({"memory": -1.0}, "memory is -1.0"),
        ({"memory": "3 s", "stage": "gain"}, "memory at stage gain"),
        ({"axes": "w"}, "axes is 'w'"),
    ],
)
def test_what_cannot_be_declared_is_refused_in_words(user_effect, declared, said):
    with pytest.raises(InputError, match=said):
        user_effect("gyr.odd", parameters=["k"], **declared)


def test_a_function_without_its_parameters_is_refused_where_it_is_defined(user_effect):
    with pytest.raises(InputError, match=r"gyr\.odd: the function old does not take .* k .*def odd\(w, k\)"):

        @user_effect("gyr.odd", parameters=["k"])
        def old(w):
            return w.t


def test_a_value_for_one_axis(user_effect):
    @user_effect("gyr.hum", parameters={"k": "rad/s"}, axes="z")
    def hum(w, k):
        return k * np.sin(w.t)

    log = imufit.simulate("handheld", {}, seed=1, duration=20.0).to_log()
    taken = log.gyr - SensorModel([hum], {"gyr.hum": {"k": 0.1}}).apply(log).gyr
    np.testing.assert_allclose(taken, np.outer(0.1 * np.sin(log.t), [0.0, 0.0, 1.0]), atol=1e-12)


def test_a_function_that_is_not_an_effect_is_refused():
    with pytest.raises(InputError, match=r"warmed is not an effect\. Decorate the function"):
        SensorModel([warmed])


FILE = """
import imufit

@imufit.effect("gyr.weight", parameters={"k": "rad/s/(m/s^2)"}, typical=0.01)
def weight(w, k):
    return k * w.specific_force
"""


def of_model(model):
    return model.parameters, [effect.id for effect, _ in model.stack()]


def test_effects_of_a_file_go_into_a_pickle_and_to_another_process(tmp_path):
    (tmp_path / "mine.py").write_text(FILE)
    try:
        assert imufit.load_effects(tmp_path / "mine.py") == ["gyr.weight"]
        model = SensorModel(["gyr.weight"], {"gyr.weight": {"k": 0.01}})
        data = pickle.dumps(model)
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            assert pool.apply(of_model, (model,)) == of_model(model)
        forget("gyr.weight")
        assert of_model(pickle.loads(data))[1] == ["gyr.weight"]
        assert find_effect("gyr.weight")
    finally:
        forget("gyr.weight")


@pytest.mark.parametrize("start", [0.0, 0.05])
def test_a_fit_keeps_an_effect_to_its_sign(user_effect, start: float) -> None:
    @user_effect("gyr.damped", parameters={"k": "1"}, typical=0.1, sign="positive", explanation="rates are damped")
    def damped(w, k):
        return -k * w.x

    log = imufit.simulate("handheld", {"gyr.scale": {"x": 0.03, "y": 0.03, "z": 0.03}}, seed=5).to_log()
    raised = SensorModel(["gyr.damped"], {"gyr.damped": {"k": start}}).fit(log)
    assert raised.params["gyr.damped.k"].value == 0.0
    assert raised.diagnose().best == "gyr.scale"
    shrunk = replace(log, gyr=0.9 * log.gyr)
    assert SensorModel(["gyr.damped"]).fit(shrunk).params["gyr.damped.k"].value == pytest.approx(0.073, abs=0.005)
