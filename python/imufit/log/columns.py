"""Names of a log's columns, their groups and the largest values that can be meant."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Final

GROUPS: Final[dict[str, tuple[str, ...]]] = {
    "acc": ("acc_x", "acc_y", "acc_z"),
    "gyr": ("gyr_x", "gyr_y", "gyr_z"),
    "mag": ("mag_x", "mag_y", "mag_z"),
    "ref_q": ("ref_qw", "ref_qx", "ref_qy", "ref_qz"),
    "ref_p": ("ref_px", "ref_py", "ref_pz"),
}
"""Columns that belong together: field of the log, columns of the table."""

SENSORS: Final = ("acc", "gyr", "mag")
SENSOR_NAMES: Final = {"acc": "accelerometer", "gyr": "gyroscope", "mag": "magnetometer"}
"""Names of the sensors in a sentence."""

EULER: Final = ("ref_roll", "ref_pitch", "ref_yaw")
"""Reference attitude as angles, rad: a file may have them in place of `ref_q`, a log has not."""
WHOLE_TURN: Final = 6.4
"""Largest angle of an attitude, rad: a whole turn, and rounding. Larger ones are in degrees."""

CONTRACT: Final[tuple[str, ...]] = (
    "t",
    *GROUPS["acc"],
    *GROUPS["gyr"],
    *GROUPS["mag"],
    "temp",
    *GROUPS["ref_q"],
    *GROUPS["ref_p"],
    "ref_angle",
    "pose",
)
"""Every column that has a fixed meaning, in the order in which tables are written."""

NUMERIC: Final = frozenset(CONTRACT) - {"pose"}

UNITS: Final = {
    "t": "s",
    **dict.fromkeys(GROUPS["acc"], "m/s^2"),
    **dict.fromkeys(GROUPS["gyr"], "rad/s"),
    **dict.fromkeys(GROUPS["mag"], "uT"),
    "temp": "degC",
    **dict.fromkeys(GROUPS["ref_q"], "1"),
    **dict.fromkeys(GROUPS["ref_p"], "m"),
    "ref_angle": "rad",
}
"""Unit of each column that has a fixed one."""

LARGEST: Final[dict[str, float]] = {
    # ns since 1970 are 2e18; check_units states this with the mapping, so they must come through
    "t": 1e19,
    # m/s^2; the most robust shock sensors end at 2e5 g. Raw counts of 24 bits come through, for check_units to name.
    **dict.fromkeys(GROUPS["acc"], 1e7),
    # rad/s; a dentist's drill turns at 5e4. Raw counts of 24 bits come through.
    **dict.fromkeys(GROUPS["gyr"], 1e7),
    # uT; the strongest lasting magnets have 45 T = 4.5e7 uT
    **dict.fromkeys(GROUPS["mag"], 1e8),
    # degC; no sensor lives at 1e3, but raw counts of 16 bits may stand unconverted in an unused column
    "temp": 1e6,
    # a unit quaternion; checked_attitude reports the distance from one
    **dict.fromkeys(GROUPS["ref_q"], 1e7),
    # m; the moon is at 4e8, and earth-centred positions are 6.4e6
    **dict.fromkeys(GROUPS["ref_p"], 1e9),
    # rad; a spindle of 1e5 rad/s for an hour
    "ref_angle": 1e9,
}
"""Largest absolute value of each column that can be meant, SI units."""

LARGEST_COVARIATE: Final = 1e30
"""Largest absolute value of a column of unknown unit. Counters of 64 bits end at 1.8e19, and no quantity in SI units
comes near; what lies beyond is a filler such as FLT_MAX. Fourth powers of 1e9 rows still have room in a float64."""

SMALLEST: Final = 1e-30
"""A value nearer to zero counts as zero in a column of a sensor, m/s^2, rad/s or uT. The quietest instrument (the test
masses of LISA Pathfinder) resolves 1e-15 m/s^2, and fourth powers still have room in a float64."""

POSES: Final = ("+x", "-x", "+y", "-y", "+z", "-z")

_UNIT_SUFFIX: Final = re.compile(r"\s*(?:\[[^\[\]]*\]|\([^()]*(?:\([^()]*\)[^()]*)?\))\s*$")


def without_unit(name: str) -> str:
    """Cut a bracketed unit off a column name: ``Time (s)`` becomes ``Time``."""
    return _UNIT_SUFFIX.sub("", name)


def present(names: Collection[str]) -> tuple[str, ...]:
    """Contract columns among the names, in contract order."""
    return tuple(column for column in CONTRACT if column in names)
