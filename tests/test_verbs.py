"""The questions as functions: they take whatever holds a log, and answer the same."""

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imufit
import numpy as np
import pandas as pd
import polars as pl
import pytest
from imufit import InputError, Log, SensorModel
from scipy.spatial.transform import Rotation

HIDDEN = {"gyr.bias": {"x": 0.02, "y": -0.01, "z": 0.015}}


@pytest.fixture(scope="module")
def log() -> Log:
    return imufit.simulate("handheld", HIDDEN, seed=501, duration=30.0).to_log()


def as_file(log: Log, folder: Path) -> Path:
    log.write(folder / "walk.parquet")
    return folder / "walk.parquet"


KINDS: dict[str, Callable[[Log, Path], Any]] = {
    "path": as_file,
    "text": lambda log, folder: str(as_file(log, folder)),
    "pandas": lambda log, _: log.to_pandas(),
    "polars": lambda log, _: log.to_polars(),
    "arrow": lambda log, _: log.to_arrow(),
    "columns": lambda log, _: {name: np.asarray(column) for name, column in log.table().items()},
    "lists": lambda log, _: {name: column.tolist() for name, column in log.table().items()},
    "arrays": lambda log, _: {
        "t": log.t,
        "acc": log.acc,
        "gyr": log.gyr,
        "mag": log.mag,
        "attitude": log.reference,
        "ref_p": log.ref_p,
    },
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_input_is_the_same_log(log: Log, kind: str, tmp_path: Path) -> None:
    given = KINDS[kind](log, tmp_path)
    by_gyro, due = (imufit.replay(each, "gyro", initial="reference") for each in (given, log))
    np.testing.assert_allclose(by_gyro.attitude["gyro"], due.attitude["gyro"], atol=1e-12)
    fitted = imufit.fit(given, ["gyr.bias"])
    values = [parameter.value for parameter in fitted.parameters]
    np.testing.assert_allclose(values, [0.02, -0.01, 0.015], atol=5e-4)


def test_a_diagnosis_of_a_table_names_what_is_hidden(log: Log) -> None:
    found = imufit.diagnose(log.to_polars())
    assert "gyr.bias is missing" in found.sentence
    assert repr(found).startswith("MISSING: gyr.bias")


def test_a_ladder_is_short_in_a_shell(log: Log) -> None:
    result = imufit.ladder(log)
    assert result.model == ("gyr.bias",)
    assert len(repr(result)) <= 400
    assert "gyr.bias" in result._repr_html_()


def test_several_logs_are_one_question(log: Log, tmp_path: Path) -> None:
    other = imufit.simulate("handheld", HIDDEN, seed=501, duration=40.0).to_log()
    fitted = imufit.fit([as_file(log, tmp_path), other.to_pandas()], "gyr.bias")
    assert len(fitted.logs) == 2


def test_a_model_is_a_file_or_a_list_or_one_effect(log: Log, tmp_path: Path) -> None:
    imufit.fit(log, "gyr.bias").save(tmp_path / "model.toml")
    by_file = imufit.compare(log, tmp_path / "model.toml")
    by_model = imufit.compare(log, SensorModel.load(tmp_path / "model.toml"))
    assert by_file.sensors == by_model.sensors
    assert by_file.sensors["gyr"] == pytest.approx(1.0, abs=0.05)
    assert imufit.compare(log).sensors["gyr"] > 3.0


def test_two_models_on_one_log(log: Log) -> None:
    found = imufit.compare(log, ["gyr.bias"], ["gyr.scale"])
    assert isinstance(found, imufit.ModelComparison)
    assert found.preferred == "first"
    assert found.ln_bayes_factor < -100.0
    assert found.first_ratio < found.second_ratio
    table = found.to_dataframe()
    assert set(table.channel[table.second_over_first > 2.0]) == {"gyr_x", "gyr_y", "gyr_z"}
    found.plot()


@pytest.mark.parametrize("effect", ["acc.bias", "gyr.scale", "mag.hard_iron"])
def test_two_models_are_held_against_each_other_as_they_are(effect: str) -> None:
    """An effect that is missing in one of them is not lent to it as a candidate."""
    log = imufit.simulate("handheld", {effect: None}, 5, 60.0).to_log()
    found = imufit.compare(log, [], [effect])
    assert found.preferred == "second"
    assert found.ln_bayes_factor > 5.0
    assert found.second_ratio < found.first_ratio


def test_two_models_that_the_log_leaves_alike(log: Log) -> None:
    found = imufit.compare(log, ["gyr.bias"], ["gyr.bias"])
    assert found.preferred == "neither"
    assert found.ln_bayes_factor == pytest.approx(0.0, abs=1e-6)


def test_a_log_is_sliced_by_rows_and_by_seconds(log: Log) -> None:
    assert len(log[100:200]) == 100
    assert log[100:200].t[0] == log.t[100]
    assert np.shares_memory(log[100:200].gyr, log.gyr)
    assert len(log[log.t > 20.0]) == int((log.t > 20.0).sum())
    part = log.between(5.0, 7.5)
    assert part.t[0] >= 5.0
    assert part.t[-1] < 7.5
    assert len(part) == 250
    assert len(log.head()) == 5
    assert len(log[::10]) == len(log) // 10
    with pytest.raises(ValueError, match="time runs forwards"):
        log[::-1]
    with pytest.raises(TypeError, match="sliced by rows"):
        log[5]


def test_a_log_is_made_of_arrays_and_rotations() -> None:
    t = np.arange(50) / 100.0
    attitude = Rotation.from_rotvec(t[:, None] * [0.0, 0.0, 1.0])
    log = Log(t, gyr=np.tile([0.0, 0.0, 1.0], (50, 1)), attitude=attitude, frame="ENU")
    assert log.metadata.frame == "ENU"
    np.testing.assert_allclose(log.reference.as_matrix(), attitude.as_matrix(), atol=1e-12)
    same = Log(t.tolist(), gyr=log.gyr.tolist(), ref_q=log.ref_q)
    np.testing.assert_array_equal(same.ref_q, log.ref_q)
    with pytest.raises(InputError, match="Did you mean gyr"):
        Log(t, gyro=log.gyr)
    with pytest.raises(InputError, match="both given"):
        Log(t, gyr=log.gyr, attitude=attitude, ref_q=log.ref_q)
    with pytest.raises(InputError, match=r"is before t = 0\.49"):
        Log(t[::-1].copy(), gyr=log.gyr)


def test_a_log_goes_into_every_table(log: Log) -> None:
    columns = list(log.table())
    assert list(log.to_pandas().columns) == columns
    assert log.to_polars().columns == columns
    assert pl.DataFrame(log).columns == columns
    assert list(pd.api.interchange.from_dataframe(log).columns) == columns
    np.testing.assert_array_equal(log.to_polars()["gyr_x"].to_numpy(), log.gyr[:, 0])


def test_the_metadata_go_with_a_table(log: Log) -> None:
    assert Log.from_dataframe(log.to_pandas()).metadata == log.metadata
    assert imufit.log.log_of(log.to_arrow()).metadata == log.metadata


def test_an_index_of_dates_is_the_time(log: Log) -> None:
    table = log.to_pandas()
    when = pd.Timestamp("2026-05-01 12:00:00") + pd.to_timedelta(table.pop("t"), unit="s")
    read = Log.from_dataframe(table.set_index(pd.DatetimeIndex(when)))
    np.testing.assert_allclose(np.diff(read.t), np.diff(log.t), atol=2e-6)


def test_a_foreign_table_is_recognised_as_a_file_is() -> None:
    rng = np.random.default_rng(5)
    n = 500
    acc = np.add([0.0, 0.0, 1000.0], rng.normal(size=(n, 3)))
    table = pd.DataFrame(
        {"millis": np.arange(n) * 10, "ax [mg]": acc[:, 0], "ay [mg]": acc[:, 1], "az [mg]": acc[:, 2]}
    )
    log = Log.from_dataframe(table)
    assert log.acc[:, 2].mean() == pytest.approx(9.80665, rel=1e-3)
    assert log.duration == pytest.approx(4.99)


def test_what_holds_no_log_is_refused() -> None:
    with pytest.raises(InputError, match="cannot be made of int"):
        imufit.diagnose(5)
    with pytest.raises(InputError, match="different lengths"):
        imufit.fit({"t": [0.0, 1.0], "gyr_x": [1.0]})
    with pytest.raises(InputError, match="no time"):
        imufit.fit({"gyr": np.zeros((5, 3))})


def test_logs_and_results_are_pickled(log: Log) -> None:
    again = pickle.loads(pickle.dumps(log))
    np.testing.assert_array_equal(again.gyr, log.gyr)
    for result in (imufit.compare(log), imufit.diagnose(log), imufit.replay(log, "mahony"), imufit.info(log)):
        assert str(pickle.loads(pickle.dumps(result))) == str(result)


def test_a_figure_shows_itself_in_a_notebook(log: Log) -> None:
    assert log.plot()._repr_png_().startswith(b"\x89PNG")
