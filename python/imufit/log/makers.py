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
        Patterns: the file is of this maker if each of them fits one of its columns.
    units : dict
        Unit of a sensor or of the time ("acc", "gyr", "mag", "t") that the names do not state.
    ticks : tuple of str
        Units of the time of which the maker used several, for the stamps to show which.
    left_out : str
        Pattern of columns that are not readings of the sensor although their names say so.
    force : str
        Pattern of columns that are specific force although their names say that gravity was taken off.
    opposite : tuple of str
        Sensors whose readings have the opposite sign: gravity instead of specific force.
    arbitrary : tuple of str
        Sensors that are given in a unit of the maker's own.
    source : str
        Where the layout is documented.
    """

    name: str
    marks: tuple[str, ...]
    units: Mapping[str, str] = field(default_factory=dict)
    ticks: tuple[str, ...] = ()
    left_out: str = r"(?!)"
    force: str = r"(?!)"
    opposite: tuple[str, ...] = ()
    arbitrary: tuple[str, ...] = ()
    source: str = ""

    def made(self, names: Sequence[str]) -> bool:
        """Whether a file with these columns is of this maker."""
        return all(any(re.search(mark, name, re.IGNORECASE) for name in names) for mark in self.marks)


MAKERS: Final = (
    Maker(
        "Sensor Logger",
        (r"(^|\.)seconds_elapsed$",),
        {"acc": "m/s^2", "gyr": "rad/s", "mag": "uT"},
        # Accelerometer.csv has the acceleration without gravity; time is in ns since 1970
        left_out=r"(^|\.)time$|^(Accelerometer|Gravity|Orientation)\.",
        source="github.com/tszheichoi/awesome-sensor-logger, README",
    ),
    Maker(
        "ROS sensor_msgs/Imu",
        (r"angular_velocity\.x$", r"linear_acceleration\.x$"),
        {"acc": "m/s^2", "gyr": "rad/s"},
        force=r"linear_acceleration\.[xyz]$",
        source="docs.ros.org, sensor_msgs/Imu",
    ),
    Maker(
        "Apple Core Motion",
        (r"(accelerometerAcceleration|userAcceleration|motionUserAcceleration)\.?x",),
        {"gyr": "rad/s"},
        opposite=("acc",),
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
        (r"(^|\.)(Acceleration|AngularVelocity|MagneticField)\.X$", r"\.Timestamp$"),
        {"acc": "m/s^2", "gyr": "rad/s", "mag": "uT"},
        left_out=r"^(Orientation|Position)\.",
        source="MathWorks, MATLAB Mobile sensor data",
    ),
)
"""In the order in which they are tried: the more special ones first."""


def maker_of(names: Sequence[str]) -> Maker | None:
    """Maker of a file with these columns; None where none is known.

    Parameters
    ----------
    names : sequence of str
        Columns, with their table's name and a point in front where the file has several.
    """
    return next((maker for maker in MAKERS if maker.made(names)), None)
