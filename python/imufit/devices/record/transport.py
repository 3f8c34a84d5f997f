"""A serial line that may be unplugged and comes back."""

from __future__ import annotations

import contextlib
import os
import time
from typing import TYPE_CHECKING, Final

from imufit.errors import InputError

if TYPE_CHECKING:
    import serial

try:
    from termios import error as _TerminalError  # noqa: N812
except ImportError:  # Windows has no termios
    _TerminalError = OSError  # type: ignore[misc, assignment]

_FAILURES: Final = (OSError, ValueError, _TerminalError)

BLOCK: Final = 1 << 16
"""Bytes read at once at most."""
RETRY: Final = 0.1
"""Wait between two attempts to open a lost line, s: the same however long it is away, so that what a device sends once
it is back is read from its first quarter of a second on."""
REQUEST: Final = b"\x00"
"""The byte that requests a device's announcement (docs/wire.md): the end of a frame, not a command of others."""
BUSY: Final = 3.0
"""Time that a port may be in use when it is opened first, s: the program before may be about to close it."""

_STUCK: Final = 0.01  # longest wait for a line that takes no byte, s: shorter than the time between two reads


def _speed(baud: float) -> int:
    """Return the speed of a line, a whole number of bits per second."""
    try:
        whole = int(baud)
    except (TypeError, ValueError, OverflowError):
        whole = 0
    if whole <= 0 or whole != baud:
        raise InputError(f"{baud!r} is not the speed of a line", remedy="Give bits per second, such as 115200.")
    return whole


class Line:
    """A serial line, opened anew as often as it is lost.

    It reads what has come and never waits for more: pyserial drops what it has already got when a line breaks while it
    waits.

    Parameters
    ----------
    port : str
        Whatever pyserial opens: ``/dev/ttyUSB0``, ``COM3``, a pseudo-terminal, ``socket://127.0.0.1:5000``, ``loop://``.
    baud : int
        Bits per second; has no meaning for sockets and pseudo-terminals.

    Attributes
    ----------
    opening : int
        How often the line was opened anew: 0 at first.
    lost_since : float or None
        When it was lost, s on the clock of `time.monotonic`; None while it is open.
    why : str
        Why it was lost last.
    """

    def __init__(self, port: str, baud: int = 115200) -> None:
        self.port = port
        self.baud = _speed(baud)
        self.opening = 0
        self.lost_since: float | None = None
        self.why = ""
        self._serial: serial.SerialBase | None = None
        self._next_try = 0.0

    def open(self) -> None:
        """Open the line for the first time.

        Raises
        ------
        InputError
            It cannot be opened; the remedy names the ports that are there.
        """
        until = time.monotonic() + BUSY
        while True:
            try:
                self._serial = self._opened()
            except _FAILURES as error:
                if not _is_busy(error) or time.monotonic() > until:
                    raise _refusal(self.port, error) from None
                time.sleep(RETRY)
            else:
                return

    def read(self) -> bytes:
        """Return what has come since the last call, at most `BLOCK` bytes; nothing while the line is lost."""
        if self._serial is None and not self._reopen():
            return b""
        assert self._serial is not None
        try:
            return bytes(self._serial.read(BLOCK))
        except OSError as error:
            self._lost(error)
            return b""

    def ask(self) -> None:
        """Ask the device to announce itself; one that does not listen is asked in vain."""
        if self._serial is not None:
            with contextlib.suppress(OSError):  # a line that breaks now is found lost when it is read
                self._serial.write(REQUEST)

    def close(self) -> None:
        """Close the line."""
        if self._serial is not None:
            with contextlib.suppress(OSError):  # it is gone already
                self._serial.close()
            self._serial = None

    def _opened(self) -> serial.SerialBase:
        import serial  # noqa: PLC0415 - only who records needs it

        # exclusive: two readers of one port would take each other's bytes
        line = serial.serial_for_url(
            self.port, do_not_open=True, baudrate=self.baud, timeout=0, write_timeout=_STUCK, exclusive=True
        )
        if self.port.lower().startswith("socket:"):
            # bytes that come with the connection are not the rest of an earlier one, as it may be with a serial port
            line.reset_input_buffer = lambda: None  # type: ignore[method-assign]
        line.open()
        return line

    def _lost(self, error: OSError) -> None:
        self.close()
        self.why = str(error)
        self.lost_since = time.monotonic()
        self._next_try = self.lost_since + RETRY

    @property
    def _is_of_others(self) -> bool:
        """Whether a lost line's name goes to strangers: that of a pseudo terminal does, a link to one stays."""
        return self.port.startswith("/dev/pts/") and os.path.realpath(self.port) == self.port

    def _reopen(self) -> bool:
        """Try to open the line again, if it is time for that."""
        if time.monotonic() < self._next_try or self._is_of_others:
            return False
        try:
            self._serial = self._opened()
        except _FAILURES as error:
            self.why = str(error)
            self._next_try = time.monotonic() + RETRY
            return False
        self.lost_since = None
        self.opening += 1
        return True


def _is_busy(error: Exception) -> bool:
    """Whether somebody else has the port open."""
    return getattr(error, "errno", None) in (11, 16) or "exclusively lock" in str(error)  # EAGAIN, EBUSY


def _refusal(port: str, error: Exception) -> InputError:
    """Say why a port cannot be opened and which ones there are."""
    from serial.tools import list_ports  # noqa: PLC0415

    if "://" in port:
        if isinstance(error, ValueError):
            return InputError(
                f"the port {port} cannot be opened ({error})",
                remedy="Write socket://HOST:PORT, or the name of a serial port.",
            )
        return InputError(
            f"the port {port} cannot be opened ({_plain(error)})", remedy="Start what is to listen there first."
        )
    there = [found.device for found in list_ports.comports()]
    listing = f"Ports here: {', '.join(there)}." if there else "This machine has no serial port: plug the device in."
    number = getattr(error, "errno", None)
    if number == 2 or isinstance(error, FileNotFoundError):  # ENOENT
        return InputError(f"the port {port} does not exist", remedy=listing)
    if number == 13:  # EACCES
        return InputError(
            f"the port {port} may not be opened by this user",
            remedy="Join its group (sudo usermod -aG dialout $USER) and log in again.",
        )
    if _is_busy(error):
        return InputError(f"the port {port} is in use", remedy="Close the serial monitor or whatever reads it.")
    return InputError(f"the port {port} cannot be opened ({_plain(error)})", remedy=listing)


def _plain(error: Exception) -> str:
    """Return the cause in words, without the numbers that pyserial puts around it."""
    cause = error.__cause__ or error.__context__
    words = getattr(cause, "strerror", None) or getattr(error, "strerror", None)
    return str(words or error).splitlines()[0]
