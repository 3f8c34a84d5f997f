"""The table of what people do wrong with logs: how it is done, where it can be noticed, and what an answer must say."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from mistakes import spoils as s
from mistakes.spoils import Spoil


class Group(StrEnum):
    """What the mistake is about."""

    UNITS = "units"
    AXES = "axes"
    SIGNS = "signs"
    FRAMES = "frames"
    REFERENCE = "reference"
    CLOCK = "clock"
    ROWS = "rows"
    SETTINGS = "sensor settings"
    NAMES = "names"
    HARMLESS = "harmless"


class Need(StrEnum):
    """What a log must have for a mistake to apply and to be noticeable."""

    ACC = "acc"
    GYR = "gyr"
    MAG = "mag"
    TEMP = "temp"
    REFERENCE = "reference attitude in every row"
    POSITION = "reference position"
    ANGLE = "angle of a rig and its axis"
    MOVING = "turns about every axis"
    TURNING = "turns"
    STILL = "rests all the time"
    NOISE = "noise told"
    FIELD = "field told"


class Remedy(StrEnum):
    """What the answer must offer."""

    MAPPING = "a mapping that restores the readings"
    WORDS = "words: what to declare, or to record again"
    NOTHING = "nothing: the log is sound"


@dataclass(frozen=True)
class Mistake:
    """One row of the table.

    Attributes
    ----------
    id, group, line
        Its name, what it is about, and what was done, in plain English.
    spoil
        Does it to a sound log.
    needs
        What the log must have.
    words
        One of these must stand in the answer: whole words whatever their case; with a star, beginnings of words.
    where
        One of these must stand there too: the sensor or column; nothing is asked where there is none.
    remedy
        What the answer must offer.
    effects
        Effects of the catalogue that name the mistake as well.
    step
        Resolution that the mistake takes from the readings, in the unit of the log: a mapping cannot restore more.
    """

    id: str
    group: Group
    line: str
    spoil: Spoil
    needs: frozenset[Need]
    words: tuple[str, ...]
    where: tuple[str, ...] = ()
    remedy: Remedy = Remedy.WORDS
    effects: tuple[str, ...] = ()
    step: float = 0.0

    @property
    def harmless(self) -> bool:
        """Whether nothing must be named."""
        return self.group is Group.HARMLESS


def _needs(*needs: Need) -> frozenset[Need]:
    return frozenset(needs)


REF, MOVING, TURNING = Need.REFERENCE, Need.MOVING, Need.TURNING
ACC, GYR, MAG, TEMP = _needs(Need.ACC), _needs(Need.GYR, TURNING), _needs(Need.MAG), _needs(Need.TEMP)
MOVED = _needs(REF, MOVING, Need.ACC, Need.GYR)
MOVED_MAG = MOVED | MAG
SENSOR = {"acc": ACC, "gyr": GYR, "mag": MAG | {REF, TURNING}, "temp": TEMP, "ref_p": _needs(Need.POSITION, MOVING)}
DPS = np.pi / 180.0
"""One deg/s, rad/s."""
ALL = ("acc", "gyr", "mag")


def _unit(
    name: str,
    sensor: str,
    line: str,
    factor: float,
    words: tuple[str, ...],
    offset: float = 0.0,
    counts: bool = False,
    extra: frozenset[Need] = frozenset(),
) -> Mistake:
    spoil = s.times(sensor, factor, offset=offset, whole=counts)
    step = 0.6 / factor if counts else 0.0  # half a count, and room for the last bit
    needs = SENSOR[sensor] | extra
    return Mistake(name, Group.UNITS, line, spoil, needs, words, (f"{sensor}*",), Remedy.MAPPING, step=step)


def _counts(sensor: str, lsb: str) -> Mistake:
    per, kind = ("LSB/g", s.G) if sensor == "acc" else ("LSB/(deg/s)", DPS)
    words = (f"{lsb} LSB",) if sensor == "acc" else (f"{lsb} LSB", f"{lsb}")
    name = f"{sensor}_counts_{lsb.replace('.', '_')}"
    return _unit(name, sensor, f"{sensor} in raw counts of {lsb} {per}", float(lsb) / kind, words, counts=True)


UNITS = (
    _unit("acc_g", "acc", "acc in g", 1 / s.G, ("[g]", "in g", "1 g")),
    _unit("acc_g_still", "acc", "acc in g, sensor at rest", 1 / s.G, ("[g]", "in g"), extra=_needs(Need.STILL)),
    _unit("acc_mg", "acc", "acc in mg", 1e3 / s.G, ("[mg]", "mg")),
    *(_counts("acc", lsb) for lsb in ("16384", "8192", "4096", "2048")),
    _unit("acc_cm", "acc", "acc in cm/s^2 (Gal)", 100.0, ("cm/s^2", "Gal", "cm", "hundred*", "100", "*0.01")),
    _unit("gyr_dps", "gyr", "gyr in deg/s", 1 / DPS, ("deg/s", "dps")),
    _unit("gyr_mdps", "gyr", "gyr in mdeg/s", 1e3 / DPS, ("mdps", "mdeg/s", "thousand*", "0.001 dps/LSB", "1000 LSB")),
    *(_counts("gyr", lsb) for lsb in ("131", "65.5", "32.8", "16.4")),
    _unit("gyr_rpm", "gyr", "gyr in rpm", 30 / np.pi, ("rpm",)),
    _unit("mag_gauss", "mag", "mag in gauss", 1e-2, ("[G]", "gauss")),
    _unit("mag_milligauss", "mag", "mag in mG", 10.0, ("[mG]", "mG", "milligauss")),
    _unit("mag_nanotesla", "mag", "mag in nT", 1e3, ("[nT]", "nT")),
    _unit("mag_tesla", "mag", "mag in T", 1e-6, ("[T]", "tesla", "1000000", "1e6", "*1e+06")),
    _unit("mag_counts", "mag", "mag in raw counts of 0.15 uT", 1 / 0.15, ("0.15", "counts", "6.67"), counts=True),
    _unit("temp_kelvin", "temp", "temp in K", 1.0, ("[K]", "K", "kelvin"), offset=273.15),
    _unit("temp_fahrenheit", "temp", "temp in degF", 1.8, ("[degF]", "degF", "fahrenheit"), offset=32.0),
    _unit("position_mm", "ref_p", "ref_p in mm", 1e3, ("[mm]", "mm", "millimet*")),
    Mistake(
        "gyr_z_dps",
        Group.UNITS,
        "only gyr_z in deg/s",
        s.times("gyr_z", 1 / DPS),
        MOVED,
        ("deg/s", "dps"),
        ("gyr_z",),
        Remedy.MAPPING,
    ),
    Mistake(
        "rig_degrees",
        Group.UNITS,
        "ref_angle in degrees",
        s.degrees_of_rig,
        _needs(Need.ANGLE, Need.ACC),
        ("deg", "degrees"),
        ("ref_angle",),
        Remedy.MAPPING,
    ),
    Mistake(
        "acc_normalised",
        Group.UNITS,
        "acc divided by its own length",
        s.normalised("acc"),
        MOVED | {Need.POSITION},
        ("length", "unit vector*", "normalis*", "direction*"),
        ("acc*",),
    ),
    Mistake(
        "mag_normalised",
        Group.UNITS,
        "mag divided by its own length",
        s.normalised("mag"),
        MOVED_MAG,
        ("length", "unit vector*", "normalis*", "direction*"),
        ("mag*",),
    ),
)

AXIS_WORDS = ("axis", "axes", "sign", "signs", "exchang*", "swap*")


def _axes(name: str, line: str, spoil: Spoil, where: tuple[str, ...], group: Group = Group.AXES) -> Mistake:
    needs = MOVED_MAG if any("mag" in part for part in where) else MOVED
    return Mistake(name, group, line, spoil, needs, AXIS_WORDS, where, Remedy.MAPPING)


AXES = (
    _axes("acc_xy", "x and y of acc exchanged", s.axes("y x z", "acc"), ("acc*",)),
    _axes("gyr_yz", "y and z of gyr exchanged", s.axes("x z y", "gyr"), ("gyr*",)),
    _axes("mag_xz", "x and z of mag exchanged", s.axes("z y x", "mag"), ("mag*",)),
    _axes("acc_cycle", "acc_x, acc_y, acc_z hold y, z, x", s.axes("y z x", "acc"), ("acc*",)),
    _axes("mag_other_chip", "mag in the axes of another chip (y x -z)", s.axes("y x -z", "mag"), ("mag*",)),
    _axes(
        "left_handed", "y of acc and gyr turned: a left-handed set", s.axes("x -y z", "acc", "gyr"), ("acc*", "gyr*")
    ),
    _axes("mount_90", "the sensor mounted a quarter turn round", s.axes("y -x z", *ALL), ("acc*", "mount")),
    _axes("mount_180", "the sensor mounted upside down", s.axes("x -y -z", *ALL), ("acc*", "mount")),
    _axes("acc_for_gyr_x", "acc_x and gyr_x exchanged by name", s.exchanged(("acc_x", "gyr_x")), ("acc*", "gyr*")),
    _axes(
        "acc_for_gyr",
        "acc and gyr exchanged by name",
        s.exchanged(*((f"acc_{axis}", f"gyr_{axis}") for axis in "xyz")),
        ("acc*", "gyr*"),
    ),
    _axes("mag_for_gyr", "mag_y and gyr_y exchanged", s.exchanged(("mag_y", "gyr_y")), ("mag*", "gyr*")),
)

SIGNS = (
    _axes("acc_x_sign", "sign of acc_x wrong", s.axes("-x y z", "acc"), ("acc*",), Group.SIGNS),
    _axes("gyr_y_sign", "sign of gyr_y wrong", s.axes("x -y z", "gyr"), ("gyr*",), Group.SIGNS),
    _axes("mag_z_sign", "sign of mag_z wrong", s.axes("x y -z", "mag"), ("mag*",), Group.SIGNS),
    _axes("gyr_negative", "all signs of gyr wrong", s.axes("-x -y -z", "gyr"), ("gyr*",), Group.SIGNS),
    # Without the field told, the negative of the field fits as well.
    Mistake(
        "mag_negative",
        Group.SIGNS,
        "all signs of mag wrong",
        s.axes("-x -y -z", "mag"),
        MOVED_MAG | {Need.FIELD},
        AXIS_WORDS,
        ("mag*",),
        Remedy.MAPPING,
    ),
    Mistake(
        "acc_negative",
        Group.SIGNS,
        "acc shows gravity, all signs wrong",
        s.axes("-x -y -z", "acc"),
        MOVED,
        ("sign", "signs", "gravity", "-acc_x", "frame"),
        ("acc*", "frame"),
        Remedy.MAPPING,
    ),
    Mistake(
        "gravity_removed",
        Group.SIGNS,
        "gravity already taken off acc",
        s.gravity_removed,
        MOVED,
        ("gravity", "linear acceleration"),
        ("acc*",),
    ),
)

FRAMES = (
    *(
        Mistake(
            f"declared_{frame.lower()}",
            Group.FRAMES,
            f"a reference in a frame of another up, declared {frame}",
            s.declared(frame),
            MOVED,
            ("frame", "ENU", "NED", "NWU"),
            ("frame",),
        )
        for frame in ("NED", "ENU", "NWU")
    ),
    Mistake(
        "frame_unknown",
        Group.FRAMES,
        'frame = "NEU"',
        s.told(frame="NEU"),
        MOVED,
        ("NEU",),
        ("frame",),
    ),
    Mistake(
        "frame_key",
        Group.FRAMES,
        "frme in the place of frame",
        s.frame_misspelt,
        MOVED,
        ("frme",),
    ),
)


def _reference(
    name: str,
    line: str,
    spoil: Spoil,
    words: tuple[str, ...],
    mapping: bool = False,
    effects: tuple[str, ...] = (),
    needs: frozenset[Need] = MOVED,
) -> Mistake:
    remedy = Remedy.MAPPING if mapping else Remedy.WORDS
    return Mistake(name, Group.REFERENCE, line, spoil, needs, words, ("ref*",), remedy, effects)


REFERENCE = (
    _reference(
        "ref_conjugated", "ref_q conjugated", s.quaternion(signs=(1, -1, -1, -1)), ("conjugat*", "inverse"), True
    ),
    _reference("ref_scalar_last", "ref_q with its scalar last", s.quaternion(order="xyzw"), ("scalar",), True),
    _reference(
        "ref_conjugated_last",
        "ref_q conjugated, its scalar last",
        s.quaternion(order="xyzw", signs=(-1, -1, -1, 1)),
        ("conjugat*", "scalar", "inverse"),
        True,
    ),
    _reference(
        "ref_mirrored",
        "sign of ref_qy wrong",
        s.quaternion(signs=(1, 1, -1, 1)),
        ("sign", "ref_qy", "mirror*", "hand*"),
        True,
    ),
    _reference(
        "ref_euler",
        "Euler angles in degrees in the columns of ref_q",
        s.euler_in_quaternion,
        ("Euler", "unit", "norm", "length"),
    ),
    _reference("ref_roll", "ref_roll, ref_pitch, ref_yaw for ref_q", s.euler_columns, ("ref_roll", "Euler", "roll")),
    _reference("ref_not_unit", "ref_q of length 1.7", s.quaternion(factor=1.7), ("unit", "norm", "length")),
    _reference(
        "ref_integers", "ref_q as whole numbers of 1/16384", s.quaternion(factor=16384.0), ("unit", "norm", "length")
    ),
    _reference(
        "ref_late",
        "reference late by 0.5 s",
        s.reference_at(lambda t: t - 0.5),
        ("late", "lag", "delay*"),
        effects=("ref.delay",),
    ),
    _reference(
        "ref_very_late",
        "reference late by 2 s",
        s.reference_at(lambda t: t - 2.0),
        ("late", "lag", "delay*"),
        effects=("ref.delay",),
    ),
    _reference(
        "ref_early",
        "reference early by 1 s",
        s.reference_at(lambda t: t + 1.0),
        ("early", "lag", "delay*", "ahead"),
        effects=("ref.delay",),
    ),
    _reference(
        "ref_skew",
        "clock of the reference off by 1 %",
        s.reference_at(lambda t: t[0] + 0.99 * (t - t[0])),
        ("clock*", "skew", "rate"),
        effects=("ref.skew",),
    ),
    _reference(
        "ref_smoothed",
        "reference low-passed at 1 Hz",
        s.reference_smoothed,
        ("smooth*", "low-pass*"),
        effects=("ref.lowpass",),
    ),
    _reference(
        "ref_held",
        "reference at 10 Hz, each value repeated",
        s.reference_held(10.0),
        ("repeat*", "held", "hold*", "stair*", "stuck", "same value*", "steps", "ref_exact"),
    ),
    _reference(
        "ref_stands",
        "one attitude in every row",
        s.reference_stands,
        ("constant", "stands", "stuck", "does not move", "never change*", "same value*", "rest*"),
    ),
    _reference(
        "ref_of_another",
        "reference of another motion",
        s.reference_of_another,
        (
            "another recording",
            "unrelated",
            "not belong",
            "nothing in common",
            "another motion",
            "wrong file",
            "other recording",
        ),
    ),
    _reference(
        "ref_own_filter",
        "a filter of the log's own readings as reference",
        s.own_filter,
        ("filter*", "own readings", "made from", "follows"),
    ),
)

TIME = ("t",)


def _clock(
    name: str,
    line: str,
    spoil: Spoil,
    words: tuple[str, ...],
    mapping: bool = True,
    needs: frozenset[Need] = MOVED,
    step: float = 0.0,
) -> Mistake:
    remedy = Remedy.MAPPING if mapping else Remedy.WORDS
    return Mistake(name, Group.CLOCK, line, spoil, needs, words, TIME, remedy, step=step)


def _whole(factor: float, offset: float = 0.0) -> Spoil:
    return s.clock(lambda t: np.round(t * factor).astype(np.int64) + int(offset))


STILL = _needs(Need.STILL, Need.ACC, REF)
CLOCK = (
    _clock("t_ms", "t in ms", s.clock(lambda t: t * 1e3), ("ms",)),
    _clock("t_ms_whole", "t in ms, whole numbers", _whole(1e3), ("ms",), step=6e-4),
    _clock("t_ms_still", "t in ms, whole numbers, sensor at rest", _whole(1e3), ("ms",), needs=STILL, step=6e-4),
    _clock("t_us", "t in us", s.clock(lambda t: t * 1e6), ("us",)),
    _clock("t_us_whole", "t in us, whole numbers", _whole(1e6), ("us",), step=1e-6),
    _clock("t_us_still", "t in us, whole numbers, sensor at rest", _whole(1e6), ("us",), needs=STILL, step=1e-6),
    _clock("t_ns_whole", "t in ns, whole numbers", _whole(1e9), ("ns",)),
    _clock("t_epoch_ms", "t in ms since 1970", _whole(1e3, s.EPOCH * 1e3), ("ms",), step=6e-4),
    _clock("t_epoch_ns", "t in ns since 1970", _whole(1e9, s.EPOCH * 1e9), ("ns",)),
    _clock("t_minutes", "t in min", s.clock(lambda t: t / 60.0), ("min", "minute*", "*60", "60")),
    _clock(
        "t_rows",
        "t counts rows",
        s.clock_counts,
        ("row*", "Hz", "rate"),
        step=s.EVEN,
    ),
    _clock(
        "t_0_1_hz",
        "t by row number, 0.1 Hz instead of 100 Hz",
        s.clock_by_row,
        ("Hz", "rate", "row*", "ms", "*0.001"),
        step=0.02,
    ),
    _clock(
        "t_double",
        "steps of t twice as long",
        s.clock(lambda t: t * 2.0),
        ("clock", "rate", "twice", "half", "*0.5"),
    ),
    _clock("t_half", "steps of t half as long", s.clock(lambda t: t * 0.5), ("clock", "rate", "twice", "half", "*2")),
    _clock(
        "t_float32",
        "t in s since 1970 as float32",
        s.clock(lambda t: (t + s.EPOCH).astype(np.float32)),
        ("float32", "single precision", "resolution", "digits", "precision", "float64"),
        mapping=False,
    ),
    _clock(
        "t_back", "the clock set back by 0.5 s once", s.clock_steps_back, ("before", "back*", "increas*"), mapping=False
    ),
    _clock(
        "t_restarts",
        "t starts again in the middle",
        s.clock_restarts,
        ("before", "back*", "increas*", "split"),
        mapping=False,
    ),
    _clock(
        "t_zero",
        "t is zero in every row",
        s.clock(lambda t: t * 0.0),
        ("increas*", "same", "constant", "row*"),
        mapping=False,
    ),
    _clock(
        "gap_closed",
        "2 s lost while turning, t by row number",
        s.gap_closed,
        ("lost", "gap", "jump*", "missing", "clock", "row*"),
        mapping=False,
    ),
)


def _rows(
    name: str,
    line: str,
    spoil: Spoil,
    words: tuple[str, ...],
    where: tuple[str, ...] = (),
    effects: tuple[str, ...] = (),
    needs: frozenset[Need] = MOVED,
) -> Mistake:
    return Mistake(name, Group.ROWS, line, spoil, needs, words, where, Remedy.WORDS, effects)


STUCK = (
    "stuck",
    "constant",
    "repeat*",
    "same value*",
    "held",
    "never change*",
    "does not change",
    "dead",
    "zero*",
    "hang*",
)
FILLED = (*STUCK, "filler*", "missing", "filled")
BEYOND = (
    "spike*",
    "outlier*",
    "cannot*",
    "nothing",
    "single",
    "beyond",
    "jump*",
    "out of range",
    "not a reading",
    "filler*",
    "missing",
)
ROWS = (
    _rows("rows_shuffled", "rows in any order", s.shuffled, ("sort*", "before", "order", "increas*")),
    _rows(
        "rows_doubled",
        "every 50th row twice",
        s.rows_doubled,
        ("twice", "duplicat*", "same time", "increas*", "again", "repeat*"),
    ),
    _rows("block_twice", "a buffer of 200 rows twice", s.block_twice, ("twice", "duplicat*", "copy", "copied")),
    _rows("filled_zero", "lost samples are 0", s.filled(0.0), FILLED),
    _rows("filled_last", "lost samples hold the last value", s.filled(None), FILLED),
    _rows("filled_999", "lost samples are -999", s.filled(-999.0), (*FILLED, *BEYOND, "-999")),
    _rows("filled_huge", "lost samples are 1e12", s.filled(1e12), (*FILLED, *BEYOND)),
    _rows("spike_large", "one sample of acc_x is 500 m/s^2", s.spike("acc", 500.0), BEYOND, ("acc*",)),
    _rows("spike_gyr", "one sample of gyr_x is 60 rad/s", s.spike("gyr", 60.0), BEYOND, ("gyr*",)),
    _rows("gyr_dead", "gyr constant", s.constant(*s.columns_of("gyr")), STUCK, ("gyr*",)),
    _rows("acc_dead", "acc constant", s.constant(*s.columns_of("acc")), STUCK, ("acc*",)),
    _rows("mag_dead", "mag constant", s.constant(*s.columns_of("mag")), STUCK, ("mag*",), needs=MOVED_MAG),
    _rows("gyr_zero", "gyr all zero", s.times("gyr", 0.0), STUCK, ("gyr*",)),
    _rows("acc_y_dead", "acc_y constant", s.constant("acc_y"), STUCK, ("acc_y",)),
    _rows("gyr_z_zero", "gyr_z all zero", s.times("gyr_z", 0.0), STUCK, ("gyr_z",)),
    _rows("gyr_hangs", "gyr hangs from two thirds on", s.late_death("gyr"), STUCK, ("gyr*",)),
    _rows(
        "gyr_copied",
        "gyr_z is a copy of gyr_y",
        s.copied("gyr_z", "gyr_y"),
        ("copy", "same", "equal*", "identical", "twice"),
        ("gyr_z",),
    ),
    _rows(
        "acc_clipped",
        "acc clipped",
        s.clipped("acc"),
        ("clip*", "saturat*", "range", "pinned"),
        ("acc*",),
        effects=("acc.saturation",),
    ),
    _rows(
        "gyr_clipped",
        "gyr clipped",
        s.clipped("gyr"),
        ("clip*", "saturat*", "range", "pinned"),
        ("gyr*",),
        effects=("gyr.saturation",),
    ),
    _rows("acc_wrapped", "acc wraps round at its range", s.wrapped("acc"), ("wrap*",), ("acc*",)),
    _rows("gyr_wrapped", "gyr wraps round at its range", s.wrapped("gyr"), ("wrap*",), ("gyr*",)),
    _rows("acc_bytes", "bytes of acc swapped", s.bytes_swapped("acc", 4 * s.G), ("byte*",), ("acc*",)),
    _rows("gyr_bytes", "bytes of gyr swapped", s.bytes_swapped("gyr", 500 * DPS), ("byte*",), ("gyr*",)),
    _rows("header_again", "the header once more in the middle", s.text(s.header_again), ("header", "not a number")),
    _rows("line_cut", "a line breaks off", s.text(s.cut_line), ("line*", "cells", "columns", "cut off")),
    _rows("word_missing", "'timeout' for missing samples", s.text(s.word_for_missing), ("timeout",)),
    _rows(
        "commas",
        "commas between cells and in numbers",
        s.text(s.thousands_commas),
        ("comma*", "cells", "fields", "separat*"),
    ),
)

COARSE = ("quantis*", "coarse*", "resolution", "step*", "bits")
LAGGED = ("low-pass*", "lowpass*", "filter*", "smooth*", "bandwidth")


def _range(sensor: str, factor: float, line: str) -> Mistake:
    words = ("range*", "scale", f"*{1 / factor:g}", "factor", "LSB*")
    spoil = s.times(sensor, factor)
    name = f"{sensor}_range_{factor:g}".replace(".", "_")
    return Mistake(name, Group.SETTINGS, line, spoil, MOVED | SENSOR[sensor], words, (f"{sensor}*",), Remedy.MAPPING)


SETTINGS = (
    _range("acc", 2.0, "acc converted for a range twice too large"),
    _range("acc", 0.5, "acc converted for half its range"),
    _range("gyr", 2.0, "gyr converted for a range twice too large"),
    _range("gyr", 0.25, "gyr converted for a quarter of its range"),
    Mistake(
        "acc_low_pass",
        Group.SETTINGS,
        "filter of acc on, 5 Hz",
        s.low_pass("acc", 5.0),
        MOVED,
        LAGGED,
        ("acc*",),
        effects=("acc.lowpass", "acc.delay"),
    ),
    Mistake(
        "gyr_low_pass",
        Group.SETTINGS,
        "filter of gyr on, 5 Hz",
        s.low_pass("gyr", 5.0),
        MOVED,
        LAGGED,
        ("gyr*",),
        effects=("gyr.lowpass", "gyr.delay"),
    ),
    Mistake(
        "acc_8_bits", Group.SETTINGS, "acc of eight bits, +-4 g", s.coarse("acc", 4 * s.G), MOVED, COARSE, ("acc*",)
    ),
    Mistake(
        "gyr_8_bits",
        Group.SETTINGS,
        "gyr of eight bits, +-500 deg/s",
        s.coarse("gyr", 500 * DPS),
        MOVED,
        COARSE,
        ("gyr*",),
    ),
)

FOREIGN = {name: f"{name[0].upper()}{name[-1].upper()}" for name in (*s.columns_of("acc"), *s.columns_of("gyr"))}
IN_G = {f"acc_{axis}": f"acc_{axis} (g)" for axis in "xyz"}
IN_DPS = {f"gyr_{axis}": f"gyr_{axis} [deg/s]" for axis in "xyz"}


def _names(
    name: str,
    line: str,
    spoil: Spoil,
    words: tuple[str, ...],
    needs: frozenset[Need] = MOVED,
    mapping: bool = False,
    effects: tuple[str, ...] = (),
) -> Mistake:
    remedy = Remedy.MAPPING if mapping else Remedy.WORDS
    return Mistake(name, Group.NAMES, line, spoil, needs, words, (), remedy, effects)


FIELD, NOISE = MOVED_MAG | {Need.FIELD}, MOVED | {Need.NOISE}
NAMES = (
    _names("field_gauss", "mag_reference in gauss", s.field_told(0.01), ("mag_reference",), FIELD),
    _names("field_nanotesla", "mag_reference in nT", s.field_told(1000.0), ("mag_reference",), FIELD),
    _names("field_up", "vertical of mag_reference turned", s.field_told(1.0, -1.0), ("mag_reference",), FIELD),
    _names("gravity_1", "gravity = 1", s.told(gravity=1.0), ("gravity",)),
    _names("gravity_negative", "gravity = -9.8", s.told(gravity=-9.80665), ("gravity",)),
    _names("gravity_text", 'gravity = "9,81"', s.told(gravity="9,81"), ("gravity",)),
    _names("noise_mg", "noise of acc in mg", s.noise_told("acc", 1e3 / s.G), ("noise",), NOISE),
    _names("noise_dps", "noise of gyr in deg/s", s.noise_told("gyr", 1 / DPS), ("noise",), NOISE),
    _names("noise_g", "noise of acc in g", s.noise_told("acc", 1 / s.G), ("noise",), NOISE),
    _names(
        "rig_axis_missing", "ref_angle without rig_axis", s.rig_axis(None), ("rig_axis",), _needs(Need.ANGLE, Need.ACC)
    ),
    _names("rig_axis_y", "rig_axis wrong", s.rig_axis("y"), ("rig_axis",), _needs(Need.ANGLE, Need.ACC, Need.GYR)),
    _names("columns_foreign", "columns AX AY AZ GX GY GZ", s.renamed(FOREIGN), ("AX", "acc_x"), MOVED, mapping=True),
    _names(
        "columns_upper",
        "columns ACC_X ACC_Y ACC_Z",
        s.renamed({name: name.upper() for name in s.columns_of("acc")}),
        ("ACC_X",),
        mapping=True,
    ),
    _names("time_named", "time stamps in the column time", s.renamed({"t": "time"}), ("time",), mapping=True),
    _names("header_g", "acc in g, stated in the header", s.renamed(IN_G, acc=1 / s.G), ("[g]", "in g"), mapping=True),
    _names(
        "header_dps", "gyr in deg/s, stated in the header", s.renamed(IN_DPS, gyr=1 / DPS), ("deg/s",), mapping=True
    ),
    _names(
        "decimal_commas",
        "semicolons between cells, decimal commas",
        s.text(s.decimal_commas),
        ("comma*",),
        mapping=True,
    ),
    _names(
        "covariate_copy",
        "a covariate that is a copy of acc_x",
        s.copied("accel_raw", "acc_x"),
        ("copy", "same as", "own reading*", "made from", "accel_raw"),
    ),
    _names(
        "covariate_norm",
        "a covariate with the length of acc",
        s.covariate_of_length,
        ("own reading*", "made from", "acc_norm"),
    ),
)


def _harmless(name: str, line: str, spoil: Spoil, needs: frozenset[Need] = MOVED) -> Mistake:
    return Mistake(name, Group.HARMLESS, line, spoil, needs, (), (), Remedy.NOTHING)


HARMLESS = (
    _harmless("sign_flips", "signs of whole quaternions flip", s.sign_flips),
    _harmless("rows_dropped", "one row in twenty lost, t right", s.rows_dropped),
    _harmless("t_epoch", "t in s since 1970", s.clock(lambda t: t + s.EPOCH)),
    _harmless("t_dates", "t as date and time of day", s.text(s.dates)),
    _harmless("t_late_start", "t begins at 1000 s", s.clock(lambda t: t + 1000.0)),
    _harmless(
        "columns_reversed",
        "columns in another order",
        lambda log, _: s.Log(dict(reversed(log.table.items())), log.metadata),
    ),
)

CATALOGUE: tuple[Mistake, ...] = (
    *UNITS,
    *AXES,
    *SIGNS,
    *FRAMES,
    *REFERENCE,
    *CLOCK,
    *ROWS,
    *SETTINGS,
    *NAMES,
    *HARMLESS,
)


def by_id(name: str) -> Mistake:
    """Row of the table by its id."""
    return next(row for row in CATALOGUE if row.id == name)
