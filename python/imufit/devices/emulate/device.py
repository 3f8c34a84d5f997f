"""Which streams an emulated device has, one function a kind of device, and what stands in each row of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imufit.devices.chips import mpu6050
from imufit.devices.emulate.source import FULL, SENSORS, Source
from imufit.errors import InputError
from imufit.remedy import option

Array = NDArray[np.float64]
Channel = tuple[str, float, float, float]
Stream = tuple[float, str, bytes, list[Channel]]

ROOM = 25.0
"""Temperature (degC) that a device shows whose source has none: its registers always hold one."""
GRAVITY = 9.80665
"""One g of an MPU6050, m/s^2."""
LOW_PASS = 3
"""`DLPF_CFG` of an emulated MPU6050, 44 and 42 Hz: with a low-pass it samples at 1 kHz over a divider."""
COMPASS = (0x18, 0x20, 0x00)
"""Registers of an emulated HMC5883L: 75 Hz, +-1.3 Ga, continuous."""
HEADROOM = 1.05
"""An MPU6050's range is chosen by this times the largest reading."""
STREAMS = 8
"""Streams that the protocol allows."""
NAME = 60
"""Characters of a device's name."""


@dataclass(frozen=True)
class Device:
    """A kind of device, ready to be sent.

    Attributes
    ----------
    name : str
        What it calls itself.
    streams : list
        As the encoder of the wire protocol takes them: rate (Hz), form, registers, channels.
    columns : tuple of str
        Columns of all streams, in order.
    widths : tuple of int
        Columns of each stream.
    values : (n, columns) array
        Readings, SI units, NaN where a stream has none.
    """

    name: str
    streams: list[Stream]
    columns: tuple[str, ...]
    widths: tuple[int, ...]
    values: Array


def _floats(source: Source) -> Device:
    """Send one stream of floats for what is read at full rate, one more for each slower sensor."""
    slow = [name for name in source.groups if source.share(name) < FULL]
    alone = slow if len(slow) < len(source.groups) else slow[1:]
    alone = alone[: STREAMS - 1]
    together = [name for name in source.groups if name not in alone]
    streams: list[Stream] = []
    values: list[Array] = []
    for names in [together, *([name] for name in alone)]:
        columns = {column: v for name in names for column, v in source.groups[name].items()}
        rate = source.rate * max(source.share(name) for name in names)
        streams.append((rate, "f32", b"", [(column, 1.0, 0.0, 0.0) for column in columns]))
        values += columns.values()
    named = tuple(channel[0] for stream in streams for channel in stream[3])
    widths = tuple(len(stream[3]) for stream in streams)
    return Device(f"imufit emulate {source.name}"[:NAME], streams, named, widths, np.column_stack(values))


def _needs(source: Source, device: str, sensors: Sequence[str]) -> None:
    for sensor in sensors:
        if sensor not in source.groups:
            raise InputError(
                f"{source.name} has no {SENSORS[sensor][0]}, which a device {device} sends",
                remedy="Use " + option("device", "floats") + ", which sends what there is.",
            )


def _range(source: Source, sensor: str, ranges: Sequence[mpu6050.FullScale], unit: float) -> int:
    """Select the smallest range that holds the readings, or the largest; `unit` is that of the ranges."""
    top = max(float(np.nanmax(np.abs(values))) for values in source.groups[sensor].values())
    fits = [index for index, one in enumerate(ranges) if HEADROOM * top <= one.range * unit]
    return fits[0] if fits else len(ranges) - 1


def _mpu6050(source: Source) -> Device:
    """Send the registers of an MPU6050: accelerometer, thermometer and gyro."""
    _needs(source, "mpu6050", ("acc", "gyr"))
    temp = source.groups.get("temp", {}).get("temp", np.full(len(source.t), ROOM))
    there = np.isfinite(temp)
    temp = np.interp(source.t, source.t[there], temp[there])
    values = np.column_stack([*source.groups["acc"].values(), *source.groups["gyr"].values(), temp])
    divider = int(np.clip(round(1000.0 / source.rate) - 1, 0, 255))
    gyr = _range(source, "gyr", mpu6050.GYR_RANGES, float(np.radians(1.0)))
    acc = _range(source, "acc", mpu6050.ACC_RANGES, GRAVITY)
    registers = bytes([divider, LOW_PASS, gyr << 3, acc << 3])
    columns = (*SENSORS["acc"], *SENSORS["gyr"], "temp")
    # Registers hold the last reading; there are none for a row without one.
    values[~np.isfinite(values).all(axis=1)] = np.nan
    return Device("MPU6050", [(source.rate, "mpu6050", registers, [])], columns, (len(columns),), values)


def _gy86(source: Source) -> Device:
    """Send an MPU6050 and beside it an HMC5883L, which is slower."""
    _needs(source, "gy86", ("mag",))
    chip = _mpu6050(source)
    rate = source.rate * source.share("mag")
    values = np.column_stack([chip.values, *source.groups["mag"].values()])
    streams = [*chip.streams, (rate, "hmc5883l", bytes(COMPASS), [])]
    columns = (*chip.columns, *SENSORS["mag"])
    return replace(chip, name="GY-86", streams=streams, columns=columns, widths=(*chip.widths, 3), values=values)


DEVICES: Mapping[str, Callable[[Source], Device]] = {"floats": _floats, "mpu6050": _mpu6050, "gy86": _gy86}
"""Kinds of device by name."""
