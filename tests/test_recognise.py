"""Files of other programs are read without options where names, maker and readings show what they hold."""

import gzip
import zipfile
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import imufit
import numpy as np
import pytest
from imufit.errors import InputError
from imufit.lab.simulate import simulate
from imufit.log import Log, LogStream, parse_mapping, read
from pasted import python_mappings, shell_mappings
from recording import recording

STANDARD_GRAVITY = 9.80665


@pytest.fixture(scope="module")
def sound() -> Log:
    made = simulate("handheld", {}, seed=4711, duration=40.0)
    return Log.from_arrays(made.t, acc=made.acc, gyr=made.gyr, mag=np.nan_to_num(made.mag, nan=30.0))


def table(path: Path, header: list[str], *columns: np.ndarray, separator: str = ",") -> Path:
    path.parent.mkdir(exist_ok=True)
    with path.open("w", encoding="utf-8") as file:
        file.write(separator.join(header) + "\n")
        np.savetxt(file, np.column_stack(columns), delimiter=separator, fmt="%.12g")
    return path


def same(log: Log, sound: Log, *sensors: str) -> None:
    for sensor in ("acc", "gyr", "mag"):
        values = getattr(log, sensor)
        assert (values is not None) == (sensor in sensors), sensor
        if values is not None:
            rows = np.isfinite(values).all(axis=1)
            expected = getattr(sound, sensor)
            np.testing.assert_allclose(values[rows], expected, atol=2e-3 * np.abs(expected).max())
    assert log.duration == pytest.approx(sound.duration, rel=1e-3)


def xyz(name: str) -> list[str]:
    return [name.replace("*", axis) for axis in "xyz"]


def counts(path: Path, log: Log) -> Path:
    acc, gyr = np.round(log.acc / STANDARD_GRAVITY * 16384), np.round(np.degrees(log.gyr) * 131)
    return table(path, ["millis", *xyz("a*"), *xyz("g*")], np.round(log.t * 1e3), acc, gyr)


def g_and_degrees(path: Path, log: Log) -> Path:
    header = ["Time", *xyz("Acc*"), *xyz("Gyro*")]
    return table(path, header, log.t * 1e3, log.acc / STANDARD_GRAVITY, np.degrees(log.gyr))


def pixhawk(path: Path, log: Log) -> Path:
    header = ["timestamp", *(f"gyro_rad[{k}]" for k in range(3)), "gyro_integral_dt"]
    header += [f"accelerometer_m_s2[{k}]" for k in range(3)]
    return table(path, header, log.t * 1e6, log.gyr, np.full(log.n, 4e3), log.acc)


def betaflight(path: Path, log: Log) -> Path:
    header = [
        "loopIteration",
        "time (us)",
        *(f"gyroADC[{k}]" for k in range(3)),
        *(f"accSmooth[{k}]" for k in range(3)),
    ]
    acc = np.round(log.acc / STANDARD_GRAVITY * 2048)
    return table(path, header, np.arange(log.n), log.t * 1e6, np.degrees(log.gyr), acc)


def xsens(path: Path, log: Log) -> Path:
    header = ["PacketCounter", "SampleTimeFine", *xyz("Acc_*"), *xyz("Gyr_*")]
    table(path, header, np.arange(log.n), np.round(log.t * 1e4), log.acc, log.gyr, separator="\t")
    path.write_text("// General information:\n// Sample rate: 100.0Hz\n" + path.read_text())
    return path


def shimmer(path: Path, log: Log) -> Path:
    header = ["Shimmer_6F42_Timestamp_Unix_CAL", *xyz("Shimmer_6F42_Accel_LN_*_CAL"), *xyz("Shimmer_6F42_Gyro_*_CAL")]
    table(path, header, 1.6e12 + log.t * 1e3, log.acc, np.degrees(log.gyr), separator="\t")
    lines = path.read_text().split("\n")
    units = "\t".join(["ms", *["m/(s^2)"] * 3, *["deg/s"] * 3])
    path.write_text("\n".join(['"sep=\t"', lines[0], units, *lines[1:]]))
    return path


def utf_16(path: Path, log: Log) -> Path:
    g_and_degrees(path, log)
    path.write_bytes(path.read_text().encode("utf-16"))
    return path


def packed(path: Path, log: Log) -> Path:
    text = pixhawk(path, log).read_bytes()
    with gzip.open(path.with_suffix(".csv.gz"), "wb") as file:
        file.write(text)
    return path.with_suffix(".csv.gz")


@pytest.mark.parametrize(
    ("write", "maker"),
    [
        (counts, ""),
        (g_and_degrees, ""),
        (pixhawk, "PX4 ulog2csv"),
        (betaflight, "Betaflight blackbox"),
        (xsens, "Xsens"),
        (shimmer, "Shimmer Consensys"),
        (utf_16, ""),
        (packed, "PX4 ulog2csv"),
    ],
)
def test_one_file(write: Callable[[Path, Log], Path], maker: str, sound: Log, tmp_path: Path) -> None:
    log = read(write(tmp_path / "a.csv", sound))
    same(log, sound, "acc", "gyr")
    assert any("taken " in note and (f"taken for {maker}:" in note or not maker) for note in log.notes)


def test_phyphox_archive_of_one_file_a_sensor(sound: Log, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for name, values, unit, late in (
            ("Accelerometer", sound.acc, "m/s^2", 0.0),
            ("Gyroscope", sound.gyr, "rad/s", 0.003),
            ("Magnetometer", sound.mag, "µT", 0.001),
        ):
            header = ['"Time (s)"', *(f'"{axis} ({unit})"' for axis in "XYZ")]
            archive.write(table(tmp_path / f"{name}.csv", header, sound.t + late, values), f"{name}.csv")
        archive.writestr("meta/device.csv", "property,value\nversion,1\n")
    log = read(tmp_path / "a.zip")
    same(log, sound, "acc", "gyr", "mag")
    assert log.n == 3 * sound.n  # no two sensors share a time


def test_sensor_logger_keeps_gravity_in_a_table_of_its_own(sound: Log, tmp_path: Path) -> None:
    for name, values in (
        ("TotalAcceleration", sound.acc),
        ("Accelerometer", sound.acc - [0.0, 0.0, STANDARD_GRAVITY]),
        ("Gyroscope", sound.gyr),
    ):
        header = ["time", "seconds_elapsed", "z", "y", "x"]
        table(tmp_path / "log" / f"{name}.csv", header, 1.7e18 + sound.t * 1e9, sound.t, values[:, ::-1])
    same(read(tmp_path / "log"), sound, "acc", "gyr")


def test_a_phone_beside_cameras_in_its_native_folder() -> None:
    path = recording("phone_qualisys/native/Thibaud_Nexus5_NoDist_Texting")
    log = read(path)
    gyroscope = np.loadtxt(path / "gyroscope.txt")
    rows = np.isfinite(log.gyr).all(axis=1)
    np.testing.assert_array_equal(log.t[rows], gyroscope[:, 0])
    np.testing.assert_array_equal(log.gyr[rows], gyroscope[:, 1:4])
    assert np.nanmedian(log.mag[:, 2]) == pytest.approx(376.0, abs=1.0)


def test_dates_and_days_as_time(sound: Log, tmp_path: Path) -> None:
    acc = [",".join(f"{value:.6f}" for value in row) for row in sound.acc]
    begin = datetime(2024, 5, 1, tzinfo=UTC)
    for name, form in (("iso", "%Y-%m-%dT%H:%M:%S.%fZ"), ("matlab", "%d-%b-%Y %H:%M:%S.%f"), ("day", "%H:%M:%S.%f")):
        stamps = [(begin + timedelta(seconds=float(t))).strftime(form) for t in sound.t]
        text = "\n".join(f"{stamp},{row}" for stamp, row in zip(stamps, acc, strict=True))
        (tmp_path / f"{name}.csv").write_text(f"timestamp,acc_x,acc_y,acc_z\n{text}\n")
        same(read(tmp_path / f"{name}.csv"), sound, "acc")
    table(tmp_path / "excel.csv", ["Date", *xyz("acc_*")], 45000.0 + sound.t / 86400.0, sound.acc)
    assert read(tmp_path / "excel.csv").duration == pytest.approx(sound.duration, rel=1e-3)


def test_the_note_on_what_was_taken_quotes_names_that_hold_units(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2]\n0,0,0,9.8\n0.01,0,0.1,9.8\n", encoding="utf-8")
    acc = " ".join(f"'acc_{axis} [m/s^2]'" for axis in "xyz")
    assert read(path).notes == (f"a.csv: taken t from 't [s]' in s, acc from {acc} in m/s^2",)


def test_what_readings_do_not_show_is_asked_once_and_for_the_whole_file(tmp_path: Path, sound: Log) -> None:
    rest = Log.from_arrays(sound.t, acc=np.tile([0.0, 0.0, STANDARD_GRAVITY], (sound.n, 1)), gyr=0.01 * sound.mag)
    path = counts(tmp_path / "a.csv", rest)
    with pytest.raises(InputError, match="does not state the unit of the gyroscope, and the readings") as caught:
        read(path)
    log = read(path, parse_mapping(shell_mappings(str(caught.value.shell_remedy))[0]))
    same(log, rest, "acc", "gyr")


def test_a_shaken_accelerometer_is_proposed_in_the_unit_that_is_nearest_to_gravity(tmp_path: Path, sound: Log) -> None:
    # Nothing rests: a centrifugal force of 8 m/s^2 stands across gravity throughout.
    shaken = sound.acc / np.linalg.norm(sound.acc, axis=1, keepdims=True) * 12.7
    for factor, unit in ((1.0, "m/s^2"), (1.0 / STANDARD_GRAVITY, "g"), (4096 / STANDARD_GRAVITY, "4096 LSB/g")):
        with pytest.raises(InputError, match="do not show it") as raised:
            read(table(tmp_path / "shaken.csv", ["t", *xyz("A*")], sound.t, shaken * factor))
        assert f"acc_x=Ax[{unit}]" in str(raised.value.shell_remedy)


def test_a_log_without_names_and_time_is_asked_once(tmp_path: Path, sound: Log) -> None:
    rows = np.column_stack([sound.acc, sound.gyr])
    np.savetxt(tmp_path / "a.txt", rows, fmt="%.6f")
    with pytest.raises(InputError, match="have no names") as caught:
        read(tmp_path / "a.txt")
    same(
        read(tmp_path / "a.txt", parse_mapping(shell_mappings(str(caught.value.shell_remedy))[0])), sound, "acc", "gyr"
    )


def folder_of_two(path: Path, sound: Log, second: str) -> Path:
    """A folder with two accelerometers, of which the second reads something else."""
    header = ["time (s)", "x (m/s^2)", "y (m/s^2)", "z (m/s^2)"]
    table(path / "Accelerometer.csv", header, sound.t, sound.acc)
    table(path / f"{second}.csv", header, sound.t, -sound.acc)
    table(path / "Gyroscope.csv", ["time (s)", "x (rad/s)", "y (rad/s)", "z (rad/s)"], sound.t, sound.gyr)
    return path


def test_a_second_file_of_a_sensor_is_named_with_the_mapping_that_takes_it(tmp_path: Path, sound: Log) -> None:
    path = folder_of_two(tmp_path / "two", sound, "Accelerometer Left")
    log = read(path)
    same(log, sound, "acc", "gyr")
    (note,) = [note for note in log.notes if "left out" in note]
    assert "Accelerometer Left.x" in note
    (mapping,) = python_mappings(note)
    other = read(path, mapping)
    np.testing.assert_allclose(other.acc, -sound.acc, atol=1e-9)
    np.testing.assert_allclose(other.gyr, sound.gyr, atol=1e-9)


def test_two_files_of_one_sensor_are_asked_about_once_with_both_named(tmp_path: Path, sound: Log) -> None:
    header = ["time (s)", "ax", "ay", "az"]
    for name, sign in (("first", 1.0), ("second", -1.0)):
        table(tmp_path / "runs" / f"{name}.csv", header, sound.t, sign * sound.acc)
    with pytest.raises(InputError, match="several columns may be the accelerometer") as caught:
        read(tmp_path / "runs")
    assert "second.ax second.ay second.az are left out" in str(caught.value)
    (mapping,) = python_mappings(str(caught.value))
    same(read(tmp_path / "runs", mapping), sound, "acc")
    instead = {target: source.replace("first.", "second.") for target, source in mapping.items()}
    np.testing.assert_allclose(read(tmp_path / "runs", instead).acc, -sound.acc, atol=1e-9)


def test_two_sensors_of_a_kind_are_not_chosen_between(tmp_path: Path, sound: Log) -> None:
    header = ["time (s)", *xyz("imu1_acc_*"), *xyz("imu2_acc_*")]
    path = table(tmp_path / "a.csv", header, sound.t, sound.acc, sound.acc)
    with pytest.raises(InputError, match="several columns may be the accelerometer"):
        read(path)


def test_linear_acceleration_is_not_specific_force(tmp_path: Path, sound: Log) -> None:
    header = ["Time (s)", *(f"Linear Acceleration {axis} (m/s^2)" for axis in "xyz")]
    with pytest.raises(InputError):
        read(table(tmp_path / "a.csv", header, sound.t, sound.acc))


def test_reference_in_angles(tmp_path: Path, sound: Log) -> None:
    made = simulate("handheld", {}, seed=4712, duration=20.0)
    q = Log.from_arrays(made.t, acc=made.acc, reference=made.ref_q)
    angles = q.reference.as_euler("ZYX")[:, ::-1]  # type: ignore[union-attr]
    for header, unit in (
        (xyz("ref_*"), 1.0),
        (xyz("ref_*"), np.degrees(1.0)),
        (xyz("Reference * [deg]"), np.degrees(1.0)),
    ):
        names = [
            name.replace(axis, word) for axis, word, name in zip("xyz", ("roll", "pitch", "yaw"), header, strict=True)
        ]
        path = table(tmp_path / "a.csv", ["t", *xyz("acc_*"), *names], made.t, made.acc, angles * unit)
        log = read(path)
        assert log.ref_q is not None
        assert np.abs(np.sum(log.ref_q * made.ref_q, axis=1)).min() > 1.0 - 1e-9
        assert not log.covariates


def test_columns_of_tables_that_are_not_asked_for_make_no_rows(tmp_path: Path, sound: Log) -> None:
    table(tmp_path / "log" / "accelerometer.csv", ["time (s)", *xyz("* (m/s^2)")], sound.t, sound.acc)
    table(tmp_path / "log" / "battery.csv", ["time (s)", "volt"], sound.t + 0.0037, sound.t)
    assert read(tmp_path / "log").n == sound.n
    log = read(tmp_path / "log", {"vbat": "battery.volt"})
    assert (log.n, int(np.isfinite(log.covariates["vbat"]).sum())) == (2 * sound.n, sound.n)


def test_damaged_archives_are_refused(tmp_path: Path, sound: Log) -> None:
    whole = packed(tmp_path / "a.csv", sound).read_bytes()
    with zipfile.ZipFile(tmp_path / "b.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(tmp_path / "a.csv", "a.csv")
    for name, content in (("c.csv.gz", whole), ("c.zip", (tmp_path / "b.zip").read_bytes())):
        for cut in (3, 20, len(content) // 2, len(content) - 4):
            (tmp_path / name).write_bytes(content[:cut])
            with pytest.raises(InputError):
                LogStream(tmp_path / name)


@pytest.mark.parametrize(
    "mapping",
    [
        "t=millis[ms]",
        "temp=21[degC]",
        "acc_x=ax[16384LSB/g],acc_y=ay[16384LSB/g],acc_z=az[16384LSB/g]",
        "gyr_x=gx[131LSB/dps],gyr_y=gy[131LSB/dps],gyr_z=gz[131LSB/dps]",
    ],
)
def test_a_mapping_overrides_only_the_columns_that_it_names(mapping: str, tmp_path: Path, sound: Log) -> None:
    path = counts(tmp_path / "sketch.csv", sound)
    same(read(path, parse_mapping(mapping)), sound, "acc", "gyr")


def test_a_sensor_whose_unit_is_open_is_asked_about_with_a_mapping_too(tmp_path: Path, sound: Log) -> None:
    path = table(tmp_path / "a.csv", ["millis", *xyz("g*")], np.round(sound.t * 1e3), np.round(sound.gyr * 7000))
    with pytest.raises(InputError, match="does not state the unit of the gyroscope") as caught:
        read(path, {"t": "millis[ms]"})
    complete = parse_mapping(shell_mappings(str(caught.value.shell_remedy))[0])
    assert complete["t"] == "millis[ms]"
    assert read(path, complete).gyr is not None


@pytest.mark.parametrize(
    ("scale", "mapping", "rate", "likely"),
    [
        (1.0, "", "1e+05 Hz", "s"),
        (1.0, "t=millis[ms]", "1e+05 Hz", "s"),
        (1e3, "t=millis[us]", "1e+05 Hz", "ms"),
        (1e6, "t=millis[ns]", "1e+05 Hz", "us"),
    ],
)
def test_a_rate_of_no_sensor_asks_about_the_clock_before_any_unit(
    scale: float, mapping: str, rate: str, likely: str, tmp_path: Path, sound: Log
) -> None:
    acc, gyr = np.round(sound.acc / STANDARD_GRAVITY * 16384), np.round(np.degrees(sound.gyr) * 131)
    path = table(tmp_path / "a.csv", ["millis", *xyz("a*"), *xyz("g*")], sound.t * scale, acc, gyr)
    with pytest.raises(InputError) as caught:
        read(path, parse_mapping(mapping) or None)
    assert caught.value.column == "millis"
    assert rate in caught.value.problem
    assert f"looks like {likely}" in caught.value.problem
    repaired = parse_mapping(shell_mappings(str(caught.value.shell_remedy))[0])
    assert repaired == {"t": f"millis[{likely}]"}
    same(read(path, repaired), sound, "acc", "gyr")


def test_a_log_in_its_own_names_is_asked_about_its_clock_before_its_units(tmp_path: Path, sound: Log) -> None:
    names = ["t", *xyz("acc_*"), *xyz("gyr_*")]
    path = table(tmp_path / "a.csv", names, sound.t, sound.acc / STANDARD_GRAVITY, np.degrees(sound.gyr))
    with pytest.raises(InputError, match=r"1e\+05 Hz.*looks like s"):
        read(path, {"t": "t[ms]"})


def test_a_clock_too_slow_to_follow_a_turn_is_asked_about_before_the_gyroscope(tmp_path: Path, sound: Log) -> None:
    path = counts(tmp_path / "sketch.csv", sound)
    with pytest.raises(InputError, match=r"steps are around 10, which looks like ms") as caught:
        read(path, {"t": "millis[s]"})
    same(read(path, parse_mapping(shell_mappings(str(caught.value.shell_remedy))[0])), sound, "acc", "gyr")


@pytest.mark.parametrize(("name", "taken"), [("temperature", 25.0), ("Temperature", -5.0), ("imu_temp", 31.0)])
def test_a_temperature_without_a_unit_is_taken_where_it_reads_as_degrees_celsius(
    name: str, taken: float, tmp_path: Path, sound: Log
) -> None:
    own = ["t", *xyz("acc_*"), *xyz("gyr_*"), name]
    foreign = ["t", *xyz("a*"), *xyz("g*"), name]
    for header in (own, foreign):
        path = table(tmp_path / "a.csv", header, sound.t, sound.acc, sound.gyr, np.full(sound.n, taken))
        log = read(path)
        assert log.temp is not None
        np.testing.assert_allclose(log.temp, taken)
        assert any(f"temp from '{name}' in degC" in note for note in log.notes)


@pytest.mark.parametrize(("name", "value"), [("temperature", 298.0), ("temperature", 77.0), ("motor_temp", 25.0)])
def test_a_temperature_in_an_open_unit_or_of_another_part_is_not_the_sensors(
    name: str, value: float, tmp_path: Path, sound: Log
) -> None:
    header = ["t", *xyz("acc_*"), *xyz("gyr_*"), name]
    log = read(table(tmp_path / "a.csv", header, sound.t, sound.acc, sound.gyr, np.full(sound.n, value)))
    assert log.temp is None
    assert name in log.covariates


def test_a_missing_axis_is_said_before_the_open_unit_of_another_sensor(tmp_path: Path, sound: Log) -> None:
    header = ["t", "ay", "az", *xyz("g*")]
    acc = sound.acc[:, 1:] / STANDARD_GRAVITY
    path = table(tmp_path / "a.csv", header, sound.t, acc, np.degrees(sound.gyr))
    with pytest.raises(InputError) as caught:
        read(path)
    assert caught.value.problem.startswith("the accelerometer lacks a column for x although ay and az are there")
    assert "unit of the gyroscope" in caught.value.problem
    assert "--drop acc" in str(caught.value.shell_remedy)
    complete = parse_mapping(shell_mappings(str(caught.value.shell_remedy))[0])
    same(read(path, complete, drop="acc"), sound, "gyr")


def test_a_sensor_without_an_axis_can_be_left_out(tmp_path: Path, sound: Log) -> None:
    header = ["t", *xyz("a*"), "gx", "gy"]
    path = table(tmp_path / "a.csv", header, sound.t, sound.acc, sound.gyr[:, :2])
    with pytest.raises(InputError, match="gyroscope lacks a column for z although gx and gy are there"):
        read(path)
    same(read(path, drop="gyr"), sound, "acc")


def test_all_missing_columns_are_said_at_once(tmp_path: Path, sound: Log) -> None:
    path = table(tmp_path / "a.csv", ["ay", "az", "gx", "gy"], sound.acc[:, 1:], sound.gyr[:, :2])
    with pytest.raises(InputError, match=r"lacks a column for x .* lacks a column for z .* column t is missing"):
        read(path)
    own = ["acc_y", "acc_z", "gyr_x", "gyr_y"]
    path = table(tmp_path / "b.csv", own, sound.acc[:, 1:], sound.gyr[:, :2])
    with pytest.raises(InputError, match=r"column t is missing; column acc_x is missing .* column gyr_z is missing"):
        read(path)


@pytest.mark.parametrize("header", ["millis,ax,ay,az,gx,gy,gz", "t,ay,az", "t,acc_x,acc_y"])
def test_a_header_without_rows_says_so_and_nothing_else(header: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(header + "\n", encoding="utf-8")
    with pytest.raises(InputError, match="header but no rows"):
        read(tmp_path / "a.csv")


def test_a_quaternion_beside_the_readings_is_offered_where_a_reference_is_missing(tmp_path: Path, sound: Log) -> None:
    made = simulate("handheld", {}, seed=4711, duration=40.0)
    header = ["t", *xyz("a*"), *xyz("g*"), "qw", "qx", "qy", "qz"]
    path = table(tmp_path / "a.csv", header, sound.t, sound.acc, sound.gyr, made.ref_q)
    log = read(path)
    assert log.ref_q is None
    with pytest.raises(InputError, match="no reference attitude") as caught:
        imufit.compare(log)
    mapping = parse_mapping(shell_mappings(str(caught.value.shell_remedy))[0])
    assert mapping == {"ref_qw": "qw", "ref_qx": "qx", "ref_qy": "qy", "ref_qz": "qz"}
    mapped = read(path, mapping)
    same(mapped, sound, "acc", "gyr")
    assert mapped.ref_q is not None


def test_text_among_the_numbers_is_said_beside_the_question_and_the_first_column_first(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = [f"{0.01 * k:.2f},0,0,9.8,0.1,0.2,0.1" for k in range(400)]
    rows[300] = "3.00,hello,0,9.8,not,0.2,0.1"
    path.write_text("time,ax,ay,az,gx,gy,gz\n" + "\n".join(rows) + "\n", encoding="utf-8")
    first = "a.csv: row 300 (line 302), column ax: 'hello' is not a number"
    with pytest.raises(InputError, match="does not state the unit of the gyroscope") as asked:
        read(path)
    assert str(asked.value).startswith(f"{first}; column gx: ")
    (mapping,) = shell_mappings(str(asked.value.shell_remedy))
    with pytest.raises(InputError) as answered:
        read(path, parse_mapping(mapping))
    assert str(answered.value).startswith(f"{first}.")
    gyroscope = {f"gyr_{axis}": f"g{axis}[deg/s]" for axis in "xyz"}
    with pytest.raises(InputError) as answered:
        read(path, gyroscope)
    assert str(answered.value).startswith(f"{first}.")
