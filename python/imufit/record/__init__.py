"""From a serial device to a log that cannot be lost, and its rows live."""

from imufit.record.live_rows import LiveRows

__all__ = ["LiveRows"]
