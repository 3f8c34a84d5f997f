"""`imufit replay` on a tilt rig that rests, moves and is struck: paper B's experiments in one log."""

import numpy as np
import pytest
from cli_stand_in import run, strict_json
from imufit import SensorModel
from imufit.cli.names import FILTERS
from imufit.log import Log
from imufit.replaying import replay

METHODS = ("accel", "gyro", "complementary", "kalman")


def rig(axis: str = "x", gain: float = 1.0) -> Log:
    """At 0 degrees, moved to -5 within two seconds, struck from the side at 35 s; a biased accelerometer and gyro."""
    rng = np.random.default_rng(3)
    t = 0.01 * np.arange(5000)
    angle = np.radians(np.interp(t, [0.0, 15.0, 17.0, 50.0], [0.0, 0.0, -5.0, -5.0]))
    rate = gain * np.gradient(angle, t)
    acc = rng.normal(0.0, 0.02, (t.size, 3))
    gyr = rng.normal(np.radians(0.03), np.radians(0.05), (t.size, 3))
    across = {"x": (1, 2), "y": (2, 0)}[axis] if axis != "z" else None
    if across is None:
        acc[:, 2] += 9.80665
        gyr[:, 2] += rate
    else:
        # Turned about the axis by the angle, up leans the other way in the body.
        level, other = across
        up = 2
        sign = 1.0 if (level, other) == (1, 2) else -1.0
        acc[:, up] += 9.80665 * np.cos(angle)
        lean = level if up == other else other
        acc[:, lean] += sign * 9.80665 * np.sin(angle) + 0.04
        struck = (t >= 35.0) & (t < 36.0)
        since = t[struck] - 35.0
        acc[struck, lean] += 3.0 * np.exp(-since / 0.2) * np.sin(2 * np.pi * 23.0 * since)
        gyr[:, "xyz".index(axis)] += rate
    return Log.from_arrays(t, acc=acc, gyr=gyr, ref_angle=angle, rig_axis=axis, frame="NWU")


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("rig") / "rig.parquet"
    rig().write(path)
    return path


def test_four_methods_in_one_table_with_their_ranks(capsys, log):
    code, out, err = run(capsys, "replay", log, "--filter", ",".join(METHODS), "--json", "-")
    assert (code, err) == (0, [])
    value = strict_json(out)
    assert tuple(value["filters"]) == METHODS
    tilt = {name: errors["tilt"] for name, errors in value["filters"].items()}
    assert value["tilt"]["kind"] == "rig"
    assert (value["tilt"]["rests"], value["tilt"]["moves"], value["tilt"]["vibrations"]) == (2, 1, 1)
    bias = np.degrees(0.04 / 9.80665)
    for name in ("accel", "complementary", "kalman"):
        assert tilt[name]["offset_deg"] == pytest.approx(bias, abs=0.02)
    sd = np.degrees(0.02 / 9.80665)
    assert tilt["accel"]["sd_deg"] == pytest.approx(sd, rel=0.05)
    assert tilt["accel"]["noise_density_deg"] == pytest.approx(sd * np.sqrt(0.02), rel=0.05)
    assert tilt["accel"]["vibration_gain"] == pytest.approx(1.0, rel=1e-6)
    assert tilt["gyro"]["drift_deg_per_min"] == pytest.approx(1.8, abs=0.3)
    ranks = {name: {method: mark["rank"] for method, mark in marks.items()} for name, marks in value["ranks"].items()}
    assert list(ranks) == ["noise", "offset", "vibration", "settling"]
    assert ranks["noise"]["accel"] == ranks["vibration"]["accel"] == 1
    assert ranks["noise"]["complementary"] == ranks["vibration"]["complementary"] == 2
    assert ranks["offset"] == {"accel": 2, "gyro": 1, "complementary": 2, "kalman": 2}
    words = value["ranks"]["offset"]
    assert (words["gyro"]["word"], words["kalman"]["word"]) == ("high", "low")


def test_the_table_for_people_names_units_and_stretches(capsys, log):
    code, out, err = run(capsys, "replay", log, "--filter", "accel,gyro", "--filter", "gyro,kalman")
    assert (code, err) == (0, [])
    assert "Error of the angle about body x: 2 rests, 1 move, 1 vibration" in " ".join(out.split())
    assert "Ranks, 1 the largest" in out
    assert "heading" not in out  # the table of whole attitudes is for logs without a rig
    rows = [line.split() for line in out.splitlines() if line.strip()]
    assert ["unit", "accel", "gyro", "kalman"] in rows
    first = [" ".join(row[:-3]) for row in rows]
    for title in ("RMSE deg", "SD at rest deg", "drift deg/min", "noise density deg/√Hz", "settling time s"):
        assert title in first
    assert "vibration gain 1" in first


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_plot_writes_the_figure(capsys, tmp_path, log, ending):
    path = tmp_path / f"tilt.{ending}"
    code, out, err = run(capsys, "replay", log, "--filter", ",".join(METHODS), "--plot", path)
    assert (code, err) == (0, [])
    assert f"wrote {path}" in " ".join(out.split())
    start = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[ending]
    assert path.read_bytes().startswith(start)


def test_the_figure_has_a_panel_for_what_the_log_holds(log):
    struck = replay(rig(), METHODS)
    titles = [axes.get_title(loc="left") for axes in struck.plot().axes]
    assert titles == [
        "The whole log",
        "A move from 0.0 to -5.0 deg",
        "The strongest vibration",
        "Error: estimate less reference",
    ]
    lines = {line.get_label(): line for line in struck.plot().axes[0].lines}
    assert set(lines) == {*METHODS, "reference"}
    t, angle = lines["accel"].get_data()
    np.testing.assert_allclose(angle[t < 15.0].mean(), np.degrees(0.04 / 9.80665), atol=0.02)
    assert angle[t > 40.0].mean() == pytest.approx(-5.0 + np.degrees(0.04 / 9.80665), abs=0.02)
    still = replay(rig().rows(0, 1200), METHODS)
    assert [axes.get_title(loc="left") for axes in still.plot().axes] == [titles[0], titles[3]]


def test_a_setting_reaches_its_filter(capsys, log):
    def noise(*assignments):
        options = [part for each in assignments for part in ("--set", each)]
        code, out, err = run(capsys, "replay", log, "--filter", "complementary", *options, "--json", "-")
        assert (code, err) == (0, [])
        return strict_json(out)["filters"]["complementary"]["tilt"]["sd_deg"]

    usual, follows = noise(), noise("complementary.a=0.5")
    assert follows > 3.0 * usual
    assert noise("complementary.a=0.5", "complementary.a=0.97") == usual


def test_a_wider_band_is_settled_in_sooner(capsys, tmp_path):
    path = tmp_path / "rig.parquet"
    rig(gain=0.8).write(path)  # the integrated rate stops one degree short

    def settling(band):
        options = ["--filter", "complementary", "--set", "complementary.step=0.04", "--band", band, "--json", "-"]
        code, out, err = run(capsys, "replay", path, *options)
        assert (code, err) == (0, [])
        value = strict_json(out)
        assert value["tilt"]["band_deg"] == band
        return value["filters"]["complementary"]["tilt"]["settling_s"]

    tau = -0.04 / np.log(0.97)
    lag = 0.2 * 2.5 * tau * (1.0 - np.exp(-2.0 / tau))  # of a ramp of 2.5 deg/s, where it ends
    assert settling(0.2) == pytest.approx(tau * np.log(lag / 0.2), abs=0.2)
    assert settling(0.1) == pytest.approx(tau * np.log(lag / 0.1), abs=0.3)


def test_a_rig_about_the_vertical_says_that_gravity_does_not_show_it(capsys, tmp_path):
    path = tmp_path / "yaw.parquet"
    rig("z").write(path)
    code, out, err = run(capsys, "replay", path, "--filter", "accel,gyro", "--json", tmp_path / "yaw.json")
    assert (code, err) == (0, [])
    assert "gravity does not show this angle, so accel cannot be judged" in " ".join(out.split())
    value = strict_json((tmp_path / "yaw.json").read_text())
    assert value["filters"]["accel"]["tilt"] is None
    assert value["filters"]["gyro"]["tilt"]["drift_deg_per_min"] == pytest.approx(1.8, abs=0.3)
    code, _, err = run(capsys, "replay", path, "--filter", "accel", "--plot", tmp_path / "yaw.png")
    assert code == 2
    assert "no filter shows the angle" in err[0]


def test_both_level_axes_turn_the_same_way():
    found = [replay(rig(axis), METHODS).comparison() for axis in ("x", "y")]
    for comparison in found:
        assert comparison is not None
        assert comparison.methods["accel"] is not None
        assert comparison.methods["accel"].rmse_deg < 1.0


def test_a_model_is_taken_out_first(capsys, tmp_path, log):
    SensorModel(["acc.bias"], {"acc.bias": {"x": 0.0, "y": 0.04, "z": 0.0}}).save(tmp_path / "m.toml")
    options = ("replay", log, "--filter", "accel", "--json", "-")
    offsets = []
    for more in ((), ("--model", tmp_path / "m.toml")):
        code, out, err = run(capsys, *options, *more)
        assert (code, err) == (0, [])
        offsets.append(strict_json(out)["filters"]["accel"]["tilt"]["offset_deg"])
    assert offsets[0] == pytest.approx(np.degrees(0.04 / 9.80665), abs=0.02)
    assert offsets[1] == pytest.approx(0.0, abs=0.02)


def test_what_cannot_be_replayed_is_one_line(capsys, tmp_path, log):
    code, _, err = run(capsys, "replay", log, "--filter", "triad")
    assert (code, len(err)) == (2, 1)
    assert "triad needs mag" in err[0]
    code, _, err = run(capsys, "replay", log, "--set", "kalman.acc_noise=-1")
    assert (code, len(err)) == (2, 1)
    assert "out of range" in err[0]
    bare = tmp_path / "bare.parquet"
    full = rig()
    Log.from_arrays(full.t, acc=full.acc, gyr=full.gyr).write(bare)
    code, out, err = run(capsys, "replay", bare, "--filter", "gyro", "--json", "-")
    assert (code, err) == (0, [])
    assert strict_json(out)["filters"] == {"gyro": None}
    code, _, err = run(capsys, "replay", bare, "--filter", "gyro", "--plot", tmp_path / "bare.png")
    assert (code, err) == (0, [])
    assert (tmp_path / "bare.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("rows", [1, 2, 10, 60])
def test_a_short_log_has_what_it_can_have(rows):
    comparison = replay(rig().rows(0, rows), METHODS).comparison()
    assert comparison is not None
    assert comparison.rests == (rows == 60)
    assert all(figures is not None for figures in comparison.methods.values())
    assert str(comparison)


def test_where_no_row_counts_the_note_says_so():
    full = rig()
    marked = Log.from_arrays(
        full.t,
        acc=full.acc,
        gyr=full.gyr,
        ref_angle=full.ref_angle,
        covariates={"movement": np.zeros(full.n)},
        rig_axis="x",
    )
    comparison = replay(marked, METHODS).comparison()
    assert comparison is not None
    assert set(comparison.methods.values()) == {None}
    assert comparison.notes[0].startswith("No row counts")


def test_results_in_python():
    result = replay(rig(), METHODS)
    comparison = result.comparison()
    assert comparison is not None
    assert {name for name, figures in comparison.methods.items() if figures is not None} <= set(FILTERS)
    frame = comparison.to_dataframe()
    assert list(frame.index) == list(METHODS)
    assert frame.loc["gyro", "rank_offset"] == 1
    error = np.degrees(result.tilt_error("accel"))
    assert np.sqrt(np.mean(error**2)) == pytest.approx(frame.loc["accel", "rmse_deg"])
    assert "<table>" in comparison._repr_html_()
    with pytest.raises(ValueError, match="the band is"):
        result.comparison(0.0)
    with pytest.raises(ValueError, match="was not replayed"):
        result.tilt_error("mahony")
    with pytest.raises(ValueError, match="does not see"):
        replay(rig("z"), ["accel"]).tilt_error("accel")
