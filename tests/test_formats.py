"""Files of other programs become tables; damaged, cut off and hostile ones an error in one line or what is whole."""

from __future__ import annotations

import json
import pickle
import random
import sqlite3
import struct
import subprocess
import sys
import time
import zipfile
import zlib
from pathlib import Path

import format_files
import numpy as np
import pytest
from format_files import ACC, GYR, MAKERS, QUATERNION, N, T
from imufit.errors import InputError
from imufit.formats.find import FORMATS, SUFFIXES, recording_of
from imufit.formats.recording import Recording, Table
from recording import recording

SECONDS = 10.0
"""Time in which every file must be read or refused, s."""


def read(path: Path) -> Recording:
    found = recording_of(path)
    assert found is not None
    assert found.tables
    for table in found.tables:
        assert table.n > 0
        assert len({len(column) for column in table.columns.values()}) == 1
        assert table.time is None or table.columns[table.time].dtype == float
        for column in table.columns.values():
            assert column.dtype in (float, object)
            assert column.dtype == float or all(value is None or isinstance(value, str) for value in column)
    return found


def table_of(found: Recording, name: str) -> Table:
    (table,) = [table for table in found.tables if table.name == name]
    return table


def stacked(table: Table, *names: str) -> np.ndarray:
    return np.column_stack([table.columns[name] for name in names])


def xyz(name: str) -> tuple[str, ...]:
    return tuple(f"{name}.{axis}" for axis in "xyz")


def three(name: str) -> tuple[str, ...]:
    return tuple(f"{name}[{index}]" for index in range(3))


def check_ros(found: Recording, offset: float = 0.0) -> None:
    imu = table_of(found, "/imu/data")
    assert imu.time is not None
    np.testing.assert_allclose(imu.columns[imu.time], T + offset, atol=1e-6)
    np.testing.assert_allclose(stacked(imu, *xyz("linear_acceleration")), ACC)
    np.testing.assert_allclose(stacked(imu, *xyz("angular_velocity")), GYR)
    np.testing.assert_allclose(stacked(imu, *(f"orientation.{part}" for part in "wxyz")), QUATERNION)
    assert not [name for name in imu.columns if "covariance" in name]


@pytest.mark.parametrize("compression", [None, "bz2", "lz4"])
def test_a_bag_of_ros_1_is_a_table_a_topic(tmp_path: Path, compression: str | None) -> None:
    found = read(format_files.ros1_bag(tmp_path / "a.bag", compression))
    assert found.notes == ()
    check_ros(found)


def test_the_time_of_the_bag_stands_in_where_messages_have_none(tmp_path: Path) -> None:
    check_ros(read(format_files.ros1_bag(tmp_path / "a.bag", stamp=False)), 0.5)


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_the_folder_of_a_bag_of_ros_2_is_read(tmp_path: Path, storage: str) -> None:
    found = read(format_files.ros2_bag(tmp_path / "bag", storage))
    check_ros(found)
    # transforms are a table for every frame that they place
    body = table_of(found, "/tf/body")
    np.testing.assert_allclose(body.columns["transform.translation.z"], np.arange(N))


def test_a_database_of_ros_2_is_read_without_its_folder(tmp_path: Path) -> None:
    check_ros(read(format_files.ros2_database(tmp_path / "a.db3")))


def test_a_folder_that_is_no_bag_is_of_no_format(tmp_path: Path) -> None:
    assert recording_of(tmp_path) is None


@pytest.mark.parametrize("compression", ["NONE", "LZ4", "ZSTD"])
@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_an_mcap_of_ros_is_a_table_a_topic(tmp_path: Path, encoding: str, compression: str) -> None:
    found = read(format_files.mcap(tmp_path / "a.mcap", encoding, compression))
    assert found.notes == ()
    check_ros(found)


def test_an_mcap_of_json_is_a_table_a_topic(tmp_path: Path) -> None:
    imu = table_of(read(format_files.mcap(tmp_path / "a.mcap", "json")), "/imu/data")
    np.testing.assert_allclose(imu.columns["t"], T, atol=1e-6)
    np.testing.assert_allclose(stacked(imu, *xyz("linear_acceleration")), ACC)


@pytest.mark.parametrize("units", [True, False])
def test_messages_of_two_sensors_in_a_dataflash_log_are_two_tables(tmp_path: Path, units: bool) -> None:
    found = read(format_files.dataflash(tmp_path / "a.bin", units))
    assert found.notes == ()
    for sensor in range(2):
        imu = table_of(found, f"IMU.{sensor}")
        assert imu.time == "TimeUS"
        np.testing.assert_allclose(imu.columns["TimeUS"], T)
        np.testing.assert_allclose(stacked(imu, "AccX", "AccY", "AccZ"), ACC + sensor, rtol=1e-6)
        np.testing.assert_allclose(imu.columns["Volt"], 12.34)
    assert list(table_of(found, "MODE").columns["Mode"]) == ["LOITER"]


def test_ulog_has_times_in_seconds() -> None:
    found = read(recording("px4_ulog/sample.ulg"))
    sensors = table_of(found, "sensor_combined")
    assert sensors.time == "timestamp"
    assert np.median(np.diff(sensors.columns["timestamp"])) == pytest.approx(0.004, abs=2e-4)
    gravity = np.linalg.norm(stacked(sensors, *three("accelerometer_m_s2")), axis=1)
    assert np.median(gravity) == pytest.approx(9.8, abs=0.3)
    assert table_of(found, "vehicle_attitude").n == 6461


def test_the_whole_messages_of_a_ulog_that_is_cut_off_are_read(tmp_path: Path) -> None:
    data = recording("px4_ulog/sample.ulg").read_bytes()
    path = tmp_path / "cut.ulg"
    path.write_bytes(data[: len(data) // 2])
    found = read(path)
    sensors = table_of(found, "sensor_combined")
    assert 0.45 < sensors.n / 17070 < 0.55
    assert "whole messages" in found.notes[0]
    assert f"{max(table.columns['timestamp'].max() for table in found.tables):.3f} s" in found.notes[0]


def test_a_ulog_with_appended_data_and_damage_between_is_read_on(tmp_path: Path) -> None:
    data = recording("px4_ulog/sample.ulg").read_bytes()
    flags = struct.pack("<HB8s8s", 40, ord("B"), bytes(8), b"\x01" + bytes(7))
    cut, path = len(data) // 2, tmp_path / "appended.ulg"
    first = data[:16] + flags + bytes(24) + data[16:cut]
    whole = read(recording("px4_ulog/sample.ulg"))
    place = struct.pack("<QQQ", len(first), 0, 0)
    info = b"int32_t twice"
    appended = struct.pack("<HBB", len(info) + 5, ord("I"), len(info)) + info + bytes(4)
    path.write_bytes(first[: 16 + len(flags)] + place + first[16 + len(flags) + 24 :] + appended)
    half = table_of(read(path), "sensor_combined")
    assert 0.4 < half.n / 17070 < 0.6
    np.testing.assert_array_equal(
        half.columns["timestamp"], table_of(whole, "sensor_combined").columns["timestamp"][: half.n]
    )
    # a few sectors of the middle are gone: messages go on behind
    path.write_bytes(data[:cut] + data[cut + 5000 :])
    found = read(path)
    assert 0.98 * 17070 < table_of(found, "sensor_combined").n < 17070
    assert "damaged" in found.notes[0]


def hostile_ends() -> list[bytes]:
    """Ends behind the definitions of a ULog at which a reader that goes back could go on for ever."""
    return [b"\xff" * 500_000, bytes(500_000), b"\xff\xffD" + bytes(100), b"\x00\x00D" * 1000, b"\x10\x27Z" + bytes(9)]


@pytest.mark.parametrize("place", [1000, 1_000_000])
def test_no_end_of_a_ulog_holds_its_reader_up(tmp_path: Path, place: int) -> None:
    data = recording("px4_ulog/sample.ulg").read_bytes()[:place]
    for end in hostile_ends():
        (tmp_path / "a.ulg").write_bytes(data + end)
        check_damaged(tmp_path / "a.ulg")


@pytest.mark.parametrize("compressed", [True, False])
def test_structs_of_matlab_are_tables_by_their_clocks(tmp_path: Path, compressed: bool) -> None:
    found = read(format_files.matlab(tmp_path / "a.mat", compressed=compressed))
    imu, mocap = table_of(found, "imu"), table_of(found, "mocap")
    np.testing.assert_array_equal(imu.columns["t"], T)
    np.testing.assert_array_equal(stacked(imu, *three("acc")), ACC)
    np.testing.assert_array_equal(stacked(imu, *three("gyr")), GYR)
    # without times beside them, the rate in the struct makes the clock
    assert mocap.time == "t"
    np.testing.assert_allclose(mocap.columns["t"], np.arange(N) / 50)
    np.testing.assert_array_equal(mocap.columns["RigidBodies.Rotations[4]"], 1 + np.arange(N))
    np.testing.assert_array_equal(stacked(mocap, *three("RigidBodies.Positions")), ACC)


def test_a_real_file_of_a_motion_capture_system_is_read() -> None:
    folder = recording("phone_qualisys/native")
    found = read(next(folder.glob("*/qualisys.mat")))
    (table,) = found.tables
    assert table.n == 7200
    np.testing.assert_allclose(np.diff(table.columns["t"]), 1 / 60)
    rotations = stacked(table, *(f"RigidBodies.Rotations[{index}]" for index in range(9))).reshape(-1, 3, 3)
    rotations = rotations[np.isfinite(rotations).all(axis=(1, 2))]
    np.testing.assert_allclose(
        rotations @ rotations.transpose(0, 2, 1), np.tile(np.eye(3), (len(rotations), 1, 1)), atol=1e-4
    )


def test_other_versions_of_matlab_are_read(tmp_path: Path) -> None:
    for name in ("v4.mat", "v73.mat"):
        (table,) = read(MAKERS[name](tmp_path / name)).tables
        np.testing.assert_array_equal(table.columns["t"], T)
        np.testing.assert_array_equal(stacked(table, *three("acc")), ACC)


@pytest.mark.parametrize("attribute", [True, False])
def test_the_layout_of_broad_is_one_table(tmp_path: Path, attribute: bool) -> None:
    (table,) = read(format_files.hdf5(tmp_path / "a.h5", attribute)).tables
    np.testing.assert_allclose(table.columns["t"], np.arange(N) / 100)
    np.testing.assert_array_equal(stacked(table, *three("imu_acc")), ACC)
    np.testing.assert_array_equal(stacked(table, *(f"opt_quat[{index}]" for index in range(4))), QUATERNION)
    np.testing.assert_array_equal(table.columns["movement"], np.arange(N) > 50)


def test_a_short_recording_of_hdf5_keeps_its_axes(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["t"] = T[:3]
        file["acc"] = ACC[:3]
    (table,) = read(tmp_path / "a.h5").tables
    np.testing.assert_array_equal(stacked(table, *three("acc")), ACC[:3])


def test_a_sheet_is_read_below_its_title_with_its_units(tmp_path: Path) -> None:
    (table,) = read(format_files.excel(tmp_path / "a.xlsx")).tables
    np.testing.assert_allclose(table.columns["Time (s)"], T)
    np.testing.assert_allclose(stacked(table, *(f"Acc{axis} (m/s^2)" for axis in "XYZ")), ACC)
    assert list(table.columns["Note"][:2]) == ["start", None]


def test_dates_of_a_sheet_are_the_time(tmp_path: Path) -> None:
    (table,) = read(format_files.excel_dates(tmp_path / "a.xlsx")).tables
    assert table.time == "when"
    start = 1714979289.0  # 2024-05-06 07:08:09 UTC
    np.testing.assert_allclose(table.columns["when"], start + 0.01 * np.arange(N), atol=1e-3)


@pytest.mark.parametrize("compression", ["uncompressed", "lz4", "zstd"])
def test_feather_is_read(tmp_path: Path, compression: str) -> None:
    (table,) = read(format_files.feather(tmp_path / "a.feather", compression)).tables
    np.testing.assert_array_equal(table.columns["t"], T)
    assert list(table.columns["pose"][:2]) == ["+x", None]


def test_feather_keeps_dates_and_metadata(tmp_path: Path) -> None:
    import pyarrow as pa

    when = pa.array(np.arange(3) * 500, type=pa.timestamp("ms"))
    missing = pa.array([1.0, None, 3.0])
    table = pa.table({"when": when, "acc_x": missing}).replace_schema_metadata({"imufit": '{"frame": "ENU"}'})
    with pa.OSFile(str(tmp_path / "a.arrow"), "wb") as file, pa.ipc.new_file(file, table.schema) as writer:
        writer.write_table(table)
    found = read(tmp_path / "a.arrow")
    assert found.metadata == {"frame": "ENU"}
    assert found.tables[0].time == "when"
    np.testing.assert_array_equal(found.tables[0].columns["when"], [0.0, 0.5, 1.0])
    np.testing.assert_array_equal(found.tables[0].columns["acc_x"], [1.0, np.nan, 3.0])


def test_arrays_of_numpy_are_read(tmp_path: Path) -> None:
    (matrix,) = read(format_files.numpy_matrix(tmp_path / "a.npy")).tables
    np.testing.assert_array_equal(stacked(matrix, "c1", "c2", "c3", "c4"), np.column_stack([T, ACC]))
    (table,) = read(format_files.numpy_structured(tmp_path / "b.npy")).tables
    np.testing.assert_array_equal(table.columns["t"], T)
    np.testing.assert_allclose(stacked(table, *three("acc")), ACC, rtol=1e-6)


def test_json_is_read_in_each_of_its_shapes(tmp_path: Path) -> None:
    (rows,) = read(format_files.json_objects(tmp_path / "a.json")).tables
    np.testing.assert_array_equal(rows.columns["acc.y"], ACC[:, 1])
    np.testing.assert_array_equal(rows.columns["ok"], 1.0)
    (arrays,) = read(format_files.json_arrays(tmp_path / "b.json")).tables
    np.testing.assert_allclose(arrays.columns["t"], np.arange(N) / 100)
    np.testing.assert_array_equal(stacked(arrays, *three("imu.gyr")), GYR)
    (lines,) = read(format_files.json_lines(tmp_path / "c.jsonl")).tables
    np.testing.assert_array_equal(lines.columns["acc_x"], ACC[:, 0])


def test_fields_that_objects_lack_are_missing(tmp_path: Path) -> None:
    content = [{"t": 0}, {"t": 1, "acc": 2.5, "pose": "+x"}, {"t": None, "acc": 3.5, "long": [0] * 99}]
    (tmp_path / "a.json").write_text(json.dumps(content))
    found = read(tmp_path / "a.json")
    columns = found.tables[0].columns
    np.testing.assert_array_equal(columns["t"], [0, 1, np.nan])
    np.testing.assert_array_equal(columns["acc"], [np.nan, 2.5, 3.5])
    assert list(columns["pose"]) == [None, "+x", None]
    assert "long" in found.notes[0]


def test_a_pickle_is_refused_and_not_run(tmp_path: Path) -> None:
    class Runs:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "ran",))

    for name, protocol in (("a.pkl", 2), ("a.pickle", 4), ("a.dat", 5)):
        (tmp_path / name).write_bytes(pickle.dumps(Runs(), protocol))
        with pytest.raises(InputError, match="runs whatever code"):
            recording_of(tmp_path / name)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("name", [name for name in MAKERS if not name.endswith(("v4.mat", ".json", ".jsonl"))])
def test_the_content_tells_the_format_whatever_the_suffix(tmp_path: Path, name: str) -> None:
    (tmp_path / "named.dat").write_bytes(format_files.bytes_of(name, tmp_path))
    read(tmp_path / "named.dat")


def test_other_files_are_of_no_format(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", t=T, acc_x=ACC[:, 0])
    (tmp_path / "log.csv").write_text("t,acc_x\n0,1\n")
    (tmp_path / "raw.bin").write_bytes(bytes(range(256)) * 8)
    (tmp_path / "empty").write_bytes(b"")
    for name in ("log.npz", "log.csv", "raw.bin", "empty", "not there"):
        assert recording_of(tmp_path / name) is None


@pytest.mark.parametrize("suffix", [suffix for suffix in SUFFIXES if suffix != ".bin"])
def test_a_file_that_only_its_suffix_names_is_refused_by_name(tmp_path: Path, suffix: str) -> None:
    for content in (b"", b"\x00", b"nothing of the kind\n" * 100):
        (tmp_path / f"a{suffix}").write_bytes(content)
        with pytest.raises(InputError, match=f"^a{suffix}: "):
            recording_of(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("form", [form for form in FORMATS if form.extra], ids=lambda form: form.name)
def test_a_library_that_is_not_installed_is_named_with_its_line(tmp_path: Path, form, monkeypatch) -> None:
    path = tmp_path / f"a{form.suffixes[0]}"
    makers = [maker for name, maker in MAKERS.items() if Path(name).suffix in form.suffixes]
    if makers:
        makers[0](path)
    else:
        path.write_bytes(b"ULog\x01\x12\x35")
    for module in ("pyulog", "rosbags", "mcap", "pymavlink", "h5py", "openpyxl"):
        for name in [name for name in sys.modules if name.partition(".")[0] == module]:
            monkeypatch.setitem(sys.modules, name, None)
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError, match=rf"pip install 'imufit\[{form.extra}\]'"):
        recording_of(path)


def mutated(data: bytes, draw: random.Random) -> bytes:
    """Change a file as transfers, broken disks and other people do."""
    kind = draw.randrange(5)
    at = draw.randrange(len(data))
    if kind == 0:
        return data[:at]
    if kind == 1:
        changed = bytearray(data)
        for _ in range(draw.choice([1, 3, 30])):
            changed[draw.randrange(len(data))] = draw.randrange(256)
        return bytes(changed)
    if kind == 2:
        at = draw.randrange(min(len(data), 600))
        return data[:at] + draw.choice([b"\xff" * 8, b"\0" * 4, b"\x7f\xff\xff\xff"]) + data[at + draw.randrange(9) :]
    if kind == 3:
        return data[:at] + data[at + draw.randrange(1, 200) :]
    return data[:at] + data[max(0, at - 300) :]


def check_damaged(path: Path) -> None:
    start = time.monotonic()
    found, problem = None, ""
    try:
        found = recording_of(path)
    except InputError as error:
        problem = str(error)
    assert "\n" not in problem
    assert found is None or found.tables
    assert time.monotonic() - start < SECONDS


@pytest.mark.parametrize("name", [*MAKERS, "sample.ulg"])
def test_damaged_files_are_refused_or_read_in_part(
    tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    if name == "sample.ulg":
        data = recording("px4_ulog/sample.ulg").read_bytes()[:300_000]
    else:
        data = format_files.bytes_of(name, tmp_path)
    capfd.readouterr()
    path = tmp_path / f"damaged{Path(name).suffix}"
    for end in [*range(0, min(len(data), 300), 23), *np.linspace(300, len(data), 25).astype(int)]:
        path.write_bytes(data[:end])
        check_damaged(path)
    draw = random.Random(name)
    for _ in range(60):
        path.write_bytes(mutated(data, draw))
        check_damaged(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "maker"),
    [
        ("a.bag", lambda path: format_files.ros1_bag(path, None)),
        ("a.mcap", lambda path: format_files.mcap(path, compression="NONE")),
        ("b.mcap", lambda path: format_files.mcap(path, compression="ZSTD")),
        ("a.bin", format_files.dataflash),
        ("a.jsonl", format_files.json_lines),
    ],
)
def test_the_whole_part_of_a_file_that_is_cut_off_is_read_with_a_note(tmp_path: Path, name: str, maker) -> None:
    path = maker(tmp_path / name)
    whole = max(read(path).tables, key=lambda table: table.n)
    data = path.read_bytes()
    path.write_bytes(data[: int(0.6 * len(data))])
    found = read(path)
    part = next(table for table in found.tables if table.name == whole.name)
    assert 0.2 * N < part.n < N
    for key, column in part.columns.items():
        np.testing.assert_array_equal(column, whole.columns[key][: part.n])
    assert any("cut off" in note for note in found.notes)


def packed(size: int) -> bytes:
    packer = zlib.compressobj(9)
    return b"".join(packer.compress(bytes(1 << 20)) for _ in range(size >> 20)) + packer.flush()


def hostile_matlab(path: Path) -> None:
    body = packed(400 << 20)
    header = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path.write_bytes(header + struct.pack("<II", 15, len(body)) + body)


def hostile_hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        file.create_dataset("acc", shape=(10**9, 3), dtype=float, chunks=(1000, 3))


def hostile_excel(path: Path) -> None:
    format_files.excel(path)
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, b" " * 60_000_000 if name.endswith("sheet1.xml") else content)


def far_cell(path: Path) -> None:
    import openpyxl

    book = openpyxl.Workbook()
    for row in range(1, 300):
        book.active.cell(row, 16_384, 1.0)
    book.active.cell(1_048_576, 1, 2.0)
    book.save(path)


def hostile_numpy(path: Path) -> None:
    with path.open("wb") as file:
        np.lib.format.write_array_header_1_0(file, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 3)})


def hostile_ulog(path: Path) -> None:
    formats = [f"m{k}:m{k + 1}[999] x;" for k in range(8)] + ["m8:uint64_t timestamp;", "loop:loop[2] x;"]
    data = b"ULog\x01\x12\x35\x01" + bytes(8)
    for text in formats:
        data += struct.pack("<HB", len(text), ord("F")) + text.encode()
    path.write_bytes(data + struct.pack("<HBBH", 5, ord("A"), 0, 0) + b"m0")


def hostile_mcap(path: Path) -> None:
    import zstandard

    packer = zstandard.ZstdCompressor().compressobj()
    body = b"".join(packer.compress(bytes(1 << 20)) for _ in range(2000)) + packer.flush()
    chunk = struct.pack("<QQQII", 0, 0, 2000 << 20, 0, 4) + b"zstd" + struct.pack("<Q", len(body)) + body
    path.write_bytes(b"\x89MCAP0\r\n" + struct.pack("<BQ", 6, len(chunk)) + chunk)


def hostile_message(path: Path) -> None:
    """A list of four billion members that take no bytes."""
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        text = b"a/Nothing[] list\n" + b"=" * 80 + b"\nMSG: a/Nothing\n"
        channel = writer.register_channel("/x", "ros1", writer.register_schema("a/List", "ros1msg", text))
        writer.add_message(channel, log_time=0, publish_time=0, data=b"\xff\xff\xff\xff")
        writer.finish()


def hostile_database(path: Path) -> None:
    format_files.ros2_database(path)
    with sqlite3.connect(path) as database:
        database.execute("ALTER TABLE messages ADD COLUMN big BLOB GENERATED ALWAYS AS (zeroblob(900000000)) VIRTUAL")


def hostile_json(path: Path) -> None:
    path.write_text("[" * 1_000_000)


def hostile_dataflash(path: Path) -> None:
    path.write_bytes(format_files.dataflash(path).read_bytes() + b"\xa3\x95\x07" * 1_000_000)


def unknown_kind(path: Path) -> None:
    """Values of a kind that MATLAB does not have, at which scipy looks beyond the end of a list in memory."""
    data = format_files.matlab(path, compressed=False).read_bytes()
    values = struct.pack("<II", 9, 8 * N)
    assert values in data
    path.write_bytes(data.replace(values, struct.pack("<II", 0xEEEE, 8 * N)))


HOSTILE = {
    "kind.mat": unknown_kind,
    "a.mat": hostile_matlab,
    "a.h5": hostile_hdf5,
    "a.xlsx": hostile_excel,
    "far.xlsx": far_cell,
    "a.npy": hostile_numpy,
    "a.ulg": hostile_ulog,
    "a.mcap": hostile_mcap,
    "list.mcap": hostile_message,
    "a.db3": hostile_database,
    "a.json": hostile_json,
    "a.bin": hostile_dataflash,
}
MEASURED = """
import re, sys, time
from pathlib import Path
from imufit.errors import InputError
from imufit.formats.find import recording_of
start = time.monotonic()
try:
    recording_of(Path(sys.argv[1]))
except InputError:
    pass
kilobytes = re.search(r"VmHWM:\\s*(\\d+)", Path("/proc/self/status").read_text())[1]
print(time.monotonic() - start, 1024 * int(kilobytes))
"""


@pytest.mark.parametrize("name", HOSTILE)
def test_a_small_file_takes_no_more_than_its_bounds(tmp_path: Path, name: str) -> None:
    HOSTILE[name](tmp_path / name)
    run = subprocess.run(
        [sys.executable, "-c", MEASURED, str(tmp_path / name)], capture_output=True, text=True, timeout=60, check=False
    )
    assert (run.returncode, run.stderr) == (0, "")
    seconds, memory = map(float, run.stdout.split())
    assert seconds < SECONDS
    assert memory < 1e9
