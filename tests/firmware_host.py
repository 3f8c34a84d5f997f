"""The firmware's programs on this computer, and the sensors that they talk to."""

from __future__ import annotations

import ctypes
import os
import subprocess
from collections.abc import Callable
from pathlib import Path

FIRMWARE = Path(__file__).resolve().parent.parent / "firmware"

OK, NO_ANSWER, STUCK = range(3)
MPU6050, HMC5883L = 0x68, 0x1E

Transfer = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_uint8, ctypes.c_uint8, ctypes.POINTER(ctypes.c_uint8), ctypes.c_uint8
)
Line = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.POINTER(ctypes.c_uint8), ctypes.c_uint16)


def make(folder: Path, *targets: str) -> Path:
    """Build targets of firmware/Makefile into a folder."""
    command = ["make", "-s", "-C", str(FIRMWARE), f"BUILD={folder}", *targets]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "LC_ALL": "C"}, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


class Gy86:
    """Registers of an MPU6050 with an HMC5883L behind its bypass; the k-th reading of each is full of k."""

    def __init__(self, now: Callable[[], float]) -> None:
        self.now = now
        self.identity = 0x68
        self.has_magnetometer = True
        self.readings: list[float] = []  # times of those that were read, s
        self.power_up()

    def power_up(self) -> None:
        self.mpu = {0x75: self.identity, 0x6B: 0x40}
        self.awake, self.sample, self.ready = 0.0, -1, False
        self.field = 0
        self.measured: float | None = None

    def rate(self) -> float:
        return 1000.0 / (self.mpu.get(0x19, 0) + 1)

    def write(self, address: int, reg: int, value: int) -> int:
        if address == HMC5883L and self.reaches_magnetometer():
            if reg == 2 and value == 1:
                self.measured = self.now()
            return OK
        if address != MPU6050:
            return NO_ANSWER
        if reg == 0x6B and value & 0x80:
            self.power_up()
            return OK
        self.mpu[reg] = value
        if reg in (0x6B, 0x19):
            self.awake, self.sample, self.ready = self.now(), 0, False
        return OK

    def reaches_magnetometer(self) -> bool:
        return self.has_magnetometer and bool(self.mpu.get(0x37, 0) & 2)

    def read(self, address: int, reg: int, n: int) -> bytes | int:
        if address == HMC5883L and self.reaches_magnetometer():
            return self.read_field(reg, n)
        if address != MPU6050:
            return NO_ANSWER
        if not self.mpu[0x6B] & 0x40:
            sample = int((self.now() - self.awake) * self.rate())
            self.ready |= sample > self.sample
            self.sample = max(sample, self.sample)
        if reg == 0x3A:
            was, self.ready = self.ready, False
            return bytes([was])
        if reg == 0x3B:
            self.readings.append(self.awake + self.sample / self.rate())
            return (self.sample % 32768).to_bytes(2, "big") * 7
        return bytes(self.mpu.get(reg + k, 0) for k in range(n))

    def read_field(self, reg: int, n: int) -> bytes:
        if reg == 0x0A:
            return b"H43"[:n]
        if reg == 0x09:
            return bytes([self.measured is not None and self.now() - self.measured >= 0.006])
        assert (reg, n) == (3, 6)
        self.field += 1
        self.measured = None
        return (self.field % 2048).to_bytes(2, "big") * 3


class Program:
    """A device's program with simulated sensors; what it sends is collected."""

    def __init__(self, library: Path) -> None:
        self.library = ctypes.CDLL(str(library))
        self.library.host_now.restype = ctypes.c_double
        self.library.host_ask.argtypes = [ctypes.c_double, ctypes.c_double, ctypes.c_uint]
        self.ask(0.0, count=0)
        self.library.host_run.argtypes = [
            ctypes.c_double,
            ctypes.c_double,
            ctypes.c_uint8,
            Transfer,
            Transfer,
            Line,
        ]
        self.sensors = Gy86(self.now)
        self.fault: Callable[[float], int] = lambda _: OK
        self.takes: Callable[[float], bool] = lambda _: True
        self.sent: list[tuple[float, bytes]] = []
        self.refused = 0

    def now(self) -> float:
        return float(self.library.host_now())

    def ask(self, first: float, every: float = 0.0, count: int = 1) -> None:
        """Ask for announcements in the next run: first, and how far apart, s."""
        self.library.host_ask(first, every, count)

    def run(self, seconds: float, start: int = 1, begin: float = 0.0) -> bytes:
        """Run it from its start; the bytes that it sent meanwhile."""
        before = len(self.sent)
        wrong: list[BaseException] = []

        def guarded(transfer: Callable[[], int]) -> int:
            # An exception would be lost between Python and C.
            try:
                return self.fault(self.now()) or transfer()
            except BaseException as error:
                wrong.append(error)
                return STUCK

        def read(address: int, reg: int, values: ctypes._Pointer[ctypes.c_uint8], n: int) -> int:
            def transfer() -> int:
                came = self.sensors.read(address, reg, n)
                if isinstance(came, int):
                    return came
                for k, byte in enumerate(came):
                    values[k] = byte
                return OK

            return guarded(transfer)

        def write(address: int, reg: int, values: ctypes._Pointer[ctypes.c_uint8], _: int) -> int:
            return guarded(lambda: self.sensors.write(address, reg, values[0]))

        def send(frame: ctypes._Pointer[ctypes.c_uint8], n: int) -> bool:
            if not self.takes(self.now()):
                self.refused += 1
                return False
            self.sent.append((self.now(), bytes(frame[:n])))
            return True

        self.library.host_run(begin, seconds, start, Transfer(read), Transfer(write), Line(send))
        if wrong:
            raise wrong[0]
        return b"".join(frame for _, frame in self.sent[before:])
