"""Layouts of makers: by which columns a file is known, and what its names leave open."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final


@dataclass(frozen=True)
class Maker:
    """A program or device whose files are known by their columns.

    Parameters
    ----------
    name : str
        What it is called.
    marks : tuple of str
        Patterns: the file is of this maker if each of them fits one of its clues (see `maker_of`).
    units : dict
        Unit of a sensor or of the time ("acc", "gyr", "mag", "t") that the names do not state.
    ticks : tuple of str
        Units of the time of which the maker used several, for the stamps to show which.
    columns : dict
        Pattern of the columns that are a sensor, whatever their names say.
    left_out : str
        Pattern of columns that are not readings of a sensor although their names say so.
    other_tables : str
        Pattern of tables that are not readings of a sensor of this body, or are without gravity.
    varied : str
        Pattern of tables whose unit depends on what the user set: `units` does not hold for them.
    opposite : dict
        Unit in which the readings of a sensor have the opposite sign: gravity instead of specific force.
    arbitrary : tuple of str
        Sensors that are given in a unit of the maker's own.
    rate : str
        Pattern whose first group is the rate in Hz, in a line before the header.
    counter : str
        Column that counts the samples, for a file whose rate is known.
    instance : str
        Column that separates sensors of one kind whose rows alternate.
    source : str
        Where the layout is documented.
    """

    name: str
    marks: tuple[str, ...]
    units: Mapping[str, str] = field(default_factory=dict)
    ticks: tuple[str, ...] = ()
    columns: Mapping[str, str] = field(default_factory=dict)
    left_out: str = r"(?!)"
    other_tables: str = r"(?!)"
    varied: str = r"(?!)"
    opposite: Mapping[str, str] = field(default_factory=dict)
    arbitrary: tuple[str, ...] = ()
    rate: str = ""
    counter: str = ""
    instance: str = ""
    source: str = ""

    def made(self, clues: Sequence[str]) -> bool:
        """Whether a file with these clues is of this maker."""
        return all(any(re.search(mark, clue, re.IGNORECASE) for clue in clues) for mark in self.marks)

    def takes(self, table: str, column: str) -> bool:
        """Whether a column may be the reading of a sensor, or the time."""
        return not (re.search(self.left_out, column) or re.search(self.other_tables, table))

    def unit(self, group: str, table: str) -> str | None:
        """Give the unit of a sensor or of the time in a table; None where the maker does not fix it."""
        return None if re.search(self.varied, table) else self.units.get(group)

    def sensor(self, column: str) -> str | None:
        """Give the sensor of a column independent of its name; None where the name counts."""
        return next((sensor for sensor, pattern in self.columns.items() if re.search(pattern, column)), None)

    def rate_in(self, clues: Sequence[str]) -> float | None:
        """Find the samples per second that the lines before the header state, Hz."""
        found = next((found for clue in clues if self.rate and (found := re.search(self.rate, clue))), None)
        return float(found[1]) if found is not None and float(found[1]) > 0.0 else None


_LOGGER: Final = "github.com/tszheichoi/awesome-sensor-logger: UNITS.md, CROSSPLATFORM.md"
_LOGGER_OTHERS: Final = r"Accelerometer|Gravity|Orientation|Compass|Headphone|WristMotion|Watch\w*"
"""Tables of Sensor Logger without gravity, and of the wrist, the head and a watch: other bodies than the phone."""
_XSENS: Final = r"(^|\.)(Acc_X|FreeAcc_[EX])$"

MAKERS: Final = (
    Maker(
        "Sensor Logger on iOS",
        (r"(^|\.)seconds_elapsed$", r"^Metadata\.platform=ios$", r"^Metadata\.standardisation=(false|0)$"),
        {"acc": "g", "gyr": "rad/s", "mag": "uT"},
        left_out=r"(^|\.)time$",
        other_tables=rf"^(TotalAcceleration|{_LOGGER_OTHERS})$",
        opposite={"acc": "g"},
        source=_LOGGER,
    ),
    Maker(
        "Sensor Logger",
        (r"(^|\.)seconds_elapsed$",),
        {"acc": "m/s^2", "gyr": "rad/s", "mag": "uT"},
        left_out=r"(^|\.)time$",
        other_tables=rf"^({_LOGGER_OTHERS})$",
        # in g on iOS, with Apple's sign, unless the user has units standardised
        varied=r"^AccelerometerUncalibrated$",
        opposite={"acc": "g"},
        source=_LOGGER,
    ),
    Maker(
        "ROS sensor_msgs/Imu",
        (r"angular_velocity\.x$", r"linear_acceleration\.x$"),
        {"acc": "m/s^2", "gyr": "rad/s"},
        columns={"acc": r"linear_acceleration\.[xyz]$"},
        source="docs.ros.org, sensor_msgs/Imu",
    ),
    Maker(
        "Apple Core Motion",
        (r"(accelerometerAcceleration|userAcceleration|motionUserAcceleration)\.?x",),
        {"gyr": "rad/s"},
        opposite={"acc": "g"},
        left_out=r"(?i)loggingTime|loggingSample|magneticField.*(Bias|Accuracy)",
        source="developer.apple.com, Core Motion: CMAccelerometerData",
    ),
    Maker(
        "phyphox",
        (r"Time \(s\)$", r"(Acceleration|Gyroscope|Magnetic field|X|x) ?(x|y|z)? \((m/s\^2|rad/s|µT)\)$"),
        left_out=r"(?i)linear",
        source="phyphox.org, wiki: data export",
    ),
    Maker(
        "Physics Toolbox Sensor Suite",
        (r"^gFx$", r"^gFz$"),
        {"acc": "g", "gyr": "rad/s", "mag": "uT"},
        columns={"acc": r"^gF[xyz]$"},
        # a is without gravity
        left_out=r"^a[xyz]$",
        source="vieyrasoftware.net, Physics Toolbox Sensor Suite: multi record",
    ),
    Maker(
        "OpenLog Artemis",
        (r"^aX$", r"^gX$", r"^(imu_degC|output_Hz|rtcDate|rtcTime)$"),
        {"acc": "mg", "gyr": "deg/s", "mag": "uT"},
        left_out=r"^output_Hz$",
        source="github.com/sparkfun/OpenLog_Artemis, firmware: ICM-20948 through getAGMT in mg, dps and uT",
    ),
    Maker(
        "ActiGraph ActiLife",
        (r"Data File Created By ActiGraph", r"^Accelerometer X$"),
        {"acc": "g"},
        rate=r"\bat ([\d.]+) Hz\b",
        source="ActiGraph, ActiLife user manual: raw data export",
    ),
    Maker(
        "Betaflight blackbox",
        (r"^loopIteration$", r"^gyroADC\[0\]"),
        {"gyr": "deg/s", "t": "us"},
        left_out=r"^(?!time|gyroADC|accSmooth|magADC|loopIteration|vbat|amperage|motor|rcCommand|debug)",
        source="github.com/betaflight/blackbox-tools, README",
    ),
    Maker(
        "PX4 ulog2csv",
        (r"(^|\.)timestamp$", r"(accelerometer_m_s2|gyro_rad|magnetometer_ga)\[0\]$"),
        {"t": "us"},
        source="docs.px4.io, sensor_combined",
    ),
    Maker(
        "ArduPilot",
        (r"(^|\.)TimeUS$", r"(^|\.)(GyrX|AccX|MagX)$"),
        {"acc": "m/s^2", "gyr": "rad/s", "mag": "mG"},
        instance="I",
        source="ardupilot.org, log messages: IMU, ACC, GYR, MAG",
    ),
    Maker(
        "Movella DOT",
        (r"\b(Xsens|Movella) DOT\b", _XSENS),
        {"acc": "m/s^2", "gyr": "deg/s", "t": "us"},
        arbitrary=("mag",),
        rate=r"^OutputRate:?[,;\s]*([\d.]+) ?Hz",
        counter="PacketCounter",
        source="Movella DOT user manual: data export; SampleTimeFine in us",
    ),
    Maker(
        "Xsens MT Manager",
        (r"^//.*(MT Manager|XDA) version|^//.*DeviceId:", _XSENS),
        {"acc": "m/s^2", "gyr": "rad/s"},
        ticks=("10000 Hz",),
        arbitrary=("mag",),
        rate=r"(?i)^//\s*(?:update|output|sample) ?rate:?\s*([\d.]+) ?Hz",
        counter="PacketCounter",
        source="Xsens, MT Manager and MT low-level communication manuals: SampleTimeFine in 0.1 ms",
    ),
    Maker(
        "Xsens",
        (r"(^|\.)SampleTimeFine$", r"(^|\.)Acc_X$"),
        {"acc": "m/s^2"},
        ticks=("10000 Hz", "us"),
        arbitrary=("mag",),
        source="Movella, MT Manager and DOT user manuals",
    ),
    Maker("Shimmer Consensys", (r"shimmer.*(Accel|Gyro|Mag)_",), source="Shimmer, Consensys user guide"),
    Maker(
        "x-io",
        (r"(^|\.)Gyroscope X \(deg/s\)$", r"(^|\.)Accelerometer X \(g\)$"),
        source="x-io Technologies, x-IMU3 user manual",
    ),
    Maker(
        "MATLAB Mobile",
        (r"(^|\.)(Acceleration|AngularVelocity|MagneticField)\.X$", r"(^|\.)Timestamp$"),
        {"acc": "m/s^2", "gyr": "rad/s", "mag": "uT"},
        other_tables=r"^(Orientation|Position)$",
        source="MathWorks, MATLAB Mobile sensor data",
    ),
)
"""In the order in which they are tried: the more special ones first."""


def maker_of(clues: Sequence[str]) -> Maker | None:
    """Maker of a file; None where none is known.

    Parameters
    ----------
    clues : sequence of str
        What a file is known by: its name, the lines before its header, its columns, with their table's name and a point
        in front where the file has several; of tables of one row also ``TABLE.COLUMN=CELL``.
    """
    return next((maker for maker in MAKERS if maker.made(clues)), None)
