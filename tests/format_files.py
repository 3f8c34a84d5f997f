"""Files of other programs, written by the libraries that the programs write them with: 200 samples at 100 Hz."""

from __future__ import annotations

import contextlib
import io
import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np

N = 200
T = 1000.0 + 0.01 * np.arange(N)
ACC = np.column_stack([np.sin(0.05 * np.arange(N)), np.cos(0.03 * np.arange(N)), 9.81 + 0.001 * np.arange(N)])
GYR = 0.1 * ACC[:, ::-1]
QUATERNION = np.column_stack([np.cos(0.01 * np.arange(N)), np.sin(0.01 * np.arange(N)), np.zeros(N), np.zeros(N)])


def _ros_imu(store, k, stamp=True):
    types = store.types
    time = types["builtin_interfaces/msg/Time"](int(T[k]) if stamp else 0, round(T[k] % 1 * 1e9) if stamp else 0)
    header = types["std_msgs/msg/Header"](**({"seq": k} if "seq" in _fields(store) else {}), stamp=time, frame_id="imu")
    vector = types["geometry_msgs/msg/Vector3"]
    return types["sensor_msgs/msg/Imu"](
        header=header,
        orientation=types["geometry_msgs/msg/Quaternion"](*QUATERNION[k, [1, 2, 3, 0]]),
        orientation_covariance=np.zeros(9),
        angular_velocity=vector(*GYR[k]),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=vector(*ACC[k]),
        linear_acceleration_covariance=np.zeros(9),
    )


def _ros_transforms(store, k):
    types = store.types
    time = types["builtin_interfaces/msg/Time"](int(T[k]), round(T[k] % 1 * 1e9))
    header = types["std_msgs/msg/Header"](**({"seq": k} if "seq" in _fields(store) else {}), stamp=time, frame_id="map")
    transform = types["geometry_msgs/msg/Transform"](
        translation=types["geometry_msgs/msg/Vector3"](1.0, 2.0, float(k)),
        rotation=types["geometry_msgs/msg/Quaternion"](*QUATERNION[k, [1, 2, 3, 0]]),
    )
    stamped = types["geometry_msgs/msg/TransformStamped"](header=header, child_frame_id="body", transform=transform)
    return types["tf2_msgs/msg/TFMessage"](transforms=[stamped])


def _fields(store):
    return [field for field, _ in store.fielddefs["std_msgs/msg/Header"][1]]


def _stores():
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    ros1, ros2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
    text = "geometry_msgs/TransformStamped[] transforms"
    ros1.register(get_types_from_msg(text, "tf2_msgs/msg/TFMessage"))
    return ros1, ros2


def ros1_bag(path: Path, compression: str | None = "lz4", stamp: bool = True) -> Path:
    from rosbags.rosbag1 import Writer

    store, _ = _stores()
    writer = Writer(path)
    if compression:
        writer.set_compression(Writer.CompressionFormat[compression.upper()])
    with writer:
        imu = writer.add_connection("/imu/data", "sensor_msgs/msg/Imu", typestore=store)
        tf = writer.add_connection("/tf", "tf2_msgs/msg/TFMessage", typestore=store)
        for k in range(N):
            at = round((T[k] + 0.5) * 1e9)
            writer.write(imu, at, store.serialize_ros1(_ros_imu(store, k, stamp), "sensor_msgs/msg/Imu"))
            writer.write(tf, at, store.serialize_ros1(_ros_transforms(store, k), "tf2_msgs/msg/TFMessage"))
    return path


def ros2_bag(path: Path, storage: str = "sqlite3") -> Path:
    from rosbags.rosbag2 import StoragePlugin, Writer

    _, store = _stores()
    with Writer(path, version=9, storage_plugin=StoragePlugin[storage.upper()]) as writer:
        imu = writer.add_connection("/imu/data", "sensor_msgs/msg/Imu", typestore=store)
        tf = writer.add_connection("/tf", "tf2_msgs/msg/TFMessage", typestore=store)
        for k in range(N):
            at = round((T[k] + 0.5) * 1e9)
            writer.write(imu, at, store.serialize_cdr(_ros_imu(store, k), "sensor_msgs/msg/Imu"))
            writer.write(tf, at, store.serialize_cdr(_ros_transforms(store, k), "tf2_msgs/msg/TFMessage"))
    return path


def ros2_database(path: Path) -> Path:
    folder = ros2_bag(path.with_suffix(""))
    path.write_bytes(next(folder.glob("*.db3")).read_bytes())
    return path


def mcap(path: Path, encoding: str = "cdr", compression: str = "ZSTD") -> Path:
    from mcap.writer import CompressionType, Writer

    ros1, ros2 = _stores()
    store = ros1 if encoding == "ros1" else ros2
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=20_000, compression=CompressionType[compression])
        writer.start(profile="", library="")
        if encoding == "json":
            schema = writer.register_schema("Imu", "jsonschema", b'{"type": "object"}')
        else:
            text, _ = store.generate_msgdef("sensor_msgs/msg/Imu", ros_version=1 if encoding == "ros1" else 2)
            schema = writer.register_schema(
                "sensor_msgs/msg/Imu", f"{'ros1' if encoding == 'ros1' else 'ros2'}msg", text.encode()
            )
        channel = writer.register_channel("/imu/data", encoding, schema)
        for k in range(N):
            if encoding == "json":
                vector = dict(zip("xyz", ACC[k], strict=True))
                stamp = {"sec": int(T[k]), "nanosec": round(T[k] % 1 * 1e9)}
                data = json.dumps({"header": {"stamp": stamp}, "linear_acceleration": vector}).encode()
            else:
                serialize = store.serialize_ros1 if encoding == "ros1" else store.serialize_cdr
                data = bytes(serialize(_ros_imu(store, k), "sensor_msgs/msg/Imu"))
            at = round((T[k] + 0.5) * 1e9)
            writer.add_message(channel, log_time=at, data=data, publish_time=at)
        writer.finish()
    return path


def dataflash(path: Path, units: bool = True) -> Path:
    """By the layout that ArduPilot publishes: FMT messages, then two sensors whose messages alternate."""

    def described(kind, length, name, layout, columns):
        return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, length, name, layout, columns)

    imu = "<QBffffffhh"
    parts = [
        described(0x80, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns"),
        described(64, 3 + struct.calcsize("<QB16s16s"), b"FMTU", b"QBNN", b"TimeUS,FmtType,UnitIds,MultIds"),
        described(
            65, 3 + struct.calcsize(imu), b"IMU", b"QBffffffhc", b"TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,Temp,Volt"
        ),
        described(66, 3 + 8 + 16, b"MODE", b"QN", b"TimeUS,Mode"),
    ]
    if units:
        parts.append(b"\xa3\x95\x40" + struct.pack("<QB16s16s", 0, 65, b"s#EEEooo--", b"F---------"))
    for k in range(N):
        for sensor in range(2):
            values = (*(GYR[k] + sensor), *(ACC[k] + sensor))
            parts.append(b"\xa3\x95\x41" + struct.pack(imu, round(T[k] * 1e6), sensor, *values, 25, 1234))
    parts.append(b"\xa3\x95\x42" + struct.pack("<Q16s", round(T[-1] * 1e6), b"LOITER"))
    path.write_bytes(b"".join(parts))
    return path


def matlab(path: Path, form: str = "5", compressed: bool = True) -> Path:
    import scipy.io

    rotations = np.stack([np.eye(3).reshape(-1) * (1 + k) for k in range(N)], axis=1).reshape(1, 9, N)
    imu = {"t": T, "acc": ACC, "gyr": GYR.T, "name": "MPU"}
    mocap = {"FrameRate": 50.0, "RigidBodies": {"Rotations": rotations, "Positions": ACC.T.reshape(1, 3, N)}}
    content = {"imu": imu, "mocap": mocap}
    if form == "4":
        content = {"t": T, "acc": ACC}
    scipy.io.savemat(path, content, format=form, do_compression=compressed and form == "5")
    return path


def matlab_73(path: Path) -> Path:
    """As MATLAB writes its version 7.3: HDF5 behind 512 bytes of its own, the axes in reverse."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group("imu")
        group["t"] = T.reshape(1, N)
        group["acc"] = ACC.T
        group["name"] = np.array([[77], [80]], dtype=np.uint16)
        group["name"].attrs["MATLAB_class"] = np.bytes_(b"char")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


def hdf5(path: Path, rate_as_attribute: bool = False) -> Path:
    """As the BROAD recordings are laid out."""
    import h5py

    with h5py.File(path, "w") as file:
        file.create_dataset("imu_acc", data=ACC, compression="gzip")
        file["imu_gyr"] = GYR
        file["opt_quat"] = QUATERNION
        file["movement"] = np.arange(N) > 50
        if rate_as_attribute:
            file.attrs["sampling_rate"] = 100.0
        else:
            file["sampling_rate"] = 100.0
    return path


def excel(path: Path) -> Path:
    import openpyxl

    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append(["Experiment of Monday"])
    sheet.append([])
    sheet.append(["Time", "AccX", "AccY", "AccZ", "Note"])
    sheet.append(["s", "m/s^2", "m/s^2", "m/s^2"])
    for k in range(N):
        sheet.append([T[k], *ACC[k], "start" if k == 0 else None])
    book.save(path)
    return path


def excel_dates(path: Path) -> Path:
    import pandas as pd

    when = pd.Timestamp("2024-05-06 07:08:09") + pd.to_timedelta(10 * np.arange(N), unit="ms")
    pd.DataFrame({"when": when, "AccX": ACC[:, 0], "AccY": ACC[:, 1]}).to_excel(path, index=False)
    return path


def feather(path: Path, compression: str = "lz4") -> Path:
    import pandas as pd

    frame = pd.DataFrame({"t": T, "acc_x": ACC[:, 0], "acc_y": ACC[:, 1], "pose": ["+x", None] * (N // 2)})
    frame.to_feather(path, compression=compression)
    return path


def numpy_matrix(path: Path) -> Path:
    np.save(path, np.column_stack([T, ACC]))
    return path


def numpy_structured(path: Path) -> Path:
    table = np.zeros(N, dtype=[("t", float), ("acc", np.float32, (3,)), ("label", "U4")])
    table["t"], table["acc"], table["label"] = T, ACC, "a"
    np.save(path, table)
    return path


def json_objects(path: Path) -> Path:
    path.write_text(
        json.dumps([{"t": t, "acc": {"x": a[0], "y": a[1]}, "ok": True} for t, a in zip(T, ACC, strict=True)])
    )
    return path


def json_arrays(path: Path) -> Path:
    path.write_text(json.dumps({"rate": 100, "imu": {"acc": ACC.tolist(), "gyr": GYR.T.tolist()}}))
    return path


def json_lines(path: Path) -> Path:
    path.write_text("".join(json.dumps({"t": t, "acc_x": a}) + "\n" for t, a in zip(T, ACC[:, 0], strict=True)))
    return path


MAKERS: dict[str, Callable[[Path], Path]] = {
    "ros1.bag": ros1_bag,
    "ros2.db3": ros2_database,
    "cdr.mcap": mcap,
    "json.mcap": lambda path: mcap(path, "json", "LZ4"),
    "flash.bin": dataflash,
    "v5.mat": matlab,
    "plain.mat": lambda path: matlab(path, compressed=False),
    "v4.mat": lambda path: matlab(path, "4"),
    "v73.mat": matlab_73,
    "broad.h5": hdf5,
    "sheet.xlsx": excel,
    "table.feather": feather,
    "matrix.npy": numpy_matrix,
    "structured.npy": numpy_structured,
    "objects.json": json_objects,
    "arrays.json": json_arrays,
    "lines.jsonl": json_lines,
}
"""A maker for every format, by the name that its file gets."""


def bytes_of(name: str, folder: Path) -> bytes:
    """Return the file that a maker makes."""
    with contextlib.redirect_stdout(io.StringIO()):
        return MAKERS[name](folder / name).read_bytes()
