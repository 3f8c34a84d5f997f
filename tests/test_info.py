"""What `info` says of a log: samples, gaps, motion, rests, reference, and which effects the log can show."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import imufit
import numpy as np
import pytest
from imufit import InputError, SensorModel
from imufit.cli.app import main
from imufit.lab.simulate import Noise, simulate
from imufit.log import Log, LogStream, gaps
from imufit.model.catalogue import effects
from imufit.model.effect import forget
from imufit.results import LogInfo
from recording import recording


@pytest.fixture(scope="module")
def handheld() -> Log:
    return simulate("handheld", {}, 3, 40.0, covariates=("motor_current",)).to_log()


@pytest.fixture(scope="module")
def told(handheld: Log) -> LogInfo:
    return imufit.info(handheld)


@pytest.fixture
def users() -> Iterator[None]:
    """Effects that a test makes are forgotten after it."""
    before = set(effects())
    yield
    for key in set(effects()) - before:
        forget(key)


def without(log: Log, *rows: tuple[int, int]) -> Log:
    kept = np.ones(log.n, np.bool_)
    for first, stop in rows:
        kept[first:stop] = False
    return log.select(kept)


def test_every_effect_of_the_catalogue_is_answered_once(told: LogInfo) -> None:
    named = [item.effect for item in told.effects if ".column:" not in item.effect]
    assert sorted(named) == sorted(effects())
    for item in told.effects:
        assert item.shown in ("yes", "in part", "no")
        assert bool(item.reason) == (item.shown != "yes")


def test_a_log_that_moves_shows_what_it_moves_for(told: LogInfo) -> None:
    for key in ("gyr.scale", "acc.bias", "gyr.g_sensitivity", "mag.hard_iron", "ref.alignment", "gyr.bias_temperature"):
        item = told.effect(key)
        assert item.shown == "yes", item
        for p in item.parameters:
            assert 0.0 < p.standard_error < p.smallest <= p.typical


@pytest.mark.parametrize("effect", ["gyr.delay", "gyr.scale", "acc.lever_arm", "mag.bias_temperature"])
def test_the_smallest_size_is_what_a_diagnosis_of_the_log_says(handheld: Log, told: LogInfo, effect: str) -> None:
    candidates = {item.effect: item for item in SensorModel().fit(handheld).diagnose().candidates}
    for p in told.effect(effect).parameters:
        size, _ = candidates[effect].minimal_detectable[p.name]
        assert p.smallest == pytest.approx(size, rel=0.35), p


def test_an_effect_below_the_smallest_size_is_not_found_and_one_above_is(told: LogInfo) -> None:
    size = told.effect("gyr.scale").parameters[0].smallest
    for factor, named in ((0.1, False), (3.0, True)):
        log = simulate("handheld", {"gyr.scale": {"x": factor * size, "y": 0.0, "z": 0.0}}, 3, 40.0).to_log()
        diagnosis = SensorModel().fit(log).diagnose()
        assert (diagnosis.best == "gyr.scale") is named, (factor, diagnosis.sentence)


def test_delay_and_lag_look_the_same_where_the_motion_is_slow(told: LogInfo) -> None:
    assert "gyr.lowpass" in told.effect("gyr.delay").like
    assert "acc.bias" not in told.effect("gyr.delay").like
    assert any("gyr.delay" in sentence and "gyr.lowpass" in sentence for sentence in told.alike())


def test_without_temperature_no_effect_of_it_can_be_seen(handheld: Log) -> None:
    found = imufit.info(replace(handheld, temp=None))
    for key, effect in effects().items():
        if effect.column == "temp":
            assert found.effect(key).shown == "no"
            assert "temp" in found.effect(key).reason
    assert found.effect("gyr.scale").shown == "yes"


def test_a_temperature_that_hardly_changes_is_named_with_its_span(handheld: Log) -> None:
    flat = 25.0 + 0.001 * np.sin(handheld.t)
    item = imufit.info(replace(handheld, temp=flat)).effect("gyr.scale_temperature")
    assert item.shown == "no"
    assert item.reason == "temp spans only 0.002 degC"


def test_an_absent_sensor_is_the_reason(handheld: Log) -> None:
    found = imufit.info(replace(handheld, mag=None))
    assert found.effect("mag.hard_iron").reason == "the log has no magnetometer"
    assert found.effect("gyr.bias").shown == "yes"


def turning_about_z() -> Log:
    """A log that turns about z alone, with noise."""
    rng = np.random.default_rng(5)
    t = np.arange(0.0, 60.0, 0.01)
    rate = np.sin(0.7 * t) + 0.5 * np.sin(1.9 * t)
    angle = np.concatenate(([0.0], np.cumsum(0.005 * (rate[1:] + rate[:-1]))))
    q = np.column_stack([np.cos(angle / 2), 0 * t, 0 * t, np.sin(angle / 2)])
    gyr = np.column_stack([0 * t, 0 * t, rate]) + rng.normal(0.0, 0.002, (t.size, 3))
    acc = np.array([0.0, 0.0, -9.80665]) + rng.normal(0.0, 0.02, (t.size, 3))
    return Log.from_arrays(t, acc=acc, gyr=gyr, reference=q)


def test_an_axis_that_never_turns_is_not_shown() -> None:
    found = imufit.info(turning_about_z())
    scale = {p.name: p for p in found.effect("gyr.scale").parameters}
    assert found.effect("gyr.scale").shown == "in part"
    assert [name for name, p in scale.items() if p.seen] == ["z"]
    assert found.motion.rate_high[2] > 1.0
    assert found.motion.rate_high[0] < 0.1
    # gravity is along z all the time
    assert found.effect("acc.scale").shown == "no"
    assert "constant offset" in found.effect("acc.scale").reason


def test_a_log_that_lies_still_says_that_it_does_not_turn() -> None:
    rng = np.random.default_rng(6)
    t = np.arange(0.0, 30.0, 0.01)
    gyr, acc = rng.normal(0.0, 0.002, (t.size, 3)), rng.normal(0.0, 0.02, (t.size, 3)) - [0.0, 0.0, 9.80665]
    still = Log.from_arrays(t, acc=acc, gyr=gyr, reference=np.tile([1.0, 0.0, 0.0, 0.0], (t.size, 1)))
    found = imufit.info(still)
    assert found.effect("gyr.bias").shown == "yes"
    assert found.effect("gyr.scale").shown == "no"
    assert "hardly turns" in found.effect("gyr.scale").reason
    assert found.rests.count == 1
    assert found.rests.longest == pytest.approx(30.0, abs=1.0)


def test_gaps_are_told_where_they_are_and_by_the_rule_of_the_project(handheld: Log) -> None:
    log = without(handheld, (1000, 1050), (2000, 2001), (3000, 3010))
    found = imufit.info(log, effects=False).one_series("rows")
    assert found is not None
    assert found.gap_count == len(gaps(log.t)) - 1 == 2
    assert [gap.t_start for gap in found.gaps] == [handheld.t[999], handheld.t[2999]]
    assert found.longest_gap == pytest.approx(0.51)
    assert found.missing == pytest.approx(61 / handheld.n, rel=1e-3)


def test_a_slow_sensor_has_its_own_rate_and_misses_nothing() -> None:
    log = simulate("handheld", {}, 4, 20.0, noise=Noise(mag_rate=20.0)).to_log()
    found = imufit.info(log, effects=False)
    mag, acc = found.one_series("mag"), found.one_series("acc")
    assert mag is not None
    assert acc is not None
    assert (mag.rate, acc.rate) == (pytest.approx(20.0), pytest.approx(100.0))
    assert mag.missing == mag.gap_count == 0


def test_samples_that_lack_an_axis_are_counted(handheld: Log) -> None:
    acc = handheld.acc.copy()
    acc[5:9, 1] = np.nan
    acc[20:22] = np.nan
    found = imufit.info(replace(handheld, acc=acc), effects=False).one_series("acc")
    assert found is not None
    assert (found.incomplete, found.samples) == (4, handheld.n - 2)


def test_jitter_is_the_scatter_of_the_stamps(handheld: Log) -> None:
    rng = np.random.default_rng(1)
    log = replace(handheld, t=handheld.t + rng.uniform(-1e-3, 1e-3, handheld.n))
    jitter = imufit.info(log, effects=False).one_series("rows").jitter
    assert jitter == pytest.approx(1e-3 * np.sqrt(2.0 / 3.0), rel=0.05)


def test_a_reference_that_was_filled_in_has_the_rate_of_its_measured_samples(handheld: Log) -> None:
    exact = (np.arange(handheld.n) % 5 == 0).astype(float)
    log = replace(handheld, covariates={**handheld.covariates, "ref_exact": exact})
    found = imufit.info(log, effects=False).reference
    assert (found.kind, found.share, found.exact) == ("attitude", 1.0, pytest.approx(0.2))
    assert found.rate == pytest.approx(20.0)
    assert found.position


def test_readings_cut_off_are_counted(handheld: Log) -> None:
    found = imufit.info(replace(handheld, gyr=np.clip(handheld.gyr, -0.8, 0.8)), effects=False)
    assert {item.channel for item in found.clipped} <= {"gyr_x", "gyr_y", "gyr_z"}
    for item in found.clipped:
        expected = np.count_nonzero(np.abs(handheld.gyr[:, "xyz".index(item.channel[-1])]) >= 0.8)
        assert (item.range, item.readings) == (pytest.approx(0.8), expected)
    assert found.clipped


def test_a_stream_is_told_as_the_log_in_memory(tmp_path: Path, handheld: Log) -> None:
    path = tmp_path / "log.parquet"
    without(handheld, (1500, 1600)).write(path)
    streamed = imufit.info(imufit.open_log(path, stream=True))
    held = imufit.info(imufit.open_log(path, stream=False))
    assert streamed.to_dict() == held.to_dict()


def test_six_positions_are_rests_in_six_poses() -> None:
    found = imufit.info(imufit.read(recording("six_positions/ferraris_session_A.parquet")))
    assert (found.judged_by, found.reference.kind) == ("rests", "poses")
    assert (found.rests.directions, found.rests.count) == (6, 12)
    assert found.effect("gyr.bias").shown == "yes"
    assert found.effect("gyr.delay").reason == "it needs a reference attitude"
    assert found.one_series("gyr").rate == pytest.approx(102.4, rel=1e-3)


def test_sensors_in_rows_of_their_own_keep_their_rates() -> None:
    log = imufit.read(recording("phone_qualisys/Thibaud_Nexus5_NoDist_AR.parquet"))
    found = imufit.info(log, effects=False)
    rates = {item.name: item.rate for item in found.series}
    assert (rates["mag"], rates["ref_q"]) == (pytest.approx(50.0, rel=0.05), pytest.approx(60.0, rel=0.01))
    assert rates["gyr"] > 150.0
    assert found.reference.frame == "ENU"


def test_a_user_effect_is_answered_like_the_others(handheld: Log, users: None) -> None:
    @imufit.effect("gyr.motor_square", parameters={"z": "rad/s/A^2"}, typical=0.01, needs=["motor_current"])
    def square(w: imufit.Window, z: float) -> np.ndarray:
        return np.outer(w.column("motor_current") ** 2, [0.0, 0.0, z])

    assert imufit.info(handheld).effect("gyr.motor_square").shown == "yes"
    item = imufit.info(replace(handheld, covariates={})).effect("gyr.motor_square")
    assert (item.shown, item.reason) == ("no", "the log has no column motor_current")


@pytest.mark.parametrize(
    "text",
    [
        "t,acc_x,acc_y,acc_z\n0,0,0,9.8\n",
        "t,mag_x,mag_y,mag_z\n0,20,0,40\n1,20,0,40\n",
        "t,acc_x,acc_y,acc_z\n0,,,\n1,,,\n2,,,\n3,,,\n",
        "t,gyr_x,gyr_y,gyr_z\n" + "".join(f"{k / 100},0,0,0.01\n" for k in range(300)),
        "t,acc_x,acc_y,acc_z,pose\n0,0,0,9.8,+z\n1,0,0,9.8,+z\n",
        "t,ref_qw,ref_qx,ref_qy,ref_qz,temp\n" + "".join(f"{k / 100},1,0,0,0,20\n" for k in range(300)),
    ],
)
def test_small_and_odd_logs_are_told_without_a_traceback(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str
) -> None:
    path = tmp_path / "odd.csv"
    path.write_text(text)
    assert main(["info", str(path), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["n"] == text.count("\n") - 1
    assert all(item["shown"] == "no" and item["reason"] for item in found["effects"])
    assert found["refusal"]
    absent = {item["effect"]: item["reason"] for item in found["effects"]}
    if "mag" in found["missing"]:
        assert absent["mag.hard_iron"] == "the log has no magnetometer"


def test_the_command_prints_within_eighty_columns(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, handheld: Log
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    # A path that a command wrote stays whole, however long the name of the folder.
    monkeypatch.chdir(tmp_path)
    handheld.write(tmp_path / "log.parquet")
    assert main(["info", "log.parquet", "--json", "info.json"]) == 0
    printed = capsys.readouterr().out
    assert max(map(len, printed.splitlines())) <= 80
    # no cell of a table is cut
    assert "…" not in printed
    assert (
        printed.index("The log can show")
        < printed.index("Samples in time")
        < printed.index("Effects that it cannot show")
    )
    assert printed.index("Effects that it cannot show") < printed.index("Columns")
    assert "Effects that this log can show" not in printed
    assert main(["info", str(tmp_path / "log.parquet"), "-v"]) == 0
    assert "Effects that this log can show" in capsys.readouterr().out
    assert json.loads((tmp_path / "info.json").read_text())["motion"]["force_rms"] > 0.0


def test_quick_leaves_the_effects_out(tmp_path: Path, capsys: pytest.CaptureFixture[str], handheld: Log) -> None:
    handheld.write(tmp_path / "log.parquet")
    assert main(["info", str(tmp_path / "log.parquet"), "--quick", "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["effects"], found["judged_by"], found["refusal"]) == ([], None, None)


def test_an_input_is_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str], handheld: Log) -> None:
    path = tmp_path / "log.parquet"
    handheld.write(path)
    before = path.read_bytes()
    assert main(["info", str(path), "--json", str(path)]) == 2
    assert "overwritten" in capsys.readouterr().err
    assert path.read_bytes() == before


def test_an_effect_that_was_not_asked_about_is_no_answer(told: LogInfo) -> None:
    with pytest.raises(KeyError, match="no_such"):
        told.effect("no_such")


def test_a_log_without_what_it_needs_says_what_to_record() -> None:
    t = np.arange(0.0, 10.0, 0.01)
    wave = np.column_stack([np.sin(t), np.cos(3 * t), np.sin(2 * t)])
    found = imufit.info(Log.from_arrays(t, gyr=wave))
    assert found.refusal
    assert "reference" in found.verdict
    assert found.remedy
    with pytest.raises(InputError):
        SensorModel().fit(Log.from_arrays(t, gyr=wave))


@pytest.mark.parametrize(
    "name",
    ["phone_qualisys/Thibaud_Nexus5_NoDist_AR.parquet", "robot_arm/MPU9150_path1_300mms.parquet"],
)
def test_what_a_recording_can_show_agrees_with_its_diagnosis(name: str):
    """Standard errors of what is missing are those of the diagnosis, which both take from one place."""
    log = imufit.open_log(recording(name))
    told = imufit.info(log)
    compared = []
    for candidate in imufit.SensorModel().fit(log).diagnose().candidates:
        own = {parameter.name: parameter for parameter in told.effect(candidate.effect).parameters}
        for parameter in candidate.parameters:
            if parameter.name in own and parameter.name in candidate.minimal_detectable:
                compared.append(own[parameter.name].standard_error / parameter.standard_error)
    assert len(compared) > 30
    assert np.allclose(compared, 1.0, rtol=0.01)


def test_a_folder_is_named_where_it_is_the_current_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "walk"
    folder.mkdir()
    rows = ["t,acc_x,acc_y,acc_z", *(f"{0.01 * k:.2f},0,0.1,9.8" for k in range(300))]
    (folder / "acc.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (folder / "words.csv").write_text("a,b\nc,d\ne,f\n", encoding="utf-8")
    monkeypatch.chdir(folder)
    found = imufit.info(LogStream(Path()), effects=False)
    assert found.sentence.startswith("walk: 300 rows")
    assert not any(note.startswith(":") for note in found.contents.notes)
