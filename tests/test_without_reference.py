"""Logs without a reference attitude: what rests, turns and the length of the field tell, and what they cannot."""

from dataclasses import replace

import numpy as np
import pytest
from cli_stand_in import run, strict_json
from imufit import Log, SensorModel, compare, effect, ladder, open_log
from imufit.errors import InputError
from imufit.lab import simulate
from imufit.model.effect import forget
from pasted import python_mappings


def bare(made) -> Log:
    """Log of a simulation without its reference."""
    return Log.from_arrays(
        made.t, acc=made.acc, gyr=made.gyr, mag=made.mag, temp=made.temp, covariates=made.covariates, **made.metadata
    )


def poses(effects=None, seed=0, duration=120.0, **options) -> Log:
    return bare(simulate.simulate("poses", effects, seed, duration, **options))


def named(diagnosis) -> set[str]:
    return {diagnosis.best, *diagnosis.ambiguous_with} - {None}


@pytest.mark.parametrize(
    ("hidden", "alone"),
    [
        ("acc.bias", True),
        ("acc.scale", True),
        ("gyr.bias", True),
        ("gyr.bias_temperature", True),
        ("gyr.scale", True),
        ("gyr.g_sensitivity", True),
        ("gyr.quadratic", False),
        ("mag.hard_iron", True),
    ],
)
def test_hidden_effect_is_named(hidden, alone):
    made = simulate.simulate("poses", {hidden: None}, seed=11)
    diagnosis = SensorModel().fit(bare(made)).diagnose()
    assert diagnosis.evidence == "rests"
    assert hidden in named(diagnosis)
    assert diagnosis.verdict == "missing" or not alone
    candidate = next(c for c in diagnosis.candidates if c.effect == hidden)
    for parameter in candidate.parameters:
        off = parameter.value - made.truth.effects[hidden][parameter.name]
        assert abs(off) < 5.0 * parameter.standard_error
    assert candidate.held_out_after < min(1.1, candidate.held_out_before)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("realistic", [False, True], ids=["white noise", "coloured noise and random walk"])
def test_nothing_hidden_is_adequate(seed, realistic):
    diagnosis = SensorModel().fit(poses(seed=seed, realistic=realistic)).diagnose()
    assert diagnosis.verdict == "adequate"
    assert "without a reference" in diagnosis.sentence


def test_columns_of_the_log_are_asked_as_well():
    made = poses(seed=3, covariates=["vbat"])
    shift = 4e-3 * (made.covariates["vbat"] - np.mean(made.covariates["vbat"])) / np.std(made.covariates["vbat"])
    diagnosis = SensorModel().fit(replace(made, gyr=made.gyr + shift[:, None] * [1.0, -1.0, 0.5])).diagnose()
    assert diagnosis.best == "gyr.column:vbat"


def test_fit_undoes_the_model_before_lengths_are_taken():
    # Five per cent of scale leave a quarter of a per cent if readings are taken for what they measure.
    truth = {
        "acc.bias": {"x": 0.3, "y": -0.2, "z": 0.25},
        "acc.scale": {"x": 0.05, "y": -0.04, "z": 0.03},
        "gyr.bias": {"x": 0.02, "y": -0.03, "z": 0.01},
        "gyr.scale": {"x": 0.04, "y": -0.03, "z": 0.05},
    }
    fit = SensorModel(list(truth)).fit(poses(truth, seed=4))
    for parameter in fit.parameters:
        assert abs(parameter.value - truth[parameter.effect][parameter.name]) < 5.0 * parameter.standard_error
        assert parameter.standard_error < 3e-3
    assert fit.ratio < 1.1
    assert fit.diagnose().verdict == "adequate"


def test_an_effect_is_added_from_rests_alone():
    fit = SensorModel().fit(poses({"gyr.bias": {"x": 0.02, "y": 0.01, "z": -0.01}}, seed=5))
    addition = fit.add("gyr.bias")
    assert addition.after < 1.1 < addition.before
    assert addition.after == pytest.approx(addition.expected, rel=0.02)


def test_what_only_a_reference_shows_is_said():
    diagnosis = SensorModel().fit(poses(seed=6)).diagnose()
    untestable = {c.effect: c for c in diagnosis.candidates if c.status == "not testable here"}
    for effect_id in ("acc.delay", "gyr.lowpass", "acc.lever_arm", "ref.tilt", "ref.alignment", "ref.delay"):
        assert "needs a reference attitude" in untestable[effect_id].explanation
    said = " ".join(diagnosis.notes)
    assert "rests in" in said
    assert "turns from rest to rest" in said
    assert "acc.delay" in said


def test_earth_rate_needs_a_heading():
    with_field = SensorModel().fit(poses(seed=7)).diagnose()
    without = SensorModel().fit(poses(seed=7, sensors=["acc", "gyr"])).diagnose()
    status = {c.effect: c.status for c in with_field.candidates}
    assert status["gyr.earth_rate"] != "not testable here"
    assert {c.effect: c.status for c in without.candidates}["gyr.earth_rate"] == "not testable here"


@pytest.fixture
def cross_product():
    """An effect that a user wrote, taken out of the catalogue afterwards."""

    @effect("acc.cross_product", sensor="acc", parameters={"k": "1/(m/s^2)"}, typical=1e-4)
    def product(w, k):
        return np.outer(w.f[:, 1] * w.f[:, 2], [k, 0.0, 0.0])

    yield product
    forget("acc.cross_product")


@pytest.mark.usefixtures("cross_product")
def test_users_effect_goes_the_same_way():
    log = poses(seed=8)
    k = 1e-3
    x, y, z = log.acc.T
    diagnosis = SensorModel().fit(replace(log, acc=np.column_stack([x + k * y * z, y, z]))).diagnose()
    assert diagnosis.best == "acc.cross_product"
    (parameter,) = diagnosis.best_candidate.parameters
    assert abs(parameter.value - k) < 3.0 * parameter.standard_error < 0.2 * k


def test_too_few_rests_are_refused_with_a_remedy(capsys, tmp_path):
    log = poses(seed=9, duration=25.0, sensors=["acc", "gyr"])
    with pytest.raises(InputError, match=r"no reference attitude.*too few rests.*at least 8 attitudes"):
        SensorModel().fit(log)
    path = tmp_path / "short.parquet"
    log.write(path)
    code, out, err = run(capsys, "diagnose", path)
    assert (code, out) == (2, "")
    assert len(err) == 1


@pytest.mark.parametrize("stream", [True, False])
def test_a_quaternion_beside_the_readings_is_offered_as_the_reference(stream, tmp_path):
    made = simulate.simulate("poses", {}, 9, 120.0).to_log()
    known = dict(zip(("qw", "qx", "qy", "qz"), made.ref_q.T, strict=True))
    path = tmp_path / "a.csv"
    made.with_fields(ref_q=None, ref_p=None, covariates=known).write(path)
    notes = compare(open_log(path, stream=stream)).notes
    (offer,) = [note for note in notes if "If qw, qx, qy, qz were measured, not computed" in note]
    (mapping,) = python_mappings(offer)
    log = open_log(path, mapping, stream=stream)
    assert compare(log).n == made.n
    # what the file cannot be read without stands in the mapping too
    other = tmp_path / "b.csv"
    path.write_text(path.read_text().replace("acc_", "first_").replace("gyr_", "second_"))
    path.rename(other)
    stated = {
        f"{sensor}_{axis}": f"{name}_{axis}" for sensor, name in (("acc", "first"), ("gyr", "second")) for axis in "xyz"
    }
    (offer,) = [note for note in compare(open_log(other, stated, stream=stream)).notes if "If qw, qx, qy, qz" in note]
    (mapping,) = python_mappings(offer)
    assert mapping.items() >= stated.items()
    assert compare(open_log(other, mapping, stream=stream)).n == made.n


def test_field_alone_is_judged_where_rests_are_too_few():
    made = simulate.simulate("handheld", {"mag.hard_iron": {"x": 8.0, "y": -5.0, "z": 3.0}}, 10, 60.0, sensors=["mag"])
    diagnosis = SensorModel().fit(bare(made)).diagnose()
    assert diagnosis.best == "mag.hard_iron"


def test_field_of_a_sensor_that_hardly_turns_is_no_evidence():
    log = poses(seed=1)
    still = replace(log, mag=np.tile(log.mag[:1], (log.n, 1)) + np.random.default_rng(1).normal(0.0, 0.3, (log.n, 3)))
    diagnosis = SensorModel().fit(still).diagnose()
    assert not any(c.effect.startswith("mag") and c.status != "not testable here" for c in diagnosis.candidates)
    assert "hardly turned" in " ".join(diagnosis.notes)


def test_logs_with_and_without_a_reference_add_up():
    truth = {"gyr.scale": {"x": 0.01, "y": -0.01, "z": 0.008}}
    first = poses(truth, seed=12, duration=60.0)
    second = simulate.simulate("handheld", truth, 13, 30.0).to_log()
    diagnosis = SensorModel().fit([first, second]).diagnose()
    assert diagnosis.evidence == "reference and rests"
    assert diagnosis.best == "gyr.scale"


def test_command_says_what_it_rests_on(capsys, tmp_path):
    path = tmp_path / "log.parquet"
    poses({"acc.bias": None}, seed=1, duration=60.0).write(path)
    code, out, err = run(capsys, "diagnose", path, "--html", tmp_path / "page.html")
    assert (code, err) == (0, [])
    assert "The log has no reference attitude. It is judged by" in out
    assert "acc.bias is missing" in out
    assert "no reference attitude" in (tmp_path / "page.html").read_text()
    code, out, _ = run(capsys, "diagnose", path, "--json", "-")
    answer = strict_json(out)
    assert code == 0
    assert answer["evidence"] == "rests"


def test_a_comparison_shows_where_the_rests_fail(capsys, tmp_path):
    path, page = tmp_path / "log.parquet", tmp_path / "page.html"
    log = poses({"acc.scale": {"x": 0.0, "y": 0.0, "z": 0.03}}, seed=1, duration=120.0)
    log.write(path)
    code, out, _ = run(capsys, "compare", path, "--json", "-", "--html", page)
    assert code == 0
    found = strict_json(out)
    channels = found["channels"]
    assert set(channels) >= {"acc_norm", "turn", "gyr_x", "mag_norm"}
    assert channels["acc_norm"]["ratio"] > 10.0
    assert channels["gyr_x"]["ratio"] < 1.5
    # A rest with z along gravity is 3 % too long, one across gravity is not.
    named = [where["covariate"] for where in found["where"] if where["channel"] == "acc_norm"]
    assert next(name for name in named if name != "constant") == "f_z"
    assert found["attitude"] is None
    assert "acc_norm" in page.read_text()
    # The worst time is one at which z lay along gravity.
    begin, end, channel, _ = compare(log).segments[0]
    assert channel == "acc_norm"
    assert np.median(np.abs(log.acc[(log.t >= begin) & (log.t <= end), 2])) > 8.0


def test_rows_of_the_field_do_not_dilute_what_the_rests_show():
    """Every channel counts equally: the field stands in thousands of rows, the length at rest in a few dozen."""
    log = poses({"acc.scale": {"x": 0.0, "y": 0.0, "z": 0.03}}, seed=1)
    fit = SensorModel().fit(log)
    channels = compare(log).channels
    samples = {item.channel: item.n for item in channels}
    assert samples["mag_norm"] > 20 * samples["acc_norm"]
    assert fit.ratio == pytest.approx(np.sqrt(np.mean([item.ratio**2 for item in channels])), rel=0.1)


def test_the_ladder_climbs_on_rests():
    answer = ladder(poses({"gyr.bias": {"x": 0.02, "y": 0.01, "z": -0.01}}, seed=5))
    assert answer.model == ("gyr.bias",)
    assert answer.ratio_end < 1.1 < answer.ratio_start
    assert max(item.ratio for item in answer.comparison_start.channels) > 10.0
    assert max(item.ratio for item in answer.comparison_end.channels) < 2.0
