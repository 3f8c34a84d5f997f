"""A device without hardware: a scenario or a log on a pty or socket, in the wire protocol, with faults on demand.

`Emulator` runs beside a program or a test that reads it; ``imufit emulate`` is the same as a command.
"""

from imufit.devices.emulate.clock import Clock
from imufit.devices.emulate.emulator import Emulator
from imufit.devices.emulate.faults import FAULTS, Fault, Kind, parse_fault, parse_fault_rate
from imufit.devices.emulate.source import open_source

__all__ = ["FAULTS", "Clock", "Emulator", "Fault", "Kind", "open_source", "parse_fault", "parse_fault_rate"]
