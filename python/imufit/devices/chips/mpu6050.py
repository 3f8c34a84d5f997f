"""MPU6050: registers, ranges, filters, and its frames decoded to SI units (the sensor of paper B).

Figures from the maker's product specification (PS-MPU-6000A-00) and register map (RM-MPU-6000A-00). The accelerometer
reads +1 g on the axis that points up: that is the specific force, and no sign is turned.

    frames = mpu6050.decode(bus.read(mpu6050.ADDRESS, mpu6050.REGISTERS["ACCEL_XOUT_H"], 14), afs_sel=0, fs_sel=0)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imufit import _imufit
from imufit.errors import InputError
from imufit.log import Log

__all__ = [
    "ACC_RANGES",
    "ADDRESS",
    "ADDRESS_AD0_HIGH",
    "GYR_RANGES",
    "LOW_PASS",
    "REGISTERS",
    "Frames",
    "FullScale",
    "LowPass",
    "decode",
    "full_scale_selection",
    "sample_rate",
]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_STANDARD_GRAVITY: Final = 9.80665
_FULL_SCALE: Final = 32768


@dataclass(frozen=True)
class FullScale:
    """A full-scale range.

    Parameters
    ----------
    range : float
        Its end: g for the accelerometer, deg/s for the gyro.
    sensitivity : float
        Counts for 1 g or 1 deg/s.
    """

    range: float
    sensitivity: float


@dataclass(frozen=True)
class LowPass:
    """Effect of the digital low-pass filter on the readings at one value of ``DLPF_CFG``.

    Parameters
    ----------
    acc_bandwidth, gyr_bandwidth : float
        Hz.
    acc_delay, gyr_delay : float
        s; what ``acc.delay`` and ``gyr.delay`` of the sensor model can find.
    gyr_rate : float
        Rate of the gyro before the divider, Hz; that of the accelerometer is 1000 Hz.
    """

    acc_bandwidth: float
    acc_delay: float
    gyr_bandwidth: float
    gyr_delay: float
    gyr_rate: float


_FACTS: Final = _imufit.mpu6050_facts()

ADDRESS: Final = _FACTS["address"]
"""Address on the bus with pin AD0 low: 0x68. It also is what WHO_AM_I answers, at either address."""

ADDRESS_AD0_HIGH: Final = _FACTS["address_ad0_high"]
"""Address with pin AD0 high: 0x69."""

REGISTERS: Final[Mapping[str, int]] = MappingProxyType(_FACTS["registers"])
"""Addresses of registers by the maker's names; a reading is two bytes from its ``_H`` on, high byte first."""

ACC_RANGES: Final = tuple(FullScale(*scale) for scale in _FACTS["acc"])
"""Ranges of the accelerometer by ``AFS_SEL``: +-2, 4, 8, 16 g."""

GYR_RANGES: Final = tuple(FullScale(*scale) for scale in _FACTS["gyr"])
"""Ranges of the gyro by ``FS_SEL``: +-250, 500, 1000, 2000 deg/s."""

LOW_PASS: Final = tuple(LowPass(*values) for values in _FACTS["low_pass"])
"""The low-pass filter by ``DLPF_CFG`` 0 to 6 (7 is reserved)."""


@dataclass(frozen=True, eq=False)
class Frames:
    """n decoded frames.

    Parameters
    ----------
    acc : (n, 3) array
        Specific force in the body frame, m/s^2: at rest it points up.
    gyr : (n, 3) array
        Angular rate, rad/s.
    temp : (n,) array or None
        Temperature, degC; None where the frames have none.
    acc_clipped, gyr_clipped : (n, 3) bool arrays
        Readings at an end of the converter (count 32767 or -32768): the true value may be anything beyond.
    acc_range, gyr_range : float
        End of the selected ranges, m/s^2 and rad/s.
    remainder : bytes
        What is left of a burst that was decoded with ``partial=True``: the beginning of the next frame.
    """

    acc: Array
    gyr: Array
    temp: Array | None
    acc_clipped: Flags
    gyr_clipped: Flags
    acc_range: float
    gyr_range: float
    remainder: bytes = b""

    @property
    def n(self) -> int:
        """Number of frames."""
        return len(self.acc)

    def to_log(self, t: ArrayLike, **metadata: Any) -> Log:
        """Make a log of the frames.

        Covariates ``acc_clipped`` and ``gyr_clipped`` (1 where an axis is clipped) are there only if anything is.
        The metadata name the sensor and hold the ranges as ``acc_range`` (m/s^2) and ``gyr_range`` (rad/s), by which
        `imufit.replaying.replay` knows clipped readings.

        Parameters
        ----------
        t : (n,) array
            Time of each frame, s.
        **metadata
            As in `imufit.log.Metadata`: frame, gravity, rig_axis, ...

        Returns
        -------
        Log
            n rows with acc, gyr and, where the frames have it, temp.

        Raises
        ------
        InputError
            Times that are not one per frame, or not increasing.
        """
        times = np.asarray(t, dtype=np.float64)
        if times.shape != (self.n,):
            raise InputError(
                f"t has shape {times.shape} for {self.n} frames", column="t", remedy="Pass one time per frame."
            )
        flags = {"acc_clipped": self.acc_clipped.any(axis=1), "gyr_clipped": self.gyr_clipped.any(axis=1)}
        about = {"sensor": "MPU6050", "acc_range": self.acc_range, "gyr_range": self.gyr_range, **metadata}
        return Log.from_arrays(
            times,
            acc=self.acc,
            gyr=self.gyr,
            temp=self.temp,
            covariates={name: flag.astype(np.float64) for name, flag in flags.items() if flag.any()},
            **about,
        )


def decode(
    data: bytes | bytearray | memoryview | NDArray[np.uint8],
    afs_sel: int = 0,
    fs_sel: int = 0,
    *,
    temperature: bool = True,
    partial: bool = False,
) -> Frames:
    """Decode a burst of frames: accelerometer, thermometer and gyro, two bytes each, high byte first.

    Specific force = count / sensitivity * 9.80665 m/s^2, angular rate = count / sensitivity deg/s in rad/s,
    temperature = count / 340 + 36.53 degC (paper B's tables and the maker's product specification).

    Parameters
    ----------
    data : bytes or uint8 array
        n frames one after another, or (n, 14): the registers 0x3B to 0x48, as read in one go or from the FIFO.
    afs_sel, fs_sel : int
        Selected ranges, 0 to 3: index of `ACC_RANGES` and `GYR_RANGES`, bits 4 and 3 of ACCEL_CONFIG and GYRO_CONFIG
        (`full_scale_selection`).
    temperature : bool
        False for frames of 12 bytes without the thermometer, as the FIFO gives them if so configured.
    partial : bool
        True: a frame that is not whole is left in `Frames.remainder`, to be put before the next burst.

    Returns
    -------
    Frames
        n frames in SI units.

    Raises
    ------
    InputError
        No bytes, a range that does not exist, or a burst that ends within a frame; the message states where.
    """
    for name, value in (("afs_sel", afs_sel), ("fs_sel", fs_sel)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or not 0 <= value <= 3:
            raise InputError(f"{name} is {value!r}, which selects no range", remedy="Pass 0, 1, 2 or 3.")
    raw = _bytes(data)
    size = 14 if temperature else 12
    over = raw.size % size if partial else 0
    whole = raw[: raw.size - over]
    try:
        acc, gyr, temp, acc_clipped, gyr_clipped = _imufit.mpu6050_decode(whole, int(afs_sel), int(fs_sel), temperature)
    except InputError as error:
        remedy = "Pass whole frames; or partial=True, and the remainder before the next burst."
        raise InputError(error.problem.rstrip("."), row=whole.size // size, remedy=remedy) from None
    return Frames(
        acc,
        gyr,
        temp,
        acc_clipped,
        gyr_clipped,
        acc_range=_FULL_SCALE / ACC_RANGES[afs_sel].sensitivity * _STANDARD_GRAVITY,
        gyr_range=float(np.radians(_FULL_SCALE / GYR_RANGES[fs_sel].sensitivity)),
        remainder=raw[raw.size - over :].tobytes(),
    )


def full_scale_selection(config: int) -> int:
    """Range that a register selects: bits 4 and 3 of ACCEL_CONFIG (``AFS_SEL``) or GYRO_CONFIG (``FS_SEL``).

    Parameters
    ----------
    config : int
        The register's byte.
    """
    return (config >> 3) & 3


def sample_rate(smplrt_div: int, dlpf_cfg: int) -> float:
    """Rate at which registers and FIFO are renewed, Hz: the gyro's rate / (1 + ``SMPLRT_DIV``).

    Above 1000 Hz the accelerometer's readings repeat.

    Parameters
    ----------
    smplrt_div : int
        Divider, 0 to 255.
    dlpf_cfg : int
        Low-pass filter, 0 to 6: index of `LOW_PASS`.

    Raises
    ------
    InputError
        A divider or filter that the device does not have.
    """
    if not 0 <= smplrt_div <= 255:
        raise InputError(f"SMPLRT_DIV is {smplrt_div}, which is not a byte", remedy="Pass 0 to 255.")
    if not 0 <= dlpf_cfg < len(LOW_PASS):
        raise InputError(f"DLPF_CFG is {dlpf_cfg}, which is not a filter of the device", remedy="Pass 0 to 6.")
    return LOW_PASS[dlpf_cfg].gyr_rate / (1 + smplrt_div)


def _bytes(data: bytes | bytearray | memoryview | NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the bytes as one contiguous run, without a copy where they are one."""
    if isinstance(data, np.ndarray):
        if data.dtype != np.uint8:
            raise InputError(
                f"data has dtype {data.dtype}, not bytes", remedy="Pass the raw bytes: bytes or an array of uint8."
            )
        return np.ascontiguousarray(data).reshape(-1)
    try:
        return np.frombuffer(data, dtype=np.uint8)
    except (TypeError, ValueError, BufferError):
        raise InputError(
            f"data is of type {type(data).__name__}, not bytes",
            remedy="Pass the raw bytes: bytes or an array of uint8.",
        ) from None
