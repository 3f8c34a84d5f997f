"""The sentences on columns that hold something else than their names say, and on metadata that the readings deny."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from imufit.figures import quantity
from imufit.log.origin import Origin
from imufit.remedy import Remedy, mapped, when_read
from imufit.results.fault_words import AXES, UNITS, Words, read_anew

Array = NDArray[np.float64]

Unit = tuple[str, str]
"""The name of a unit, and its form in a mapping."""


def _declare(columns: Sequence[str], units: Sequence[str], origin: Origin) -> Remedy:
    """Name the mapping that declares the unit of columns: the first one, or else another."""
    declared = ({column: f"{column}[{unit}]" for column in columns} for unit in units)
    first, *others = (mapped(origin.mapping(each)) for each in declared)
    return sum(("; or " + other for other in others), when_read(first))


def wrong_unit(sensor: str, axes: str, ratio: float, units: Sequence[Unit], origin: Origin) -> Words:
    """Say in which unit some axes of a sensor seem to read; without any unit, that the size cannot be.

    Parameters
    ----------
    sensor, axes : str
        Such as ``gyr`` and ``xyz``.
    ratio : float
        Reading over ideal reading.
    units : sequence of (str, str)
        Those that it may be, the likeliest first.
    origin : Origin
        Columns of the file, which the remedy names.
    """
    size = f"{ratio:.4g} times what it should" if ratio < 1.0 else f"{ratio:.4g} times too much"
    name = sensor if axes == AXES else f"{sensor}_{axes}"
    where = " on every axis alike" if axes == AXES else ", the other axes as they should"
    columns = [f"{sensor}_{axis}" for axis in axes]
    if not units:
        return (
            f"{name} reads {size}{where}: no sensor is wrong by so much, and no known unit gives this factor.",
            "Find the unit. Until then: " + _declare(columns, [f"*{1.0 / ratio:.6g}"], origin) + ".",
        )
    kinds = ", or ".join(words for words, _ in units)
    remedy = "Declare the unit: " + _declare(columns, [unit for _, unit in units], origin) + "."
    return f"{name} reads {size}{where}, which looks like {kinds}.", remedy


def field_in_another_unit(size: float, units: Sequence[Unit], origin: Origin) -> Words:
    """Say that the field which the magnetometer shows is of a size that is not on earth."""
    kinds = ", or ".join(words for words, _ in units)
    return (
        f"The field that turns in mag has a magnitude of {size:.4g}, and no such field in uT is on earth: it looks "
        f"like {kinds}.",
        "Declare the unit: " + _declare([f"mag_{axis}" for axis in AXES], [unit for _, unit in units], origin) + ".",
    )


def exchanged(pairs: Sequence[tuple[str, str]], origin: Origin) -> Words:
    """Say that columns of two sensors are exchanged."""
    names = " and ".join(f"{one} with {other}" for one, other in pairs)
    mapping = {target: source for one, other in pairs for target, source in ((one, other), (other, one))}
    return (
        f"Columns are exchanged between sensors: {names}.",
        "Exchange them back: " + read_anew(mapping, origin) + ".",
    )


def positions(unit: str, origin: Origin) -> Words:
    """Say that the reference's positions are in another unit of length."""
    return (
        f"The accelerations along the path of ref_p fit acc only if the positions are in {unit}, not m.",
        "Declare the unit: " + _declare([f"ref_p{axis}" for axis in AXES], [unit], origin) + ".",
    )


def swapped_bytes(sensor: str) -> Words:
    """Say that the bytes of a sensor's counts are swapped."""
    return (
        f"The bytes of {sensor} are swapped: its counts fit the reference once the upper byte and the lower byte of "
        "each change places.",
        f"Read the registers of {sensor} in the other byte order, and record again or convert the counts anew.",
    )


GRAVITY_REMOVED: Final = (
    "Gravity is not in acc: the columns hold the linear acceleration, from which gravity was taken off.",
    "Export the accelerometer itself (the specific force), not the linear acceleration.",
)


def gravity_told(told: float, gravity: float) -> Words:
    """Say that the metadata's gravity is not that of the readings."""
    return (
        f"The metadata say gravity = {told:g}, but acc shows the gravity of the earth.",
        f"Write gravity = {gravity:g}, in m/s^2, or leave it out.",
    )


def field_told(told: Sequence[float], field: Array) -> Words:
    """Say that the metadata's field is not that of the readings."""
    shown = [", ".join(f"{float(value):.4g}" for value in vector) for vector in (told, field)]
    return (
        f"The metadata say mag_reference = [{shown[0]}], but mag and the reference attitude show a field of "
        f"[{shown[1]}] uT.",
        f"Write mag_reference = [{shown[1]}], or the field of the place in uT and in the log's frame, or leave it out.",
    )


def own_length(sensor: str, length: float) -> Words:
    """Say that a sensor's vectors all have one length."""
    return (
        f"Every reading of {sensor} has the same length, {length:.4g}: each was divided by its own length, and only "
        "its direction is left.",
        f"Export the readings of {sensor} themselves, in {UNITS[sensor]}. A filter can use directions, but no error of "
        f"{sensor} can be judged from them.",
    )


def copied(copy: str, original: str, *, sure: bool) -> Words:
    """Say that one column repeats another."""
    which = f"{copy} is a copy of {original}" if sure else f"{copy} and {original} are the same, one of them a copy"
    return (
        f"{which}: the two are equal in every row.",
        f"Look for the axis that is read twice, and record {copy} again.",
    )


def outliers(channel: str, rows: int, span: tuple[float, float], values: tuple[float, float], usual: float) -> Words:
    """Say that single samples are none that the sensor can have read."""
    low, high = values
    shown = f"{low:.6g}" if low == high else f"{low:.6g} to {high:.6g}"
    unit = UNITS[channel[:3]]
    what = f"one sample of {channel} is {shown}" if rows == 1 else f"{rows} samples of {channel} are {shown}"
    return (
        f"At {quantity.span(*span)} {what}, far beyond every other one (up to {quantity.quantity(usual, unit)}) and "
        "with nothing that leads up to it: a spike or a filler, not a reading.",
        "Write NaN, or leave the cell empty, for a missing sample; look for errors on the bus.",
    )


def angle_in_degrees(factor: float, sign: int, zero: int, origin: Origin) -> Words:
    """Say that the commanded angle of a rig is in degrees, by the gyroscope.

    Parameters
    ----------
    factor : float
        Turn of the angle over that of the gyroscope.
    sign : int
        -1 where the angle counts the other way.
    zero : int
        Angle, deg, at which the body stands upright.
    origin : Origin
        Columns of the file, which the remedy names.
    """
    way = ", and counts the other way" if sign < 0 else ""
    where = f", and the body stands upright at {zero} deg" if zero else ""
    unit = "deg" if not zero else f"deg - {zero}" if zero > 0 else f"deg + {-zero}"
    return (
        f"ref_angle turns {factor:.4g} times as far as the gyroscope: it is in degrees{way}{where}.",
        "Declare the unit: " + read_anew({"ref_angle": f"{'-' if sign < 0 else ''}ref_angle[{unit}]"}, origin) + ".",
    )


def other_rig_axis(told: str, axis: str) -> Words:
    """Say that a rig turns about another axis than the metadata say."""
    return (
        f"The metadata say rig_axis = {told}, but it is gyr_{axis} that turns with ref_angle.",
        f'Write rig_axis = "{axis}".',
    )
