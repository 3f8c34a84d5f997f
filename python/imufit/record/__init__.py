"""From a serial device to a log that cannot be lost, and its rows live."""

from imufit.record.live_rows import LiveConverter, LiveRows
from imufit.record.recorder import record
from imufit.record.recover import recover

__all__ = ["LiveConverter", "LiveRows", "record", "recover"]
