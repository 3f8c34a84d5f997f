"""Serial transcripts: the records among boot messages, diagnostics and damaged lines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from imufit.errors import InputError
from imufit.log import Log, open_log, parse_mapping, read
from pasted import python_mappings, shell_mappings
from recording import recording

ACC = ",".join(f"acc_{axis}=a{axis}[g]" for axis in "xyz")
COUNTS = ",".join(f"acc_{a}=accel_{a}[16384LSB/g],gyr_{a}=gyro_{a}[131LSB/dps]" for a in "xyz")
TEMPERATURE = "temp=temp_raw[333.87LSB/degC+21]"
BOOT = "\x1b[0;32mI (24) boot: chip revision: v0.4\x1b[0m\r\nload:0x3fcd5820,len:0x1714\r\nwho_am_i=0x70 tries=1\r\n"


def transcript(tmp_path: Path, *lines: str, mapping: str = f"t=row[10Hz],{ACC}", name: str = "a.log") -> Log:
    (tmp_path / name).write_bytes("".join(f"{line}\n" for line in lines).encode())
    return read(tmp_path / name, parse_mapping(mapping))


def numbered(form: str, n: int = 20) -> list[str]:
    """Lines with x = 0, y = the number of the line / 1000, z = 1."""
    return [form.format(t=0.1 * k, ms=100 * k, x=0.0, y=k / 1000, z=1.0, k=k) for k in range(n)]


def check(log: Log, n: int = 20) -> None:
    assert log.acc is not None
    np.testing.assert_allclose(log.acc[:, 1] / 9.80665, np.arange(n) / 1000, atol=1e-12)
    np.testing.assert_allclose(log.acc[:, 2], 9.80665)
    np.testing.assert_allclose(log.t - log.t[0], 0.1 * np.arange(n), atol=1e-12)


@pytest.mark.parametrize(
    "form",
    [
        "ax={x} ay={y} az={z}",
        "ax: {x}, ay: {y}, az: {z}",
        "ax:{x}\tay:{y}\taz:{z}",
        "ax = {x} | ay = {y} | az = {z}",
        "ax={x}g, ay={y}g, az={z}g;",
        "data {k}: ax={x} ay={y} az={z} ok",
        '{{"ax": {x}, "ay": {y}, "az": {z}}}',
        "\x1b[0;32mI (12{k}) imu: ax={x} ay={y} az={z}\x1b[0m\r",
        "progress 3\rax={x} ay={y} az={z}",
    ],
)
def test_single_values(tmp_path: Path, form: str) -> None:
    check(transcript(tmp_path, BOOT, *numbered(form)))


@pytest.mark.parametrize(
    ("form", "name"),
    [
        ("RAW 0x68: acc=({x}, {y}, {z}) temp=21", "acc_{}"),
        ("a: [{x} {y} {z}]", "a_{}"),
        ("Acc: {x}, {y}, {z} Gyro: 1, 2, 3", "Acc_{}"),
        ("Accel X: {x}, Y: {y}, Z: {z} m/s^2 Gyro X: 1, Y: 2, Z: 3 rad/s", "Accel_{}"),
        ("Acc (g): {x} {y} {z}", "Acc_{} (g)"),
        ("a[0]={x} a[1]={y} a[2]={z}", "a_{}"),
        ('{{"acc":{{"x":{x},"y":{y},"z":{z}}}}}', "acc_{}"),
    ],
)
def test_triples(tmp_path: Path, form: str, name: str) -> None:
    ends = "012" if "[0]" in form else "XYZ" if "X:" in form else "xyz"
    mapping = ",".join(f"acc_{a}={name.format(e)}[g]" for a, e in zip("xyz", ends, strict=True))
    if "Gyro" in form:
        mapping += "," + ",".join(f"gyr_{a}=Gyro_{e}[dps]" for a, e in zip("xyz", ends, strict=True))
    check(transcript(tmp_path, BOOT, *numbered(form), mapping=f"t=row[10Hz],{mapping}"))


@pytest.mark.parametrize(
    ("form", "source"),
    [
        ("t={t} ax={x} ay={y} az={z}", "t"),
        ("millis: {ms}, ax: {x}, ay: {y}, az: {z}", "millis[ms]"),
        ("I ({ms}) imu: ax={x} ay={y} az={z}", "c1[ms]"),
        ("12:00:0{t:.1f} -> ax: {x} ay: {y} az: {z}", "clock"),
        ("2024-01-31T12:00:0{t:.1f}Z ax: {x} ay: {y} az: {z}", "clock"),
    ],
)
def test_time_of_the_record(tmp_path: Path, form: str, source: str) -> None:
    log = transcript(tmp_path, BOOT, *numbered(form), mapping=f"t={source},{ACC}")
    np.testing.assert_allclose(log.t - log.t[0], 0.1 * np.arange(20), atol=1e-6)
    assert log.t[0] == {"12": 43200.0, "20": 1706702400.0}.get(form[:2], 0.0)


def test_clock_that_is_none_is_no_time(tmp_path: Path) -> None:
    lines = ["99:99:99 ax=0 ay=0 az=1", "2024-13-01 12:00:00 ax=0 ay=0 az=1"] * 2
    with pytest.raises(InputError):
        transcript(tmp_path, *lines, mapping=f"t=clock,{ACC}")


def test_frequent_short_diagnostics_do_not_win(tmp_path: Path) -> None:
    lines = [line for pair in zip(numbered("heap={k}"), numbered("ax={x} ay={y} az={z}"), strict=True) for line in pair]
    log = transcript(tmp_path, "heap=1", "heap=2", *lines)
    check(log)
    assert log.notes == (
        "a.log: 20 records (ax, ay, az); 22 other lines ignored",
        "a.log: 22 lines with other values (heap) are not part of the record",
    )


def test_other_lines_are_counted_and_blank_ones_are_not(tmp_path: Path) -> None:
    log = transcript(tmp_path, "hello", "", "# capture", *numbered("ax={x} ay={y} az={z}"), "", "bye")
    assert log.notes == ("a.log: 20 records (ax, ay, az); 3 other lines ignored",)


def test_damaged_records_keep_their_row_and_are_named(tmp_path: Path) -> None:
    lines = numbered("RAW 0x68: acc=({x}, {y}, {z}) temp={k} hum=50")
    lines[3] = "RAW 0x68: acc=(0.0, 0.003, 1.0) temp= hum=50"
    lines[7] = "RAW 0x68: acc=(0.0, 0.0"
    lines[9] = "RAW 0x68: acc=(0.0, 0.0RAW 0x68: acc=(0.0, 0.009, 1.0) temp=9 hum=50"
    lines[19] = "RAW 0x68: acc=(0.0, 0.019, 1.0) temp=1"
    log = transcript(tmp_path, *lines, mapping=",".join(["t=row[10Hz]", *(f"acc_{a}=acc_{a}[g]" for a in "xyz")]))
    assert log.acc is not None
    assert log.temp is not None
    assert log.n == 20
    assert list(np.flatnonzero(np.isnan(log.acc[:, 0]))) == [7]
    # the last number of a line that is cut off may have lost digits
    assert list(np.flatnonzero(np.isnan(log.temp))) == [3, 7, 19]
    assert log.notes == (
        "a.log: 20 records (acc, temp, hum); 0 other lines ignored",
        "a.log: the record in line 4 lacks temp",
        "a.log: the record in line 8 lacks acc_x, acc_y, acc_z, temp, hum",
        "a.log: the record in line 10 names a value twice: two lines may have run into one",
        "a.log: the record in line 20 lacks temp, hum",
    )


def test_many_damaged_records_are_listed(tmp_path: Path) -> None:
    lines = numbered("ax={x} ay={y} az={z}", 40)
    lines[10:20] = ["ax=1 ay= az=1"] * 10
    log = transcript(tmp_path, *lines)
    assert log.notes[5:7] == (
        "a.log: the record in line 15 lacks ay",
        "a.log: 5 more records are damaged, in lines 16, 17, 18, 19, 20",
    )


def test_first_line_may_lack_its_begin(tmp_path: Path) -> None:
    lines = numbered("RAW: ax={x} ay={y} az={z}")
    log = transcript(tmp_path, "0.1 ay=0.0 az=1.0", *lines[1:])
    assert log.n == 20
    assert "a.log: the record in line 1 lacks ax" in log.notes


def test_record_without_its_time_is_left_out_and_named(tmp_path: Path) -> None:
    lines = numbered("ax={x} ay={y} az={z} t={t}")
    lines[-1] = lines[-1].partition(" t=")[0]
    lines[5] = lines[5].replace("t=0.5", "t=nan")
    log = transcript(tmp_path, *lines, mapping=f"t=t,{ACC}")
    assert log.n == 18
    assert log.notes == (
        "a.log: 18 records (ax, ay, az, t); 0 other lines ignored",
        "a.log: the record in line 6 lacks its time, so it is left out",
        "a.log: the record in line 20 lacks az, t, so it is left out",
    )


def test_second_sensor_is_left_out_and_named(tmp_path: Path) -> None:
    one, two = numbered("IMU a: ax={x} ay={y} az={z}"), numbered("IMU b: ax=1 ay=1 az=1", 18)
    log = transcript(tmp_path, *two, *one)
    check(log)
    assert log.notes[0] == "a.log: 20 records (ax, ay, az); 18 other lines ignored"
    assert log.notes[1].startswith("a.log: 18 lines with values of the same names after 'IMU b:' left out: lines 1, 2,")


def test_longer_records_give_the_values_of_the_record(tmp_path: Path) -> None:
    lines = numbered("ax={x} ay={y} az={z}")
    lines[4] += " mx=1 my=2"
    lines[8] += " mx=1 my=2"
    log = transcript(tmp_path, *lines)
    check(log)
    assert log.notes[1:] == ("a.log: 2 records name more values (mx, my), which are not read",)


def test_last_line_without_end_is_noted(tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text("\n".join(numbered("ax={x} ay={y} az={z}")))
    assert "the last line has no line end" in read(tmp_path / "a.log", parse_mapping(f"t=row[10Hz],{ACC}")).notes[-1]


def test_pose_marks_become_labels(tmp_path: Path) -> None:
    lines = numbered("ax={x} ay={y} az={z}", 8)
    marks = ["# face_begin +X", "# face_help keep still", "# face_end +X", "pose begin: -z", "# face_begin up"]
    log = transcript(
        tmp_path, lines[0], *marks[:2], *lines[1:3], marks[2], lines[3], marks[3], *lines[4:6], marks[4], *lines[6:]
    )
    assert log.pose is not None
    assert list(log.pose) == [None, "+x", "+x", None, "-z", "-z", None, None]
    assert log.notes == (
        "a.log: 8 records (ax, ay, az); 1 other line ignored",
        "a.log: the mark in line 11 names no pose (+x -x +y -y +z -z): 'up'",
    )


def test_bad_reading_is_named_by_row_line_and_column(tmp_path: Path) -> None:
    lines = numbered("ax={x} ay={y} az={z}")
    lines[4] = "ax=inf ay=0 az=1"
    with pytest.raises(InputError, match=r"a.log: row 4 \(line 6\), column ax: inf is not a reading"):
        transcript(tmp_path, "boot", *lines)


def test_without_mapping_the_error_names_one_that_works(tmp_path: Path) -> None:
    lines = numbered("accel=({x}, {y}, {z})")
    with pytest.raises(InputError, match="column t is missing") as caught:
        transcript(tmp_path, *lines, mapping="")
    mapping = shell_mappings(str(caught.value.shell_remedy))[0]
    assert mapping == "t=row[100Hz],acc_x=accel_x[g],acc_y=accel_y[g],acc_z=accel_z[g]"
    assert python_mappings(str(caught.value)) == [parse_mapping(mapping)]
    assert read(tmp_path / "a.log", parse_mapping(mapping)).n == 20


@pytest.mark.parametrize("name", ["a.log", "a.csv", "a.capture", "a"])
def test_content_decides_and_not_the_suffix(tmp_path: Path, name: str) -> None:
    check(transcript(tmp_path, *numbered("ax={x} ay={y} az={z}"), name=name))
    table = transcript(tmp_path, *numbered("{x} {y} {z} mode=1"), mapping=TABLE, name=name)
    check(table)
    assert list(table.labels) == ["c4"]


TABLE = "t=row[10Hz],acc_x=c1[g],acc_y=c2[g],acc_z=c3[g]"


def test_table_with_remarks_that_look_like_records(tmp_path: Path) -> None:
    remarks = [f"# range={k} rate={k}" for k in range(50)]
    check(transcript(tmp_path, *remarks, *numbered("{x};{y};{z};state=1"), mapping=TABLE))


def test_long_transcript_is_streamed_in_blocks(tmp_path: Path) -> None:
    n = 45_000
    (tmp_path / "a.log").write_text(BOOT + "".join(f"ax=0 ay={k / 1e6} az=1\n" for k in range(n)))
    mapping = parse_mapping(f"t=row[100Hz],{ACC}")
    stream = open_log(tmp_path / "a.log", mapping, stream=True)
    log = read(tmp_path / "a.log", mapping)
    assert log.acc is not None
    np.testing.assert_array_equal(np.concatenate([chunk.core.acc for chunk in stream.chunks(7000, 5)]), log.acc)
    assert (stream.n, stream.notes) == (n, log.notes)


def test_six_faces_of_a_real_transcript() -> None:
    log = read(recording("serial_transcripts/sixface.log"), parse_mapping(f"t=row[1Hz],{COUNTS},{TEMPERATURE}"))
    assert log.notes == ("sixface.log: 22 records (accel, temp_raw, gyro); 57 other lines ignored",)
    assert log.acc is not None
    assert log.gyr is not None
    assert log.temp is not None
    assert log.pose is not None
    np.testing.assert_allclose(log.acc[0], np.array([9708, 4304, 13400]) / 16384 * 9.80665)
    np.testing.assert_allclose(log.gyr[-1], np.radians(np.array([16184, -8921, -8832]) / 131))
    assert log.temp[0] == pytest.approx(4062 / 333.87 + 21)
    assert set(log.pose) == {"+x"}


def test_minute_of_rest_of_a_real_transcript() -> None:
    log = read(recording("serial_transcripts/stationary-60s.log"), parse_mapping(f"t=row[10Hz],{COUNTS},{TEMPERATURE}"))
    assert log.notes == ("stationary-60s.log: 580 records (accel, temp_raw, gyro); 79 other lines ignored",)
    assert log.acc is not None
    assert np.median(np.linalg.norm(log.acc, axis=1)) == pytest.approx(9.8, abs=0.3)
    assert log.pose is None
