"""Reads an emulated device to its end, and says which samples came."""

import time

import numpy as np
import serial
from imufit import _imufit


def read(device, text=False):
    """Bytes of all connections until the device ends, in a decoder; and what it took from them."""
    decoder, batches = (_imufit.LineDecoder if text else _imufit.WireDecoder)(), []
    over = False
    while not over:
        over = device.join(0.0)
        try:
            with serial.serial_for_url(device.port, timeout=0) as line:
                quiet = 0
                while quiet < 3:
                    data = line.read(65536)
                    decoder.feed(data)
                    batches += decoder.take()
                    quiet = 0 if data or not device.join(0.0) else quiet + 1
                    time.sleep(0.002)
        except (serial.SerialException, OSError):
            time.sleep(0.01)
        decoder.interrupted()
    decoder.finish()
    return decoder, batches + decoder.take()


def keys(batches):
    """Start, sequence and stamp of every sample, (n, 3)."""
    parts = [np.column_stack([np.full(len(b["stamps"]), b["start"]), b["sequence"], b["stamps"]]) for b in batches]
    return np.concatenate(parts) if parts else np.zeros((0, 3))


def intact(device):
    """The same of every sample that was sent whole."""
    table = device.sent.to_pandas()
    return table[table.intact][["start", "sequence", "stamp"]].to_numpy()
