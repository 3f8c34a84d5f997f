"""Fitting: parameters come back, their errors are honest, models keep what they know, unusable logs are refused."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from engine import swaying
from imufit import InputError, Log, SensorModel, ladder
from imufit.lab import simulate
from imufit.lab.simulate import Noise, SensorNoise
from scipy.spatial.transform import Rotation

FIRST_EFFECTS = [
    "acc.bias", "acc.scale", "acc.misalignment", "acc.lever_arm", "acc.bias_temperature",
    "acc.scale_temperature", "gyr.bias", "gyr.scale", "gyr.misalignment", "gyr.g_sensitivity", "gyr.bias_temperature",
    "gyr.scale_temperature", "mag.hard_iron", "mag.soft_iron", "mag.bias_temperature", "mag.scale_temperature",
    "mag.field_reference", "ref.alignment", "ref.delay", "acc.column:vbat", "gyr.column:motor_current",
    "mag.column:vbat", "acc.bias_drift", "gyr.bias_drift", "acc.quadratic", "acc.cubic", "gyr.quadratic", "gyr.cubic",
    "gyr.scale_asymmetry", "gyr.earth_rate", "mag.current", "acc.delay", "gyr.delay", "mag.delay", "acc.lowpass",
    "gyr.lowpass", "gyr.warmup",
]  # fmt: skip


@pytest.mark.parametrize("effect", FIRST_EFFECTS)
def test_the_parameters_of_each_effect_come_back(effect):
    sim = simulate.simulate("handheld", {effect: None}, 3, 60.0, size="large")
    fit = SensorModel([effect]).fit(sim.to_log())
    truth = sim.truth.effects[effect]
    assert {p.name for p in fit.parameters} == set(truth)
    for p in fit.parameters:
        assert p.standard_error > 0.0
        assert abs(p.value - truth[p.name]) < 4.0 * p.standard_error, str(p)
    assert fit.ratio == pytest.approx(1.0, abs=0.05)
    assert fit.training_ratio <= fit.ratio


COLOURED = Noise(
    acc=SensorNoise(0.02, coloured=0.01, correlation_time=0.3),
    gyr=SensorNoise(8.7e-4, coloured=5e-4, correlation_time=0.3),
)


def test_standard_errors_cover_the_truth():
    effects = {"gyr.bias": None, "acc.scale": None}
    z = []
    for seed in range(60):
        noise = (Noise(), COLOURED)[seed % 2]
        sim = simulate.simulate(
            "handheld", effects, seed, 12.0, size=1.0, noise=noise, sensors=("acc", "gyr"), noise_in_metadata=False
        )
        for p in SensorModel(list(effects)).fit(sim.to_log()).parameters:
            z.append((p.value - sim.truth.effects[p.effect][p.name]) / p.standard_error)
    for half in (z, [v for k in range(0, 60, 2) for v in z[6 * k : 6 * k + 6]]):
        assert 0.90 <= np.mean(np.abs(half) < 2.0) <= 0.99
        assert abs(np.mean(half)) < 4.0 / np.sqrt(len(half))


def test_a_nonlinear_effect_is_iterated_to_its_minimum():
    truth = {"ref.alignment": {"x": 0.15, "y": -0.1, "z": 0.2}, "ref.delay": {"tau": 0.03}}
    sim = simulate.simulate("handheld", truth, 1, 60.0)
    fit = SensorModel(list(truth)).fit(sim.to_log())
    for p in fit.parameters:
        assert abs(p.value - truth[p.effect][p.name]) < 4.0 * p.standard_error, str(p)
    assert fit.ratio == pytest.approx(1.0, abs=0.05)


def test_starting_from_the_answer_changes_nothing():
    log = simulate.simulate("arm", {"ref.alignment": None, "gyr.scale": None}, 1, 60.0, size="large").to_log()
    fit = SensorModel(["ref.alignment", "gyr.scale"]).fit(log)
    again = fit.model.fit(log)
    for a, b in zip(fit.parameters, again.parameters, strict=True):
        assert abs(a.value - b.value) < 0.1 * a.standard_error


def test_the_order_of_the_effects_does_not_matter():
    effects = ["acc.bias", "ref.alignment", "gyr.scale", "acc.scale"]
    log = simulate.simulate("handheld", dict.fromkeys(effects), 1, 30.0, size="large").to_log()
    one = {(p.effect, p.name): p for p in SensorModel(effects).fit(log).parameters}
    other = {(p.effect, p.name): p for p in SensorModel(effects[::-1]).fit(log).parameters}
    for key, p in one.items():
        assert abs(p.value - other[key].value) < 0.01 * p.standard_error


CHANGES = {"ENU": [[0, 1, 0], [1, 0, 0], [0, 0, -1]], "NWU": [[1, 0, 0], [0, -1, 0], [0, 0, -1]]}


@pytest.mark.parametrize("frame", CHANGES)
@pytest.mark.parametrize("effect", ["acc.bias", "ref.alignment", "acc.lever_arm", "mag.field_reference"])
def test_the_same_motion_in_another_frame_gives_the_same_answer(frame, effect):
    ned = simulate.simulate("handheld", {effect: None}, 2, 40.0, size="large").to_log()
    change = np.array(CHANGES[frame], float)
    reference = Rotation.from_matrix(change) * ned.reference
    metadata = replace(ned.metadata, frame=frame, mag_reference=tuple(change @ ned.metadata.mag_reference))
    other = replace(ned.with_reference(reference), ref_p=ned.ref_p @ change.T, metadata=metadata)
    a, b = SensorModel([effect]).fit(ned), SensorModel([effect]).fit(other)
    assert a.ratio == pytest.approx(b.ratio, rel=1e-9)
    values, others = ([p.value for p in fit.parameters] for fit in (a, b))
    if effect == "mag.field_reference":  # the only one whose parameters are a vector of the reference frame
        values = change @ values
    np.testing.assert_allclose(values, others, rtol=0.0, atol=1e-6 * max(p.standard_error for p in a.parameters))
    assert [c.effect for c in a.diagnose().candidates[:4]] == [c.effect for c in b.diagnose().candidates[:4]]


def test_a_model_comes_back_from_its_file(tmp_path):
    sim = simulate.simulate(
        "handheld",
        {"gyr.bias_temperature": None, "acc.column:vbat": None, "ref.delay": None},
        1,
        40.0,
        size="large",
        covariates=("motor_current",),
    )
    fit = SensorModel(list(sim.truth.effects)).fit(sim.to_log())
    fit.save(tmp_path / "model.toml")
    model = SensorModel.load(tmp_path / "model.toml")
    assert model.effects == fit.model.effects
    assert model.parameters == fit.model.parameters
    assert model.standard_errors == fit.model.standard_errors
    assert model.constants == fit.model.constants
    assert model.constants["temperature_mean"] == pytest.approx(np.mean(sim.temp), abs=1e-9)
    assert model.constants["covariate_means"] == {"vbat": pytest.approx(np.mean(sim.covariates["vbat"]), abs=1e-9)}


@pytest.fixture
def model_file(tmp_path):
    path = tmp_path / "model.toml"
    SensorModel(["gyr.bias"], {"gyr.bias": {"x": 0.01}}).save(path)
    assert tomllib.loads(path.read_text())["kind"]
    return path


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("rad/s", "deg/s", "gyr.bias x is in deg/s, not in rad/s"),
        ("imufit sensor model", "recipe", "kind is 'recipe'"),
        ("format = 1", "format = 99", "format 99 is not known"),
        ("gyr.bias", "gyr.bios", "unknown effect gyr.bios.*Did you mean gyr.bias"),
        ("x = 0.01", "w = 0.01", "gyr.bias has no parameter w.*x, y, z"),
        ("x = 0.01", 'x = "much"', "gyr.bias x is 'much', not a finite number"),
        ("x = 0.01", "x = ", "not valid TOML"),
        ("x = 0.01", "x = nan", "gyr.bias x is nan"),
    ],
)
def test_a_model_file_that_cannot_be_is_refused_with_its_name(model_file, old, new, problem):
    text = model_file.read_text()
    assert old in text
    model_file.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=rf"^model\.toml.*{problem}"):
        SensorModel.load(model_file)


def test_a_missing_model_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"^nothing\.toml: the model cannot be read"):
        SensorModel.load(tmp_path / "nothing.toml")


@pytest.mark.parametrize(
    ("effects", "parameters", "problem"),
    [
        (["gyr.bias", "gyr.bias"], None, "twice"),
        ("gyr.bias", None, "Pass a list"),
        (["gyr.bais"], None, "Did you mean gyr.bias"),
        (["gyr.bias"], {"gyr.scale": {"x": 1.0}}, "gyr.scale, which is not in the model"),
    ],
)
def test_a_model_that_cannot_be_is_refused(effects, parameters, problem):
    with pytest.raises(InputError, match=problem):
        SensorModel(effects, parameters)


def two_days(effect: str = "gyr.bias_temperature"):
    """The same sensor on a cool and on a warm day."""
    cool = simulate.simulate("handheld", {effect: None}, 1, 60.0, size="large")
    c = np.array(list(cool.truth.effects[effect].values()))
    warm = cool.to_log()
    # The zero of the simulated effect is at the mean temperature of its own log.
    warm = replace(warm, temp=warm.temp + 15.0, gyr=warm.gyr + 15.0 * c)
    return cool.to_log(), warm


def test_the_temperature_a_model_was_fitted_at_holds_for_other_logs(tmp_path):
    cool, warm = two_days()
    fit = SensorModel(["gyr.bias", "gyr.bias_temperature"]).fit(cool)
    assert fit.compare(warm).sensors["gyr"] == pytest.approx(1.0, abs=0.05)
    fit.save(tmp_path / "model.toml")
    stored = SensorModel.load(tmp_path / "model.toml")
    assert stored.constants["temperature_mean"] == pytest.approx(np.mean(cool.temp))
    fit.model.constants.clear()
    assert fit.compare(warm).sensors["gyr"] > 1.5


def test_a_mean_temperature_of_zero_is_stored_as_well(tmp_path):
    cool, _ = two_days()
    cool = replace(cool, temp=np.round(cool.temp - np.mean(cool.temp)))
    cool.temp[-1] -= cool.temp.sum()
    fit = SensorModel(["gyr.bias_temperature"]).fit(cool)
    fit.save(tmp_path / "model.toml")
    assert SensorModel.load(tmp_path / "model.toml").constants["temperature_mean"] == 0.0


def test_comparing_with_another_log_keeps_the_parameters():
    made = simulate.simulate("handheld", {"gyr.bias": {"x": 0.02, "y": 0.0, "z": 0.0}}, 1, 40.0)
    fit = SensorModel(["gyr.bias"]).fit(made.to_log())
    other = simulate.simulate("handheld", {"gyr.bias": {"x": 0.05, "y": 0.0, "z": 0.0}}, 2, 40.0).to_log()
    before = dict(fit.model.parameters)
    found = fit.compare(other)
    means = {c.channel: c.mean for c in found.channels}
    assert means["gyr_x"] == pytest.approx(0.03, abs=2e-4)
    assert means["gyr_y"] == pytest.approx(0.0, abs=2e-4)
    assert fit.model.parameters == before
    assert found.n == other.n


@pytest.mark.parametrize(
    ("spoil", "problem"),
    [
        (lambda log: log.rows(0, 150), "150 rows are too few for a fit.*at least 200"),
        (lambda log: replace(log, ref_q=None, ref_p=None), "gyr.bias.* no reference attitude"),
        (lambda log: replace(log, ref_q=np.full_like(log.ref_q, np.nan)), "gyr.bias.* no reference attitude"),
        (
            lambda log: replace(log, acc=None, gyr=None, mag=None, covariates={"AccX": log.acc[:, 0]}),
            "no sensor of the log has a sample. Name the columns .*mapping=.*The columns are AccX",
        ),
        (
            lambda log: replace(log, acc=np.full_like(log.acc, np.nan), gyr=None, mag=None),
            "no sensor of the log has a sample",
        ),
        (
            lambda log: replace(log, ref_q=np.where(np.arange(log.n)[:, None] < 5, log.ref_q, np.nan)),
            "too few samples have a reference around them",
        ),
        (
            lambda log: replace(log, gyr=np.where(np.arange(log.n)[:, None] < 5, log.gyr, np.nan)),
            "gyr.bias cannot be fitted: too few samples of gyr",
        ),
    ],
    ids=[
        "short",
        "no reference",
        "reference all missing",
        "no sensor",
        "sensor all missing",
        "5 references",
        "5 samples",
    ],
)
def test_a_log_that_cannot_be_fitted_is_refused_in_words(spoil, problem):
    log = spoil(swaying(duration=20.0, noise=1.0))
    with pytest.raises(InputError, match=problem):
        SensorModel(["gyr.bias"]).fit(log)
    if "gyr" not in problem:
        with pytest.raises(InputError, match=problem):
            ladder(log)


def test_a_moving_log_without_reference_is_judged_by_the_length_of_the_field_alone():
    log = replace(swaying(duration=20.0, noise=1.0), ref_q=None, ref_p=None)
    answer = ladder(log).diagnosis
    assert {each.sensor: each.judged for each in answer.judged} == {"acc": False, "gyr": False, "mag": True}
    assert answer.sentence.startswith("mag: nothing missing; acc, gyr: not judged")


def test_an_effect_on_a_sensor_without_samples_cannot_be_fitted():
    log = swaying(duration=20.0, noise=1.0)
    log = replace(log, acc=np.full_like(log.acc, np.nan))
    with pytest.raises(InputError, match=r"acc\.bias cannot be fitted: the log has no accelerometer"):
        SensorModel(["acc.bias"]).fit(log)
    assert SensorModel(["gyr.bias"]).fit(log).ratio == pytest.approx(1.0, abs=0.05)


def test_an_effect_of_a_column_that_the_log_has_not_cannot_be_fitted():
    with pytest.raises(InputError, match=r"gyr\.column:fan cannot be fitted: the log has no column fan"):
        SensorModel(["gyr.column:fan"]).fit(swaying(duration=20.0, noise=1.0))
    with pytest.raises(InputError, match=r"gyr\.bias_temperature cannot be fitted: the log has no column temp"):
        SensorModel(["gyr.bias_temperature"]).fit(swaying(duration=20.0, noise=1.0))


def test_a_column_that_is_known_only_now_and_then_is_not_used():
    log = simulate.simulate("handheld", {}, 1, 40.0, covariates=("vbat",)).to_log()
    log.covariates["vbat"][:2000] = np.nan
    with pytest.raises(InputError, match=r"gyr\.column:vbat cannot be fitted: column vbat is known in only .. %"):
        SensorModel(["gyr.column:vbat"]).fit(log)


def test_an_unknown_field_is_estimated_and_fitted_along():
    known = simulate.simulate("handheld", {"mag.hard_iron": None}, 1, 60.0, size="large")
    metadata = {k: v for k, v in known.metadata.items() if k != "mag_reference"}
    log = replace(known.to_log(), metadata=type(known.to_log().metadata).from_mapping(metadata))
    fit = SensorModel(["mag.hard_iron"]).fit(log)
    for p in fit.parameters:
        assert abs(p.value - known.truth.effects["mag.hard_iron"][p.name]) < 4.0 * p.standard_error
    assert "mag.field_reference" not in fit.model.effects
    assert "mag.field_reference" not in {c.effect for c in fit.diagnose().candidates}
    assert any("field was estimated" in note for note in fit.compare().notes)


def carried(iron: np.ndarray, gain: np.ndarray, seed: int) -> Log:
    """Return readings of a phone that is carried about and hardly tilted, beside a magnet, in an unknown field."""
    t = np.arange(0.0, 60.0, 0.02)
    rng = np.random.default_rng(seed)

    def attitude(t: np.ndarray) -> Rotation:
        tilts = (np.deg2rad(20.0) * np.sin(2.0 * np.pi * f * t + seed) for f in (0.23, 0.31))
        return Rotation.from_euler("ZYX", np.transpose([0.9 * t, *tilts]))

    turned, step = attitude(t), 1e-5
    rates = (attitude(t - step).inv() * attitude(t + step)).as_rotvec() / (2.0 * step)
    field = turned.inv().apply([0.0, 21.0, -43.0])
    return Log.from_arrays(
        t,
        acc=turned.inv().apply([0.0, 0.0, 9.80665]) + 0.02 * rng.standard_normal((t.size, 3)),
        gyr=rates + 0.002 * rng.standard_normal((t.size, 3)),
        mag=field @ gain.T + iron + 0.3 * rng.standard_normal((t.size, 3)),
        ref_q=turned.as_quat(scalar_first=True),
        frame="ENU",
    )


def test_a_strong_magnet_in_an_unknown_field_is_not_charged_to_the_gain():
    # The mean reading in the reference frame is mostly the magnet's: it must not be believed as the field.
    iron, gain = np.array([60.0, -75.0, 410.0]), np.eye(3) + np.array([[0.0, 0.03, 0.0], [0.0] * 3, [0.04, 0.0, 0.0]])
    logs = [carried(iron, gain, seed) for seed in (1, 2)]
    params = SensorModel(["mag.hard_iron", "mag.soft_iron"]).fit(logs).params
    for axis, truth in zip("xyz", iron, strict=True):
        p = params[f"mag.hard_iron.{axis}"]
        assert abs(p.value - truth) < 3.0 * p.stderr
        assert p.stderr < 10.0
    for row in range(3):
        for column in range(3):
            p = params[f"mag.soft_iron.{'xyz'[row]}{'xyz'[column]}"]
            assert abs(p.value - (gain[row, column] - (row == column))) < min(3.0 * p.stderr, 0.1)


@pytest.mark.parametrize("hidden", [["mag.hard_iron"], ["mag.hard_iron", "mag.soft_iron"]])
def test_what_acts_on_an_unknown_field_acts_on_the_true_one(hidden):
    # Columns of delays, mounts and gains follow from the field: a magnet in it would make them seven times too large.
    gain = np.eye(3) + 0.04 * np.eye(3)[[1, 2, 0]] * ("mag.soft_iron" in hidden)
    found = ladder(carried(np.array([60.0, -75.0, 410.0]), gain, 3))
    assert [step.effect for step in found.steps] == hidden
    assert found.verdict == "adequate"
    assert found.ratio_end == pytest.approx(1.0, abs=0.02)


def test_the_result_of_a_fit_is_json():
    fit = SensorModel(["gyr.bias"]).fit(swaying(duration=20.0, noise=1.0))
    found = json.loads(json.dumps(fit.to_dict(), allow_nan=False))
    assert found.keys() >= {"model", "parameters", "ratio", "training_ratio", "n"}
    assert found["parameters"]["gyr.bias"].keys() == {"x", "y", "z"}
    assert found["parameters"]["gyr.bias"]["x"].keys() >= {"value", "standard_error", "unit"}


def test_progress_is_told_of_every_row():
    log = swaying(duration=20.0, noise=1.0)
    told = []
    SensorModel(["gyr.bias"]).fit(log, progress=lambda done, rows, label: told.append((done, rows, label)))
    assert {rows for _, rows, _ in told} == {log.n}
    assert max(done for done, _, _ in told) == log.n
    assert all(label for _, _, label in told)


def test_a_log_on_disk_gives_the_answer_of_the_log_in_memory(tmp_path):
    from imufit import LogStream

    log: Log = swaying(duration=20.0, noise=1.0)
    log.write(tmp_path / "log.parquet")
    a = SensorModel(["gyr.bias"]).fit(log)
    b = SensorModel(["gyr.bias"]).fit(LogStream(tmp_path / "log.parquet"))
    assert a.to_dict() == b.to_dict()


def test_a_model_is_compared_as_it_is():
    log = simulate.simulate("handheld", {"gyr.bias": {"x": 0.05, "y": 0.0, "z": 0.0}}, 1, 40.0).to_log()
    model = SensorModel(["gyr.bias"], {"gyr.bias": {"x": 0.02}})
    seen = {channel.channel: channel.mean for channel in model.compare(log).channels}
    assert seen["gyr_x"] == pytest.approx(0.03, abs=1e-4)
    assert seen["gyr_y"] == pytest.approx(0.0, abs=1e-4)


def test_chance_is_not_said_to_depend_on_anything():
    logs = [simulate.simulate("handheld", {}, seed, 40.0).to_log() for seed in range(5)]
    assert sum(len(SensorModel().compare(log).where) for log in logs) <= 2


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('[constants]\ntemperature_mean = "warm"', "the mean of the temperature is 'warm', not a finite number"),
        ('[constants.covariate_means]\nvbat = "full"', "the mean of vbat is 'full', not a finite number"),
        ("[constants]\ncovariate_means = 3", "constants.covariate_means is 3, not a table"),
        ('[standard_errors."gyr.bias"]\nx = "small"', "the standard error of gyr.bias x is 'small', not a number"),
        ("[standard_errors]\nx = 3", 'standard_errors."x" is 3, not a table'),
        ("[[extra]]\n[units]\n'gyr.bias' = 3", 'units."gyr.bias" is 3, not a table'),
        ("[parameters]\n'gyr.bias' = 3", 'parameters."gyr.bias" is 3, not a table'),
        ("[parameters.'gyr.bias']\nx = 1e308", "gyr.bias x is 1e+308, not a finite number"),
        (f"[parameters.'gyr.bias']\nx = 1{'0' * 400}", "x is an integer of more than 64 bits"),
        (f"x = {'[' * 5000}{']' * 5000}", "stand within one another"),
    ],
)
def test_text_and_tables_in_place_of_a_model_files_numbers_are_refused(tmp_path, line, words):
    path = tmp_path / "model.toml"
    path.write_text(f'kind = "imufit sensor model"\nformat = 1\neffects = ["gyr.bias"]\n{line}\n')
    with pytest.raises(InputError) as caught:
        SensorModel.load(path)
    assert str(caught.value).startswith("model.toml: ")
    assert words in str(caught.value)
