"""A replay of a log without a reference: its angles as a table and as a figure."""

import imufit
import numpy as np
import pytest
from cli_stand_in import run
from imufit.log import Log

G = 9.80665
ROLL = 0.5
"""Angle about x to which the sensor is turned and back, rad."""


@pytest.fixture
def log(tmp_path):
    """Ten seconds: level, rolled by `ROLL` between 4 and 6 s, level again; NED, so that z points down."""
    t = np.arange(0.0, 10.0, 0.01)
    roll = np.interp(t, [0.0, 3.0, 4.0, 6.0, 7.0, 10.0], [0.0, 0.0, ROLL, ROLL, 0.0, 0.0])
    acc = -G * np.stack([np.zeros_like(t), np.sin(roll), np.cos(roll)], axis=1)
    gyr = np.stack([np.gradient(roll, t), np.zeros_like(t), np.zeros_like(t)], axis=1)
    path = tmp_path / "bare.parquet"
    Log.from_arrays(t, acc=acc, gyr=gyr).write(path)
    return path


def test_the_table_has_start_end_and_extremes(log):
    table = imufit.replay(log, "accel").tables()[0]
    rows = {row[1]: row[2:] for row in table.rows}
    assert {"start", "end", "least roll", "most roll", "least pitch", "most pitch"} == set(rows)
    assert float(rows["most roll"][1]) == pytest.approx(np.degrees(ROLL), abs=0.01)
    assert 4.0 <= float(rows["most roll"][0]) <= 6.0
    assert (float(rows["start"][0]), float(rows["end"][0])) == (0.0, 9.99)
    assert float(rows["end"][1]) == pytest.approx(0.0, abs=0.01)


def test_the_command_shows_and_draws_the_angles(capsys, log, tmp_path):
    figure = tmp_path / "angles.png"
    code, out, err = run(capsys, "replay", log, "--filter", "accel,kalman", "--plot", figure)
    assert (code, err) == (0, [])
    assert "most roll" in out
    assert "28.6" in out
    assert "reference, RMSE" not in out
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_the_figure_has_a_panel_for_each_angle_and_a_line_for_each_filter(log):
    figure = imufit.replay(log, ["accel", "kalman"]).plot()
    assert [axes.get_ylabel() for axes in figure.axes] == ["roll, deg", "pitch, deg", "yaw, deg"]
    lines = figure.axes[0].get_lines()
    assert [line.get_label() for line in lines] == ["accel", "kalman"]
    assert np.nanmax(lines[0].get_ydata()) == pytest.approx(np.degrees(ROLL), abs=0.01)


def test_the_command_says_that_the_written_angles_are_in_rad(capsys, log, tmp_path):
    written = tmp_path / "angles.csv"
    code, out, _ = run(capsys, "replay", log, "--filter", "accel", "-o", written)
    assert code == 0
    assert "roll, pitch and yaw of each filter in rad" in " ".join(out.split())
    table = np.genfromtxt(written, delimiter=",", names=True)
    assert np.nanmax(table["accel_roll"]) == pytest.approx(ROLL, abs=1e-4)


def turned(frame: str, up: float, roll: float = 0.0) -> Log:
    """Two seconds at rest in a frame that nothing else shows, the body's z up (1) or down (-1), rolled (rad)."""
    t = np.arange(0.0, 2.0, 0.01)
    noise = 1e-3 * np.random.default_rng(1).normal(size=(2, t.size, 3))
    force = up * G * np.array([0.0, np.sin(roll), np.cos(roll)])
    return Log.from_arrays(t, acc=force + noise[0], gyr=noise[1], frame=frame)


@pytest.mark.parametrize(("frame", "up", "level"), [("NED", 1.0, "NWU"), ("NWU", -1.0, "NED"), ("ENU", -1.0, "NED")])
def test_a_sensor_that_starts_upside_down_in_the_frame_is_told_the_one_in_which_it_starts_level(frame, up, level):
    words = imufit.replay(turned(frame, up), "accel").sentences()[1]
    assert f"the frame {frame}" in words
    assert f"frame='{level}'" in words
    other = imufit.replay(turned(level, up), "accel")
    assert "upside down" not in other.sentences()[1]
    assert all(abs(float(row[3])) < 1.0 for row in other.angle_table().rows)


def test_the_command_names_frame_and_remedy(capsys, tmp_path):
    turned("NED", 1.0).write(tmp_path / "up.csv")
    _, out, _ = run(capsys, "replay", tmp_path / "up.csv", "--filter", "accel")
    assert "use --frame NWU." in " ".join(out.split())


def test_a_sensor_on_its_side_is_not_called_upside_down():
    assert "upside down" not in imufit.replay(turned("NED", 1.0, np.pi / 2.0), "accel").frame_words()


def test_an_angle_that_comes_round_has_no_extremes():
    rows = {row[1] for row in imufit.replay(turned("NED", 1.0), "accel").angle_table().rows}
    assert rows == {"start", "end", "least pitch", "most pitch"}


def test_the_legend_stands_outside_the_curves(log):
    figure = imufit.replay(log, ["accel", "kalman"]).plot()
    figure.canvas.draw()
    (legend,) = figure.legends
    assert all(axes.get_legend() is None for axes in figure.axes)
    assert not any(legend.get_window_extent().overlaps(axes.get_window_extent()) for axes in figure.axes)
