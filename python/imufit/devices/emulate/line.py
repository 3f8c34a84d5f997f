"""The two ends at which an emulated device can be read: a pty, which is a serial port, or a TCP socket."""

from __future__ import annotations

import array
import errno
import fcntl
import os
import secrets
import select
import socket
import termios
import time
import tty
from pathlib import Path
from typing import Protocol

from imufit.errors import InputError
from imufit.remedy import keyword

SETTLING = 0.1
"""Time (s) that a reader gets before anything is sent: pyserial throws away what is there when it opens a port."""
HEARD = 4096
"""Bytes of a reader that are looked at at once."""
QUEUED = 0.02
"""Time (s) in which the system passes on what was written to a pty."""
_PREFIX = "socket://"


class Line(Protocol):
    """A line to a reader who may come and go."""

    @property
    def address(self) -> str:
        """Name that a reader opens."""

    def open(self) -> None:
        """Plug in: from now on a reader can open it."""

    def attached(self) -> bool:
        """Return whether a reader is there and listens."""

    def write(self, data: bytes, patience: float) -> int:
        """Write as much as is taken; wait at most `patience` (s) for the first byte.

        Parameters
        ----------
        data : bytes
            To be sent.
        patience : float
            Longest wait, s.

        Returns
        -------
        int
            Bytes that were taken; 0 if the reader does not read, or has gone.
        """

    def heard(self) -> bytes:
        """Return the bytes of the reader since the last call."""

    def drain(self, patience: float) -> None:
        """Wait until the reader has read what was written, for at most `patience` (s)."""

    def close(self) -> None:
        """Unplug: a reader loses the line."""


def _writable(descriptor: int, patience: float) -> bool:
    ready = select.poll()
    ready.register(descriptor, select.POLLOUT)
    return bool(ready.poll(1000.0 * patience))


class Pty:
    """A pseudo terminal, raw: bytes go through as they are.

    Parameters
    ----------
    link : Path, optional
        Symbolic link that points to the terminal, whichever it is after the device was unplugged.
    """

    def __init__(self, link: Path | None = None) -> None:
        if link is not None and os.path.lexists(link) and not link.is_symlink():
            raise InputError(
                f"{str(link)!r} exists and is not a link",
                remedy="Give " + keyword("link") + " a path that is free.",
            )
        self._link, self._master, self._name, self._since = link, -1, "", float("inf")

    @property
    def address(self) -> str:
        """Path of the link, or of the terminal."""
        return self._name if self._link is None else str(self._link)

    def open(self) -> None:
        """Make a terminal and point the link to it."""
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self._name = os.ttyname(slave)
        # With no reader the master is hung up, which shows when a reader opens it.
        os.close(slave)
        os.set_blocking(self._master, False)
        self._since = float("inf")
        if self._link is not None:
            new = self._link.with_name(f".{self._link.name}.{secrets.token_hex(8)}")
            new.symlink_to(self._name)  # fails where anything stands already
            new.replace(self._link)

    def attached(self) -> bool:
        """Return whether a reader has had the terminal open for `SETTLING`."""
        if self._master < 0:
            return False
        ready = select.poll()
        ready.register(self._master, 0)
        if any(event & select.POLLHUP for _, event in ready.poll(0)):
            self._since = float("inf")
            return False
        now = time.monotonic()
        self._since = min(self._since, now)
        return now - self._since >= SETTLING

    def write(self, data: bytes, patience: float) -> int:
        """Write as much as is taken; see `Line.write`."""
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            pass
        except OSError as error:
            if error.errno == errno.EIO:
                return 0
            raise
        if patience <= 0.0 or not _writable(self._master, patience) or not self.attached():
            return 0
        return self.write(data, 0.0)

    def heard(self) -> bytes:
        """Return the bytes of the reader since the last call."""
        try:
            return os.read(self._master, HEARD)
        except OSError:  # nothing, or not read
            return b""

    def drain(self, patience: float) -> None:
        """Wait until the reader has read what was written, for at most `patience` (s)."""
        until = time.monotonic() + patience
        empty = 0
        while self.attached() and empty < 2 and time.monotonic() < until:
            time.sleep(QUEUED)
            empty = empty + 1 if self._waiting() == 0 else 0

    def _waiting(self) -> int:
        """Return how many bytes wait for the reader."""
        count = array.array("i", [0])
        try:
            slave = os.open(self._name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError:
            return 0
        try:
            fcntl.ioctl(slave, termios.FIONREAD, count)
        finally:
            os.close(slave)
        return count[0]

    def close(self) -> None:
        """Hang up and take the link away."""
        if self._master < 0:
            return
        if self._link is not None:
            self._link.unlink(missing_ok=True)
        os.close(self._master)
        self._master = -1


class Socket:
    """A TCP socket of this machine; one reader at a time.

    Parameters
    ----------
    port : int
        0 takes a free one, and keeps it.
    """

    def __init__(self, port: int = 0) -> None:
        self._port = port
        self._server: socket.socket | None = None
        self._reader: socket.socket | None = None
        self._since = 0.0
        self._heard = b""

    @property
    def address(self) -> str:
        """URL of the socket as pyserial takes it."""
        return f"{_PREFIX}127.0.0.1:{self._port}"

    def open(self) -> None:
        """Listen."""
        server = socket.socket()
        server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            server.bind(("127.0.0.1", self._port))
        except OSError as error:
            server.close()
            raise InputError(
                f"port {self._port} cannot be opened: {error.strerror}", remedy="Use another one, or 0 for a free one."
            ) from error
        server.listen(1)
        server.setblocking(False)
        self._port = server.getsockname()[1]
        self._server = server

    def attached(self) -> bool:
        """Return whether a reader has been connected for `SETTLING`, and let one in if it waits."""
        if self._reader is not None and self._left(self._reader):
            self._reader.close()
            self._reader = None
        if self._reader is None and self._server is not None:
            try:
                self._reader, _ = self._server.accept()
            except BlockingIOError:
                return False
            self._reader.setblocking(False)
            self._reader.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._heard = b""
            self._since = time.monotonic()
        return self._reader is not None and time.monotonic() - self._since >= SETTLING

    def heard(self) -> bytes:
        """Return the bytes of the reader since the last call."""
        said, self._heard = self._heard, b""
        return said

    def _left(self, reader: socket.socket) -> bool:
        """Return whether the reader has closed its end; its last bytes are kept until requested."""
        try:
            while data := reader.recv(HEARD):
                self._heard = (self._heard + data)[-HEARD:]
        except BlockingIOError:
            return False
        except OSError:
            pass
        return True

    def write(self, data: bytes, patience: float) -> int:
        """Write as much as is taken; see `Line.write`."""
        if self._reader is None:
            return 0
        try:
            return self._reader.send(data)
        except BlockingIOError:
            pass
        except OSError:
            return 0
        if patience <= 0.0 or not _writable(self._reader.fileno(), patience):
            return 0
        return self.write(data, 0.0)

    def drain(self, patience: float) -> None:
        """Do nothing: what was written to a socket arrives even if it is closed."""

    def close(self) -> None:
        """Stop listening and end the connection behind what was sent."""
        if self._reader is not None:
            self._left(self._reader)
            self._reader.close()
            self._reader = None
        if self._server is not None:
            self._server.close()
            self._server = None


def line_at(on: str, link: Path | None = None) -> Pty | Socket:
    """Return the line that a text names.

    Parameters
    ----------
    on : str
        ``pty`` or ``socket://127.0.0.1:PORT``, port 0 for a free one.
    link : Path, optional
        Stable path of a pty.

    Raises
    ------
    InputError
        Another text, another host, or a link to a socket.
    """
    if on == "pty":
        return Pty(link)
    host, _, port = on.removeprefix(_PREFIX).partition(":")
    if not on.startswith(_PREFIX) or not port.isdigit() or int(port) > 65535:
        raise InputError(f"a device cannot be on {on!r}", remedy="Use pty or socket://127.0.0.1:PORT.")
    if host not in ("127.0.0.1", "localhost"):
        raise InputError(f"{host} is not this machine", remedy="Use socket://127.0.0.1:PORT.")
    if link is not None:
        raise InputError("a socket has no link", remedy="Leave out " + keyword("link") + ": its port stays the same.")
    return Socket(int(port))
