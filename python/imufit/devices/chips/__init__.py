"""Bytes of sensors, decoded to SI units: one module for each device, with its registers and ranges as data."""

from imufit.devices.chips import mpu6050

__all__ = ["mpu6050"]
