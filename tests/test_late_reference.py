"""A reference that is late by more than an effect can follow: its lag is named, and the remedy's command cures it."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace
from pathlib import Path

import imufit
import numpy as np
import pandas as pd
import pytest
from imufit import Log, SensorModel
from imufit.cli.app import main
from imufit.lab.simulate import simulate
from imufit.log import LogStream, Metadata
from imufit.results import DataFault
from join_pairs import repetitive
from recording import recording
from scipy.spatial.transform import Rotation, Slerp

EFFECT = {"acc.bias": None}


def late(lag: float, seed: int = 3, scenario: str = "handheld") -> Log:
    """Simulated log whose reference is stamped late by a lag, s; the rows that then have none stay empty."""
    log = simulate(scenario, EFFECT, seed=seed, duration=40.0).to_log()
    return shifted(log, lag)


def shifted(log: Log, lag: float) -> Log:
    rows = np.arange(log.n) - round(lag / float(np.median(np.diff(log.t))))
    there = (rows >= 0) & (rows < log.n)
    assert log.ref_q is not None
    moved = [
        None if each is None else np.where(there[:, None], each[np.clip(rows, 0, log.n - 1)], np.nan)
        for each in (log.ref_q, log.ref_p)
    ]
    return replace(log, ref_q=moved[0], ref_p=moved[1])


def own_rows(log: Log) -> Log:
    """Put every fourth sample of the reference into a row of its own, 2 ms after the sensor's, and drop the others."""
    table = log.to_dataframe()
    names = [name for name in table.columns if name.startswith("ref_")]
    reference = table[["t", *names]].iloc[::4].copy()
    reference["t"] += 0.002
    both = pd.concat([table.drop(columns=names), reference]).sort_values("t", ignore_index=True)
    return Log.from_dataframe(both, log.metadata)


def lag_of(fault: DataFault) -> float:
    words = shlex.split(fault.shell_remedy)
    return float(words[words.index("--lag") + 1])


def named(log: Log | LogStream) -> tuple[DataFault, ...]:
    return SensorModel().compare(log).data_faults


@pytest.mark.parametrize("lag", [0.3, -0.3, 2.0, -7.0, 20.0])
def test_a_late_reference_is_named_with_its_lag(lag: float) -> None:
    (found,) = named(late(lag))
    assert (found.fault, found.sensor, found.spoils) == ("late", "ref", True)
    assert lag_of(found) == pytest.approx(lag, abs=0.002)
    assert f"The reference is {abs(lag):.2f} s {'late' if lag > 0.0 else 'early'} against the sensors" in found.evidence
    assert "as declared)" in found.evidence


def test_no_channel_is_blamed_and_the_verdict_says_what_to_do() -> None:
    found = SensorModel().fit(late(2.0)).diagnose()
    assert found.verdict == "unknown"
    assert found.best is None
    assert found.candidates == ()
    assert "imufit.join(log, log, lag=2.00" in found.sentence


def test_samples_of_the_reference_in_rows_of_their_own_say_the_same() -> None:
    (found,) = named(own_rows(late(-3.0, seed=5)))
    assert found.fault == "late"
    assert lag_of(found) == pytest.approx(-3.0, abs=0.005)


def test_a_log_on_the_disk_says_the_same(tmp_path: Path) -> None:
    late(2.0).write(tmp_path / "a log.parquet")
    (found,) = named(LogStream(tmp_path / "a log.parquet"))
    assert found.fault == "late"
    assert shlex.split(found.shell_remedy.partition(": ")[2])[2] == str(tmp_path / "a log.parquet")


@pytest.mark.parametrize("lag", [0.0, 0.02, 0.05])
def test_a_lag_that_the_effect_finds_is_left_to_it(lag: float) -> None:
    found = SensorModel().fit(late(lag)).diagnose()
    assert found.data_faults == ()
    if lag:
        assert "ref.delay" in found.sentence


def on_another_clock(log: Log, skew: float = 0.0, lag: float = 0.0) -> Log:
    """Stamp the reference with a clock that is late by a lag, s, and faster than the sensor's by a share `skew`."""
    assert log.ref_q is not None
    since = log.t - log.t[0]
    known = np.isfinite(log.ref_q).all(axis=1)
    stamps = since[known] * (1.0 + skew) + lag
    turns = Slerp(stamps, Rotation.from_quat(log.ref_q[known][:, [1, 2, 3, 0]]))
    q = turns(np.clip(since, stamps[0], stamps[-1])).as_quat()[:, [3, 0, 1, 2]]
    there = (since >= stamps[0]) & (since <= stamps[-1])
    return replace(log, ref_q=np.where(there[:, None], q, np.nan), ref_p=None)


@pytest.mark.parametrize("scenario", ["turntable", "arm", "handheld"])
def test_a_clock_that_runs_away_is_named_however_slow_the_motion(scenario: str) -> None:
    log = on_another_clock(simulate(scenario, EFFECT, seed=4, duration=60.0).to_log(), 0.01)
    (found,) = named(log)
    assert (found.fault, found.sensor, found.spoils) == ("skew", "ref", True)
    assert "fast against the sensors', and begins together with it" in found.evidence
    words = shlex.split(found.shell_remedy)
    # Of the reference's clock, in parts per million.
    assert float(words[words.index("--skew") + 1]) == pytest.approx(1e6 * 0.01 / 1.01, rel=0.01)
    assert SensorModel().fit(log).diagnose().best is None


@pytest.mark.parametrize("skew", [1e-4, -5e-4])
def test_a_clock_that_the_effect_follows_is_left_to_it(skew: float) -> None:
    log = on_another_clock(simulate("turntable", EFFECT, seed=5, duration=60.0).to_log(), skew)
    assert named(log) == ()


def test_other_axes_are_not_a_lag() -> None:
    log = simulate("handheld", EFFECT, seed=3, duration=40.0).to_log()
    assert log.gyr is not None
    turned = log.gyr[:, [1, 0, 2]] * [1.0, -1.0, 1.0]
    assert [each.fault for each in named(replace(log, gyr=turned))] == ["axes"]
    turn = Rotation.from_rotvec(np.deg2rad(40.0) * np.array([0.6, 0.0, 0.8]))
    slanted = turn.apply(log.gyr)
    assert "late" not in {each.fault for each in named(replace(log, gyr=slanted))}


@pytest.mark.parametrize("seed", [3101, 3102])
def test_no_wrong_lag_is_named_of_a_motion_that_repeats_itself(seed: int) -> None:
    one = repetitive(seed)
    known = np.isfinite(one.ref_q).all(axis=1)
    # On the sensor's clock, but two seconds late.
    ref_t = (one.ref_t - one.lag - one.skew * (one.ref_t - one.ref_t[0]) + 2.0)[known]
    rows = np.flatnonzero((one.t > ref_t[0]) & (one.t < ref_t[-1]))
    q = one.ref_q[known][np.searchsorted(ref_t, one.t[rows])]
    log = Log(t=one.t[rows], acc=one.acc[rows], gyr=one.gyr[rows], ref_q=q, metadata=Metadata(frame="ENU"))
    for fault in named(log):
        assert fault.fault != "late" or lag_of(fault) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("lag", [-7.0])
def test_the_command_of_the_remedy_cures(
    lag: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    late(lag).write("a log.parquet")
    assert main(["diagnose", "a log.parquet", "--json", "before.json"]) == 0
    assert "late against" in (text := capsys.readouterr().out) or "early against" in text
    (fault,) = json.loads(Path("before.json").read_text())["data_faults"]
    assert fault["fault"] == "late"
    command, name, *arguments = shlex.split(fault["remedy"].partition(": ")[2])
    assert (command, name, arguments[-1]) == ("imufit", "join", "joined.parquet")
    assert main(["join", *arguments]) == 0
    assert main(["diagnose", "joined.parquet", "--json", "after.json"]) == 0
    after = json.loads(Path("after.json").read_text())
    assert after["data_faults"] == []
    assert after["best"] == "acc.bias"


def test_the_map_of_a_log_that_is_its_own_reference_holds_for_both(tmp_path: Path) -> None:
    table = late(2.0).to_dataframe().rename(columns={"gyr_x": "p", "ref_qw": "w"})
    table.to_csv(tmp_path / "foreign.csv", index=False)
    log = str(tmp_path / "foreign.csv")
    joined = tmp_path / "joined.parquet"
    arguments = ["--map", "gyr_x=p,ref_qw=w", "--lag", "2", "-o", str(joined)]
    assert main(["join", log, log, *arguments]) == 0
    assert named(imufit.read(joined)) == ()


@pytest.mark.parametrize("name", ["MPU9150_path2_150mms", "MPU6050RM3100_path3_300mms"])
def test_real_recordings_are_called_late_only_when_they_are_shifted(name: str) -> None:
    log = imufit.read(recording(f"robot_arm/{name}.parquet"))
    assert "late" not in {each.fault for each in named(log)}
    # Rows of a receiver that caught up are not evenly spaced: a shift by rows is not everywhere one by that time.
    (moved,) = [each for each in named(shifted(log, 2.0)) if each.fault == "late"]
    assert lag_of(moved) == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("lag", [-1.0, 0.5])
def test_poses_whose_times_scatter_show_their_lag_in_wider_bins(lag: float) -> None:
    # The arm's own sensors come 0.1 s late.
    log = imufit.read(recording("robot_arm/MPU6050RM3100_path1_300mms.parquet"))
    (moved,) = [each for each in named(on_another_clock(log, lag=lag)) if each.fault == "late"]
    assert lag_of(moved) == pytest.approx(lag - 0.1, abs=0.1)
