"""A device that speaks the wire protocol on a pseudo-terminal or a socket, for tests of what listens to it."""

import contextlib
import os
import select
import socket
import time
import tty

import numpy as np
from imufit import _imufit

COUNT = 2.0**-10  # exact in binary, so that values come back as they are
NINE = [(f"{sensor}_{axis}", COUNT, 0.0, 0.0) for sensor in ("acc", "gyr", "mag") for axis in "xyz"]
RATE = 1000.0


def values_of(numbers):
    """Values of the samples of these numbers, (n, 9): whole counts."""
    k = np.asarray(numbers, dtype=np.float64)[:, None]
    return np.round(np.sin(0.01 * k + np.arange(9)) * 9.0 / COUNT) * COUNT


class Sender:
    """Frames of one device; `reset` begins anew."""

    def __init__(self, start=1, tick=1000, columns=None, name="nine axes"):
        self.tick, self.name, self.start = tick, name, start
        self.columns = NINE if columns is None else columns
        self.reset(start)

    def reset(self, start=None):
        self.start = self.start + 1 if start is None else start
        self._encoder = _imufit.WireEncoder(self.name, self.tick, [(RATE, "i32", b"", self.columns)], self.start)

    def announce(self):
        return self._encoder.announce()

    def text(self, text):
        return self._encoder.text(text)

    def samples(self, numbers, stamps=None):
        """Frames of the samples of these numbers; a stamp is the number in ms unless given."""
        numbers = np.asarray(numbers)
        stamps = numbers * 1_000_000 // self.tick if stamps is None else np.asarray(stamps)
        data, _ = self._encoder.samples((stamps % 2**32).astype(np.uint32), values_of(numbers)[:, : len(self.columns)])
        return data


class Pty:
    """Both ends of a pseudo-terminal; `port` is what a listener opens."""

    def __init__(self):
        self._ours, theirs = os.openpty()
        os.set_blocking(self._ours, False)
        tty.setraw(theirs)
        self.port = os.ttyname(theirs)
        self._theirs = theirs

    def send(self, data, unless=lambda: False):
        """Send all of it, unless that has become needless."""
        end = time.monotonic() + 20.0
        while data and not unless():
            _, ready, _ = select.select([], [self._ours], [], 0.1)
            assert ready or time.monotonic() < end, "nobody reads"
            with contextlib.suppress(BlockingIOError):
                data = data[os.write(self._ours, data) :]

    def heard(self, seconds):
        """What the listener says in that time."""
        said, end = b"", time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            ready, _, _ = select.select([self._ours], [], [], left)
            if ready:
                said += os.read(self._ours, 4096)
        return said

    def close(self):
        os.close(self._ours)
        os.close(self._theirs)


class Socket:
    """A server for one listener at a time; `unplug` closes the connection and `plug` waits for the next."""

    def __init__(self):
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.settimeout(10.0)
        self._peer = None
        self.number = self._server.getsockname()[1]
        self.port = f"socket://127.0.0.1:{self.number}"

    def plug(self):
        if self._server is None:
            self._server = socket.create_server(("127.0.0.1", self.number))
            self._server.settimeout(10.0)
        self._peer, _ = self._server.accept()

    def send(self, data):
        self._peer.sendall(data)

    def unplug(self, gone=False):
        """Close the connection; `gone` refuses others until `plug`."""
        self._peer.close()
        self._peer = None
        if gone:
            self._server.close()
            self._server = None

    def close(self):
        for end in (self._peer, self._server):
            if end is not None:
                with contextlib.suppress(OSError):
                    end.close()
