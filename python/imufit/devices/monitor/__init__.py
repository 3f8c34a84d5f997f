"""Attitude of a device while it runs, by several filters at once."""

from imufit.devices.monitor.monitor import Monitor, MonitorState

__all__ = ["Monitor", "MonitorState"]
