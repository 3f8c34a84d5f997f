"""Gains tuned on a log: by error they are the best, by prediction they come near, their tolerance is as told."""

import json
from dataclasses import replace

import numpy as np
import pytest
from cli_stand_in import run, strict_json
from imufit.errors import InputError
from imufit.lab.simulate import simulate
from imufit.log import Log
from imufit.replaying import FILTERS, read_settings, replay
from imufit.tuning import tune
from imufit.tuning.search import coarse, refine
from imufit.tuning.trials import trials

BIASED = {"gyr.bias": {"x": 0.01, "y": -0.02, "z": 0.01}}


def handheld(seed: int = 3, duration: float = 30.0, effects=BIASED) -> Log:
    return simulate("handheld", effects, duration=duration, rate=50.0, seed=seed).to_log()


@pytest.fixture(scope="module")
def log() -> Log:
    return handheld()


@pytest.fixture(scope="module")
def tuned(log):
    return tune(log, "mahony", gains=("k_p", "k_i"))


def error(log: Log, settings, name: str = "mahony", metric: str = "total_deg") -> float:
    return replay(log, (name,), settings={name: settings}).errors[name][metric]


def test_trials_judge_as_a_replay_does(log):
    movement = (np.arange(log.n) % 3 > 0).astype(float)
    log = replace(log, covariates={"movement": movement})
    gains = [{"k_p": 0.1}, {"k_p": 1.0, "k_2": 4.0}, {"k_p": 10.0}]
    for metric in ("total", "heading", "inclination"):
        ready = trials(log, "mahony", "error", metric, 1.0, {"k_i": 0.1})
        values = ready.values(ready.scores(gains))
        for found, each in zip(values, gains, strict=True):
            assert found[2] == pytest.approx(error(log, {**each, "k_i": 0.1}, metric=f"{metric}_deg"), rel=1e-9)
        rows = np.flatnonzero(movement)
        halves = (ready.part[rows] == 0).sum(), (ready.part[rows] == 1).sum()
        assert abs(halves[0] - halves[1]) <= 1
        np.testing.assert_allclose((values[:, :2] ** 2) @ halves / rows.size, values[:, 2] ** 2, rtol=1e-9)


def test_tuned_gains_are_the_best_that_the_map_and_the_lines_show(log, tuned):
    best = tuned.value["tuned"]
    assert best == pytest.approx(error(log, tuned.settings["mahony"]), rel=1e-9)
    assert tuned.value["default"] == pytest.approx(error(log, {}), rel=1e-9)
    assert best < 0.7 * tuned.value["default"]
    assert tuned.map.values.min() >= 0.999 * best
    for gain in tuned.gains:
        assert gain.values.min() >= 0.999 * best
        assert gain.flat[0] < 1.0 < gain.flat[1]
    at = tuned.map.values[3, 12]
    gains = {tuned.map.names[0]: tuned.map.x[12], tuned.map.names[1]: tuned.map.y[3]}
    assert at == pytest.approx(error(log, gains), rel=1e-9)


def test_held_out_is_the_error_of_gains_that_did_not_see_the_half(tuned):
    assert tuned.value["tuned"] <= tuned.value["held_out"] < tuned.value["default"]


def test_the_gains_may_be_as_bad_as_told_before_the_filter_loses(log, tuned):
    name, limit = tuned.rival
    assert name == "triad"
    assert limit == pytest.approx(error(log, {}, "triad"), rel=1e-9)
    bounds = 0
    for gain in tuned.gains:
        for factor in gain.wins:
            if 0.0 < factor < np.inf:
                bounds += 1
                gains = {**tuned.settings["mahony"], gain.name: gain.tuned * factor}
                assert error(log, gains) <= limit
                beyond = 1.03 if factor > 1.0 else 1.0 / 1.03
                assert error(log, {**gains, gain.name: gain.tuned * factor * beyond}) > limit
    assert bounds > 0
    assert any("loses to triad" in remark for remark in tuned.remarks)


@pytest.mark.parametrize(("name", "gains"), [("mahony", ("k_p", "k_i")), ("complementary", ())])
@pytest.mark.parametrize("seed", [3, 5])
def test_without_reference_the_gains_come_near_those_of_the_error(name, gains, seed):
    log = handheld(seed, duration=40.0)
    metric = "inclination" if name == "complementary" else "total"
    by_error = tune(log, name, by="error", metric=metric, gains=gains)
    blind = tune(replace(log, ref_q=None), name, metric=metric, gains=gains)
    assert (blind.criterion, blind.error, blind.rival) == ("prediction", None, None)
    reached = error(log, blind.settings[name], name, f"{metric}_deg")
    assert reached < 1.35 * by_error.value["tuned"]
    if name == "mahony":
        assert reached < 0.8 * by_error.value["default"]


def test_innovations_are_whiter_where_the_filter_is_neither_stiff_nor_slack():
    rng = np.random.default_rng(0)
    t = 0.02 * np.arange(3000)
    still = Log.from_arrays(
        t,
        acc=rng.normal(0.0, 0.5, (t.size, 3)) + np.array([0.0, 0.0, 9.80665]),
        gyr=rng.normal(0.0, 0.01, (t.size, 3)),
        reference=np.tile([1.0, 0.0, 0.0, 0.0], (t.size, 1)),
        frame="NWU",
    )
    stiff, slack = (
        tune(still, "complementary", by="error", gains=("time_constant",), fixed=None).innovation["tuned"],
        tune(still, "mahony", by="error", gains=("k_p",), fixed={"k_i": 0.0, "k_1": 1.0}).innovation["default"],
    )
    assert abs(stiff.correlation) < 0.05
    assert stiff.rms_deg == pytest.approx(np.degrees(np.sqrt(2.0) * 0.5 / 9.80665), rel=0.05)
    assert abs(slack.correlation) < 0.2


def test_a_gain_that_the_log_does_not_bound_is_told():
    found = tune(handheld(effects={}), "kalman", metric="inclination")
    walk = next(gain for gain in found.gains if gain.name == "bias_walk")
    assert walk.edge is not None or walk.flat[0] == 0.0 or np.isinf(walk.flat[1])
    assert any("bias_walk" in remark for remark in found.remarks)


def test_a_gain_without_effect_is_left_alone(log):
    found = tune(replace(log, mag=None), "mahony", metric="inclination")
    assert [gain.name for gain in found.gains] == ["k_p", "k_i"]
    assert any("k_2 changes nothing" in note for note in found.notes)


@pytest.mark.parametrize("name", [name for name in FILTERS if name not in ("accel", "gyro", "triad", "quest")])
def test_every_filter_with_gains_is_tuned_by_its_own_settings(name):
    log = handheld(duration=6.0)
    found = tune(log, name)
    assert found.value["tuned"] <= found.value["default"] * (1.0 + 1e-9)
    assert found.value["tuned"] == pytest.approx(
        error(log, found.settings[name], name, f"{found.metric}_deg"), rel=1e-9
    )


def test_noise_at_rest_comes_from_the_allan_deviation():
    log = handheld(duration=30.0, effects={})
    rng = np.random.default_rng(1)
    t = np.concatenate([0.02 * np.arange(1500), 30.0 + log.t])
    noise = [rng.normal(0.0, size, (1500, 3)) for size in (0.02, 1e-3)]
    first_up, first_rate = log.acc[0] / np.linalg.norm(log.acc[0]) * 9.80665, np.zeros(3)
    rested = Log.from_arrays(
        t, acc=np.concatenate([noise[0] + first_up, log.acc]), gyr=np.concatenate([noise[1] + first_rate, log.gyr])
    )
    found = tune(rested, "kalman", metric="inclination")
    assert found.fixed["gyr_noise"] == pytest.approx(1e-3 * np.sqrt(0.02), rel=0.1)
    assert "gyr_noise from the Allan deviation" in " ".join(found.notes)
    assert "gyr_noise" in found.settings["kalman"]


def test_the_search_finds_a_valley_between_the_points_of_the_grid():
    target = np.log([0.37, 6.1])
    low, high = np.log([1e-3, 1e-3]), np.log([1e3, 1e3])

    def value(points):
        across = points - target
        return across[:, 0] ** 2 + 5.0 * (across[:, 1] - 0.8 * across[:, 0]) ** 2

    points = coarse(low, high)
    best = points[np.argmin(value(points))]
    found, least = refine(value, best, float(value(points).min()), low, high, np.array([0.6, 0.6]))
    assert least < 2e-3
    np.testing.assert_allclose(found, target, atol=0.03)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"filter_name": "triad"}, "no gains|no setting"),
        ({"filter_name": "mahoni"}, "unknown"),
        ({"filter_name": "mahony", "gains": ("k_q",)}, "no setting 'k_q'"),
        ({"filter_name": "kalman", "gains": ("adaptive",)}, "is 0 by default"),
        ({"filter_name": "mahony", "map_of": ("k_p", "k_1")}, "the map is over gains"),
        ({"filter_name": "mahony", "horizon": 0.0}, "not a time for a prediction"),
        ({"filter_name": "complementary", "fixed": {"time_constant": 1.0}}, "no gain remains to tune"),
    ],
)
def test_what_cannot_be_tuned_is_refused(log, arguments, said):
    with pytest.raises(InputError, match=said):
        tune(log, **arguments)


def test_a_log_without_what_it_takes_is_refused(log):
    with pytest.raises(InputError, match="no reference"):
        tune(replace(log, ref_q=None), "mahony", by="error")
    with pytest.raises(InputError, match="needs gyr"):
        tune(replace(log, gyr=None), "mahony")
    with pytest.raises(InputError, match="no rows count"):
        tune(replace(log, covariates={"movement": np.zeros(log.n)}), "mahony")


def test_results_come_as_json_frame_and_figure(tuned):
    value = json.loads(json.dumps(tuned.to_dict(), allow_nan=False))
    assert set(value["gains"]) == {"k_p", "k_i"}
    assert np.shape(value["map"]["values_deg"]) == (17, 17)
    assert len(tuned.to_dataframe()) == 2 * 65
    assert len(tuned.plot().axes) == 3
    assert "held out" in str(tuned)


def test_command_writes_settings_that_a_replay_takes(capsys, tmp_path):
    path, toml = tmp_path / "log.parquet", tmp_path / "gains.toml"
    handheld(duration=10.0).write(path)
    arguments = ("tune", path, "--filter", "mahony", "--gain", "k_p", "--set", "mahony.k_i=0.2", "-o", toml)
    code, out, err = run(capsys, *arguments, "--plot", tmp_path / "map.png", "--json", "-")
    assert (code, err) == (0, [])
    value = strict_json(out)
    assert read_settings(toml) == {"mahony": {"k_i": 0.2, "k_p": pytest.approx(value["gains"]["k_p"]["tuned"])}}
    assert (tmp_path / "map.png").stat().st_size > 0
    code, out, err = run(capsys, "replay", path, "--filter", "mahony", "--settings", toml, "--json", "-")
    assert (code, err) == (0, [])
    assert strict_json(out)["filters"]["mahony"]["total_deg"] == pytest.approx(value["value_deg"]["tuned"], rel=1e-9)
    code, out, err = run(capsys, "tune", path, "--filter", "mahony", "--gain", "k_p")
    assert (code, err) == (0, [])
    assert "within 5 %" in out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "Missing option '--filter'"),
        (("--filter", "mahonny"), "did you mean mahony"),
        (("--filter", "mahony", "--gain", "q"), "no setting 'q'"),
        (("--filter", "mahony", "-o", "gains.txt"), "must end in .toml"),
    ],
)
def test_wrong_arguments_are_told_in_one_line(capsys, tmp_path, arguments, said):
    path = tmp_path / "log.parquet"
    handheld(duration=2.0).write(path)
    code, out, err = run(capsys, "tune", path, *arguments)
    assert (code, out, len(err)) == (2, "", 1)
    assert said in err[0]
