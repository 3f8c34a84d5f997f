"""From a serial device to a log that cannot be lost, and its rows live."""

from imufit.record.live_rows import LiveConverter, LiveRows
from imufit.record.recorder import record
from imufit.record.recover import recover
from imufit.record.rig import Rig, TypedAngles

__all__ = ["LiveConverter", "LiveRows", "Rig", "TypedAngles", "record", "recover"]
