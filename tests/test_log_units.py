"""Units: conversions, mappings of foreign columns, and the refusal of readings in another unit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from imufit.errors import InputError
from imufit.log import Log, parse_mapping, read
from imufit.log.units import conversion
from pasted import python_mappings, shell_mappings
from scipy.spatial.transform import Rotation

G = 9.80665
DEG = np.pi / 180.0


def moving(still: bool = False, **metadata: object) -> Log:
    """A hand-turned sensor with all readings and a reference."""
    t = np.arange(3000) * 0.01
    rng = np.random.default_rng(3)
    amplitude = 0.0 if still else 0.8
    angles = np.stack([amplitude * np.sin(0.5 * t + k) * (k + 1) for k in range(3)], axis=1)
    reference = Rotation.from_euler("ZYX", angles)
    step = (reference[:-1].inv() * reference[1:]).as_rotvec() / 0.01
    gyr = np.vstack([step, step[-1:]]) + 0.002 * rng.standard_normal((t.size, 3))
    acc = reference.inv().apply([0.0, 0.0, G]) + 0.02 * rng.standard_normal((t.size, 3))
    mag = reference.inv().apply([20.0, 0.0, -40.0]) + 0.2 * rng.standard_normal((t.size, 3))
    return Log.from_arrays(t, acc=acc, gyr=gyr, mag=mag, reference=reference, frame="ENU", **metadata)


def written(tmp_path: Path, reference: bool = True, **factors: float) -> Path:
    df = moving().to_dataframe()
    for column in df.columns:
        df[column] = df[column] * factors.get(column.split("_")[0], 1.0)
    if not reference:
        df = df[[column for column in df.columns if not column.startswith("ref")]]
    df.to_csv(tmp_path / "a.csv", index=False)
    return tmp_path / "a.csv"


@pytest.mark.parametrize(
    ("target", "unit", "factor", "offset"),
    [
        ("acc_x", "g", G, 0.0),
        ("acc_x", "mg", 1e-3 * G, 0.0),
        ("acc_x", "m/s^2", 1.0, 0.0),
        ("acc_x", "m/s2", 1.0, 0.0),
        ("acc_x", "m/s²", 1.0, 0.0),
        ("acc_x", "16384 LSB/g", G / 16384, 0.0),
        ("acc_x", "0.061 mg/LSB", 0.061e-3 * G, 0.0),
        ("acc_x", "*0.00059855", 0.00059855, 0.0),
        ("gyr_x", "deg/s", DEG, 0.0),
        ("gyr_x", "°/s", DEG, 0.0),
        ("gyr_x", "dps", DEG, 0.0),
        ("gyr_x", "mdps", 1e-3 * DEG, 0.0),
        ("gyr_x", "rad/s", 1.0, 0.0),
        ("gyr_x", "131 LSB/(deg/s)", DEG / 131, 0.0),
        ("mag_x", "uT", 1.0, 0.0),
        ("mag_x", "µT", 1.0, 0.0),
        ("mag_x", "nT", 1e-3, 0.0),
        ("mag_x", "mT", 1e3, 0.0),
        ("mag_x", "T", 1e6, 0.0),
        ("mag_x", "G", 100.0, 0.0),
        ("mag_x", "gauss", 100.0, 0.0),
        ("mag_x", "mG", 0.1, 0.0),
        ("t", "s", 1.0, 0.0),
        ("t", "ms", 1e-3, 0.0),
        ("t", "us", 1e-6, 0.0),
        ("t", "ns", 1e-9, 0.0),
        ("t", "100 Hz", 0.01, 0.0),
        ("temp", "degC", 1.0, 0.0),
        ("temp", "K", 1.0, -273.15),
        ("temp", "333.87LSB/degC+21", 1 / 333.87, 21.0),
        ("temp", "340 LSB/degC + 36.53", 1 / 340, 36.53),
        ("temp", "100 LSB/K - 3", 0.01, -276.15),
        ("temp", "*0.005+25", 0.005, 25.0),
        ("temp", "*5e-3-1e1", 0.005, -10.0),
        ("acc_x", "g-0.5", G, -0.5 * G),
        ("acc_x", "16384LSB/g", G / 16384, 0.0),
        ("gyr_x", "131LSB/dps", DEG / 131, 0.0),
        ("ref_angle", "deg", DEG, 0.0),
        ("ref_angle", "rad", 1.0, 0.0),
        ("ref_px", "mm", 1e-3, 0.0),
        ("ref_px", "m", 1.0, 0.0),
        ("motor_current", "", 1.0, 0.0),
    ],
)
def test_unit_becomes_si(target: str, unit: str, factor: float, offset: float) -> None:
    made = conversion(target, unit)
    assert made.factor == pytest.approx(factor, rel=1e-15)
    assert made.offset == offset


def test_fahrenheit() -> None:
    np.testing.assert_allclose(conversion("temp", "degF").apply(np.array([32.0, 212.0])), [0.0, 100.0], atol=1e-12)


@pytest.mark.parametrize("unit", ["degX+3", "m/s^-2", "+2", "degC+", "degC+x", "*0+ +00", "340 LSB/degC+36.53+1"])
def test_offset_that_cannot_be_read(unit: str) -> None:
    with pytest.raises(InputError) as caught:
        conversion("temp", unit)
    assert str(caught.value).startswith(f"column temp: the unit [{unit}] is not known.")


def test_unit_of_another_quantity_is_refused() -> None:
    with pytest.raises(InputError, match=r"\[deg/s\] is a unit of angular rate, but acc_x is specific force"):
        conversion("acc_x", "deg/s")
    with pytest.raises(InputError, match=r"the unit \[furlong\] is not known"):
        conversion("acc_x", "furlong")
    with pytest.raises(InputError, match="divides by zero"):
        conversion("acc_x", "0 LSB/g")


def test_mapping_text() -> None:
    assert parse_mapping("acc_x=AccX[g]") == {"acc_x": "AccX[g]"}
    assert parse_mapping("t=Time (s),acc_x=-A, b[16384 LSB/g]", "mag_x=m=x") == {
        "t": "Time (s)",
        "acc_x": "-A, b[16384 LSB/g]",
        "mag_x": "m=x",
    }
    for text in ("acc_x", "=AccX", "acc_x="):
        with pytest.raises(InputError, match="does not read TARGET=SOURCE"):
            parse_mapping(text)
    with pytest.raises(InputError, match="column t is mapped twice"):
        parse_mapping("t=a", "t=b")


def foreign(tmp_path: Path, header: str, *rows: str) -> Path:
    path = tmp_path / "f.csv"
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def test_mapping_with_units_signs_and_headers(tmp_path: Path) -> None:
    path = foreign(tmp_path, "ms,AccX[g],ay,az (mg),note", "0,1,2,3000,a", "10,1,2,3000,b")
    log = read(path, parse_mapping("t=ms[ms],acc_x=-AccX[g],acc_y=ay[*2],acc_z=az (mg)"))
    np.testing.assert_allclose(log.t, [0.0, 0.01])
    assert log.acc is not None
    np.testing.assert_allclose(log.acc, [[-G, 4.0, 3 * G]] * 2)
    assert list(log.labels["note"]) == ["a", "b"]
    assert not log.covariates


def test_bracket_that_the_header_lacks_is_the_unit(tmp_path: Path) -> None:
    path = foreign(tmp_path, "t,AccX,AccY,AccZ", "0,0,0,1", "1,0,0,1")
    log = read(path, {f"acc_{a.lower()}": f"Acc{a}[g]" for a in "XYZ"})
    assert log.acc is not None
    assert log.acc[0, 2] == G


def test_time_from_the_row_number(tmp_path: Path) -> None:
    path = foreign(tmp_path, "mag_x,mag_y,mag_z", *["20,30,40"] * 5)
    np.testing.assert_allclose(read(path, {"t": "row[50 Hz]"}).t, [0.0, 0.02, 0.04, 0.06, 0.08])


def test_wrong_mapping_names_the_nearest_columns(tmp_path: Path) -> None:
    path = foreign(tmp_path, "t,AccX,AccY,AccZ", "0,0,0,1")
    with pytest.raises(InputError) as caught:
        read(path, {"acc_x": "Acc_X[g]"})
    assert str(caught.value) == (
        "f.csv: column Acc_X is not in the file, but the mapping takes acc_x from it. Nearest are AccX, AccZ, AccY."
    )


def test_misspelt_target_is_named(tmp_path: Path) -> None:
    path = foreign(tmp_path, "t,AccX,AccY,AccZ", "0,0,0,1")
    with pytest.raises(InputError, match=r"the mapping makes a column acc_X; did you mean acc_x\?"):
        read(path, {"acc_X": "AccX[g]"})


def test_own_name_mapping_keeps_a_lookalike_as_covariate(tmp_path: Path) -> None:
    path = foreign(tmp_path, "t,mag_x,mag_y,mag_z,ax", "0,20,0,40,1", "1,20,0,40,1")
    with pytest.raises(InputError, match="lacks a column for y and z although ax is there"):
        read(path)
    assert "ax" in read(path, {"ax": "ax"}).covariates


@pytest.mark.parametrize(
    ("sensor", "factor", "words", "unit"),
    [
        ("acc", 1 / G, "g,", "g"),
        ("acc", 1000 / G, "milli-g,", "mg"),
        ("acc", 16384 / G, "raw counts of 16384 LSB/g,", "16384 LSB/g"),
        ("acc", 8192 / G, "raw counts of 8192 LSB/g,", "8192 LSB/g"),
        ("acc", 4096 / G, "raw counts of 4096 LSB/g,", "4096 LSB/g"),
        ("acc", 2048 / G, "raw counts of 2048 LSB/g,", "2048 LSB/g"),
        ("gyr", 1 / DEG, "deg/s,", "deg/s"),
        ("gyr", 1000 / DEG, "milli-deg/s,", "mdps"),
        ("gyr", 131 / DEG, "raw counts of 131 LSB/(deg/s),", "131 LSB/(deg/s)"),
        ("mag", 0.01, "gauss,", "G"),
        ("mag", 10.0, "milligauss,", "mG"),
        ("mag", 1000.0, "nT,", "nT"),
        ("mag", 1e-6, "T,", "T"),
    ],
)
@pytest.mark.parametrize("reference", [True, False])
def test_other_unit_is_recognised_and_the_remedy_works(
    *, tmp_path: Path, sensor: str, factor: float, words: str, unit: str, reference: bool
) -> None:
    path = written(tmp_path, reference, **{sensor: factor})
    with pytest.raises(InputError) as caught:
        read(path)
    error = caught.value
    assert f"which looks like {words} not" in error.problem
    assert error.column == f"{sensor}_x"
    assert f"{sensor}_x={sensor}_x[{unit}]" in (error.shell_remedy or "")
    mapping = parse_mapping(shell_mappings(str(error.shell_remedy))[0])
    assert python_mappings(str(error))[0] == mapping
    corrected = getattr(read(path, mapping), sensor)
    np.testing.assert_allclose(corrected, getattr(moving(), sensor), rtol=1e-9, atol=1e-9)


def test_exact_message_of_a_wrong_unit(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        read(written(tmp_path, acc=1 / G))
    assert str(caught.value) == (
        "a.csv: column acc_x: at rest the norm of acc is 1, which looks like g, not m/s^2. "
        f"Use imufit.read('{tmp_path / 'a.csv'}', "
        "mapping={'acc_x': 'acc_x[g]', 'acc_y': 'acc_y[g]', 'acc_z': 'acc_z[g]'})"
    )
    assert caught.value.shell_remedy == "Use --map 'acc_x=acc_x[g],acc_y=acc_y[g],acc_z=acc_z[g]'"


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_time_in_ticks_is_recognised(tmp_path: Path, unit: str, factor: float) -> None:
    df = moving().to_dataframe()
    df["t"] = np.round(df["t"] * factor)
    df.to_parquet(tmp_path / "a.parquet")
    with pytest.raises(InputError, match=f"looks like {unit}, not s"):
        read(tmp_path / "a.parquet")
    np.testing.assert_allclose(read(tmp_path / "a.parquet", {"t": f"t[{unit}]"}).t, moving().t, atol=1e-9)


def test_slow_log_states_its_clock() -> None:
    log = moving(still=True)
    for start in (0.0, 0.37):
        df = log.to_dataframe().assign(t=start + np.arange(log.n) * 10.0)
        with pytest.raises(InputError, match="the time steps are around 10, which looks like ms, not s"):
            Log.from_dataframe(df)
        assert Log.from_dataframe(df, mapping={"t": "t[s]"}).duration == pytest.approx(10.0 * (log.n - 1))


def test_clock_in_milliseconds_is_not_taken_for_a_gyroscope_in_another_unit() -> None:
    df = moving().to_dataframe()
    df["t"] *= 1e3
    df = df.assign(**{f"ref_q{axis}": np.nan for axis in "wxyz"})
    with pytest.raises(InputError, match="looks like ms, not s") as caught:
        Log.from_dataframe(df)
    assert "imufit.Log.from_dataframe(df, mapping={'t': 't[ms]'})" in (caught.value.remedy or "")
    assert "t=t[ms]" in (caught.value.shell_remedy or "")


def test_strong_iron_beside_a_magnetometer_is_noted_not_refused() -> None:
    df = moving().to_dataframe()
    df["mag_x"] += 400.0
    log = Log.from_dataframe(df)
    assert any("iron beside the sensor" in note for note in log.notes)


def test_stated_field_settles_the_unit() -> None:
    df = moving().to_dataframe()
    for axis in "xyz":
        df[f"mag_{axis}"] *= 10.0
    Log.from_dataframe(df, {"mag_reference": [200.0, 0.0, -400.0]})


def test_text_column_can_be_renamed(tmp_path: Path) -> None:
    path = foreign(tmp_path, "t,mag_x,mag_y,mag_z,letter", "0,20,0,40,a", "1,20,0,40,b")
    assert list(read(path, {"state": "letter"}).labels["state"]) == ["a", "b"]


def test_bad_reading_is_named_by_the_column_of_the_file(tmp_path: Path) -> None:
    path = foreign(tmp_path, "t,mx,my,mz", "0,20,0,40", "1,inf,0,40")
    with pytest.raises(InputError, match=r"row 1 \(line 3\), column mx: inf is not a reading"):
        read(path, {f"mag_{a}": f"m{a}" for a in "xyz"})
