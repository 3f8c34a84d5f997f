"""What `plot` draws: panels, reference, rests and gaps, thinned where a log is long."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import imufit
import numpy as np
import pytest
from imufit import InputError
from imufit.cli.app import main
from imufit.inspection.traces import PIXELS, Trace
from imufit.lab.simulate import simulate
from imufit.log import Log
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from recording import recording


@pytest.fixture(scope="module")
def handheld() -> Log:
    return simulate("handheld", {}, 3, 20.0, covariates=("motor_current",)).to_log()


def panel(figure: Figure, name: str) -> Axes:
    return next(axes for axes in figure.axes if axes.get_ylabel().startswith(name))


def names(figure: Figure) -> list[str]:
    return [axes.get_ylabel() for axes in figure.axes]


def test_there_is_a_panel_for_each_sensor_and_for_the_reference(handheld: Log) -> None:
    units = ["accelerometer, m/s²", "gyroscope, deg/s", "magnetometer, µT", "reference, deg"]
    assert names(imufit.plot(handheld)) == units
    assert names(imufit.plot(replace(handheld, mag=None, ref_q=None))) == units[:2]
    assert names(imufit.plot(handheld, show="readings")) == units[:3]
    assert names(imufit.plot(handheld, show="reference")) == ["reference, deg", "rates of the reference, deg/s"]
    drawn = imufit.plot(handheld, columns=("temp", "motor_current"))
    assert names(drawn)[-2:] == ["temp, °C", "motor_current"]


def test_readings_are_drawn_in_their_unit(handheld: Log) -> None:
    line = panel(imufit.plot(handheld), "gyroscope").lines[1]
    np.testing.assert_allclose(line.get_ydata(), np.degrees(handheld.gyr[:, 1]))
    np.testing.assert_array_equal(line.get_xdata(), handheld.t)


def test_rates_of_the_reference_lie_on_those_of_the_gyroscope(handheld: Log) -> None:
    lines = panel(imufit.plot(handheld), "gyroscope").lines
    readings, reference = lines[0], lines[3]
    expected = np.interp(reference.get_xdata(), readings.get_xdata(), readings.get_ydata())
    error = np.asarray(reference.get_ydata()) - expected
    assert np.sqrt(np.nanmean(error**2)) < 0.03 * np.std(expected)


def test_a_line_is_interrupted_over_a_gap(handheld: Log) -> None:
    kept = np.ones(handheld.n, np.bool_)
    kept[900:1000] = False
    line = panel(imufit.plot(handheld.select(kept)), "acc").lines[0]
    missing = np.asarray(line.get_xdata())[np.isnan(np.asarray(line.get_ydata(), dtype=float))]
    assert missing.size == 1
    assert handheld.t[899] < missing[0] < handheld.t[1000]


def test_a_slow_sensor_has_an_unbroken_line() -> None:
    figure = imufit.plot(imufit.read(recording("phone_qualisys/Thibaud_Nexus5_NoDist_AR.parquet")), end=20.0)
    line = np.asarray(panel(figure, "mag").lines[0].get_ydata(), dtype=float)
    assert line.size > 500
    assert np.isfinite(line).all()


def test_a_spike_of_a_single_sample_in_a_long_log_is_seen() -> None:
    t = np.arange(0.0, 2000.0, 0.01)
    acc = np.zeros((t.size, 3))
    acc[123_457, 1] = 50.0
    acc[54_321, 2] = -70.0
    lines = panel(imufit.plot(Log.from_arrays(t, acc=acc)), "acc").lines
    assert len(lines[0].get_xdata()) <= 2 * PIXELS
    y, z = (np.asarray(lines[k].get_ydata()) for k in (1, 2))
    assert (y.max(), z.min()) == (50.0, -70.0)
    assert np.asarray(lines[1].get_xdata())[y.argmax()] == pytest.approx(1234.57, abs=2000.0 / PIXELS)


@pytest.mark.parametrize("piece", [1, 7, 1000, 100_000])
def test_a_trace_does_not_depend_on_how_the_log_is_cut(piece: int) -> None:
    rng = np.random.default_rng(piece)
    t = np.sort(rng.uniform(0.0, 50.0, 4000 if piece == 1 else 20_000))
    t = t[(t < 20.0) | (t > 25.0)]
    values = rng.normal(size=(t.size, 2))
    values[rng.uniform(size=values.shape) < 0.05] = np.nan
    whole, parts = (Trace(0.0, 50.0, 2, 0.0025) for _ in range(2))
    whole.add(t, values)
    for first in range(0, t.size, piece):
        parts.add(t[first : first + piece], values[first : first + piece])
    for one, other in zip(whole.lines(), parts.lines(), strict=True):
        np.testing.assert_array_equal(one, other)
    assert np.nanmax(whole.lines()[1]) == np.nanmax(values)
    assert np.isnan(whole.lines()[1]).all(axis=1).any()


def test_a_stream_is_drawn_as_the_log_in_memory(tmp_path: Path, handheld: Log) -> None:
    path = tmp_path / "log.parquet"
    handheld.write(path)
    figures = [imufit.plot(imufit.open_log(path, stream=stream)) for stream in (True, False)]
    for one, other in zip(*(figure.axes for figure in figures), strict=True):
        for a, b in zip(one.lines, other.lines, strict=True):
            np.testing.assert_array_equal(a.get_xydata(), b.get_xydata())


def test_rests_are_shaded() -> None:
    log = imufit.read(recording("six_positions/ferraris_session_A.parquet"))
    assert len(panel(imufit.plot(log), "acc").patches) == 12
    assert len(panel(imufit.plot(log, begin=0.0, end=10.0), "acc").patches) == 1


def test_a_part_is_drawn_alone(handheld: Log) -> None:
    by_time = panel(imufit.plot(handheld, begin=5.0, end=6.0), "acc").lines[0].get_xdata()
    by_rows = panel(imufit.plot(handheld, rows=(500, 601)), "acc").lines[0].get_xdata()
    np.testing.assert_array_equal(by_time, by_rows)
    assert (by_time[0], by_time[-1]) == (5.0, 6.0)


def test_an_angle_that_passes_half_a_turn_has_no_line_across_the_panel() -> None:
    t = np.arange(0.0, 20.0, 0.01)
    half = 0.5 * t
    q = np.column_stack([np.cos(half), 0 * t, 0 * t, np.sin(half)])
    log = Log.from_arrays(t, gyr=np.tile([0.0, 0.0, 1.0], (t.size, 1)), reference=q)
    yaw = np.asarray(panel(imufit.plot(log), "reference").lines[2].get_ydata(), dtype=float)
    assert np.nanmax(np.abs(np.diff(yaw))) < 1.0
    assert np.isnan(yaw).sum() == 3
    assert (np.nanmin(yaw), np.nanmax(yaw)) == (pytest.approx(-180.0, abs=1.0), pytest.approx(180.0, abs=1.0))


def test_the_command_writes_beside_nothing_else(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, handheld: Log
) -> None:
    (tmp_path / "logs").mkdir()
    (tmp_path / "here").mkdir()
    handheld.write(tmp_path / "logs" / "walk.parquet")
    monkeypatch.chdir(tmp_path / "here")
    assert main(["plot", "../logs/walk.parquet"]) == 0
    assert "wrote walk.png" in capsys.readouterr().out
    assert (tmp_path / "here" / "walk.png").read_bytes().startswith(b"\x89PNG")
    assert [path.name for path in (tmp_path / "logs").iterdir()] == ["walk.parquet"]
    assert main(["plot", "../logs/walk.parquet", "-o", "walk.svg", "--columns", "temp,motor_current"]) == 0
    assert "motor_current" in (tmp_path / "here" / "walk.svg").read_text()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--columns", "tmp"], "temp"),
        (["--columns", "nonsense_of_mine"], "no such column"),
        (["--from", "99"], "It goes from 0 to"),
        (["--from", "6", "--to", "5"], "It goes from 0 to"),
        (["--rows", "10:999999"], "has 2000 rows"),
        (["--rows", "ten"], "not a range"),
        (["--show", "all"], "all"),
        (["-o", "figure.jpg"], ".png"),
        (["-o", "no/such/folder.png"], "does not exist"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], handheld: Log, options: list[str], words: str
) -> None:
    handheld.write(tmp_path / "log.parquet")
    output = [] if "-o" in options else ["-o", str(tmp_path / "f.png")]
    assert main(["plot", str(tmp_path / "log.parquet"), *options, *output]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert words in error
    assert not (tmp_path / "f.png").exists()


def test_a_log_without_values_has_nothing_to_draw() -> None:
    with pytest.raises(InputError, match="nothing can be drawn"):
        imufit.plot(Log.from_arrays([0.0, 1.0], acc=np.full((2, 3), np.nan)))
    with pytest.raises(InputError, match="nothing can be drawn"):
        imufit.plot(Log.from_arrays([0.0, 1.0], acc=np.ones((2, 3))), show="reference")


def test_one_row_is_a_dot(tmp_path: Path) -> None:
    figure = imufit.plot(Log.from_arrays([3.0], acc=[[0.0, 0.0, 9.8]]))
    assert panel(figure, "acc").lines[2].get_marker() == "."
    figure.savefig(tmp_path / "one.png")
