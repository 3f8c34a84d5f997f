"""Applying a model undoes what the simulator, which shares no code with it, did to the readings."""

import json
from dataclasses import replace

import numpy as np
import pytest
from engine import swaying
from imufit import InputError, Log, SensorModel, effect, read
from imufit.cli.app import main
from imufit.lab import simulate
from imufit.lab.simulate import Noise, SensorNoise
from imufit.model.catalogue import effects
from imufit.model.effect import forget

SILENT = SensorNoise(1e-15)
NOISE_FREE = Noise(acc=SILENT, gyr=SILENT, mag=SILENT, temperature=0.0)
SENSORS = ("acc", "gyr", "mag")


def simulated(wrong, *, noise=NOISE_FREE, rate=100.0, covariates=("motor_current",)) -> Log:
    return simulate.simulate("handheld", wrong, 3, 30.0, rate, noise=noise, covariates=covariates).to_log()


def model_of(log: Log, wrong) -> SensorModel:
    """The truth as a model, with the means of the log."""
    means = {name: float(np.nanmean(values)) for name, values in log.covariates.items()}
    constants = {"temperature_mean": float(np.nanmean(log.temp)), "covariate_means": means}
    return SensorModel(list(wrong), wrong, constants=constants)


def off(corrected: Log, truth: Log, edge: int = 0) -> dict[str, float]:
    """Largest difference of each sensor from the truth, `edge` rows at either end left out."""
    inner = slice(edge, corrected.n - edge)
    return {name: np.nanmax(np.abs(getattr(corrected, name) - getattr(truth, name))[inner]) for name in SENSORS}


@pytest.fixture
def user_effect():
    before = set(effects())
    yield effect
    for effect_id in set(effects()) - before:
        forget(effect_id)


XYZ = {"x": 0.02, "y": -0.03, "z": 0.01}
SIX = {"xy": 0.01, "xz": -0.02, "yx": 0.015, "yz": 0.005, "zx": -0.01, "zy": 0.02}
NINE = {**SIX, "xx": 0.03, "yy": -0.02, "zz": 0.01}
STACKS = [
    {"acc.bias": {"x": 0.3, "y": -0.2, "z": 0.1}},
    {"acc.scale": XYZ},
    {"acc.scale": {"x": -2.0, "y": 0.0, "z": 0.5}},
    {"acc.misalignment": SIX},
    {"gyr.g_sensitivity": {key: 0.1 * value for key, value in NINE.items()}},
    {"mag.soft_iron": NINE},
    {"acc.bias_temperature": XYZ, "gyr.bias_temperature": {"x": 0.003, "z": -0.002}, "mag.bias_temperature": XYZ},
    {f"{sensor}.scale_temperature": {"x": 0.002, "y": -0.003, "z": 0.001} for sensor in SENSORS},
    {
        "acc.bias_drift": {"x": 1e-3, "y": -2e-3, "z": 5e-4},
        "acc.quadratic": {"x": 1e-3, "y": -5e-4, "z": 2e-3},
        "acc.cubic": {"x": -1e-4, "y": 5e-5, "z": 2e-5},
        "mag.current": XYZ,
    },
    {
        "gyr.bias_drift": {"x": 1e-4, "y": -2e-4, "z": 5e-5},
        "gyr.quadratic": {"x": 2e-3, "y": -5e-3, "z": 1e-3},
        "gyr.cubic": {"x": -2e-3, "y": 1e-3, "z": 5e-4},
        "gyr.scale_asymmetry": {"x": 0.01, "y": -0.02, "z": 0.005},
    },
    {"mag.column:vbat": {"x": 1.0, "y": -2.0, "z": 0.5}},
    {
        "acc.bias": {"x": 0.3, "y": -0.2, "z": 0.1},
        "acc.scale": XYZ,
        "acc.misalignment": SIX,
        "gyr.bias": {"x": 0.02, "y": 0.01, "z": -0.03},
        "gyr.scale": {"x": -2.0, "y": 0.01, "z": -0.01},
        "gyr.g_sensitivity": {key: 0.1 * value for key, value in NINE.items()},
        "mag.hard_iron": {"x": 10.0, "y": -20.0, "z": 5.0},
        "mag.soft_iron": NINE,
        "mag.scale_temperature": XYZ,
    },
]


@pytest.mark.parametrize("wrong", STACKS, ids="+".join)
def test_what_the_simulator_did_is_undone(wrong):
    recorded, truth = simulated(wrong), simulated({}, covariates=("motor_current", "vbat"))
    corrected = model_of(recorded, wrong).apply(recorded)
    assert max(off(recorded, truth).values()) > 1e-3
    for name, difference in off(corrected, truth).items():
        assert difference < 1e-9, name
    assert corrected.notes == ()


def test_a_lever_arm_is_undone_with_the_rates_of_the_log():
    arm = {"acc.lever_arm": {"x": 0.05, "y": -0.1, "z": 0.03}}
    recorded, truth = simulated(arm, rate=200.0), simulated({}, rate=200.0)
    corrected = model_of(recorded, arm).apply(recorded)
    assert off(recorded, truth)["acc"] > 0.5
    assert off(corrected, truth, edge=4)["acc"] < 1e-4
    assert off(corrected, truth)["acc"] < 0.02
    assert corrected.gyr is recorded.gyr


def test_late_and_sluggish_readings_are_set_right_in_time():
    late = {"acc.delay": {"tau": 0.013}, "gyr.lowpass": {"tau": 0.02}, "mag.delay": {"tau": 0.007}, "acc.scale": XYZ}
    recorded, truth = simulated(late, rate=200.0), simulated({}, rate=200.0)
    before, after = off(recorded, truth, edge=20), off(model_of(recorded, late).apply(recorded), truth, edge=20)
    for name, least in zip(SENSORS, (0.5, 0.1, 0.5), strict=True):
        assert before[name] > least, name
        assert after[name] < 2e-3 * before[name], name


def test_sensors_that_read_each_other_come_to_rest():
    wrong = {
        "acc.lever_arm": {"x": 0.05, "y": -0.1, "z": 0.03},
        "acc.scale": XYZ,
        "gyr.bias": {"x": 0.02, "y": 0.01, "z": -0.03},
        "gyr.g_sensitivity": {key: 0.1 * value for key, value in NINE.items()},
    }
    recorded, truth = simulated(wrong, rate=200.0), simulated({}, rate=200.0)
    # The simulator lets the gyroscope feel the force at the body's origin, which is the corrected one.
    found = off(model_of(recorded, wrong).apply(recorded), truth, edge=20)
    assert found["acc"] < 1e-4
    assert found["gyr"] < 1e-6


def test_a_lever_arm_does_not_make_a_noisy_log_noisier():
    arm = {"acc.lever_arm": {"x": 0.05, "y": -0.05, "z": 0.03}}
    recorded, truth = simulated(arm, noise=Noise()), simulated({}, noise=NOISE_FREE)
    corrected = model_of(recorded, arm).apply(recorded)
    left = (corrected.acc - truth.acc)[10:-10]
    assert np.sqrt(np.mean(left**2)) < 1.1 * 0.02


@pytest.mark.parametrize("stage", ["offset", "gain", "input"])
def test_a_users_effect_is_undone_like_a_built_in_one(user_effect, stage):
    @user_effect("gyr.fan", parameters={"a": "1", "b": "1/(rad/s)"}, stage=stage)
    def fan(w, a, b):
        own = 0.1 * w.omega**2 if stage == "offset" else 0.1 * w.x**2
        return a * (w.column("motor_current")[:, None] + 0.01 * w.f) + b * own

    truth = simulated({})
    a, b = 0.02, 0.3
    added = a * (truth.covariates["motor_current"][:, None] + 0.01 * truth.acc) + b * 0.1 * truth.gyr**2
    recorded = replace(truth, gyr=truth.gyr + added)
    corrected = SensorModel(["gyr.fan"], {"gyr.fan": {"a": a, "b": b}}).apply(recorded)
    assert off(corrected, truth)["gyr"] < 1e-10


def test_missing_samples_stay_missing_and_no_other_becomes_so():
    wrong = {"mag.soft_iron": NINE, "gyr.g_sensitivity": {"xx": 0.002}, "acc.bias": XYZ}
    recorded, truth = simulated(wrong), simulated({})
    rows = np.arange(recorded.n)
    for log in (recorded, truth):
        log.mag[rows % 5 != 0] = np.nan
        log.acc[100:140] = np.nan
        log.gyr[200:210, 1] = np.nan
        log.temp[rows % 10 != 3] = np.nan
    corrected = model_of(recorded, wrong).apply(recorded)
    for name in SENSORS:
        assert np.array_equal(np.isnan(getattr(corrected, name)), np.isnan(getattr(truth, name))), name
    # Between 100 and 140 the gyroscope's effect is worked out from accelerations drawn straight across the gap.
    assert np.nanmax(np.abs(corrected.gyr - truth.gyr)[140:]) < 1e-9
    assert off(corrected, truth)["mag"] < 1e-9


def test_one_missing_axis_costs_only_those_that_read_it():
    recorded = simulated({"mag.soft_iron": {"xx": 0.1, "xy": 0.05, "zz": -0.1}})
    recorded.mag[50, 1] = np.nan
    corrected = SensorModel(["mag.soft_iron"], {"mag.soft_iron": {"xx": 0.1, "xy": 0.05, "zz": -0.1}}).apply(recorded)
    assert np.isnan(corrected.mag[50, :2]).all()
    assert corrected.mag[50, 2] == pytest.approx(recorded.mag[50, 2] / 0.9, rel=1e-12)
    assert corrected.notes == ("1 samples of mag are NaN now: what an effect reads besides is not known there",)


def test_a_slow_gyroscope_serves_a_fast_accelerometer():
    arm = {"acc.lever_arm": {"x": 0.05, "y": -0.1, "z": 0.03}}
    recorded, truth = simulated(arm, rate=200.0), simulated({}, rate=200.0)
    recorded.gyr[np.arange(recorded.n) % 2 != 0] = np.nan
    corrected = model_of(recorded, arm).apply(recorded)
    assert np.isfinite(corrected.acc).all()
    assert off(corrected, truth, edge=20)["acc"] < 1e-2


def test_everything_else_of_the_log_is_kept():
    recorded = simulated({"acc.bias": XYZ})
    recorded = replace(recorded, pose=np.array([None, "+z"] * (recorded.n // 2), dtype=object), notes=("as read",))
    corrected = SensorModel(["acc.bias"], {"acc.bias": XYZ}).apply(recorded)
    for name in ("t", "gyr", "mag", "temp", "ref_q", "ref_p", "pose", "covariates", "metadata", "notes"):
        assert getattr(corrected, name) is getattr(recorded, name) or getattr(corrected, name) == getattr(
            recorded, name
        )


def test_no_reference_is_needed_and_effects_of_the_reference_are_named_as_left_alone():
    recorded = replace(simulated({}), ref_q=None, ref_p=None)
    model = SensorModel(
        ["ref.delay", "mag.field_reference", "gyr.bias"],
        {"ref.delay": {"tau": 0.1}, "mag.field_reference": {"x": 5.0}, "gyr.bias": {"x": 0.1}},
    )
    corrected = model.apply(recorded)
    assert np.array_equal(corrected.mag, recorded.mag)
    assert np.allclose(corrected.gyr, recorded.gyr - [0.1, 0.0, 0.0], rtol=0, atol=1e-15)
    assert corrected.notes == (
        "ref.delay and mag.field_reference left unchanged: an effect of the reference, not of the readings",
    )


def test_temperatures_count_from_the_mean_of_the_fitted_log():
    log = simulated({})
    model = SensorModel(["acc.bias_temperature"], {"acc.bias_temperature": {"x": 0.1}})
    own = model.apply(log)
    assert "temperature_mean" in own.notes[0]
    assert np.mean(own.acc - log.acc) == pytest.approx(0.0, abs=1e-12)
    model.constants["temperature_mean"] = 0.0
    assert np.allclose(model.apply(log).acc[:, 0], log.acc[:, 0] - 0.1 * log.temp, rtol=0, atol=1e-12)


def without(log: Log, *names: str) -> Log:
    return replace(log, **dict.fromkeys(names))


@pytest.mark.parametrize(
    ("wrong", "gone", "problem"),
    [
        ({"acc.lever_arm": {"x": 0.1}}, ("gyr",), r"acc\.lever_arm .*: the log has no columns gyr_x gyr_y gyr_z"),
        ({"gyr.g_sensitivity": {"xx": 0.1}}, ("acc",), r"gyr\.g_sensitivity .*: the log has no columns acc_x"),
        ({"mag.scale_temperature": {"x": 0.1}}, ("temp",), r"mag\.scale_temperature .*: the log has no column temp"),
        ({"acc.column:fan": {"x": 0.1}}, (), r"acc\.column:fan .*: the log has no column fan"),
        ({"acc.bias": {"x": 1.0}, "acc.scale": {"y": -1.0}}, (), r"row 0: acc\.scale cannot be undone.*same reading"),
        ({"mag.soft_iron": {"xx": -0.5, "xy": 0.5, "yx": 0.5, "yy": -0.5}}, (), r"mag\.soft_iron cannot be undone"),
    ],
)
def test_what_cannot_be_undone_is_refused_by_name(wrong, gone, problem):
    log = without(simulated({}), *gone)
    with pytest.raises(InputError, match=problem):
        SensorModel(list(wrong), wrong).apply(log)


def test_a_users_effect_without_its_temperature_is_refused(user_effect):
    @user_effect("acc.warm", parameters={"k": "m/s^2/K"})
    def warm(w, k):
        return k * w.temperature

    model = SensorModel(["acc.warm"], {"acc.warm": {"k": 0.1}})
    with pytest.raises(InputError, match=r"acc\.warm cannot be undone: the log has no column temp"):
        model.apply(without(simulated({}), "temp"))


def test_a_reading_that_nothing_gives_is_refused_with_its_row(user_effect):
    @user_effect("acc.bent", parameters={"k": "1/(m/s^2)"}, stage="gain")
    def bent(w, k):
        return k * w.x**2

    log = simulated({})
    log.acc[77, 2] = -100.0
    with pytest.raises(InputError, match=r"row 77: acc\.bent cannot be undone: no input of the accelerometer gives"):
        SensorModel(["acc.bent"], {"acc.bent": {"k": 0.01}}).apply(log)


def test_a_users_exception_comes_out_as_it_went_in(user_effect):
    @user_effect("acc.bad", parameters={"k": "1"})
    def bad(w, k):
        raise RuntimeError("by hand")

    with pytest.raises(RuntimeError, match="by hand"):
        SensorModel(["acc.bad"], {"acc.bad": {"k": 1.0}}).apply(simulated({}))


def test_a_log_from_a_file_is_corrected_like_one_in_memory(tmp_path):
    import imufit

    log = swaying(duration=5.0)
    log.write(tmp_path / "log.parquet")
    model = SensorModel(["acc.scale"], {"acc.scale": XYZ})
    stream = imufit.open_log(tmp_path / "log.parquet")
    assert np.array_equal(model.apply(stream).acc, model.apply(log).acc)


def test_the_command_corrects_a_log_and_says_what_it_left_alone(tmp_path, capsys):
    wrong = {"acc.bias": XYZ, "gyr.scale": XYZ}
    recorded, truth = simulated(wrong), simulated({})
    model = SensorModel([*wrong, "ref.delay"], {**wrong, "ref.delay": {"tau": 0.01}})
    model.save(tmp_path / "m.toml")
    recorded.write(tmp_path / "in.parquet")
    arguments = ["apply", str(tmp_path / "m.toml"), str(tmp_path / "in.parquet"), "-o", str(tmp_path / "out.parquet")]
    assert main(arguments) == 0
    said = capsys.readouterr().out
    assert "ref.delay left unchanged" in said
    assert "wrote" in said
    assert max(off(read(tmp_path / "out.parquet"), truth).values()) < 1e-9
    assert main([*arguments, "--json", "-"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["n"] == recorded.n
    assert answer["model"] == [*wrong, "ref.delay"]
    assert answer["change"]["acc"]["rms"] == pytest.approx(np.linalg.norm(list(XYZ.values())) / np.sqrt(3.0), rel=1e-6)


def test_the_command_says_the_units_of_what_it_wrote(tmp_path, capsys):
    (tmp_path / "g.csv").write_text(
        "millis,ax,ay,az,gx,gy,gz\n" + "".join(f"{10 * k},0,0,1,{k % 3},0,90\n" for k in range(200))
    )
    SensorModel(["acc.bias"], {"acc.bias": {"x": 0.1, "y": 0.0, "z": 0.0}}).save(tmp_path / "m.toml")
    out = tmp_path / "o.csv"
    mapped = "t=millis[ms],acc_x=ax[g],acc_y=ay[g],acc_z=az[g],gyr_x=gx[deg/s],gyr_y=gy[deg/s],gyr_z=gz[deg/s]"
    assert main(["apply", str(tmp_path / "m.toml"), str(tmp_path / "g.csv"), "--map", mapped, "-o", str(out)]) == 0
    told = " ".join(capsys.readouterr().out.split()).partition("wrote ")[2]
    assert all(words in told for words in ("t in s", "acc in m/s^2", "gyr in rad/s"))
    written = np.genfromtxt(out, delimiter=",", names=True)
    assert written["t"][100] == pytest.approx(1.0)
    assert written["acc_z"][0] == pytest.approx(9.80665)
    assert written["gyr_z"][0] == pytest.approx(np.pi / 2.0)


def test_the_command_refuses_in_one_line(tmp_path, capsys):
    SensorModel(["acc.lever_arm"], {"acc.lever_arm": {"x": 0.1}}).save(tmp_path / "m.toml")
    without(simulated({}), "gyr").write(tmp_path / "in.parquet")
    assert main(["apply", str(tmp_path / "m.toml"), str(tmp_path / "in.parquet"), "-o", str(tmp_path / "o.csv")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "in.parquet" in said
    assert "gyr_x" in said
    assert main(["apply", str(tmp_path / "m.toml"), str(tmp_path / "in.parquet")]) == 2
    assert main(["apply", str(tmp_path / "m.toml"), "x.csv", "-o", str(tmp_path / "o.csv")]) == 2


def test_mount_of_the_sensor_is_turned_back_into_the_axes_of_the_body():
    mount = {"x": 0.05, "y": -0.1, "z": 0.2}
    silent = Noise(acc=SensorNoise(1e-12), gyr=SensorNoise(1e-12), mag=SensorNoise(1e-12))
    turned = simulate.simulate(
        "handheld", {"ref.alignment": mount, "acc.bias": {"x": 0.3}}, 3, 20.0, noise=silent
    ).to_log()
    straight = simulate.simulate("handheld", {}, 3, 20.0, noise=silent).to_log()
    model = SensorModel(["acc.bias", "ref.alignment"], {"ref.alignment": mount, "acc.bias": {"x": 0.3}})
    corrected = model.apply(turned)
    for sensor in ("acc", "gyr", "mag"):
        np.testing.assert_allclose(getattr(corrected, sensor), getattr(straight, sensor), atol=1e-9)
    assert any("ref.alignment" in note for note in corrected.notes)


def test_the_command_says_that_the_model_comes_first(tmp_path, capsys):
    SensorModel(["acc.bias"], {"acc.bias": XYZ}).save(tmp_path / "m.toml")
    (tmp_path / "log.csv").write_text("t,acc_x\n0,1\n1,2\n")
    swapped = ["apply", str(tmp_path / "log.csv"), str(tmp_path / "m.toml"), "-o", str(tmp_path / "o.csv")]
    assert main(swapped) == 2
    said = capsys.readouterr().err
    assert "log.csv" in said
    assert "The first argument must be the model" in said
    (tmp_path / "cut.toml").write_text("a = ")
    assert main(["apply", str(tmp_path / "cut.toml"), str(tmp_path / "log.csv"), "-o", str(tmp_path / "o.csv")]) == 2
    assert "copy or save it again" in capsys.readouterr().err
