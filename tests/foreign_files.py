"""Files as other makers' programs export them, written from a sound log: what a user would have on disk.

Every writer of `WRITERS` takes a folder and a `Sound` and returns a `Foreign`: the path to read and the readings in SI
as they were printed. The layouts follow the makers' public descriptions; nothing here knows how imufit reads them.
"""

from __future__ import annotations

import gzip
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from imufit.lab.simulate import simulate
from numpy.typing import NDArray

Array = NDArray[np.float64]

G = 9.80665
"""Standard gravity, m/s^2, by which makers turn m/s^2 into g."""

DEG = 180 / np.pi
"""Degrees in a radian."""

RATE = 100
"""Rows per second of the logs, Hz."""

EPOCH_S = 1_718_870_400
"""2024-06-20 08:00:00 UTC in seconds since 1970: when the recordings are said to have begun."""


@dataclass(frozen=True, eq=False)
class Sound:
    """Readings to write down: `t` (n,) s; `acc`, `gyr`, `mag` (n, 3) in m/s^2, rad/s, uT; `q` (n, 4), body to ENU."""

    kind: str
    t: Array
    acc: Array
    gyr: Array
    mag: Array
    q: Array


def sound(kind: str, seed: int) -> Sound:
    """Readings of a hand or an arm: `handheld`, `arm`, `rest_first` (10 s at rest, then the hand) or `rest` alone."""
    log = simulate("arm" if kind == "arm" else "handheld", seed=seed, duration=14, rate=RATE, frame="ENU")
    assert log.acc is not None
    assert log.gyr is not None
    assert log.mag is not None
    assert log.ref_q is not None
    parts = {"acc": log.acc, "gyr": log.gyr, "mag": log.mag, "q": log.ref_q}
    if kind in ("rest", "rest_first"):
        rng = np.random.default_rng(seed)
        n = 10 * RATE
        still = {
            "acc": log.acc[0] + rng.normal(0, 0.02, (n, 3)),
            "gyr": np.array([0.004, -0.003, 0.002]) + rng.normal(0, 0.001, (n, 3)),
            "mag": log.mag[0] + rng.normal(0, 0.3, (n, 3)),
            "q": np.tile(log.ref_q[0], (n, 1)),
        }
        parts = {name: still[name] if kind == "rest" else np.vstack([still[name], parts[name]]) for name in parts}
    return Sound(kind, np.arange(len(parts["acc"])) / RATE, **parts)


@dataclass(frozen=True, eq=False)
class Part:
    """One sensor as printed: `t` (n,) s from its first sample, `values` (n, 3) in SI."""

    t: Array
    values: Array


@dataclass(frozen=True, eq=False)
class Foreign:
    """A file, folder or archive and what stands in it, None where a sensor is not in it.

    Sensors in `may_lack` may be left out: they stand there as a sum of two columns.
    """

    path: Path
    acc: Part | None = None
    gyr: Part | None = None
    mag: Part | None = None
    may_lack: tuple[str, ...] = ()


@dataclass(eq=False)
class Sheet:
    """A table under construction: columns of text beside the readings that the text stands for."""

    sound: Sound
    every: int = 1
    names: list[str] = field(default_factory=list)
    columns: list[list[str]] = field(default_factory=list)
    parts: dict[str, Part] = field(default_factory=dict)
    seconds: Array | None = None

    def __post_init__(self) -> None:
        self.t = self.sound.t[:: self.every]

    def time(self, name: str, per_s: float = 1, start: float = 0, form: str = "%.6f") -> Sheet:
        """Time in units of 1/`per_s` s, from `start` (s); whole numbers where `form` is "%d"."""
        if form == "%d":
            cells = [str(round(per_s * start) + round(float(t) * per_s)) for t in self.t]
            self.seconds = np.array([int(cell) - int(cells[0]) for cell in cells]) / per_s
        else:
            cells = [form % ((start + t) * per_s) for t in self.t]
            self.seconds = (np.array([float(cell) for cell in cells]) - float(cells[0])) / per_s
        return self.other(name, cells)

    def sensor(
        self, sensor: str, names: Sequence[str] | str, per_si: float = 1, form: str = "%.6f", order: str = "xyz"
    ) -> Sheet:
        """Three columns of a sensor: the reading in SI times `per_si`; `order` is that of the columns in the file.

        `names` are three names in the order of the file, or one with a ``*`` for the axis.
        """
        values = getattr(self.sound, sensor)[:: self.every]
        printed = np.empty_like(values)
        if "*" in names:
            names = [str(names).replace("*", axis) for axis in order]
        for name, axis in zip(names, order, strict=True):
            k = "xyz".index(axis)
            cells = [form % value for value in values[:, k] * per_si]
            printed[:, k] = np.array([float(cell) for cell in cells]) / per_si
            self.other(name, cells)
        self.parts[sensor] = Part(self.t - self.t[0] if self.seconds is None else self.seconds, printed)
        return self

    def other(self, name: str, cells: Sequence[str] | str | Array, form: str = "%.6f") -> Sheet:
        """Another column: the same text all the way down, or a text or a number a row."""
        if isinstance(cells, str):
            cells = [cells] * len(self.t)
        self.names.append(name)
        self.columns.append([cell if isinstance(cell, str) else form % cell for cell in cells])
        return self

    def others(self, names: Sequence[str], values: Array, form: str = "%.6f") -> Sheet:
        """Further columns, one for each column of `values`."""
        for k, name in enumerate(names):
            self.other(name, values[:, k], form)
        return self

    def text(
        self, separator: str = ",", *, header: str | None = "", before: str = "", quote: bool = False, end: str = "\n"
    ) -> str:
        """Text of the table: `before`, the header (None leaves it out, "" makes it of the names) and the rows."""
        lines = [separator.join(cells) for cells in zip(*self.columns, strict=True)]
        if header is not None:
            names = [f'"{name}"' for name in self.names] if quote else self.names
            lines.insert(0, header or separator.join(names))
        return (before + "\n".join(lines) + "\n").replace("\n", end)

    def write(self, path: Path, text: str | None = None, encoding: str = "utf-8") -> Foreign:
        """Write the table, or `text` made from it."""
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes((self.text() if text is None else text).encode(encoding))
        return Foreign(path, **self.parts)


Writer = Callable[[Path, Sound], Foreign]

KINDS = ("handheld", "arm", "rest_first", "rest")
"""Kinds of logs; see `sound`."""


@dataclass(frozen=True)
class Case:
    """A writer and what is due for each kind of log.

    ``reads``
        Read right with no option.
    ``asks``
        The file does not tell: a question with one complete mapping is due.
    ``either``
        Read right, or such a question.
    ``refuses``
        As ``either``, or a refusal that offers no mapping: the layout is beyond a table.
    """

    name: str
    write: Writer
    due: dict[str, str]


WRITERS: dict[str, Case] = {}


def case(moving: str = "reads", rest: str = "reads") -> Callable[[Writer], Writer]:
    """Enter a writer under its own name.

    Where a file at rest may ask for the unit of the rates, a hand that never rests may, too: its gravity is hidden
    under accelerations.
    """

    def enter(writer: Writer) -> Writer:
        name = writer.__name__
        hand = "either" if moving == "reads" != rest else moving
        WRITERS[name] = Case(name, writer, {"handheld": hand, "arm": moving, "rest_first": moving, "rest": rest})
        return writer

    return enter


def norms(values: Array) -> Array:
    """Norm of each row."""
    return np.linalg.norm(values, axis=1)


def together(path: Path, *parts: Foreign) -> Foreign:
    """One folder or archive out of its files."""
    found = {name: getattr(part, name) for part in parts for name in ("acc", "gyr", "mag") if getattr(part, name)}
    return Foreign(path, **found)


def zipped(folder: Path, path: Path) -> None:
    """Put all files of a folder into an archive."""
    with zipfile.ZipFile(path, "w") as archive:
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                archive.write(file, file.relative_to(folder).as_posix())


def euler_deg(s: Sound) -> Array:
    """Roll, pitch, yaw in degrees, (n, 3)."""
    w, x, y, z = s.q.T
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.column_stack([roll, pitch, yaw]) * DEG


def gravity(s: Sound) -> Array:
    """Specific force of gravity alone, (n, 3) m/s^2: up, seen in the body."""
    w, x, y, z = s.q.T
    up = np.column_stack([2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z])
    return G * up


# --- phyphox -------------------------------------------------------------------------------------------------------

PHYPHOX_TIME = "Time (s)"
SCIENTIFIC = "%.9E"


def _phyphox(s: Sound, sensor: str, names: str, absolute: str | None = None) -> Sheet:
    sheet = Sheet(s).time(PHYPHOX_TIME, form=SCIENTIFIC).sensor(sensor, names, form=SCIENTIFIC)
    return sheet.other(absolute, norms(getattr(s, sensor)), SCIENTIFIC) if absolute else sheet


@case()
def phyphox_acc_new(folder: Path, s: Sound) -> Foreign:
    sheet = _phyphox(s, "acc", "Acceleration * (m/s^2)", "Absolute acceleration (m/s^2)")
    return sheet.write(folder / "Raw Data.csv", sheet.text(quote=True))


@case()
def phyphox_acc_old(folder: Path, s: Sound) -> Foreign:
    sheet = _phyphox(s, "acc", "Acceleration * (m/s²)")
    return sheet.write(folder / "Raw Data.csv", sheet.text(quote=True))


@case()
def phyphox_acc_old_names(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("Time (s)", form=SCIENTIFIC).sensor("acc", "Accelerometer * (m/s^2)", form=SCIENTIFIC)
    return sheet.write(folder / "Accelerometer.csv", sheet.text(quote=True))


@case()
def phyphox_gyr(folder: Path, s: Sound) -> Foreign:
    sheet = _phyphox(s, "gyr", "Gyroscope * (rad/s)", "Absolute (rad/s)")
    return sheet.write(folder / "Raw Data.csv", sheet.text(quote=True))


@case()
def phyphox_mag(folder: Path, s: Sound) -> Foreign:
    sheet = _phyphox(s, "mag", "Magnetic field * (µT)", "Absolute field (µT)")
    return sheet.write(folder / "Raw Data.csv", sheet.text(quote=True))


@case()
def phyphox_semicolon_comma(folder: Path, s: Sound) -> Foreign:
    sheet = _phyphox(s, "acc", "Acceleration * (m/s^2)", "Absolute acceleration (m/s^2)")
    return sheet.write(folder / "Raw Data.csv", sheet.text(";", quote=True).replace(".", ","))


@case()
def phyphox_tab(folder: Path, s: Sound) -> Foreign:
    sheet = _phyphox(s, "gyr", "Gyroscope * (rad/s)", "Absolute (rad/s)")
    return sheet.write(folder / "Raw Data.csv", sheet.text("\t", quote=True))


def _phyphox_folder(folder: Path, s: Sound, separator: str = ",", decimal: str = ".") -> list[Foreign]:
    files = {
        "Accelerometer.csv": _phyphox(s, "acc", "Acceleration * (m/s^2)"),
        "Gyroscope.csv": _phyphox(s, "gyr", "Gyroscope * (rad/s)"),
        "Magnetometer.csv": _phyphox(s, "mag", "Magnetic field * (µT)"),
    }
    written = [
        sheet.write(folder / name, sheet.text(separator, quote=True).replace(".", decimal))
        for name, sheet in files.items()
    ]
    linear = Sheet(s).time(PHYPHOX_TIME, form=SCIENTIFIC)
    linear.others([f"Linear Acceleration {a} (m/s^2)" for a in "xyz"], s.acc - gravity(s), SCIENTIFIC)
    linear.write(folder / "Linear Accelerometer.csv", linear.text(separator, quote=True).replace(".", decimal))
    meta = folder / "meta"
    meta.mkdir()
    (meta / "device.csv").write_text(
        '"property","value"\n"version","1.1.16"\n"build","1011605"\n"fileFormat","1.18"\n"deviceModel","Pixel 6"\n'
        '"deviceBrand","google"\n"deviceRelease","14"\n"accelerometer Name","LSM6DSR Accelerometer"\n'
        '"accelerometer Range","156.90640"\n"accelerometer MinDelay","2404"\n'
    )
    (meta / "time.csv").write_text(
        '"event","experiment time","system time","system time text"\n'
        f'"START",0.000000000E0,{EPOCH_S}.123,"2024-06-20 10:00:00.123 UTC+02:00"\n'
        f'"PAUSE",{s.t[-1]:.9E},{EPOCH_S + 60}.456,"2024-06-20 10:01:00.456 UTC+02:00"\n'
    )
    return written


@case()
def phyphox_folder(folder: Path, s: Sound) -> Foreign:
    return together(folder / "run", *_phyphox_folder(folder / "run", s))


@case()
def phyphox_zip(folder: Path, s: Sound) -> Foreign:
    parts = _phyphox_folder(folder / "run", s)
    path = folder / "Multi sensor 2024-06-20 10-00-00.zip"
    zipped(folder / "run", path)
    return together(path, *parts)


@case()
def phyphox_zip_semicolon_comma(folder: Path, s: Sound) -> Foreign:
    parts = _phyphox_folder(folder / "run", s, ";", ",")
    zipped(folder / "run", folder / "Messung.zip")
    return together(folder / "Messung.zip", *parts)


@case()
def phyphox_linear_only_with_gyr(folder: Path, s: Sound) -> Foreign:
    run = folder / "run"
    part = _phyphox(s, "gyr", "Gyroscope * (rad/s)").write(run / "Gyroscope.csv")
    linear = Sheet(s).time(PHYPHOX_TIME, form=SCIENTIFIC)
    linear.others([f"Linear Acceleration {a} (m/s^2)" for a in "xyz"], s.acc - gravity(s), SCIENTIFIC)
    linear.write(run / "Linear Acceleration.csv", linear.text(quote=True))
    return together(run, part)


# --- Sensor Logger (Tszheichoi) --------------------------------------------------------------------------------------


def _logger(s: Sound, sensor: str, per_si: float = 1, every: int = 1) -> Sheet:
    sheet = Sheet(s, every).time("time", 1e9, EPOCH_S, "%d")
    sheet.other("seconds_elapsed", sheet.t + 0.057, "%.9f")
    return sheet.sensor(sensor, "*", per_si, "%.9f", "zyx")


def _logger_vector(s: Sound, values: Array) -> Sheet:
    sheet = Sheet(s).time("time", 1e9, EPOCH_S, "%d")
    return sheet.other("seconds_elapsed", sheet.t + 0.057, "%.9f").others("zyx", values[:, ::-1], "%.9f")


def _logger_folder(run: Path, s: Sound, *, total: bool = True, slow_mag: bool = False) -> list[Foreign]:
    parts = [
        _logger(s, "gyr").write(run / "Gyroscope.csv"),
        _logger(s, "mag", every=2 if slow_mag else 1).write(run / "Magnetometer.csv"),
    ]
    _logger_vector(s, s.acc - gravity(s)).write(run / "Accelerometer.csv")
    _logger_vector(s, gravity(s)).write(run / "Gravity.csv")
    if total:
        parts.append(_logger(s, "acc").write(run / "TotalAcceleration.csv"))
    q = Sheet(s).time("time", 1e9, EPOCH_S, "%d")
    q.other("seconds_elapsed", q.t + 0.057, "%.9f").others(
        ["qz", "qy", "qx", "qw", "roll", "pitch", "yaw"], np.column_stack([s.q[:, ::-1], euler_deg(s) / DEG]), "%.9f"
    )
    q.write(run / "Orientation.csv")
    (run / "Annotation.csv").write_text("time,seconds_elapsed,text,millisecond_press_duration\n")
    (run / "Metadata.csv").write_text(
        "version,device name,recording epoch time,recording time,recording timezone,platform,appVersion,device id,"
        "sensors,sampleRateMs,standardisation,platform version\n"
        f"3,Pixel 6,{EPOCH_S}000,2024-06-20_08-00-00,Europe/Berlin,android,1.32.0,a-b-c,"
        "Accelerometer|Gravity|Gyroscope|Orientation|Magnetometer,10|10|10|10|10,false,14\n"
    )
    return parts


@case()
def sensor_logger_folder(folder: Path, s: Sound) -> Foreign:
    return together(folder / "run", *_logger_folder(folder / "run", s))


@case()
def sensor_logger_slow_mag(folder: Path, s: Sound) -> Foreign:
    return together(folder / "run", *_logger_folder(folder / "run", s, slow_mag=True))


@case()
def sensor_logger_zip(folder: Path, s: Sound) -> Foreign:
    parts = _logger_folder(folder / "run", s)
    zipped(folder / "run", folder / "My_Recording-2024-06-20_08-00-00.zip")
    return together(folder / "My_Recording-2024-06-20_08-00-00.zip", *parts)


@case()
def sensor_logger_without_total(folder: Path, s: Sound) -> Foreign:
    """Accelerometer.csv is without gravity; with Gravity.csv beside, the sum of both is the specific force."""
    parts = _logger_folder(folder / "run", s, total=False)
    sums = Part(s.t, np.round(s.acc - gravity(s), 9) + np.round(gravity(s), 9))
    return replace(together(folder / "run", *parts, Foreign(folder, acc=sums)), may_lack=("acc",))


@case()
def sensor_logger_ios_uncalibrated(folder: Path, s: Sound) -> Foreign:
    """Raw CoreMotion: G with Apple's sign, rad/s, uT; the metadata names the platform."""
    run = folder / "run"
    parts = [
        _logger(s, "acc", -1 / G).write(run / "AccelerometerUncalibrated.csv"),
        _logger(s, "gyr").write(run / "GyroscopeUncalibrated.csv"),
        _logger(s, "mag").write(run / "MagnetometerUncalibrated.csv"),
    ]
    (run / "Metadata.csv").write_text(
        "version,device name,recording epoch time,recording time,recording timezone,platform,appVersion,device id,"
        "sensors,sampleRateMs,standardisation,platform version\n"
        f"3,iPhone 13,{EPOCH_S}000,2024-06-20_08-00-00,Europe/Berlin,ios,1.32.0,a-b-c,"
        "AccelerometerUncalibrated|GyroscopeUncalibrated|MagnetometerUncalibrated,10|10|10,false,17.5\n"
    )
    return together(run, *parts)


@case()
def sensor_logger_single_file(folder: Path, s: Sound) -> Foreign:
    return _logger(s, "acc").write(folder / "TotalAcceleration.csv")


# --- x-io ------------------------------------------------------------------------------------------------------------


@case()
def xio_fusion_sensor_data(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("Time (s)").sensor("gyr", [f"Gyroscope {a} (deg/s)" for a in "XYZ"], DEG)
    sheet.sensor("acc", [f"Accelerometer {a} (g)" for a in "XYZ"], 1 / G)
    sheet.sensor("mag", [f"Magnetometer {a} (uT)" for a in "XYZ"])
    return sheet.write(folder / "sensor_data.csv", sheet.text(end="\r\n"))


@case(moving="either", rest="either")
def ximu3_folder(folder: Path, s: Sound) -> Foreign:
    """The magnetometer's unit is arbitrary (1 a.u. is the field at the place of calibration)."""
    run = folder / "x-IMU3 01234567"
    inertial = Sheet(s).time("Timestamp (us)", 1e6, 12.5, "%d")
    inertial.sensor("gyr", [f"Gyroscope {a} (deg/s)" for a in "XYZ"], DEG, "%.4f")
    inertial.sensor("acc", [f"Accelerometer {a} (g)" for a in "XYZ"], 1 / G, "%.4f")
    part = inertial.write(run / "Inertial.csv")
    mag = Sheet(s, 5).time("Timestamp (us)", 1e6, 12.5, "%d")
    mag.sensor("mag", [f"Magnetometer {a} (a.u.)" for a in "XYZ"], 1 / 50, "%.4f").write(run / "Magnetometer.csv")
    q = Sheet(s).time("Timestamp (us)", 1e6, 12.5, "%d").others("WXYZ", s.q, "%.4f")
    q.write(run / "Quaternion.csv")
    (run / "Battery.csv").write_text("Timestamp (us),Percentage (%),Voltage (V),Charging Status\n12500000,87,4.01,0\n")
    (run / "Command.json").write_text('[{"device_name":"x-IMU3"}]')
    return together(run, part)


@case()
def ximu3_inertial_alone(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("Timestamp (us)", 1e6, 12.5, "%d")
    sheet.sensor("gyr", [f"Gyroscope {a} (deg/s)" for a in "XYZ"], DEG, "%.4f")
    return sheet.sensor("acc", [f"Accelerometer {a} (g)" for a in "XYZ"], 1 / G, "%.4f").write(folder / "Inertial.csv")


@case(moving="asks", rest="asks")
def ximu_cal_inertial_and_mag(folder: Path, s: Sound) -> Foreign:
    """A packet number and no time: the rate stands nowhere."""
    sheet = Sheet(s).other("Packet number", [str(k) for k in range(len(s.t))])
    sheet.sensor("gyr", [f"Gyroscope {a} (deg/s)" for a in "XYZ"], DEG)
    sheet.sensor("acc", [f"Accelerometer {a} (g)" for a in "XYZ"], 1 / G)
    sheet.sensor("mag", [f"Magnetometer {a} (G)" for a in "XYZ"], 0.01)
    return sheet.write(folder / "LoggedData_CalInertialAndMag.csv")


# --- Xsens, Movella --------------------------------------------------------------------------------------------------

XSENS_PREAMBLE = (
    "// General information: \n//  MT Manager version: 2022.2.0 \n//  XDA version: 2022.2.0 build 7381 rev 124627\n"
    "// Device information: \n//  DeviceId: 0180A8F3\n//  ProductCode: MTI-3-8A7G6\n//  Firmware Version: 1.5.0\n"
    "// Device settings: \n//  Filter Profile: general(50.1)\n//  Option Flags: AHS Disabled, ICC Disabled\n"
    "{rate}// Coordinate system: ENU\n"
)


def _xsens(s: Sound, fine: bool, mag: bool) -> Sheet:
    n = len(s.t)
    sheet = Sheet(s).other("PacketCounter", [str((51400 + k) % 65536) for k in range(n)])
    if fine:
        sheet.time("SampleTimeFine", 1e4, 3.2, "%d")
    sheet.sensor("acc", [f"Acc_{a}" for a in "XYZ"]).sensor("gyr", [f"Gyr_{a}" for a in "XYZ"])
    if mag:
        sheet.others([f"Mag_{a}" for a in "XYZ"], s.mag / 48.6)
    sheet.others([f"FreeAcc_{a}" for a in "ENU"], s.acc - gravity(s))
    return sheet.others([f"Quat_q{k}" for k in range(4)], s.q).others(["Roll", "Pitch", "Yaw"], euler_deg(s))


@case()
def xsens_mt_manager(folder: Path, s: Sound) -> Foreign:
    sheet = _xsens(s, True, False)
    before = XSENS_PREAMBLE.format(rate="")
    return sheet.write(folder / "MT_0180A8F3-000.txt", sheet.text("\t", before=before, end="\r\n"))


@case(moving="either", rest="either")
def xsens_mt_manager_mag(folder: Path, s: Sound) -> Foreign:
    """The field is in arbitrary units: 1 where the sensor was calibrated."""
    sheet = _xsens(s, True, True)
    return sheet.write(folder / "MT_0180A8F3-000.txt", sheet.text("\t", before=XSENS_PREAMBLE.format(rate="")))


@case()
def xsens_rate_in_preamble(folder: Path, s: Sound) -> Foreign:
    sheet = _xsens(s, False, False)
    before = XSENS_PREAMBLE.format(rate="// Update Rate: 100.0Hz\n")
    return sheet.write(folder / "MT_0180A8F3-000.txt", sheet.text("\t", before=before))


@case(moving="asks", rest="asks")
def xsens_no_rate(folder: Path, s: Sound) -> Foreign:
    sheet = _xsens(s, False, False)
    return sheet.write(folder / "MT_0180A8F3-000.txt", sheet.text("\t", before=XSENS_PREAMBLE.format(rate="")))


def _dot(s: Sound, mag: bool) -> Sheet:
    sheet = Sheet(s).other("PacketCounter", [str(k) for k in range(len(s.t))]).time("SampleTimeFine", 1e6, 12.25, "%d")
    sheet.others([f"Euler_{a}" for a in "XYZ"], euler_deg(s))
    sheet.sensor("acc", [f"Acc_{a}" for a in "XYZ"]).sensor("gyr", [f"Gyr_{a}" for a in "XYZ"], DEG)
    if mag:
        sheet.others([f"Mag_{a}" for a in "XYZ"], s.mag / 48.6)
    return sheet.other("Status", "0")


DOT_PREAMBLE = (
    "DeviceTag:,Xsens DOT\nFirmwareVersion:,2.0.0\nAppVersion:,v2021.0\nSyncStatus:,Unsynced\nOutputRate:,100Hz\n"
    "FilterProfile:,General\nMeasurementMode:,Custom Mode 5\nStartTime:,2024-06-20_10-00-00-123\n"
    "© Xsens Technologies B. V. 2005-2021\n\n"
)


@case()
def movella_dot(folder: Path, s: Sound) -> Foreign:
    """The DOT's rates are in deg/s, its clock ticks in us; the preamble names it."""
    sheet = _dot(s, False)
    return sheet.write(folder / "Xsens DOT_D422CD001234_20240620_100000.csv", sheet.text(before=DOT_PREAMBLE))


@case(moving="either", rest="either")
def movella_dot_mag(folder: Path, s: Sound) -> Foreign:
    sheet = _dot(s, True)
    return sheet.write(folder / "Xsens DOT_1.csv", sheet.text(before=DOT_PREAMBLE))


# --- Shimmer ---------------------------------------------------------------------------------------------------------


def _shimmer(s: Sound, *, raw: bool, wide: bool, separator: str = "\t", sep_line: bool = True) -> tuple[Sheet, str]:
    device = "Shimmer_9A3B_"
    sheet = Sheet(s).time(device + "Timestamp_Unix_CAL", 1e3, EPOCH_S, "%.4f")
    units = ["ms"]
    if raw:
        sheet.others([device + f"Accel_LN_{a}_RAW" for a in "XYZ"], np.column_stack([2048 + s.acc * 83, *([])]), "%.0f")
        units += ["no_units"] * 3
    sheet.sensor("acc", [device + f"Accel_LN_{a}_CAL" for a in "XYZ"], form="%.9f")
    units += ["m/(s^2)"] * 3
    if wide:
        sheet.others([device + f"Accel_WR_{a}_CAL" for a in "XYZ"], s.acc * 1.02 + 0.3, "%.9f")
        units += ["m/(s^2)"] * 3
    sheet.sensor("gyr", [device + f"Gyro_{a}_CAL" for a in "XYZ"], DEG, "%.9f")
    units += ["deg/s"] * 3
    sheet.sensor("mag", [device + f"Mag_{a}_CAL" for a in "XYZ"], 0.01 / 0.49, "%.9f")
    units += ["local_flux"] * 3
    before = f'"sep={separator}"\n' if sep_line else ""
    text = sheet.text(separator, before=before + "", header=separator.join(sheet.names) + "\n" + separator.join(units))
    return sheet, text


def _without_mag(written: Foreign) -> Foreign:
    return Foreign(written.path, written.acc, written.gyr)


@case(moving="either", rest="either")
def shimmer_consensys_local_flux(folder: Path, s: Sound) -> Foreign:
    """The field is in `local_flux`, an arbitrary unit."""
    sheet, text = _shimmer(s, raw=False, wide=False)
    return _without_mag(sheet.write(folder / "Session1_Shimmer_9A3B_Calibrated_SD.csv", text))


@case()
def shimmer_consensys(folder: Path, s: Sound) -> Foreign:
    device = "Shimmer_9A3B_"
    sheet = Sheet(s).time(device + "Timestamp_Unix_CAL", 1e3, EPOCH_S, "%.4f")
    sheet.sensor("acc", [device + f"Accel_LN_{a}_CAL" for a in "XYZ"], form="%.9f")
    sheet.sensor("gyr", [device + f"Gyro_{a}_CAL" for a in "XYZ"], DEG, "%.9f")
    units = ["ms", *["m/(s^2)"] * 3, *["deg/s"] * 3]
    text = sheet.text("\t", before='"sep=\t"\n', header="\t".join(sheet.names) + "\n" + "\t".join(units))
    return sheet.write(folder / "Session1_Calibrated_SD.csv", text)


@case(moving="either", rest="either")
def shimmer_raw_and_wide_range(folder: Path, s: Sound) -> Foreign:
    """Raw counts and a second, wide-range accelerometer beside: the low-noise one is taken, or a question put."""
    sheet, text = _shimmer(s, raw=True, wide=True, separator=",", sep_line=False)
    return _without_mag(sheet.write(folder / "Shimmer.csv", text))


# --- flight controllers ----------------------------------------------------------------------------------------------


def _betaflight(s: Sound, time: str, acc: str, acc_per_si: float, gyr: str, gyr_form: str, acc_form: str) -> Sheet:
    n = len(s.t)
    sheet = Sheet(s).other("loopIteration", [str(32 * k) for k in range(n)]).time(time, 1e6, 55.15, "%d")
    for name in ("axisP", "axisI", "axisD"):
        sheet.others([f"{name}[{k}]" for k in range(3)], np.round(s.gyr * 40), "%d")
    sheet.others([f"rcCommand[{k}]" for k in range(4)], np.tile([1.0, -2, 0, 1200], (n, 1)), "%d")
    sheet.other("vbatLatest (V)", "16.21").other("amperageLatest (A)", "3.05")
    sheet.sensor("gyr", [gyr.replace("*", str(k)) for k in range(3)], DEG, gyr_form)
    sheet.sensor("acc", [acc.replace("*", str(k)) for k in range(3)], acc_per_si, acc_form)
    sheet.others([f"motor[{k}]" for k in range(4)], np.full((n, 4), 220.0), "%d")
    sheet.other("flightModeFlags (flags)", "0").other("stateFlags (flags)", "0")
    return sheet.other("failsafePhase (flags)", "IDLE").other("rxSignalReceived", "1")


@case(moving="either", rest="either")
def betaflight_raw(folder: Path, s: Sound) -> Foreign:
    """Whole numbers: gyroADC in deg/s, accSmooth in counts of 2048 LSB/g (acc_1G stands in the .bbl alone)."""
    sheet = _betaflight(s, "time (us)", "accSmooth[*]", 2048 / G, "gyroADC[*]", "%d", "%d")
    # blackbox_decode rounds; the form "%d" of Python cuts off, and what was printed is what counts
    return sheet.write(folder / "LOG00007.01.csv", sheet.text(", "))


@case()
def betaflight_units(folder: Path, s: Sound) -> Foreign:
    sheet = _betaflight(s, "time (us)", "accSmooth[*] (m/s/s)", 1, "gyroADC[*] (deg/s)", "%.2f", "%.6f")
    return sheet.write(folder / "LOG00007.02.csv", sheet.text(", "))


@case()
def betaflight_units_g(folder: Path, s: Sound) -> Foreign:
    sheet = _betaflight(s, "time (s)", "accSmooth[*] (g)", 1 / G, "gyroADC[*] (deg/s)", "%.2f", "%.6f")
    k = sheet.names.index("time (s)")
    sheet.columns[k] = [f"{55.15 + t:.6f}" for t in s.t]
    return sheet.write(folder / "LOG00007.03.csv", sheet.text(", "))


def _px4_combined(s: Sound) -> Sheet:
    sheet = Sheet(s).time("timestamp", 1e6, 112.5, "%d").sensor("gyr", [f"gyro_rad[{k}]" for k in range(3)])
    sheet.other("gyro_integral_dt", "10000").other("accelerometer_timestamp_relative", "0")
    sheet.sensor("acc", [f"accelerometer_m_s2[{k}]" for k in range(3)])
    return sheet.other("accelerometer_integral_dt", "10000").other("accelerometer_clipping", "0")


@case()
def px4_sensor_combined(folder: Path, s: Sound) -> Foreign:
    return _px4_combined(s).write(folder / "log_1_sensor_combined_0.csv")


@case()
def px4_topics(folder: Path, s: Sound) -> Foreign:
    part = _px4_combined(s).write(folder / "run" / "log_1_sensor_combined_0.csv")
    mag = Sheet(s, 2).time("timestamp", 1e6, 112.5, "%d")
    mag.other("timestamp_sample", mag.columns[0]).other("device_id", "396825")
    mag.sensor("mag", [f"magnetometer_ga[{k}]" for k in range(3)], 0.01)
    mag.other("calibration_count", "1")
    second = mag.write(folder / "run" / "log_1_vehicle_magnetometer_0.csv")
    q = Sheet(s).time("timestamp", 1e6, 112.5, "%d").others([f"q[{k}]" for k in range(4)], s.q)
    q.others([f"delta_q_reset[{k}]" for k in range(4)], np.tile([1.0, 0, 0, 0], (len(s.t), 1)))
    q.write(folder / "run" / "log_1_vehicle_attitude_0.csv")
    (folder / "run" / "log_1_vehicle_status_0.csv").write_text("timestamp,arming_state,nav_state\n112500000,1,0\n")
    return together(folder / "run", part, second)


# --- sketches --------------------------------------------------------------------------------------------------------


def _sketch(s: Sound, units: tuple[float, float, str, str], names: str, header: bool = True, time: str = "ms") -> Sheet:
    acc, gyr, acc_form, gyr_form = units
    sheet = Sheet(s)
    listed = names.split(",")
    sheet.time(listed[0], *{"ms": (1e3, 0.512, "%d"), "us": (1e6, 0.512, "%d")}[time])
    sheet.sensor("acc", listed[1:4], acc, acc_form)
    return sheet.sensor("gyr", listed[4:7], gyr, gyr_form)


COUNTS = (16384 / G, 131 * DEG, "%d", "%d")
G_DPS = (1 / G, DEG, "%.4f", "%.3f")
SI = (1.0, 1.0, "%.4f", "%.5f")


@case(moving="either", rest="asks")
def sketch_counts(folder: Path, s: Sound) -> Foreign:
    return _sketch(s, COUNTS, "millis,ax,ay,az,gx,gy,gz").write(folder / "putty.log")


@case(moving="either", rest="asks")
def sketch_counts_no_time_unit(folder: Path, s: Sound) -> Foreign:
    return _sketch(s, COUNTS, "time,accX,accY,accZ,gyroX,gyroY,gyroZ").write(folder / "DATA.CSV")


@case(moving="either", rest="asks")
def sketch_mpu6050_tmp(folder: Path, s: Sound) -> Foreign:
    """The layout of the classic MPU-6050 sketch, with the raw temperature between, at +-250 deg/s and +-2 g."""
    sheet = Sheet(s).time("t_ms", 1e3, 0, "%d").sensor("acc", [f"Ac{a}" for a in "XYZ"], 16384 / G, "%d")
    sheet.other("Tmp", [str(-4100 + k // 50) for k in range(len(s.t))])
    return sheet.sensor("gyr", [f"Gy{a}" for a in "XYZ"], 131 * DEG, "%d").write(folder / "teraterm.log")


@case(rest="either")
def sketch_g_dps(folder: Path, s: Sound) -> Foreign:
    return _sketch(s, G_DPS, "millis,ax,ay,az,gx,gy,gz").write(folder / "log.txt")


@case(rest="either")
def sketch_si(folder: Path, s: Sound) -> Foreign:
    return _sketch(s, SI, "micros,ax,ay,az,gx,gy,gz", time="us").write(folder / "log.csv")


@case(rest="either")
def sketch_si_long_names(folder: Path, s: Sound) -> Foreign:
    return _sketch(s, SI, "time_ms,accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z").write(folder / "log.csv")


@case(rest="either")
def sketch_spaced_names(folder: Path, s: Sound) -> Foreign:
    names = "Time (ms),Accel X,Accel Y,Accel Z,Gyro X,Gyro Y,Gyro Z"
    return _sketch(s, G_DPS, names).write(folder / "log.csv")


@case()
def sketch_units_in_names(folder: Path, s: Sound) -> Foreign:
    names = "millis,ax_g,ay_g,az_g,gx_dps,gy_dps,gz_dps"
    return _sketch(s, G_DPS, names).write(folder / "log.csv")


@case()
def sketch_units_in_square_brackets(folder: Path, s: Sound) -> Foreign:
    names = "Time [ms],AccX [m/s^2],AccY [m/s^2],AccZ [m/s^2],GyroX [rad/s],GyroY [rad/s],GyroZ [rad/s]"
    return _sketch(s, SI, names).write(folder / "log.csv")


@case()
def sketch_milli_units(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("t (us)", 1e6, 3, "%d").sensor("acc", [f"A_{a} [mg]" for a in "XYZ"], 1000 / G, "%.1f")
    return sheet.sensor("gyr", [f"G_{a} [mdps]" for a in "XYZ"], 1000 * DEG, "%.1f").write(folder / "st.csv")


@case(rest="either")
def sketch_text_before(folder: Path, s: Sound) -> Foreign:
    sheet = _sketch(s, G_DPS, "millis,ax,ay,az,gx,gy,gz")
    before = "Initializing I2C devices...\nTesting device connections...\nMPU6050 connection successful\n\n"
    return sheet.write(folder / "serial.txt", sheet.text(before=before, end="\r\n"))


@case(moving="either", rest="asks")
def sketch_no_header(folder: Path, s: Sound) -> Foreign:
    sheet = _sketch(s, COUNTS, "millis,ax,ay,az,gx,gy,gz")
    return sheet.write(folder / "capture.txt", sheet.text(header=None))


@case(moving="either", rest="asks")
def sketch_no_header_si_tabs(folder: Path, s: Sound) -> Foreign:
    sheet = _sketch(s, SI, "micros,ax,ay,az,gx,gy,gz", time="us")
    return sheet.write(folder / "capture.txt", sheet.text("\t", header=None))


@case(moving="asks", rest="asks")
def sketch_no_time(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).sensor("acc", [f"a{a}" for a in "xyz"], 1, "%.4f").sensor("gyr", [f"g{a}" for a in "xyz"], 1)
    return sheet.write(folder / "capture.csv")


@case(rest="either")
def sketch_named_values(folder: Path, s: Sound) -> Foreign:
    """The Adafruit example's lines, units spelled out."""
    sheet = Sheet(s).time("t", 1e3, 0, "%d").sensor("acc", "acc*", 1, "%.2f").sensor("gyr", "gyr*", 1, "%.2f")
    lines = ["Adafruit MPU6050 test!", "MPU6050 Found!", "Accelerometer range set to: +-8G"]
    for t, ax, ay, az, gx, gy, gz in zip(*sheet.columns, strict=True):
        lines.append(f"t: {t} ms, Accel X: {ax}, Y: {ay}, Z: {az} m/s^2, Gyro X: {gx}, Y: {gy}, Z: {gz} rad/s")
    return sheet.write(folder / "serial.log", "\n".join(lines) + "\n")


@case(rest="either")
def adafruit_lsm9ds1(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("time_s", form="%.3f").sensor("acc", [f"accel_{a}_ms2" for a in "xyz"])
    sheet.sensor("gyr", [f"gyro_{a}_dps" for a in "xyz"], DEG).sensor("mag", [f"mag_{a}_gauss" for a in "xyz"], 0.01)
    return sheet.other("temp_c", "24.5").write(folder / "lsm9ds1.csv")


@case(rest="either")
def nine_axis_counts_free(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("Time", form="%.3f").sensor("acc", [f"Acc{a}" for a in "XYZ"], 1 / G)
    sheet.sensor("gyr", [f"Gyr{a}" for a in "XYZ"], DEG, "%.4f").sensor("mag", [f"Mag{a}" for a in "XYZ"], 1, "%.3f")
    return sheet.write(folder / "imu.csv")


# --- MATLAB Mobile, Android, Apple -----------------------------------------------------------------------------------


def _clock(s: Sound, form: str, cut: int = 3) -> list[str]:
    start = datetime.fromtimestamp(EPOCH_S, UTC)
    return [(start + timedelta(seconds=float(t))).strftime(form)[: -cut or None] for t in s.t]


@case()
def matlab_mobile_folder(folder: Path, s: Sound) -> Foreign:
    """`writetimetable` of the three timetables of a MATLAB Mobile recording: X, Y, Z in m/s^2, rad/s, uT."""
    parts = []
    for sensor, name in (("acc", "Acceleration"), ("gyr", "AngularVelocity"), ("mag", "MagneticField")):
        sheet = Sheet(s).other("Timestamp", _clock(s, "%d-%b-%Y %H:%M:%S.%f"))
        parts.append(sheet.sensor(sensor, "XYZ").write(folder / "run" / f"{name}.csv"))
    return together(folder / "run", *parts)


@case()
def matlab_mobile_single(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).other("Timestamp", _clock(s, "%d-%b-%Y %H:%M:%S.%f"))
    return sheet.sensor("acc", "XYZ").write(folder / "Acceleration.csv")


@case(moving="either", rest="either")
def android_text_folder(folder: Path, s: Sound) -> Foreign:
    """One file a sensor, without header: ns since the start of the phone, then x y z."""
    parts = []
    for sensor, name in (("acc", "accelerometer"), ("gyr", "gyroscope"), ("mag", "magnetometer")):
        sheet = Sheet(s).time("t", 1e9, 8123.25, "%d").sensor(sensor, "*")
        parts.append(sheet.write(folder / "run" / f"{name}.txt", sheet.text(" ", header=None)))
    return together(folder / "run", *parts)


def _apple(s: Sound, gravity_too: bool, raw: bool) -> Sheet:
    sheet = Sheet(s).other("loggingTime(txt)", _clock(s, "%Y-%m-%dT%H:%M:%S.%f+02:00", 0))
    sheet.other("loggingSample(N)", [str(k) for k in range(len(s.t))])
    if raw:
        sheet.time("accelerometerTimestamp_sinceReboot(s)", start=5012.25)
        sheet.sensor("acc", [f"accelerometerAcceleration{a}(G)" for a in "XYZ"], -1 / G)
    sheet.time("motionTimestamp_sinceReboot(s)", start=5012.25)
    sheet.others([f"motion{a}(rad)" for a in ("Roll", "Pitch", "Yaw")], euler_deg(s) / DEG)
    sheet.sensor("gyr", [f"motionRotationRate{a}(rad/s)" for a in "XYZ"])
    user = (gravity(s) - s.acc) / G
    sheet.others([f"motionUserAcceleration{a}(G)" for a in "XYZ"], user)
    if gravity_too:
        sheet.others([f"motionGravity{a}(G)" for a in "XYZ"], -gravity(s) / G)
    return sheet


@case(moving="either", rest="either")
def apple_sensorlog(folder: Path, s: Sound) -> Foreign:
    """Apple's sign: flat on the table z reads -1 G; the specific force is the reading turned about."""
    return _apple(s, True, True).write(folder / "2024-06-20_10_00_00_iPhone.csv")


@case(moving="either", rest="either")
def apple_core_motion_gravity_and_user(folder: Path, s: Sound) -> Foreign:
    sheet = _apple(s, True, False)
    total = -G * (np.round(-gravity(s) / G, 6) + np.round((gravity(s) - s.acc) / G, 6))
    assert sheet.seconds is not None
    sheet.parts["acc"] = Part(sheet.seconds, total)
    return replace(sheet.write(folder / "motion.csv"), may_lack=("acc",))


@case(moving="either", rest="either")
def apple_core_motion_user_only(folder: Path, s: Sound) -> Foreign:
    """Without gravity there is no specific force to be read."""
    return _apple(s, False, False).write(folder / "motion.csv")


@case(moving="either", rest="either")
def apple_device_motion_dotted(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("timestamp", start=5012.25)
    sheet.sensor("gyr", [f"rotationRate.{a}" for a in "xyz"])
    sheet.others([f"gravity.{a}" for a in "xyz"], -gravity(s) / G)
    sheet.others([f"userAcceleration.{a}" for a in "xyz"], (gravity(s) - s.acc) / G)
    total = -G * (np.round(-gravity(s) / G, 6) + np.round((gravity(s) - s.acc) / G, 6))
    sheet.parts["acc"] = Part(s.t, total)
    return replace(sheet.write(folder / "dws_1.csv"), may_lack=("acc",))


# --- data sets -------------------------------------------------------------------------------------------------------


@case()
def euroc_imu0(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("#timestamp [ns]", 1e9, EPOCH_S, "%d")
    sheet.sensor("gyr", [f"w_RS_S_{a} [rad s^-1]" for a in "xyz"], form="%.15g")
    sheet.sensor("acc", [f"a_RS_S_{a} [m s^-2]" for a in "xyz"], form="%.15g")
    return sheet.write(folder / "imu0" / "data.csv", sheet.text(end="\r\n"))


@case()
def tum_vi_imu0_folder(folder: Path, s: Sound) -> Foreign:
    part = euroc_imu0(folder / "mav0", s)
    (folder / "mav0" / "imu0" / "sensor.yaml").write_text("sensor_type: imu\nrate_hz: 200\n")
    return together(folder / "mav0" / "imu0", part)


@case(moving="either", rest="either")
def tum_rgbd_accelerometer(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("timestamp", start=1305031102.25).sensor("acc", ["ax", "ay", "az"])
    before = "# accelerometer data\n# file: 'rgbd_dataset_freiburg1_xyz.bag'\n# timestamp ax ay az\n"
    return sheet.write(folder / "accelerometer.txt", sheet.text(" ", header=None, before=before))


# --- other sensors ---------------------------------------------------------------------------------------------------


@case()
def witmotion_csv(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("Time(s)", form="%.3f").other("ChipTime", _clock(s, "%Y-%m-%d %H:%M:%S.%f"))
    sheet.sensor("acc", [f"a{a}(g)" for a in "xyz"], 1 / G, "%.4f")
    sheet.sensor("gyr", [f"w{a}(deg/s)" for a in "xyz"], DEG, "%.4f")
    sheet.sensor("mag", [f"h{a}(uT)" for a in "xyz"], 1, "%.3f")
    return sheet.others([f"Angle{a}(deg)" for a in "XYZ"], euler_deg(s), "%.4f").write(folder / "witmotion.csv")


@case()
def witmotion_txt(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).other("Address", "0x50").other("Time(s)", _clock(s, " %H:%M:%S.%f"))
    sheet.other("ChipTime(s)", _clock(s, "%Y-%m-%d %H:%M:%S.%f"))
    sheet.sensor("acc", [f"a{a}(g)" for a in "xyz"], 1 / G, "%.4f")
    sheet.sensor("gyr", [f"w{a}(deg/s)" for a in "xyz"], DEG, "%.4f")
    sheet.others([f"Angle{a}(deg)" for a in "XYZ"], euler_deg(s), "%.4f").other("T(°)", "28.4100")
    before = "StartTime: 2024-06-20 10:00:00.000\n"
    return sheet.write(folder / "20240620100000.txt", sheet.text("\t", before=before, end="\r\n"))


@case()
def witmotion_new(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).other("time", _clock(s, "%Y-%m-%d %H:%M:%S.%f")).other("DeviceName", "WT901BLE(f1:c0)")
    sheet.sensor("acc", [f"Acceleration {a}(g)" for a in "XYZ"], 1 / G, "%.4f")
    sheet.sensor("gyr", [f"Angular velocity {a}(°/s)" for a in "XYZ"], DEG, "%.4f")
    sheet.others([f"Angle {a}(°)" for a in "XYZ"], euler_deg(s), "%.4f")
    sheet.sensor("mag", [f"Magnetic field {a}(uT)" for a in "XYZ"], 1, "%.3f")
    sheet.others([f"Quaternions {k}()" for k in range(4)], s.q, "%.5f").other("Temperature(°C)", "28.41")
    return sheet.write(folder / "data_20240620.csv")


def _metabase(s: Sound, sensor: str, unit: str, per_si: float) -> Sheet:
    sheet = Sheet(s).time("epoc (ms)", 1e3, EPOCH_S, "%d")
    sheet.other("timestamp (+0000)", _clock(s, "%Y-%m-%dT%H.%M.%S.%f")).other("elapsed (s)", s.t, "%.6f")
    return sheet.sensor(sensor, [f"{a}-axis ({unit})" for a in "xyz"], per_si, "%.6f")


@case()
def metabase_acc(folder: Path, s: Sound) -> Foreign:
    return _metabase(s, "acc", "g", 1 / G).write(folder / "MetaWear_2024-06-20T10.00_C8_Accelerometer_100.000Hz.csv")


@case()
def metabase_folder(folder: Path, s: Sound) -> Foreign:
    stem = "MetaWear_2024-06-20T10.00.00.123_C8D6E1A3B2F4_"
    return together(
        folder / "run",
        _metabase(s, "acc", "g", 1 / G).write(folder / "run" / f"{stem}Accelerometer_100.000Hz_1.5.0.csv"),
        _metabase(s, "gyr", "deg/s", DEG).write(folder / "run" / f"{stem}Gyroscope_100.000Hz_1.5.0.csv"),
        _metabase(s, "mag", "uT", 1).write(folder / "run" / f"{stem}Magnetometer_25.000Hz_1.5.0.csv"),
    )


@case()
def vernier_graphical_analysis(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("Data Set 1:Time(s)", form="%.2f")
    sheet.sensor("acc", [f"Data Set 1:{a}-axis acceleration(m/s²)" for a in "XYZ"])
    sheet.sensor("gyr", [f"Data Set 1:{a}-axis gyro(rad/s)" for a in "XYZ"])
    return sheet.write(folder / "vernier.csv")


@case()
def opensignals_like_units_row(folder: Path, s: Sound) -> Foreign:
    """A line of units under the names, as LabVIEW, DEWESoft and others write it."""
    sheet = Sheet(s).time("Time").sensor("acc", [f"Acc {a}" for a in "XYZ"], 1 / G)
    sheet.sensor("gyr", [f"Gyro {a}" for a in "XYZ"], DEG)
    head = ";".join(sheet.names) + "\n" + ";".join(["s", *["g"] * 3, *["°/s"] * 3])
    return sheet.write(folder / "dewe.csv", sheet.text(";", header=head).replace(".", ","), "latin-1")


# --- time stamps and encodings ---------------------------------------------------------------------------------------


def _labelled(sheet: Sheet) -> Sheet:
    sheet.sensor("acc", [f"acc_{a} (m/s^2)" for a in "xyz"]).sensor("gyr", [f"gyr_{a} (rad/s)" for a in "xyz"])
    return sheet.sensor("mag", [f"mag_{a} (uT)" for a in "xyz"])


@case()
def iso_time(folder: Path, s: Sound) -> Foreign:
    return _labelled(Sheet(s).other("timestamp", _clock(s, "%Y-%m-%dT%H:%M:%S.%fZ", 0))).write(folder / "a.csv")


@case()
def iso_time_blank_offset(folder: Path, s: Sound) -> Foreign:
    stamps = _clock(s, "%Y-%m-%d %H:%M:%S.%f+02:00", 0)
    return _labelled(Sheet(s).other("Time", stamps)).write(folder / "a.csv")


@case()
def us_date_time(folder: Path, s: Sound) -> Foreign:
    return _labelled(Sheet(s).other("Date/Time", _clock(s, "%m/%d/%Y %H:%M:%S.%f"))).write(folder / "a.csv")


@case()
def date_and_clock_in_two_columns(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).other("Date", _clock(s, "%Y-%m-%d", 0)).other("Time", _clock(s, "%H:%M:%S.%f"))
    return _labelled(sheet).write(folder / "a.csv")


@case()
def python_time_time(folder: Path, s: Sound) -> Foreign:
    return _labelled(Sheet(s).time("timestamp", start=EPOCH_S, form="%.6f")).write(folder / "a.csv")


@case()
def javascript_date_now(folder: Path, s: Sound) -> Foreign:
    return _labelled(Sheet(s).time("timestamp", 1e3, EPOCH_S, "%d")).write(folder / "a.csv")


@case()
def unix_ns(folder: Path, s: Sound) -> Foreign:
    return _labelled(Sheet(s).time("timestamp", 1e9, EPOCH_S, "%d")).write(folder / "a.csv")


@case(moving="either", rest="either")
def excel_serial_date(folder: Path, s: Sound) -> Foreign:
    """Days since 1899-12-30, as a spreadsheet saves a date it was not told to format."""
    sheet = Sheet(s).time("Time", 1 / 86400, 25569 * 86400 + EPOCH_S, "%.12f")
    return _labelled(sheet).write(folder / "a.csv")


@case()
def utf16(folder: Path, s: Sound) -> Foreign:
    sheet = _labelled(Sheet(s).time("Time (s)"))
    return sheet.write(folder / "a.csv", sheet.text("\t", end="\r\n"), "utf-16")


@case()
def gzipped(folder: Path, s: Sound) -> Foreign:
    sheet = _labelled(Sheet(s).time("Time (s)"))
    path = folder / "a.csv.gz"
    path.write_bytes(gzip.compress(sheet.text().encode()))
    return Foreign(path, **sheet.parts)


# --- made difficult --------------------------------------------------------------------------------------------------


@case(moving="either", rest="either")
def two_accelerometers(folder: Path, s: Sound) -> Foreign:
    """The first, or a question: never a mixture."""
    sheet = Sheet(s).time("time_s").sensor("acc", [f"acc1_{a} (m/s^2)" for a in "xyz"])
    sheet.others([f"acc2_{a} (m/s^2)" for a in "xyz"], s.acc[:, [1, 2, 0]] * 1.1 + 0.4)
    return sheet.sensor("gyr", [f"gyr_{a} (rad/s)" for a in "xyz"]).write(folder / "a.csv")


@case(moving="either", rest="either")
def two_accelerometers_suffix(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("time_s").sensor("acc", [f"ax{k}" for k in (1,)] + ["ay1", "az1"])
    sheet.others(["ax2", "ay2", "az2"], s.acc[:, [1, 2, 0]] * 1.1 + 0.4)
    return sheet.sensor("gyr", ["gx (rad/s)", "gy (rad/s)", "gz (rad/s)"]).write(folder / "a.csv")


@case(moving="either", rest="either")
def linear_acceleration_only(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("time_s").others([f"linear_acceleration_{a}" for a in "xyz"], s.acc - gravity(s))
    return sheet.sensor("gyr", [f"gyr_{a} (rad/s)" for a in "xyz"]).write(folder / "a.csv")


@case(moving="either", rest="either")
def linear_acceleration_called_acc(folder: Path, s: Sound) -> Foreign:
    """Named as an accelerometer, but without gravity: the values tell."""
    sheet = Sheet(s).time("time_s").others([f"lin_acc_{a} (m/s^2)" for a in "xyz"], s.acc - gravity(s))
    return sheet.sensor("gyr", [f"gyr_{a} (rad/s)" for a in "xyz"]).write(folder / "a.csv")


@case()
def linear_beside_total(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("time_s").others([f"linear_acc_{a} (m/s^2)" for a in "xyz"], s.acc - gravity(s))
    sheet.others([f"gravity_{a} (m/s^2)" for a in "xyz"], gravity(s))
    sheet.sensor("acc", [f"acc_{a} (m/s^2)" for a in "xyz"])
    return sheet.sensor("gyr", [f"gyr_{a} (rad/s)" for a in "xyz"]).write(folder / "a.csv")


@case()
def ros_imu_topic(folder: Path, s: Sound) -> Foreign:
    """`rostopic echo -p` of a sensor_msgs/Imu: there linear_acceleration holds gravity."""
    sheet = Sheet(s).time("%time", 1e9, EPOCH_S, "%d").other("field.header.seq", [str(k) for k in range(len(s.t))])
    sheet.time("field.header.stamp", 1e9, EPOCH_S, "%d").other("field.header.frame_id", "imu_link")
    sheet.others([f"field.orientation.{a}" for a in "xyzw"], s.q[:, [1, 2, 3, 0]])
    sheet.others([f"field.orientation_covariance{k}" for k in range(9)], np.zeros((len(s.t), 9)), "%.1f")
    sheet.sensor("gyr", [f"field.angular_velocity.{a}" for a in "xyz"])
    sheet.others([f"field.angular_velocity_covariance{k}" for k in range(9)], np.zeros((len(s.t), 9)), "%.1f")
    sheet.sensor("acc", [f"field.linear_acceleration.{a}" for a in "xyz"])
    sheet.others([f"field.linear_acceleration_covariance{k}" for k in range(9)], np.zeros((len(s.t), 9)), "%.1f")
    return sheet.write(folder / "imu.csv")


@case()
def other_order(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).sensor("mag", [f"mag_{a} (uT)" for a in "zxy"], order="zxy")
    sheet.sensor("gyr", [f"gyr_{a} (deg/s)" for a in "yxz"], DEG, order="yxz").other("temp (degC)", "25.1")
    sheet.sensor("acc", [f"acc_{a} (g)" for a in "zyx"], 1 / G, order="zyx")
    return sheet.time("t (ms)", 1e3, 0, "%d").write(folder / "a.csv")


@case()
def capitals(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("TIME (S)").sensor("acc", [f"ACCELEROMETER {a} (G)" for a in "XYZ"], 1 / G)
    return sheet.sensor("gyr", [f"GYROSCOPE {a} (DEG/S)" for a in "XYZ"], DEG).write(folder / "A.CSV")


def _plain(s: Sound) -> Sheet:
    sheet = Sheet(s).time("Time (s)").sensor("acc", [f"Acc {a} (g)" for a in "XYZ"], 1 / G)
    return sheet.sensor("gyr", [f"Gyro {a} (deg/s)" for a in "XYZ"], DEG).other("Temperature (°C)", "24.5")


@case()
def spaces_around_separators(folder: Path, s: Sound) -> Foreign:
    sheet = _plain(s)
    return sheet.write(folder / "a.csv", sheet.text(" , "))


@case()
def quoted_cells(folder: Path, s: Sound) -> Foreign:
    sheet = _plain(s)
    lines = sheet.text().splitlines()
    quoted = "\n".join(",".join(f'"{cell}"' for cell in line.split(",")) for line in lines)
    return sheet.write(folder / "a.csv", quoted)


@case()
def trailing_separator(folder: Path, s: Sound) -> Foreign:
    sheet = _plain(s)
    return sheet.write(folder / "a.csv", sheet.text().replace("\n", ",\n"))


@case()
def empty_first_row(folder: Path, s: Sound) -> Foreign:
    sheet = _plain(s)
    head, _, rows = sheet.text().partition("\n")
    return sheet.write(folder / "a.csv", f"{head}\n,,,,,,,\n{rows}")


@case()
def first_row_time_alone(folder: Path, s: Sound) -> Foreign:
    sheet = _plain(s)
    head, _, rows = sheet.text().partition("\n")
    return sheet.write(folder / "a.csv", f"{head}\n-0.01,,,,,,,\n{rows}")


@case()
def nan_words(folder: Path, s: Sound) -> Foreign:
    sheet = _plain(s)
    return _with_words(sheet, ("NaN", "nan", "NAN", "-nan", "NaN")).write(folder / "a.csv")


@case()
def spreadsheet_words(folder: Path, s: Sound) -> Foreign:
    """What spreadsheets, R and databases write where nothing was measured."""
    return _with_words(_plain(s), ("NA", "#N/A", "NULL", "null", "None")).write(folder / "a.csv")


def _with_words(sheet: Sheet, words: Sequence[str]) -> Sheet:
    for row, word in zip((3, 40, 41, 90, 200), words, strict=True):
        for k in (1, 2, 3):
            sheet.columns[k][row] = word
        sheet.parts["acc"].values[row] = np.nan
    return sheet


@case()
def pandas_index(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).other("", [str(k) for k in range(len(s.t))]).time("Time (s)")
    sheet.sensor("acc", [f"Acc {a} (g)" for a in "XYZ"], 1 / G)
    return sheet.sensor("gyr", [f"Gyro {a} (deg/s)" for a in "XYZ"], DEG).write(folder / "a.csv")


@case()
def sample_counter_before_time(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).other("Sample", [str(k) for k in range(1, len(s.t) + 1)]).time("Elapsed (ms)", 1e3, 0, "%d")
    sheet.sensor("acc", [f"Acc {a} (g)" for a in "XYZ"], 1 / G)
    return sheet.sensor("gyr", [f"Gyro {a} (deg/s)" for a in "XYZ"], DEG).write(folder / "a.csv")


@case()
def german_header(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).time("Zeit (s)").sensor("acc", [f"Beschleunigung {a} (m/s²)" for a in "xyz"])
    sheet.sensor("gyr", [f"Drehrate {a} (rad/s)" for a in "xyz"])
    return sheet.write(folder / "a.csv", sheet.text(";").replace(".", ","))


@case()
def gyro_before_acc_short_names(folder: Path, s: Sound) -> Foreign:
    """`wx` are rates, `mx` the field; units in the header."""
    sheet = Sheet(s).time("t[s]").sensor("gyr", ["wx[deg/s]", "wy[deg/s]", "wz[deg/s]"], DEG)
    sheet.sensor("acc", ["fx[m/s2]", "fy[m/s2]", "fz[m/s2]"])
    return sheet.sensor("mag", ["mx[mG]", "my[mG]", "mz[mG]"], 10).write(folder / "a.csv")


@case(moving="either", rest="either")
def mocap_tum(folder: Path, s: Sound) -> Foreign:
    """Positions and quaternions alone: no sensor may come out of it."""
    sheet = Sheet(s).time("timestamp", start=1305031102.25)
    sheet.others(["tx", "ty", "tz"], np.cumsum(s.gyr, axis=0) / 200, "%.4f")
    sheet.others(["qx", "qy", "qz", "qw"], s.q[:, [1, 2, 3, 0]])
    before = "# ground truth trajectory\n# file: 'rgbd_dataset_freiburg1_xyz.bag'\n# timestamp tx ty tz qx qy qz qw\n"
    return sheet.write(folder / "groundtruth.txt", sheet.text(" ", header=None, before=before))


@case(moving="either", rest="either")
def euler_rates_and_angles(folder: Path, s: Sound) -> Foreign:
    """`gx gy gz` may be gravity where the accelerations beside it are linear: nothing of it is a rate."""
    sheet = Sheet(s).time("time_s").others(["lax", "lay", "laz"], s.acc - gravity(s))
    sheet.others(["gx", "gy", "gz"], gravity(s))
    return sheet.sensor("mag", ["mx (uT)", "my (uT)", "mz (uT)"]).write(folder / "a.csv")


@case(moving="either", rest="either")
def acc_without_gravity(folder: Path, s: Sound) -> Foreign:
    """Named as an accelerometer, but the norm at rest is near 0: no specific force, whatever the header says."""
    sheet = Sheet(s).time("time_s").others([f"acc_{a} (m/s^2)" for a in "xyz"], s.acc - gravity(s))
    return sheet.sensor("gyr", [f"gyr_{a} (rad/s)" for a in "xyz"]).write(folder / "a.csv")


# --- more makers -----------------------------------------------------------------------------------------------------


@case(moving="either", rest="either")
def euroc_ground_truth(folder: Path, s: Sound) -> Foreign:
    """Estimated biases in rad/s and m/s^2 stand beside the attitude: none is a reading."""
    n = len(s.t)
    sheet = Sheet(s).time("#timestamp", 1e9, EPOCH_S, "%d")
    sheet.others([f" p_RS_R_{a} [m]" for a in "xyz"], np.cumsum(s.gyr, axis=0) / 200)
    sheet.others([f" q_RS_{a} []" for a in "wxyz"], s.q).others([f" v_RS_R_{a} [m s^-1]" for a in "xyz"], s.gyr)
    sheet.others([f" b_w_RS_S_{a} [rad s^-1]" for a in "xyz"], np.full((n, 3), -0.002))
    sheet.others([f" b_a_RS_S_{a} [m s^-2]" for a in "xyz"], np.full((n, 3), 0.05))
    return sheet.write(folder / "state_groundtruth_estimate0" / "data.csv")


@case(moving="refuses", rest="refuses")
def kitti_oxts(folder: Path, s: Sound) -> Foreign:
    """One file a sample, thirty numbers without names; the times stand in a file beside."""
    run = folder / "oxts"
    (run / "data").mkdir(parents=True)
    stamps = _clock(s, "%Y-%m-%d %H:%M:%S.%f000", 0)[:60]
    (run / "timestamps.txt").write_text("\n".join(stamps) + "\n")
    for k in range(60):
        row = [49.01, 8.43, 112.8, *euler_deg(s)[k] / DEG, 0, 0, 0, 0, 0, *s.acc[k], *s.acc[k], *s.gyr[k], *s.gyr[k]]
        text = " ".join(f"{value:.10g}" for value in row) + " 0.1 0.02 4 8 5 6 0\n"
        (run / "data" / f"{k:010d}.txt").write_text(text)
    first = slice(0, 60)
    return Foreign(run, Part(s.t[first], s.acc[first]), Part(s.t[first], s.gyr[first]))


@case(moving="either", rest="either")
def physics_toolbox(folder: Path, s: Sound) -> Foreign:
    """Physics Toolbox Sensor Suite: gF is the specific force in g, ax ay az is without gravity."""
    sheet = Sheet(s).time("time", form="%.6f").sensor("acc", "gF*", 1 / G, "%.6f")
    sheet.others(["ax", "ay", "az"], s.acc - gravity(s)).sensor("gyr", "w*").other("p", "1013.2")
    sheet.sensor("mag", "B*", 1, "%.4f").others(["Azimuth", "Pitch", "Roll"], euler_deg(s), "%.3f")
    return sheet.write(folder / "physics_toolbox.csv")


@case()
def androsensor(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s)
    ms = [str(round(1e3 * float(t)) + 7) for t in s.t]
    sheet.sensor("acc", [f"ACCELEROMETER {a} (m/s²)" for a in "XYZ"], form="%.4f")
    sheet.others([f"GRAVITY {a} (m/s²)" for a in "XYZ"], gravity(s), "%.4f")
    sheet.others([f"LINEAR ACCELERATION {a} (m/s²)" for a in "XYZ"], s.acc - gravity(s), "%.4f")
    sheet.sensor("gyr", [f"GYROSCOPE {a} (rad/s)" for a in "XYZ"], form="%.4f")
    sheet.sensor("mag", [f"MAGNETIC FIELD {a} (μT)" for a in "XYZ"], form="%.4f")
    sheet.others([f"ORIENTATION {a} (°)" for a in ("Z (azimuth", "X (pitch", "Y (roll")], euler_deg(s), "%.4f")
    sheet.other("Time since start in ms ", ms).other("YYYY-MO-DD HH-MI-SS_SSS", _clock(s, "%Y-%m-%d %H-%M-%S:%f"))
    return sheet.write(folder / "Sensor_record_20240620_100000_AndroSensor.csv", sheet.text(";"))


@case(moving="either", rest="either")
def axivity_omgui(folder: Path, s: Sound) -> Foreign:
    """AX6 export: no header, a date and clock, g and deg/s."""
    sheet = Sheet(s).other("t", _clock(s, "%Y-%m-%d %H:%M:%S.%f")).sensor("acc", "a*", 1 / G, "%.6f")
    sheet.sensor("gyr", "g*", DEG, "%.6f")
    return sheet.write(folder / "CWA-DATA.csv", sheet.text(header=None))


@case(moving="either", rest="either")
def actigraph(folder: Path, s: Sound) -> Foreign:
    before = (
        "------------ Data File Created By ActiGraph GT3X+ ActiLife v6.13.3 Firmware v2.5.0 date format M/d/yyyy at "
        "100 Hz  Filter Normal -----------\nSerial Number: NEO1DXXXXXXXX\nStart Time 08:00:00\nStart Date 6/20/2024\n"
        "Epoch Period (hh:mm:ss) 00:00:00\nDownload Time 16:26:16\nDownload Date 6/21/2024\n"
        "Current Memory Address: 0\nCurrent Battery Voltage: 4.03     Mode = 12\n"
        "--------------------------------------------------\n"
    )
    sheet = Sheet(s).sensor("acc", [f"Accelerometer {a}" for a in "XYZ"], 1 / G, "%.3f")
    return sheet.write(folder / "NEO1D (2024-06-20)RAW.csv", sheet.text(before=before, end="\r\n"))


@case(moving="either", rest="either")
def openlog_artemis(folder: Path, s: Sound) -> Foreign:
    """Milli-g, deg/s and uT without a word of it; every line ends in a comma."""
    sheet = Sheet(s).other("rtcDate", _clock(s, "%m/%d/%Y", 0)).other("rtcTime", _clock(s, "%H:%M:%S.%f", 4))
    sheet.sensor("acc", [f"a{a}" for a in "XYZ"], 1000 / G, "%.2f").sensor("gyr", [f"g{a}" for a in "XYZ"], DEG, "%.2f")
    sheet.sensor("mag", [f"m{a}" for a in "XYZ"], 1, "%.2f").other("imu_degC", "24.31").other("output_Hz", "99.998")
    return sheet.write(folder / "dataLog00001.TXT", sheet.text(end=",\r\n"))


@case()
def polar_acc(folder: Path, s: Sound) -> Foreign:
    sheet = Sheet(s).other("Phone timestamp", _clock(s, "%Y-%m-%dT%H:%M:%S.%f"))
    sheet.time("sensor timestamp [ns]", 1e9, EPOCH_S - 946_684_800, "%d")
    sheet.sensor("acc", [f"{a} [mg]" for a in "XYZ"], 1000 / G, "%.1f")
    return sheet.write(folder / "Polar_Sense_ACC.txt", sheet.text(";"))


@case()
def polar_folder(folder: Path, s: Sound) -> Foreign:
    parts = []
    for sensor, unit, per_si, name in (
        ("acc", "mg", 1000 / G, "ACC"),
        ("gyr", "dps", DEG, "GYRO"),
        ("mag", "G", 0.01, "MAGN"),
    ):
        sheet = Sheet(s).other("Phone timestamp", _clock(s, "%Y-%m-%dT%H:%M:%S.%f"))
        sheet.time("sensor timestamp [ns]", 1e9, EPOCH_S - 946_684_800, "%d")
        sheet.sensor(sensor, [f"{a} [{unit}]" for a in "XYZ"], per_si, "%.5f")
        parts.append(sheet.write(folder / "run" / f"Polar_Sense_0A1B2C3D_20240620_100000_{name}.txt", sheet.text(";")))
    return together(folder / "run", *parts)


@case(rest="either")
def ardupilot_imu(folder: Path, s: Sound) -> Foreign:
    """`mavlogdump.py --types IMU --format csv` of a vehicle with one sensor: rad/s and m/s^2 without a word of it."""
    sheet = Sheet(s).time("timestamp", start=EPOCH_S, form="%.6f").time("TimeUS", 1e6, 112.5, "%d").other("I", "0")
    sheet.sensor("gyr", [f"Gyr{a}" for a in "XYZ"], form="%.7g").sensor("acc", [f"Acc{a}" for a in "XYZ"], form="%.7g")
    for name, cell in (
        ("EG", "0"),
        ("EA", "0"),
        ("T", "41.2"),
        ("GH", "1"),
        ("AH", "1"),
        ("GHz", "1000"),
        ("AHz", "1000"),
    ):
        sheet.other(name, cell)
    return sheet.write(folder / "imu.csv")


@case(moving="either", rest="either")
def ardupilot_two_imus(folder: Path, s: Sound) -> Foreign:
    """Rows of two sensors take turns, told by the column I: they must not become one."""
    sheet = Sheet(s).time("TimeUS", 1e6, 112.5, "%d").other("I", "0")
    sheet.sensor("gyr", [f"Gyr{a}" for a in "XYZ"], form="%.7g").sensor("acc", [f"Acc{a}" for a in "XYZ"], form="%.7g")
    lines = sheet.text().splitlines()
    both = [lines[0]]
    for k, line in enumerate(lines[1:]):
        time = int(sheet.columns[0][k])
        other = [f"{value:.7g}" for value in (*(-s.gyr[k, [1, 0, 2]]), *(s.acc[k, [2, 1, 0]] + 0.4))]
        both += [line, ",".join([str(time + 40), "1", *other])]
    return sheet.write(folder / "imu.csv", "\n".join(both) + "\n")


@case(moving="refuses", rest="refuses")
def micros_that_wrap(folder: Path, s: Sound) -> Foreign:
    """micros() of an Arduino starts again at 0 after 2^32 us: the time goes on, or the file is refused."""
    sheet = _sketch(s, SI, "micros,ax,ay,az,gx,gy,gz", time="us")
    sheet.columns[0] = [str((int(cell) + 2**32 - 5_000_000) % 2**32) for cell in sheet.columns[0]]
    return sheet.write(folder / "log.csv")


@case(moving="refuses", rest="refuses")
def gnss_logger(folder: Path, s: Sound) -> Foreign:
    """Google's GnssLogger: records of several kinds in one file, told by the first cell."""
    lines = [
        "# ",
        "# Header Description:",
        "# ",
        "# Version: v3.0.5.6 Platform: 14 Manufacturer: Google Model: Pixel 6",
    ]
    for kind, unit in (("Accel", "Mps2"), ("Gyro", "RadPerSec"), ("Mag", "MicroT")):
        axes = ",".join(f"Uncal{kind}{a}{unit}" for a in "XYZ")
        lines += ["# ", f"# Uncal{kind},utcTimeMillis,elapsedRealtimeNanos,{axes},Bias{unit}X,Bias{unit}Y,Bias{unit}Z"]
    for k, t in enumerate(s.t):
        stamp = f"{EPOCH_S * 1000 + round(t * 1000)},{8_123_250_000_000 + round(t * 1e9)}"
        for kind, row in (("Accel", s.acc[k]), ("Gyro", s.gyr[k]), ("Mag", s.mag[k])):
            lines.append(f"Uncal{kind},{stamp}," + ",".join(f"{value:.7f}" for value in row) + ",0.0,0.0,0.0,3")
    path = folder / "gnss_log_2024_06_20_10_00_00.txt"
    path.write_text("\n".join(lines) + "\n")
    rounded = {name: Part(s.t, np.round(getattr(s, name), 7)) for name in ("acc", "gyr", "mag")}
    return Foreign(path, **rounded)


# --- spellings of units ----------------------------------------------------------------------------------------------

SPELLINGS = (
    ("Time (sec)", 1, "m/s/s", 1, "deg/sec", DEG, "microtesla", 1),
    ("time [msec]", 1e3, "m/s**2", 1, "rad/sec", 1, "Gauss", 0.01),
    ("t_us", 1e6, "m s^-2", 1, "degrees/s", DEG, "nT", 1e3),
    ("timestamp_ns", 1e9, "m·s⁻²", 1, "rad·s⁻¹", 1, "μT", 1),
    ("Time(ms)", 1e3, "milli-g", 1000 / G, "mdps", 1000 * DEG, "mGauss", 10),
    ("elapsed [µs]", 1e6, "G", 1 / G, "DPS", DEG, "UT", 1),
    ("Time, ms", 1e3, "mg", 1000 / G, "°/sec", DEG, "mG", 10),
    ("seconds", 1, "ms-2", 1, "rads-1", 1, "µT", 1),
)
"""Spellings of time, acc, gyr and mag with how many of it make one of SI: as they are met in headers."""


def _spelled(k: int, style: str) -> Writer:
    time, time_per, acc, acc_per, gyr, gyr_per, mag, mag_per = SPELLINGS[k]

    def spelled(folder: Path, s: Sound) -> Foreign:
        sheet = Sheet(s).time(time, time_per, 1.5, "%.6f" if time_per == 1 else "%d")
        sheet.sensor("acc", [style.format("Acc", a, acc) for a in "xyz"], acc_per, "%.7f")
        sheet.sensor("gyr", [style.format("Gyr", a, gyr) for a in "xyz"], gyr_per, "%.7f")
        sheet.sensor("mag", [style.format("Mag", a, mag) for a in "xyz"], mag_per, "%.6f")
        return sheet.write(folder / "a.txt", sheet.text("\t"))

    spelled.__name__ = f"spelled_{k}_{'brackets' if '[' in style else 'parentheses'}"
    return spelled


for _k in range(len(SPELLINGS)):
    for _style in ("{0}_{1} [{2}]", "{0} {1} ({2})"):
        case()(_spelled(_k, _style))


def write(name: str, folder: Path, s: Sound) -> Foreign:
    """Write the file of that case."""
    folder.mkdir(parents=True, exist_ok=True)
    return WRITERS[name].write(folder, s)
