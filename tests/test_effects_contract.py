"""What fitting relies on holds for every effect, built in or a user's; what breaks it is refused in words."""

import re

import numpy as np
import pytest
from engine import analysis_of, pieces
from imufit import InputError, SensorModel, _imufit, effect
from imufit.lab import simulate
from imufit.lab.simulate import Noise
from imufit.model.catalogue import effects, find_effect
from imufit.model.effect import forget

BUILT_IN = [*(e.id for e in _imufit.built_in_effects()), *(f"{s}.column:motor_current" for s in ("acc", "gyr", "mag"))]


@pytest.fixture(scope="module")
def log():
    noise = Noise(jitter=1e-3, dropped=0.02, mag_rate=50.0)
    made = simulate.simulate("handheld", {}, 1, 20.0, noise=noise, covariates=("motor_current",)).to_log()
    made.temp[np.arange(made.n) % 7 != 0] = np.nan
    return made


@pytest.fixture(scope="module")
def checked(log):
    """A call that checks an effect on rows 200 to 800 of the log, at given parameters."""
    surveyed = analysis_of(log).logs[0].surveyed
    chunk = pieces(log, surveyed.passes.covariates, [200, 800], surveyed.facts.margin)[1]

    def check(effect_id: str, at: list[float]) -> None:
        find_effect(effect_id).check(chunk, surveyed.facts, at)

    return check


@pytest.fixture
def user_effect():
    """The decorator; effects made with it are forgotten after the test."""
    before = set(effects())
    yield effect
    for effect_id in set(effects()) - before:
        forget(effect_id)


def fan(w):
    return np.repeat((np.sin(3.0 * w.t) ** 2)[:, None], 3, axis=1)


def times_k(function):
    """A function of the window as the value of an effect that is proportional to k."""
    return lambda w, k: k * function(w)


@pytest.mark.parametrize("effect_id", BUILT_IN)
def test_every_built_in_effect_keeps_the_contract(checked, effect_id):
    parameters = find_effect(effect_id).parameters
    typical = [(size or 0.1) * (1.0 - 0.3 * k) for k, (_, _, size) in enumerate(parameters)]
    checked(effect_id, [0.0] * len(parameters))
    checked(effect_id, typical)


@pytest.mark.parametrize("stage", ["offset", "gain", "input"])
def test_a_users_effect_keeps_the_contract(checked, user_effect, stage):
    @user_effect("gyr.fan", parameters={"k": "rad/s"}, stage=stage)
    def one(w, k):
        return k * fan(w) * (w.x if stage != "offset" else 1.0)

    @user_effect("acc.two", parameters={"a": "1", "b": "1"}, stage=stage)
    def two(w, a, b):
        return a * w.column("motor_current")[:, None] + b * w.alpha

    checked("gyr.fan", [0.3])
    checked("acc.two", [0.3, -0.1])


def test_all_that_a_user_is_given_has_the_shape_that_is_promised(log, user_effect):
    seen = []

    @user_effect("mag.look", parameters={"k": "uT"})
    def look(w, k):
        n = w.t.size
        shapes = [a.shape for a in (w.omega, w.alpha, w.f, w.m, w.x)]
        seen.append(shapes == [(n, 3)] * 5 and w.temperature.shape == w.column("motor_current").shape == (n,))
        assert w.t_start <= w.t[0]
        assert w.dt == pytest.approx(np.median(np.diff(log.t)), rel=0.01)
        assert (w.rate is w.omega, w.specific_force is w.f, w.field is w.m) == (True, True, True)
        assert w.angular_acceleration is w.alpha
        return k * fan(w)

    SensorModel(["mag.look"]).fit(log)
    assert len(seen) > 2
    assert all(seen)


def broken(user_effect, name):
    """One of the ways to write an effect wrongly, under the id gyr.broken."""
    functions = {
        "not finite": lambda w: np.where(w.t[:, None] % 1.0 < 0.1, np.nan, fan(w)),
        "mean of the window": lambda w: fan(w) - fan(w).mean(axis=0),
        "counts from the window": lambda w: fan(w) * (w.t - w.t[0])[:, None],
        "running sum": lambda w: np.cumsum(fan(w), axis=0),
        "too few rows": lambda w: fan(w)[:-1],
        "two axes": lambda w: fan(w)[:, :2],
        "columns": lambda w: np.stack([fan(w), fan(w)], axis=2),
    }
    user_effect("gyr.broken", parameters={"k": "rad/s"})(times_k(functions[name]))


CONTRACT = {
    "not finite": r"gyr\.broken.*value is not finite",
    "mean of the window": r"gyr\.broken.*column k depends on where the rows are cut",
    "counts from the window": r"gyr\.broken.*column k depends on where the rows are cut",
    "running sum": r"gyr\.broken.*column k depends on where the rows are cut",
    "too few rows": r"gyr\.broken returned shape \(\d+, 3\) for \d+ rows\. Return .* \(\d+, 3\)",
    "two axes": r"gyr\.broken returned shape \(\d+, 2\) for \d+ rows",
    "columns": r"gyr\.broken returned shape \(\d+, 3, 2\) for \d+ rows",
}


@pytest.mark.parametrize("name", CONTRACT)
def test_a_broken_effect_is_told_what_is_wrong_with_it(checked, user_effect, name):
    broken(user_effect, name)
    with pytest.raises(ValueError, match=CONTRACT[name]):
        checked("gyr.broken", [0.1])


@pytest.mark.parametrize("name", CONTRACT)
def test_a_broken_effect_is_not_fitted(log, user_effect, name):
    broken(user_effect, name)
    with pytest.raises(InputError, match=CONTRACT[name]):
        SensorModel(["gyr.broken"]).fit(log)


@pytest.mark.parametrize("name", CONTRACT)
def test_a_broken_effect_does_not_spoil_the_ranking_of_the_others_unnoticed(log, user_effect, name):
    broken(user_effect, name)
    with pytest.raises(InputError, match=CONTRACT[name]):
        SensorModel().fit(log)


LIES = {
    "reads a derivative": (
        {"reach": "row"},
        lambda w: w.alpha,
        r"gyr\.lie.*reach is the row, but it reads a derivative",
    ),
    "counts from the start": (
        {"reach": "row"},
        lambda w: (w.t - w.t_start)[:, None] * np.ones(3),
        r"gyr\.lie.*reads the time since the start",
    ),
    "no constant": ({"affine": "offset"}, fan, r"gyr\.lie.*column x is not what its trait affine says"),
    "gain of another": (
        {"affine": "scale", "stage": "gain"},
        lambda w: w.f,
        r"gyr\.lie.*column x is not what its trait",
    ),
}


@pytest.mark.parametrize("lie", LIES)
def test_a_trait_that_the_columns_deny_is_refused(checked, user_effect, lie):
    traits, function, problem = LIES[lie]
    names = ["x", "y", "z"] if "affine" in traits else ["k"]

    @user_effect("gyr.lie", parameters=names, **traits)
    def value(w, **at):
        return function(w) * np.array(list(at.values()))

    with pytest.raises(ValueError, match=problem):
        checked("gyr.lie", [0.1] * len(names))


def test_a_trait_that_the_columns_bear_out_is_kept(checked, user_effect):
    @user_effect("gyr.gain", parameters=["xy", "zx"], stage="gain", affine="matrix", reach="row")
    def gain(w, xy, zx):
        return np.stack([xy * w.x[:, 1], 0.0 * w.x[:, 1], zx * w.x[:, 0]], axis=1)

    checked("gyr.gain", [0.1, -0.2])
    assert (find_effect("gyr.gain").affine, find_effect("gyr.gain").reach) == ("matrix", "row")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"scope": "fleet"}, "scope is 'fleet'.*sensor, log"),
        ({"reach": "reference"}, "reach is 'reference'"),
        ({"sign": "negative"}, "sign is 'negative'"),
        ({"affine": "cubic"}, "affine is 'cubic'"),
        ({"affine": "offset"}, "affine offset has other parameters. Call them x, y, z"),
        ({"affine": "scale"}, "affine scale at stage offset. Use stage gain"),
        ({"affine": "offset", "needs": ["fan"]}, "an effect with a column is not a constant offset"),
    ],
)
def test_a_trait_that_cannot_be_is_refused_in_words(user_effect, wrong, said):
    with pytest.raises(InputError, match=said):
        user_effect("gyr.odd", parameters=["k"], **wrong)


class OwnError(RuntimeError):
    pass


@pytest.mark.parametrize(
    "raised", [OwnError("the fan was off"), ZeroDivisionError("by nothing"), KeyError("no such"), InputError("bad fan")]
)
def test_a_users_exception_comes_out_as_it_went_in(log, user_effect, raised):
    @user_effect("gyr.fan", parameters={"k": "rad/s"})
    def fails(w, k):
        if w.t[-1] > 1.0:
            raise raised
        return k * fan(w)

    with pytest.raises(type(raised), match=re.escape(str(raised))) as caught:
        SensorModel(["gyr.fan"]).fit(log)
    assert caught.value is raised


def test_the_exception_of_one_fit_is_not_shown_for_another(log, user_effect):
    @user_effect("gyr.fan", parameters={"k": "rad/s"})
    def fails(w, k):
        raise OwnError("the fan was off")

    with pytest.raises(OwnError):
        SensorModel(["gyr.fan"]).fit(log)
    forget("gyr.fan")
    fit = SensorModel(["gyr.bias"]).fit(log)
    with pytest.raises(InputError, match=r"acc\.nonsense"):
        fit.add("acc.nonsense")


def test_a_missing_column_is_named(log, user_effect):
    @user_effect("gyr.fan", parameters={"k": "rad/s"})
    def fails(w, k):
        return k * w.column("fan_speed")

    with pytest.raises(InputError, match=r"gyr\.fan.*no column fan_speed; it has temp, motor_current"):
        SensorModel(["gyr.fan"]).fit(log)


def test_an_effect_that_needs_a_column_is_not_offered_without_it(log, user_effect):
    @user_effect("gyr.fan", parameters={"k": "rad/s"}, needs=["fan_speed"])
    def needs(w, k):
        return k * w.column("fan_speed")

    fit = SensorModel().fit(log)
    assert "gyr.fan" not in {c.effect for c in fit.diagnose().candidates}
    with pytest.raises(InputError, match=r"gyr\.fan cannot be added: the log has no column fan_speed"):
        fit.add("gyr.fan")


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ({"effect_id": "fan", "parameters": ["k"]}, "is not SENSOR.NAME"),
        ({"effect_id": "imu.fan", "parameters": ["k"]}, "sensor 'imu' is unknown"),
        ({"effect_id": "gyr.bias", "parameters": ["k"]}, "is built in"),
        ({"effect_id": "gyr.fan", "parameters": []}, "has no parameter"),
    ],
)
def test_an_effect_that_cannot_be_is_refused_where_it_is_defined(user_effect, arguments, problem):
    with pytest.raises(InputError, match=problem):
        user_effect(**arguments)


def hidden_fan(shape, size: float = 2.0, seed: int = 4):
    """A log whose gyroscope reads too much by `shape` of the motor current, along (1, -0.5, 0.2); and how much."""
    sim = simulate.simulate("handheld", {}, seed, 120.0, covariates=("motor_current",))
    signal = shape(sim.covariates["motor_current"])
    k = size * np.radians(0.05) / np.std(signal)
    sim.gyr[:] += k * signal[:, None] * np.array([1.0, -0.5, 0.2])
    return sim.to_log(), k


def test_a_users_effect_is_found_when_it_is_the_hidden_one(user_effect):
    log, k = hidden_fan(lambda current: np.sin(4.0 * current))

    @user_effect("gyr.fan", parameters={"k": "rad/s"}, explanation="the fan shakes the board")
    def own(w, k):
        return np.outer(np.sin(4.0 * w.column("motor_current")), k * np.array([1.0, -0.5, 0.2]))

    answer = SensorModel().fit(log).diagnose()
    assert (answer.verdict, answer.best) == ("missing", "gyr.fan")
    assert "the fan shakes the board" in answer.sentence
    (found,) = answer.best_candidate.parameters
    assert abs(found.value - k) < 4 * found.standard_error
    added = SensorModel().fit(log).add("gyr.fan")
    assert added.after == pytest.approx(1.0, abs=0.02)
    assert added.fit.diagnose().verdict == "adequate"


def test_without_the_users_effect_the_answer_is_unknown():
    log, _ = hidden_fan(lambda current: np.sin(4.0 * current))
    answer = SensorModel().fit(log).diagnose()
    assert answer.verdict == "unknown"
    assert any(u.covariate == "motor_current" and u.channel == "gyr_x" for u in answer.unexplained)


def test_two_names_for_the_same_physics_are_both_named(user_effect):
    log, _ = hidden_fan(lambda current: current)

    @user_effect("gyr.fan", parameters={"k": "rad/s/A"})
    def own(w, k):
        return np.outer(w.column("motor_current"), k * np.array([1.0, -0.5, 0.2]))

    answer = SensorModel(["gyr.bias"]).fit(log).diagnose()
    assert answer.verdict == "ambiguous"
    assert {answer.best, *answer.ambiguous_with} >= {"gyr.fan", "gyr.column:motor_current"}
