"""From a serial device to a log that cannot be lost, and its rows live."""

from imufit.devices.record.live_rows import LiveConverter, LiveRows
from imufit.devices.record.recorder import Recorder, record
from imufit.devices.record.recover import recover
from imufit.devices.record.rig import Rig, TypedAngles

__all__ = ["LiveConverter", "LiveRows", "Recorder", "Rig", "TypedAngles", "record", "recover"]
